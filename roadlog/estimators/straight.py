"""What the straight-driving methods share: speed, its derivative, matched forces, masks, noise.

Source: docs/methods/common.md.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, TypeVar

import numpy as np

from roadlog.car.driveline import undriven_axle
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.base import flag, parameter
from roadlog.filters.kernels import causal, odd_window, parabola, parabolic_mean, slope
from roadlog.filters.windows import moving_mean
from roadlog.types import Flags, Floats
from roadlog.units import STANDARD_GRAVITY as G

NOISE_TIME = 2.0  # s, window over which the sensors' noise is estimated from the log


@dataclass(frozen=True)
class StraightParameters:
    """docs/methods/common.md#parameters-of-straight-driving-methods."""

    wheels: Literal["undriven", "all", "front", "rear", "median"] | None = parameter(
        None, "", "wheels that give the speed; none: undriven, all with preset paper"
    )
    slope_time: float = parameter(0.3, "s", "window of the speed's derivative")
    hold_time: float = parameter(5.0, "s", "the last value is held this long")
    causal: bool | None = parameter(
        None, "", "speed's derivative and forces of the last samples, not of those around"
    )


P = TypeVar("P", bound=StraightParameters)


def with_preset(params: P, presets: Mapping[str, Mapping[str, Any]], preset: str) -> P:
    """The parameters with those that are None taken from the preset."""
    open_ = {f.name for f in fields(params) if getattr(params, f.name) is None}
    return replace(params, **{k: v for k, v in presets[preset].items() if k in open_})


@dataclass(frozen=True)
class Longitudinal:
    """Straight-line motion: every array has the drive's length and the same smoothing.

    f_x, f_z: specific force, m/s2. vdot: derivative of the speed, m/s2. f_x_sd, f_z_sd: of one raw
    sample; vdot_sd: of `vdot`. NaN where an input is missing inside the kernel.
    """

    speed: Floats
    f_x: Floats
    f_z: Floats
    vdot: Floats
    f_x_sd: Floats
    f_z_sd: Floats
    vdot_sd: Floats
    kernel: int  # samples of the smoothing kernel
    correlation: float  # how many samples of the smoothed signals are worth one independent one

    @property
    def sine(self) -> Floats:
        """(f_x - dv/dt) / g, sine of the inclination; docs/methods/massel2004.md#inclination."""
        return (self.f_x - self.vdot) / G

    @property
    def inclination(self) -> Floats:
        """rad, asin((f_x - dv/dt) / g)."""
        return np.arcsin(np.clip(self.sine, -1.0, 1.0))

    @property
    def inclination_sd(self) -> Floats:
        """rad, from the noise of the accelerometer and of the speed's derivative."""
        f_x_sd = self.f_x_sd / np.sqrt(self.kernel / 1.2)  # through the parabolic kernel
        return np.sqrt(f_x_sd**2 + self.vdot_sd**2) / G


def longitudinal(drive: Drive, params: StraightParameters, vehicle: Vehicle) -> Longitudinal:
    """Speed, its derivative, and forces smoothed alike; docs/methods/common.md#matched-kernel.

    A signal that the drive does not have is NaN everywhere.
    """
    n = odd_window(params.slope_time, drive.dt)
    speed = selected_speed(drive, params.wheels or "undriven", vehicle)
    f_x, f_z = drive.get("imu.accel_x"), drive.get("imu.accel_z")
    vdot = slope(speed, n, drive.dt)
    # the kernel pads the ends with a constant speed: no derivative there, as beside a gap
    vdot[: n // 2] = vdot[len(vdot) - n // 2 :] = np.nan

    def aligned(values: Floats) -> Floats:
        return causal(values, n) if params.causal else values

    return Longitudinal(
        speed=speed,
        f_x=aligned(parabolic_mean(f_x, n)),
        f_z=aligned(parabolic_mean(f_z, n)),
        vdot=aligned(vdot),
        f_x_sd=noise_sd(f_x, n, drive.rate),
        f_z_sd=noise_sd(f_z, n, drive.rate),
        vdot_sd=noise_sd(speed, n, drive.rate) * np.sqrt(12.0 / n**3) / drive.dt,
        kernel=n,
        correlation=max(1.0, n / 1.2),
    )


def selected_speed(drive: Drive, wheels: str, vehicle: Vehicle) -> Floats:
    """m/s, from the chosen wheels; the drive's speed where it has no wheel speeds, else NaN.

    `undriven`: the axle that the car does not drive; all where it drives all, or is not known.
    """
    if wheels == "undriven":
        known = vehicle.source("driven").kind != "default"
        wheels = (undriven_axle(drive, vehicle) if known else None) or "all"
    if "wheel_speeds" in drive.sources_of_speed():
        return drive.wheel_speed(wheels)
    return drive.speed if drive.has_speed else np.full(len(drive), np.nan)


def noise_sd(values: Floats, n: int, rate: float) -> Floats:
    """Standard deviation of one raw sample's noise: docs/methods/common.md#noise-from-the-log."""
    weights = parabola(n)
    removed = values - parabolic_mean(values, n)
    share = 1 - 2 * weights[n // 2] + float(weights @ weights)  # of white noise that is removed
    return np.sqrt(moving_mean(removed**2, round(NOISE_TIME * rate), centered=True) / share)


def straight_flags(drive: Drive, known: np.ndarray) -> Flags:
    """Flags that hold for every straight-driving method: missing, standstill, model."""
    return (
        flag(~known, "missing")
        | flag(drive.standstill, "standstill")
        | flag(~drive.straight, "model")
    )
