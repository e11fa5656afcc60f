"""Pitch from the direction of acceleration: how f_z changes with f_x while driving.

Stands for Kasaba (ISAL 2015), which Kim 2023 compares with; reconstructed after the "acceleration
ratio" patents of the same company: docs/methods/kim2023.md#kasaba.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.filters import Engine
from roadlog.filters.lowpass import zero_phase
from roadlog.types import Bools, Floats


@dataclass(frozen=True)
class KasabaParameters:
    """docs/methods/kim2023.md#parameters-of-kasaba."""

    variant: Literal["plain", "delta", "intercept"] = parameter(
        "plain", "", "plain: f_z over f_x; delta: their changes; intercept: changes and mean f_x"
    )
    cutoff: float = parameter(1.0, "Hz", "of the zero-phase low-pass, 2nd-order Butterworth")
    min_speed: float = parameter(1.0, "m/s", "slower samples do not count")
    min_spread: float = parameter(0.3, "m/s2", "standard deviation of f_x that gives a slope")
    min_time: float = parameter(60.0, "s", "of driving that gives a slope")
    lag: float = parameter(1.0, "s", "delta, intercept: time between the two samples")
    min_change: float = parameter(0.4, "m/s2", "delta, intercept: smaller changes do not count")
    forget_time: float | None = parameter(None, "s", "time constant of forgetting; none: never")


def kasaba(drive: Drive, vehicle: Vehicle, params: KasabaParameters, engine: Engine) -> Estimate:
    """pitch = -atan(slope of f_z over f_x), by least squares over all driving up to each sample.

    A car that accelerates moves the specific force by (vd cos p, -vd sin p). Not causal: the
    low-pass has no phase.
    """
    del vehicle, engine  # no parameter of the car, sums only
    x, z = (_lowpassed(drive[f"imu.accel_{axis}"], drive.rate, params.cutoff) for axis in "xz")
    with np.errstate(invalid="ignore"):
        used = np.isfinite(x) & np.isfinite(z) & (drive.speed > params.min_speed)
    driven = np.cumsum(used) * drive.dt
    if params.variant == "plain":
        regressors, response = [np.ones(len(x)), x], z
    else:
        lag = round(params.lag * drive.rate)
        change = _change(x, lag)
        with np.errstate(invalid="ignore"):
            used &= np.abs(change) > params.min_change
        response = _change(z, lag)
        used &= np.isfinite(response)
        regressors = [change]
        if params.variant == "intercept":
            regressors.append(change * (x - 0.5 * change))  # times the mean f_x of both samples
    decay = 0.0 if params.forget_time is None else drive.dt / params.forget_time
    slope, variance, spread = _least_squares(regressors, response, used, decay)
    # samples of a low-passed signal repeat each other: n is worth 2 fc / fs of its count
    sd = np.sqrt(variance * drive.rate / (2 * params.cutoff))
    valid = np.isfinite(slope) & (spread > params.min_spread) & (driven > params.min_time)
    flags = (
        flag(~np.isfinite(x + z + drive.speed), "missing")
        | flag(drive.standstill, "standstill")
        | flag(~valid, "converging")
        | flag(spread <= params.min_spread, "excitation")
    )
    pitch = np.where(valid, -np.arctan(slope), np.nan)
    sd = np.where(valid, sd, np.nan)
    return Estimate(drive.time, {"pitch": pitch}, {"pitch": sd}, valid, flags)


def _least_squares(
    regressors: list[Floats], response: Floats, used: Bools, decay: float
) -> tuple[Floats, Floats, Floats]:
    """Slope, its variance for white residuals, and the spread of the slope's regressor.

    At every sample, over the used ones so far. One regressor: a line through the origin; two: the
    slope belongs to the second when the first is constant, else to the first.
    """
    w = used.astype(np.float64)

    def total(values: Floats) -> Floats:
        return _accumulate(np.where(used, values, 0.0), decay)

    n = _accumulate(w, decay)
    yy = total(response**2)
    constant = len(regressors) == 2 and bool((regressors[0] == 1.0).all())
    with np.errstate(divide="ignore", invalid="ignore"):
        if len(regressors) == 1:
            a = regressors[0]
            aa, ay = total(a * a), total(a * response)
            slope, inner, free = ay / aa, aa, n - 1
            rss = yy - ay**2 / aa
            spread = np.sqrt(aa / n)
        else:
            # the coefficient of `a` once `b` is taken out of both sides
            b, a = regressors if constant else regressors[::-1]
            aa, ab, bb = total(a * a), total(a * b), total(b * b)
            ay, by = total(a * response), total(b * response)
            inner, free = aa - ab**2 / bb, n - 2
            covariance = ay - ab * by / bb
            slope = covariance / inner
            rss = yy - by**2 / bb - covariance**2 / inner
            spread = np.sqrt(inner / n)
        variance = np.maximum(rss, 0.0) / np.maximum(free, 1.0) / inner
    return slope, variance, np.nan_to_num(spread)


def _accumulate(values: Floats, decay: float) -> Floats:
    if decay == 0.0:
        return np.cumsum(values)
    from scipy.signal import lfilter

    return lfilter([1.0], [1.0, decay - 1.0], values)


def _change(values: Floats, lag: int) -> Floats:
    """values(t) - values(t - lag); NaN at the start."""
    result = np.full(len(values), np.nan)
    result[lag:] = values[lag:] - values[:-lag]
    return result


def _lowpassed(values: Floats, rate: float, cutoff: float) -> Floats:
    """Between gaps; NaN where the signal is, and in pieces shorter than the filter's memory."""
    result = np.full(len(values), np.nan)
    memory = round(rate / cutoff)
    for run in runs(np.isfinite(values)):
        if run.stop - run.start > memory:
            result[run] = zero_phase(values[run], cutoff, rate, memory)
    return result


KASABA = Estimator(
    name="kasaba",
    run=kasaba,
    parameters=KasabaParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("pitch",),
    reference="Kasaba 2015, by Kim 2023 (reconstructed); docs/methods/kim2023.md#kasaba",
    summary="pitch of the load from the direction of acceleration while driving",
    systematic_deg={"pitch": 0.5},
)
