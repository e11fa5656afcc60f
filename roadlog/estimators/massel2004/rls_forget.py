"""Pitch and inclination by recursive least squares with exponential forgetting.

Massel 2004, equations (16)-(18), corrected: docs/methods/massel2004.md#recursive-least-squares.
"""

from __future__ import annotations

import math
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
from roadlog.filters.gaps import age, hold
from roadlog.filters.rls import Regression, rls
from roadlog.filters.windows import moving_mean, moving_std
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

PAPER_RATE = 1000.0  # Hz, at which the paper gives its forgetting factor

PRESETS = {"paper": {**PAPER, "trace_max": math.inf}, "robust": {**ROBUST, "trace_max": 1e2}}


@dataclass(frozen=True)
class RlsForgetParameters(RegressionParameters):
    """docs/methods/massel2004.md#parameters-of-rls_forget; none: as the preset says."""

    preset: Literal["paper", "robust"] = parameter(
        "robust", "", "paper: as printed; robust: gated, against windup"
    )
    forgetting: float = parameter(0.997, "-", "lambda per sample at 1 kHz, scaled to the rate")
    initial_variance: float = parameter(1e4, "-", "P0, not more than trace_max")
    trace_max: float | None = parameter(None, "-", "cap on the covariance's trace")
    excitation_time: float = parameter(1.2, "s", "window of that std")
    average_time: float = parameter(0.6, "s", "moving mean of the inclination, source x")


@dataclass(frozen=True)
class RecursiveFit(RegressionFit):
    """updated: samples that were learned from."""

    updated: Bools


def fit_recursively(
    motion: Longitudinal, params: RlsForgetParameters, rate: float, engine: Engine
) -> RecursiveFit:
    """Two recursions: model 1 gives [pitch, i^2], model 2 gives [pitch^2, i]."""
    y1, y2, u, known = Data.of(motion)
    excitation = moving_std(u, round(params.excitation_time * rate))
    updated = known & (excitation >= (params.excitation_min or 0.0))
    forgetting = params.forgetting ** (PAPER_RATE / rate)
    trace_max = math.inf if params.trace_max is None else params.trace_max
    p0 = min(params.initial_variance, trace_max)  # a larger P0 would be harmful
    constant = np.full(len(u), G)
    vertical = rls(Regression(-u, -constant / 2, y1, updated), forgetting, p0, trace_max, engine)
    learned = np.cumsum(updated) > 0
    error = np.where(np.isfinite(vertical.error), vertical.error**2, 0.0)
    noise = np.sqrt(np.maximum(_forgetting_mean(error, updated, forgetting), 0.0))
    # the recursion takes its samples for independent; the smoothed ones are not
    pitch_sd = noise * np.sqrt(np.maximum(vertical.p11, 0.0) * motion.correlation)
    pitch = np.where(learned, vertical.x[:, 0], np.nan)
    squared = np.where(learned, vertical.x[:, 1], np.nan)
    if params.inclination_source == "paper":
        along = rls(Regression(-u / 2, constant, y2, updated), forgetting, p0, trace_max, engine)
        inclination = np.where(learned & known, root(squared, along.x[:, 1]), np.nan)
        inclination_sd = root_sd(noise, inclination)
    else:
        n = round(params.average_time * rate)
        inclination = np.where(known, moving_mean(motion.inclination, n), np.nan)
        inclination_sd = motion.inclination_sd * min(1.0, math.sqrt(motion.correlation / n))
    return RecursiveFit(
        pitch, inclination, pitch_sd, inclination_sd, squared, excitation, known, updated
    )


def _forgetting_mean(values: Floats, counted: Bools, forgetting: float) -> Floats:
    """Exponentially forgetting mean of the counted values; weights as in the recursion."""
    from scipy.signal import lfilter

    # forget only where something is learned: the recursion skips the other samples altogether
    result = np.zeros(len(values))
    kept = values[counted]
    if len(kept):
        weight = lfilter([1.0], [1.0, -forgetting], np.ones(len(kept)))
        mean = lfilter([1.0], [1.0, -forgetting], kept) / weight
        last = np.cumsum(counted) - 1
        result = np.where(last >= 0, mean[np.maximum(last, 0)], 0.0)
    return result


def rls_forget(
    drive: Drive, vehicle: Vehicle, params: RlsForgetParameters, engine: Engine
) -> Estimate:
    """Recursive least squares on f_z and f_x over dv/dt; memory 0.33 s with the paper's lambda.

    Biased as `ls_window` by a body that pitches with dv/dt: p + k g i.
    """
    params = with_preset(params, PRESETS, params.preset)
    motion = longitudinal(drive, params, vehicle)
    fit = fit_recursively(motion, params, drive.rate, engine)
    since = age(fit.updated) * drive.dt
    pitch = np.where(since <= params.pitch_hold_time, fit.pitch, np.nan)
    inclination, held = hold(fit.inclination, round(params.hold_time * drive.rate))
    inclination_sd, _ = hold(
        np.where(fit.known, fit.inclination_sd, np.nan), round(params.hold_time * drive.rate)
    )
    converging = np.cumsum(fit.updated) * drive.dt < params.excitation_time
    flags = (
        straight_flags(drive, fit.known)
        | flag(held | (np.isfinite(pitch) & ~fit.updated), "held")
        | flag(fit.known & ~fit.updated, "excitation")
        | flag(converging, "converging")
    )
    kept = replace(fit, pitch=pitch, inclination=inclination, inclination_sd=inclination_sd)
    valid = fit.updated & ~converging & np.isfinite(inclination - pitch)
    return estimate_of(drive, kept, valid, flags)


RLS_FORGET = Estimator(
    name="rls_forget",
    run=rls_forget,
    parameters=RlsForgetParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Massel 2004, eqs. (16)-(18); docs/methods/massel2004.md#recursive-least-squares",
    summary="pitch and grade by recursive least squares; needs changing dv/dt and a smooth road",
    systematic_deg={"inclination": 0.7},
    tilted=("inclination",),
)
