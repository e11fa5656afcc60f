"""The simulated inertial measurement unit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.filters.lowpass import butterworth
from roadlog.signals import AXES
from roadlog.simulate.motion import Motion
from roadlog.simulate.sampling import (
    Columns,
    at,
    clock,
    gauss_markov,
    mounting,
    quantized,
    stream,
    without_errors,
)
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G


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
        return without_errors(
            self,
            "bandwidth accel_noise accel_bias_sd accel_drift_sd accel_lsb accel_rumble gyro_noise "
            "gyro_bias_sd gyro_drift_sd gyro_lsb heave",
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
            force = butterworth(force, self.bandwidth, 1 / motion.dt)
            rate = butterworth(rate, self.bandwidth, 1 / motion.dt)
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
            # docs/methods/kim2023.md#scenarios
            noise = noise * np.minimum(motion.speed / self.heave_speed, 1.5)
        return noise
