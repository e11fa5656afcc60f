"""Sensors: what a log would hold of a motion; every error has a size that may be zero.

Defaults: docs/simulator.md#sensors (a car-grade MEMS IMU, an anti-lock brake system's wheel
speeds on CAN, a two-antenna receiver). Every sensor draws from a random stream of its own, so that
changing one leaves the others as they were.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.signals import WHEELS
from roadlog.simulate.fuel import FuelSender
from roadlog.simulate.gnss import Barometer, GnssReceiver
from roadlog.simulate.imu import ImuSensor
from roadlog.simulate.motion import Motion
from roadlog.simulate.sampling import Columns, at, clock, quantized, stream, without_errors
from roadlog.types import Floats


@dataclass(frozen=True)
class CanSensors:
    """What the car itself sends; rates in Hz, 0 = no such message."""

    wheel_rate: float = 50.0
    wheel_noise: float = 0.0063  # m/s sd of a sample (0.02 rad/s)
    wheel_lsb: float = 0.0174  # m/s (0.055 rad/s)
    wheel_scale: float = 1.003  # wrong rolling radius
    dead_band: float = 0.3  # m/s below which a wheel sensor says 0
    latency: float = 0.020  # s, a message's values are this old
    speed_rate: float = 0.0
    speed_noise: float = 0.0  # m/s/sqrt(Hz): sd of a sample is noise sqrt(rate)
    torque_rate: float = 50.0
    drive_gain: float = 1.03
    drive_lsb: float = 0.5  # N m
    brake_gain: float = 1.05
    brake_lsb: float = 1.0  # N m
    force_rate: float = 0.0  # of powertrain.drive_force alone, where no engine is modeled
    force_noise: float = 0.0  # N sd of a sample
    steering_rate: float = 100.0
    steering_lsb: float = float(np.radians(0.1) / 16)  # rad at the road wheel
    steering_offset: float = float(np.radians(0.5) / 16)  # rad at the road wheel

    def ideal(self) -> CanSensors:
        """The same channels without any error, at 100 Hz, and the true speed as well."""
        zero = (
            "wheel_noise wheel_lsb dead_band latency speed_noise drive_lsb brake_lsb force_noise "
            "steering_lsb steering_offset"
        )
        rates = {
            name: max(100.0, value)
            for name in ("wheel_rate", "torque_rate", "steering_rate", "force_rate")
            if (value := getattr(self, name))
        }
        one = dict.fromkeys(("wheel_scale", "drive_gain", "brake_gain"), 1.0)
        speed = max(100.0, self.speed_rate)
        return without_errors(self, zero, speed_rate=speed, **rates, **one)

    def measure(self, motion: Motion, vehicle: Vehicle, seed: int) -> Columns:
        """Sections wheel_speeds, speed, steering, wheel_torques, powertrain."""
        result: Columns = {}
        if self.wheel_rate:
            rng = stream(seed, "wheel_speeds")
            time, true = self._delayed(
                motion, [f"wheel_speeds.{w}" for w in WHEELS], self.wheel_rate
            )
            noisy = true * self.wheel_scale + self.wheel_noise * rng.standard_normal(true.shape)
            noisy = np.where(np.abs(true) < 1e-9, 0.0, noisy)  # a standing wheel gives no pulse
            noisy[np.abs(noisy) < self.dead_band] = 0.0
            result["wheel_speeds"] = (time, _fields(WHEELS, quantized(noisy, self.wheel_lsb)))
        if self.speed_rate:
            rng = stream(seed, "speed")
            time, true = self._delayed(motion, ["speed.v"], self.speed_rate)
            noise = self.speed_noise * np.sqrt(self.speed_rate) * rng.standard_normal(true.shape)
            result["speed"] = (time, _fields(["v"], true + noise))
        if self.steering_rate and "steering.road_wheel_angle" in motion.signals:
            time, true = self._delayed(motion, ["steering.road_wheel_angle"], self.steering_rate)
            angle = quantized(true + self.steering_offset, self.steering_lsb)
            result["steering"] = (time, _fields(["road_wheel_angle"], angle))
        if self.torque_rate and "powertrain.engine_torque" in motion.signals:
            result |= self._torques(motion, vehicle)
        elif self.force_rate:
            rng = stream(seed, "drive_force")
            time, true = self._delayed(motion, ["powertrain.drive_force"], self.force_rate)
            noisy = true[:, 0] + self.force_noise * rng.standard_normal(len(time))
            unknown = np.full(len(time), np.nan)
            fields = {"engine_torque": unknown, "gear_ratio": unknown, "drive_force": noisy}
            result["powertrain"] = (time, fields)
        return result

    def _torques(self, motion: Motion, vehicle: Vehicle) -> Columns:
        names = [f"{kind}_{wheel}" for kind in ("drive", "brake") for wheel in WHEELS]
        time, true = self._delayed(motion, [f"wheel_torques.{n}" for n in names], self.torque_rate)
        drive = quantized(true[:, :4] * self.drive_gain, self.drive_lsb)
        brake = np.maximum(quantized(true[:, 4:] * self.brake_gain, self.brake_lsb), 0.0)
        torques = _fields(names, np.hstack([drive, brake]))
        roles = [f"powertrain.{n}" for n in ("engine_torque", "gear_ratio", "drive_force")]
        _, true = self._delayed(motion, roles, self.torque_rate)
        # what the control unit believes: the same gain as at the wheels; brakes are in the force
        engine = {
            "engine_torque": quantized(true[:, 0] * self.drive_gain, self.drive_lsb),
            "gear_ratio": true[:, 1],
            "drive_force": (drive.sum(axis=1) - brake.sum(axis=1)) / vehicle.wheel_radius,
        }
        return {"wheel_torques": (time, torques), "powertrain": (time, engine)}

    def _delayed(self, motion: Motion, roles: list[str], rate: float) -> tuple[Floats, Floats]:
        """Times of the messages and the true values that much earlier."""
        time = clock(motion, rate)
        values = np.stack([motion.signals[role] for role in roles], axis=1)
        return time, at(motion, values, time - self.latency)


def _fields(names: tuple[str, ...] | list[str], values: Floats) -> dict[str, Floats]:
    return {name: values[:, k] for k, name in enumerate(names)}


@dataclass(frozen=True)
class Sensors:
    """All of a car's sensors."""

    imu: ImuSensor = field(default_factory=ImuSensor)
    can: CanSensors = field(default_factory=CanSensors)
    gnss: GnssReceiver = field(default_factory=GnssReceiver)
    barometer: Barometer = field(default_factory=Barometer)
    fuel: FuelSender = field(default_factory=FuelSender)

    def ideal(self) -> Sensors:
        """The same channels without any error."""
        return Sensors(
            self.imu.ideal(),
            self.can.ideal(),
            self.gnss.ideal(),
            self.barometer.ideal(),
            self.fuel.ideal(),
        )

    def measure(self, motion: Motion, vehicle: Vehicle, seed: int) -> Columns:
        """Every section of the log: times in s and fields in SI."""
        return (
            self.imu.measure(motion, seed)
            | self.can.measure(motion, vehicle, seed)
            | self.gnss.measure(motion, seed)
            | self.barometer.measure(motion, seed)
            | self.fuel.measure(motion, vehicle, seed)
        )
