"""Attitude by sliding least squares of a constant, baseline of Wang 2025.

docs/methods/wang2025.md#baselines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.straight import straight_flags
from roadlog.estimators.wang2025.ekf_suspension import drive_force
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.kernels import causal, odd_window, parabolic_mean, slope
from roadlog.filters.windows import moving_count, moving_mean, moving_std
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G


@dataclass(frozen=True)
class LsAttitudeParameters:
    """docs/methods/wang2025.md#parameters-of-ls_attitude."""

    smooth: bool = parameter(True, "", "centered windows instead of the last samples")
    source: Literal["kinematic", "drive_force"] = parameter(
        "kinematic", "", "accelerometer (inclination) or drive force (grade)"
    )
    window: float = parameter(6.0, "s", "of the least squares")
    slope_time: float = parameter(0.21, "s", "window of the speed's derivative")
    hold_time: float = parameter(5.0, "s", "the last value is held this long")


def ls_attitude(
    drive: Drive, vehicle: Vehicle, params: LsAttitudeParameters, engine: Engine
) -> Estimate:
    """asin of the mean sine over the window: what is constant in it by least squares.

    The drive force knows nothing of the body, so its angle is the grade, not the inclination.
    """
    del engine  # sliding sums are one vectorized formula
    sine = _sine(drive, vehicle, params)
    n = max(1, round(params.window * drive.rate))
    known = np.isfinite(sine)
    count = np.maximum(moving_count(sine, n, params.smooth), 1)
    mean = np.where(known, moving_mean(sine, n, params.smooth), np.nan)
    angle = np.arcsin(np.clip(mean, -1.0, 1.0))
    # smoothed samples are worth fewer independent ones
    independent = np.maximum(count * 1.2 * drive.dt / params.slope_time, 1.0)
    sd = np.where(known, moving_std(sine, n, params.smooth) / np.sqrt(independent), np.nan)
    limit = round(params.hold_time * drive.rate)
    angle, held = hold(angle, limit)
    sd, _ = hold(sd, limit)
    flags = straight_flags(drive, known) | flag(held, "held")
    name = "inclination" if params.source == "kinematic" else "grade"
    return Estimate(drive.time, {name: angle}, {name: sd}, known, flags)


def _sine(drive: Drive, vehicle: Vehicle, params: LsAttitudeParameters) -> Floats:
    """Sine of the angle at every sample."""
    n = odd_window(params.slope_time, drive.dt)
    speed = drive.speed if drive.has_speed else np.full(len(drive), np.nan)

    def aligned(values: Floats) -> Floats:
        return values if params.smooth else causal(values, n)

    vdot = aligned(slope(speed, n, drive.dt))
    if params.source == "kinematic":
        return (aligned(parabolic_mean(drive.get("imu.accel_x"), n)) - vdot) / G
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * speed**2
    force = (drive_force(drive, vehicle) - drag) / vehicle.mass
    return (aligned(parabolic_mean(force, n)) - vdot) / G - vehicle.rolling_resistance


LS_ATTITUDE = Estimator(
    name="ls_attitude",
    run=ls_attitude,
    parameters=LsAttitudeParameters,
    needs=("imu.accel_x", ANY_SPEED),
    gives=("inclination",),
    reference="Wang 2025; docs/methods/wang2025.md#baselines",
    summary="inclination as the mean over 6 s of acceleration minus dv/dt; straight driving",
    systematic_deg={"inclination": 0.45},
    tilted=("inclination",),
)
