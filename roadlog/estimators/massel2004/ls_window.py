"""Pitch and inclination by least squares over a sliding window.

Massel 2004, equations (6)-(15), corrected: docs/methods/massel2004.md#least-squares-window.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.massel2004.regression import (
    PAPER,
    ROBUST,
    Data,
    RegressionFit,
    RegressionParameters,
    estimate_of,
    root,
    root_sd,
)
from roadlog.estimators.straight import Longitudinal, longitudinal, straight_flags, with_preset
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.windows import moving_sum
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

MIN_SHARE = 0.9  # of a window's samples that must be known

PRESETS = {"paper": {**PAPER, "smooth": False}, "robust": {**ROBUST, "smooth": True}}


@dataclass(frozen=True)
class LsWindowParameters(RegressionParameters):
    """docs/methods/massel2004.md#parameters-of-ls_window; none: as the preset says."""

    preset: Literal["paper", "robust"] = parameter(
        "robust", "", "paper: as printed; robust: gated, well conditioned"
    )
    window: float = parameter(1.2, "s", "of the least squares; the paper's 1200 samples")
    smooth: bool | None = parameter(None, "", "centered window instead of the last samples")


def fit_windows(motion: Longitudinal, n: int, source: str, centered: bool) -> RegressionFit:
    """Sliding least squares over n samples; sums of centered signals, never normal equations.

    Not known where a window holds too few samples.
    """
    y1, y2, u, mask = Data.of(motion)

    def centered_signal(values: Floats) -> tuple[Floats, float]:
        offset = float(values[mask].mean()) if mask.any() else 0.0
        return np.where(mask, values - offset, 0.0), offset

    (u, u0), (y1, y1_0), (y2, y2_0) = (centered_signal(values) for values in (u, y1, y2))
    count = np.rint(moving_sum(mask.astype(np.float64), n, centered))
    safe = np.maximum(count, 3.0)
    s_u, s_1, s_2 = (moving_sum(values, n, centered) for values in (u, y1, y2))

    def covariance(a: Floats, b: Floats, s_a: Floats, s_b: Floats) -> Floats:
        return moving_sum(a * b, n, centered) - s_a * s_b / safe

    c_uu = np.maximum(covariance(u, u, s_u, s_u), 0.0)
    c_1, c_2 = covariance(u, y1, s_u, s_1), covariance(u, y2, s_u, s_2)
    # a window without any excitation gives no slope; NaN says so better than a division by 0
    slope_1, slope_2 = (c / np.where(c_uu > 0, c_uu, np.nan) for c in (c_1, c_2))
    u_mean, y1_mean, y2_mean = s_u / safe + u0, s_1 / safe + y1_0, s_2 / safe + y2_0
    intercept_1 = y1_mean - slope_1 * u_mean
    squared = -2 * intercept_1 / G
    residual_1 = np.maximum(covariance(y1, y1, s_1, s_1) - np.nan_to_num(c_1 * slope_1), 0.0)
    residual_2 = np.maximum(covariance(y2, y2, s_2, s_2) - np.nan_to_num(c_2 * slope_2), 0.0)
    # smoothed signals are correlated: fewer independent samples than samples
    variance_1, variance_2 = (r / (safe - 2) * motion.correlation for r in (residual_1, residual_2))
    if source == "paper":
        inclination = root(squared, y2_mean - slope_2 * u_mean)
        intercept_sd = np.sqrt(variance_1 * (1 / safe + u_mean**2 / c_uu.clip(min=1e-30)))
        inclination_sd = root_sd(intercept_sd, inclination)
    else:
        inclination = y2_mean / G
        inclination_sd = np.sqrt(variance_2 / safe) / G
    known = count >= MIN_SHARE * n
    return RegressionFit(
        pitch=np.where(known, -slope_1, np.nan),
        inclination=np.where(known, inclination, np.nan),
        pitch_sd=np.sqrt(variance_1 / c_uu.clip(min=1e-30)),
        inclination_sd=inclination_sd,
        inclination_squared=np.where(known, squared, np.nan),
        excitation=np.where(known, np.sqrt(c_uu / safe), np.nan),
        known=known,
    )


def ls_window(
    drive: Drive, vehicle: Vehicle, params: LsWindowParameters, engine: Engine
) -> Estimate:
    """Pitch is the slope of f_z over dv/dt, inclination the mean of f_x - dv/dt; grade = i - p.

    A body that pitches with dv/dt biases the pitch: p_LS = p + k g i;
    docs/methods/massel2004.md#errata.
    """
    del engine  # sliding sums are one vectorized formula
    params = with_preset(params, PRESETS, params.preset)
    motion = longitudinal(drive, params, vehicle)
    n = max(4, round(params.window * drive.rate))
    source, smooth = params.inclination_source or "x", bool(params.smooth)
    fit = fit_windows(motion, n, source, smooth)
    excited = fit.known & (fit.excitation >= (params.excitation_min or 0.0))
    excited &= np.isfinite(fit.pitch)
    limit = round(params.hold_time * drive.rate)
    pitch_limit = round(params.pitch_hold_time * drive.rate)
    pitch, pitch_held = hold(np.where(excited, fit.pitch, np.nan), pitch_limit)
    pitch_sd, _ = hold(np.where(excited, fit.pitch_sd, np.nan), pitch_limit)
    inclination, inclination_held = hold(fit.inclination, limit)
    inclination_sd, _ = hold(np.where(fit.known, fit.inclination_sd, np.nan), limit)
    started = np.cumsum(fit.known) > 0
    flags = (
        straight_flags(drive, fit.known | ~started)
        | flag(pitch_held | inclination_held, "held")
        | flag(fit.known & ~excited, "excitation")
        | flag(~started, "converging")
    )
    held = replace(
        fit,
        pitch=pitch,
        pitch_sd=pitch_sd,
        inclination=inclination,
        inclination_sd=inclination_sd,
    )
    return estimate_of(drive, held, excited, flags)


LS_WINDOW = Estimator(
    name="ls_window",
    run=ls_window,
    parameters=LsWindowParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Massel 2004, eqs. (6)-(15); docs/methods/massel2004.md#least-squares-window",
    summary="pitch and grade by sliding least squares; needs changing dv/dt and a smooth road",
    systematic_deg={"grade": 1.7, "pitch": 1.7, "inclination": 0.45},
    tilted=("inclination",),
)
