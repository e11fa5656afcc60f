"""Attitude by a low-pass: the plainest inclination estimate, baseline of Wang 2025.

docs/methods/wang2025.md#baselines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.filters import Engine
from roadlog.filters.gaps import age, hold
from roadlog.filters.kernels import causal, odd_window, parabolic_mean, slope
from roadlog.filters.lowpass import exponential
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G


@dataclass(frozen=True)
class LowpassAttitudeParameters:
    """docs/methods/wang2025.md#parameters-of-lowpass_attitude."""

    smooth: bool = parameter(True, "", "centered kernels, low-pass forward and backward in time")
    cutoff: float = parameter(0.1, "Hz", "of the first-order low-pass")
    slope_time: float = parameter(0.21, "s", "window of the speed's derivative")
    hold_time: float = parameter(5.0, "s", "the last value is held this long")


def lowpass_attitude(
    drive: Drive, vehicle: Vehicle, params: LowpassAttitudeParameters, engine: Engine
) -> Estimate:
    """Inclination = asin((f_x - dv/dt) / g), low-passed; no pitch, no bias, no cornering.

    Its standard deviation is the root mean square of what the low-pass takes away, through the
    same low-pass.
    """
    del vehicle  # a kinematic method: no parameter of the car
    n = odd_window(params.slope_time, drive.dt)
    rate = slope(drive.speed, n, drive.dt)
    force = parabolic_mean(drive["imu.accel_x"], n)
    if not params.smooth:
        rate, force = causal(rate, n), causal(force, n)
    raw = np.arcsin(np.clip((force - rate) / G, -1.0, 1.0))
    alpha = 1 - math.exp(-2 * math.pi * params.cutoff * drive.dt)
    inclination, variance = np.full(len(drive), np.nan), np.full(len(drive), np.nan)
    known = np.isfinite(raw)
    for run in runs(known):
        inclination[run] = _lowpass(raw[run], alpha, params.smooth, engine)
    residual = (raw - inclination) ** 2
    usual = float(np.mean(residual[known])) if known.any() else 0.0  # at the beginning of a run
    for run in runs(known):
        variance[run] = _lowpass(residual[run], alpha, params.smooth, engine, usual)
    limit = round(params.hold_time * drive.rate)
    inclination, was_held = hold(inclination, limit)
    variance, _ = hold(variance, limit)
    flags = (
        flag(~known, "missing")
        | flag(was_held, "held")
        | flag(drive.standstill, "standstill")
        | flag(~drive.straight, "model")
        | flag(age(known) * drive.dt > params.hold_time, "uncertain")
    )
    return Estimate(
        drive.time,
        {"inclination": inclination},
        {"inclination": np.sqrt(np.maximum(variance, 0.0))},
        known,
        flags,
    )


def _lowpass(
    values: Floats, alpha: float, smooth: bool, engine: Engine, begin: float | None = None
) -> Floats:
    """y += alpha (x - y), from `begin` or the first value; then backward when smoothing."""
    forward = _first_order(values, alpha, engine, begin)
    return _first_order(forward[::-1], alpha, engine, begin)[::-1] if smooth else forward


def _first_order(values: Floats, alpha: float, engine: Engine, begin: float | None) -> Floats:
    start = float(values[0]) if begin is None else begin
    if engine == "reference":
        from filterpy.memory import FadingMemoryFilter

        memory = FadingMemoryFilter([start], dt=1.0, order=0, beta=1 - alpha)
        result = np.empty(len(values))
        for k, value in enumerate(values):
            memory.update(value)
            result[k] = memory.x[0]
        return result
    return exponential(values, alpha, start)


LOWPASS_ATTITUDE = Estimator(
    name="lowpass_attitude",
    run=lowpass_attitude,
    parameters=LowpassAttitudeParameters,
    needs=("imu.accel_x", ANY_SPEED),
    gives=("inclination",),
    reference="Wang 2025; docs/methods/wang2025.md#baselines",
    summary="low-passed inclination from acceleration minus dv/dt; straight driving",
    tilted=("inclination",),
)
