"""Sensors: what a log would hold of a motion; every error has a size that may be zero.

Defaults: Ryu/Luo chapter, section 5.7 (a car-grade MEMS IMU, an anti-lock brake system's wheel
speeds on CAN, a two-antenna receiver). Every sensor draws from a random stream of its own, so that
changing one leaves the others as they were.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from roadlog.simulate.motion import Motion
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G
from roadlog.vehicle import Vehicle

WHEELS = ("fl", "fr", "rl", "rr")
AXES = ("x", "y", "z")
HOME = (47.2, 11.4, 600.0)  # deg, deg, m: where every road begins; no real one
METERS_PER_DEGREE = 111_195.0  # of latitude, on a sphere; roads are a few km long

Columns = dict[str, tuple[Floats, dict[str, Floats]]]  # section -> times, fields


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one part of the simulation."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


@dataclass(frozen=True)
class ImuSensor:
    """Accelerometers and gyros in one housing, `position` from the motion's reference point."""

    rate: float = 100.0  # Hz
    position: tuple[float, float, float] = (-0.3, 0.1, -0.15)  # m
    mount: Literal["body", "road"] = "body"  # road: accelerometers follow the road, not the body
    bandwidth: float = 30.0  # Hz, 2nd-order Butterworth; 0 = none
    misalignment_deg: tuple[float, float, float] = (0.2, 0.15, 0.3)  # roll, pitch, yaw
    accel_noise: float = 120e-6 * G  # m/s2/sqrt(Hz): sd of a sample is noise sqrt(rate)
    accel_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m/s2
    accel_bias_sd: float = 0.015  # m/s2, drawn at turn-on
    accel_drift_sd: float = 0.003  # m/s2, Gauss-Markov
    accel_lsb: float = 0.0012  # m/s2
    accel_rumble: float = 0.0  # m/s2, white noise behind a 0.3 s quadratic smoother
    gyro_noise: float = float(np.radians(0.007))  # rad/s/sqrt(Hz)
    gyro_bias: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad/s
    gyro_bias_sd: float = float(np.radians(0.08))  # rad/s
    gyro_drift_sd: float = float(np.radians(0.01))  # rad/s
    gyro_lsb: float = float(np.radians(0.005))  # rad/s
    drift_time: float = 200.0  # s, of both Gauss-Markov processes
    heave: float = 0.0  # m/s2 rms on accel_z: the road's roughness where no car model makes it
    heave_band: tuple[float, float] = (1.0, 20.0)  # Hz
    heave_speed: float = 0.0  # m/s, at which heave has that size; 0 = at any speed

    def ideal(self) -> ImuSensor:
        """The same channel without any error, at the reference point."""
        return replace(
            self,
            **dict.fromkeys(
                [
                    "bandwidth",
                    "accel_noise",
                    "accel_bias_sd",
                    "accel_drift_sd",
                    "accel_lsb",
                    "accel_rumble",
                    "gyro_noise",
                    "gyro_bias_sd",
                    "gyro_drift_sd",
                    "gyro_lsb",
                    "heave",
                ],
                0.0,
            ),
            **dict.fromkeys(
                ("position", "misalignment_deg", "accel_bias", "gyro_bias"), (0.0, 0.0, 0.0)
            ),
        )

    def measure(self, motion: Motion, seed: int) -> Columns:
        """Section `imu`."""
        rng = stream(seed, "imu")
        force, rate = motion.at(self.position), motion.rate
        if self.mount == "road" and motion.road_force is not None:
            force = motion.road_force
        if self.heave:
            force = force + np.array([0.0, 0.0, 1.0]) * self._heave(motion, rng)[:, None]
        turn = mounting(*np.radians(self.misalignment_deg)).T
        force, rate = force @ turn.T, rate @ turn.T
        if self.bandwidth:
            force = low_pass(force, self.bandwidth, motion.dt)
            rate = low_pass(rate, self.bandwidth, motion.dt)
        time = clock(motion, self.rate)
        n = len(time)
        force, rate = at(motion, force, time), at(motion, rate, time)
        force = force + np.array(self.accel_bias) + self.accel_bias_sd * rng.standard_normal(3)
        rate = rate + np.array(self.gyro_bias) + self.gyro_bias_sd * rng.standard_normal(3)
        wander = gauss_markov(rng, n, 6, self.drift_time * self.rate)
        noise = rng.standard_normal((n, 6)) * np.sqrt(self.rate)
        force = force + self.accel_drift_sd * wander[:, :3] + self.accel_noise * noise[:, :3]
        rate = rate + self.gyro_drift_sd * wander[:, 3:] + self.gyro_noise * noise[:, 3:]
        if self.accel_rumble:
            from scipy.signal import savgol_filter

            window = 2 * round(0.15 * self.rate) + 1
            white = rng.standard_normal(n)
            force[:, 0] += self.accel_rumble * savgol_filter(white, window, 2)
        force, rate = quantized(force, self.accel_lsb), quantized(rate, self.gyro_lsb)
        fields = {f"accel_{axis}": force[:, k] for k, axis in enumerate(AXES)}
        fields |= {f"gyro_{axis}": rate[:, k] for k, axis in enumerate(AXES)}
        return {"imu": (time, fields)}

    def _heave(self, motion: Motion, rng: np.random.Generator) -> Floats:
        from scipy.signal import butter, sosfilt

        band = butter(2, self.heave_band, "bandpass", fs=1 / motion.dt, output="sos")
        noise: Floats = sosfilt(band, rng.standard_normal(len(motion.time)))
        noise *= self.heave / noise.std()
        if self.heave_speed:
            # Kim chapter, 3.11: proportional to speed, up to 1.5 times
            noise = noise * np.minimum(motion.speed / self.heave_speed, 1.5)
        return noise


@dataclass(frozen=True)
class CanSensors:
    """What the car itself sends; rates in Hz, 0 = no such message."""

    wheel_rate: float = 50.0
    wheel_noise: float = 0.0063  # m/s sd of a sample (0.02 rad/s)
    wheel_lsb: float = 0.0174  # m/s (0.055 rad/s)
    wheel_scale: float = 1.003  # wrong rolling radius
    dead_band: float = 0.0  # m/s below which a wheel sensor says 0
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
        return replace(self, speed_rate=speed, **rates, **one, **dict.fromkeys(zero.split(), 0.0))

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


@dataclass(frozen=True)
class GnssReceiver:
    """Satellite receiver with two antennas; messages carry the epoch's time."""

    rate: float = 10.0  # Hz, 0 = none
    position: tuple[float, float, float] = (-0.2, 0.0, 0.85)  # m from the reference point
    horizontal_noise: float = 0.5  # m, Gauss-Markov
    vertical_noise: float = 1.0  # m, Gauss-Markov
    wander_time: float = 60.0  # s, of both
    speed_noise: float = 0.03  # m/s, each horizontal axis
    climb_noise: float = 0.045  # m/s
    two_antennas: bool = True
    heading_noise: float = float(np.radians(0.15))  # rad
    roll_noise: float = float(np.radians(0.20))  # rad
    latency: float = 0.0  # s by which the stamps are late: a receiver that stamps on arrival

    def ideal(self) -> GnssReceiver:
        """The same channel without any error, at the reference point."""
        zero = "horizontal_noise vertical_noise speed_noise climb_noise heading_noise roll_noise"
        return replace(
            self, position=(0.0, 0.0, 0.0), latency=0.0, **dict.fromkeys(zero.split(), 0.0)
        )

    def measure(self, motion: Motion, seed: int) -> Columns:
        """Section gnss; nothing when the motion has no place on earth."""
        if not self.rate or motion.attitude is None:
            return {}
        assert motion.position is not None
        assert motion.velocity is not None
        rng = stream(seed, "gnss")
        time = clock(motion, self.rate)
        time = time[time - self.latency >= motion.time[0] - 1e-9]
        epoch = time - self.latency
        near = np.clip(np.searchsorted(motion.time, epoch - 1e-9), 0, len(motion.time) - 1)
        attitude, arm = motion.attitude[near], np.array(self.position)
        place = motion.position[near] + attitude @ arm
        turning = np.cross(motion.rate[near], arm)
        velocity = motion.velocity[near] + np.einsum("nij,nj->ni", attitude, turning)
        n = len(time)
        wander = gauss_markov(rng, n, 3, self.wander_time * self.rate)
        place = place + wander * [self.horizontal_noise, self.horizontal_noise, self.vertical_noise]
        white = rng.standard_normal((n, 5))
        velocity = velocity + white[:, :3] * [self.speed_noise, self.speed_noise, self.climb_noise]
        unknown = np.full(n, np.nan)
        two = self.two_antennas
        heading = (
            np.arctan2(attitude[:, 1, 0], attitude[:, 0, 0]) + self.heading_noise * white[:, 3]
        )
        roll = np.arcsin(attitude[:, 2, 1]) + self.roll_noise * white[:, 4]
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        fields = {
            "latitude": HOME[0] + place[:, 1] / METERS_PER_DEGREE,
            "longitude": HOME[1] + place[:, 0] / (METERS_PER_DEGREE * np.cos(np.radians(HOME[0]))),
            "altitude": HOME[2] + place[:, 2],
            "speed": speed,
            "course": np.arctan2(velocity[:, 1], velocity[:, 0]),
            "climb": velocity[:, 2],
            "heading": _wrapped(heading) if two else unknown,
            "roll": roll if two else unknown,
            "horizontal_accuracy": np.full(n, self.horizontal_noise),
            "vertical_accuracy": np.full(n, self.vertical_noise),
            "speed_accuracy": np.full(n, self.speed_noise),
            "course_accuracy": np.minimum(self.speed_noise / np.maximum(speed, 1e-3), np.pi),
            "climb_accuracy": np.full(n, self.climb_noise),
            "heading_accuracy": np.full(n, self.heading_noise) if two else unknown,
            "roll_accuracy": np.full(n, self.roll_noise) if two else unknown,
        }
        return {"gnss": (time, fields)}


@dataclass(frozen=True)
class FuelSender:
    """Float in a box tank (Wang chapter, section 4.4) whose surface sloshes."""

    rate: float = 0.0  # Hz, 0 = none
    volume: float = 0.020  # m3, true
    slosh_frequency: float = 0.7  # Hz
    slosh_damping: float = 0.05  # -, of critical
    noise: float = 0.0005  # m

    def ideal(self) -> FuelSender:
        """A float without noise; the fuel sloshes as it does."""
        return replace(self, noise=0.0)

    def measure(self, motion: Motion, vehicle: Vehicle, seed: int) -> Columns:
        """Section fuel."""
        if not self.rate:
            return {}
        from scipy.signal import lfilter

        tilt = motion.force[:, 0] / motion.force[:, 2]
        w = 2 * np.pi * self.slosh_frequency * motion.dt
        z = self.slosh_damping
        # the surface follows the specific force like an oscillator (backward difference)
        a = np.array([1 + 2 * z * w + w * w, -2 - 2 * z * w, 1.0])
        start = tilt[0]
        surface = start + lfilter([w * w], a, tilt - start)
        time = clock(motion, self.rate)
        height = sender_height(self.volume, at(motion, surface, time), vehicle)
        noise = self.noise * stream(seed, "fuel").standard_normal(len(time))
        return {"fuel": (time, {"sender": np.clip(height + noise, 0.0, vehicle.tank_height)})}


def sender_height(volume: float, slope: Floats, vehicle: Vehicle) -> Floats:
    """m, fuel level at the sender by bisection of the volume under a plane in a box.

    volume: m3. slope: fall of the surface towards +x, -.
    """
    cells = (np.arange(400) + 0.5) / 400 - 0.5
    x = cells * vehicle.tank_length
    base = vehicle.tank_length * vehicle.tank_width
    span = vehicle.tank_height + np.abs(slope) * vehicle.tank_length
    low, high = -span, span + vehicle.tank_height
    for _ in range(40):
        middle = (low + high) / 2
        level = middle[:, None] - slope[:, None] * (x - vehicle.tank_sender[0])
        filled = base * np.clip(level, 0.0, vehicle.tank_height).mean(axis=1)
        low, high = np.where(filled < volume, middle, low), np.where(filled < volume, high, middle)
    return (low + high) / 2


@dataclass(frozen=True)
class Sensors:
    """All of a car's sensors."""

    imu: ImuSensor = field(default_factory=ImuSensor)
    can: CanSensors = field(default_factory=CanSensors)
    gnss: GnssReceiver = field(default_factory=GnssReceiver)
    fuel: FuelSender = field(default_factory=FuelSender)

    def ideal(self) -> Sensors:
        """The same channels without any error."""
        return Sensors(self.imu.ideal(), self.can.ideal(), self.gnss.ideal(), self.fuel.ideal())

    def measure(self, motion: Motion, vehicle: Vehicle, seed: int) -> Columns:
        """Every section of the log: times in s and fields in SI."""
        return (
            self.imu.measure(motion, seed)
            | self.can.measure(motion, vehicle, seed)
            | self.gnss.measure(motion, seed)
            | self.fuel.measure(motion, vehicle, seed)
        )


# What every sensor does to a signal. ----------------------------------------------------------


def clock(motion: Motion, rate: float) -> Floats:
    """s, times of the samples; the first at 0."""
    first = max(0.0, motion.time[0])
    count = int(np.floor((motion.time[-1] - first) * rate + 1e-6)) + 1
    return first + np.arange(count) / rate


def at(motion: Motion, values: Floats, time: Floats) -> Floats:
    """Values of a fine signal (columns) at given times; the ends are held."""
    position = np.clip((time - motion.time[0]) / motion.dt, 0.0, len(motion.time) - 1.0)
    left = np.minimum(np.floor(position + 1e-6).astype(np.int64), len(motion.time) - 2)
    share = np.clip(position - left, 0.0, 1.0)
    share[share < 1e-5] = 0.0  # a sample on the grid is that sample
    if values.ndim > 1:
        share = share[:, None]
    result: Floats = values[left] + share * (values[left + 1] - values[left])
    return result


def mounting(roll: float, pitch: float, yaw: float) -> Floats:
    """(3, 3) vehicle axes from axes turned by yaw, then pitch (nose up +), then roll; rad."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(-pitch), np.sin(-pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    result: Floats = about_z @ about_y @ about_x
    return result


def low_pass(values: Floats, frequency: float, dt: float) -> Floats:
    """Second-order Butterworth, causal, starting settled; columns."""
    from scipy.signal import butter, sosfilt, sosfilt_zi

    sos = butter(2, frequency, fs=1 / dt, output="sos")
    start = sosfilt_zi(sos)[:, :, None] * values[0]
    result: Floats = sosfilt(sos, values, axis=0, zi=start)[0]
    return result


def gauss_markov(rng: np.random.Generator, n: int, columns: int, time: float) -> Floats:
    """(n, columns) first-order process of unit variance; time constant in samples."""
    from scipy.signal import lfilter

    keep = np.exp(-1.0 / time)
    white = rng.standard_normal((n, columns)) * np.sqrt(1 - keep**2)
    white[0] /= np.sqrt(1 - keep**2)
    result: Floats = lfilter([1.0], [1.0, -keep], white, axis=0)
    return result


def quantized(values: Floats, lsb: float) -> Floats:
    """Rounded to multiples of `lsb`; 0 = not at all."""
    return np.round(values / lsb) * lsb if lsb else values


def _fields(names: tuple[str, ...] | list[str], values: Floats) -> dict[str, Floats]:
    return {name: values[:, k] for k, name in enumerate(names)}


def _wrapped(angle: Floats) -> Floats:
    result: Floats = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return result
