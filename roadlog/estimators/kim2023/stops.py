"""Stops of a drive, and what its sensors show at rest.

Source: docs/methods/kim2023.md."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.drive import Drive, runs
from roadlog.estimators.base import parameter
from roadlog.filters.lowpass import exponential
from roadlog.types import Bools, Floats

NOISE_MARGIN = 4.0  # standard deviations of noise that a car at rest may show besides
STIR_TIME = 0.1  # s, mean that tells the first stir of a car at rest from noise
STIR = 0.005  # m/s2, change of that mean that is none


@dataclass(frozen=True)
class StaticSlopeParameters:
    """docs/methods/kim2023.md#parameters-of-static_slope; "paper" marks the paper's values."""

    align: Literal["auto", "full", "paper"] = parameter(
        "auto",
        "",
        "paper: attitude next to the stop; full: settled, gyro, lever; auto: full where the "
        "lever is known or found",
    )
    direction: Literal["both", "forward", "reverse"] = parameter(
        "both", "", "windows out of stops (forward), into them (reverse time), or both"
    )
    integration: Literal["trapezoid", "rectangle"] = parameter("trapezoid", "", "rectangle: paper")
    gyro_bias: Literal["mean", "lowpass"] = parameter("mean", "", "lowpass: paper")
    accel_bias: Literal["gravity", "none"] = parameter(
        "gravity", "", "gravity: along x by the size of gravity at stops (ours); none: paper"
    )
    bias_cutoff: float = parameter(0.05, "Hz", "of the gyro bias low-pass")
    hold_off: float = parameter(0.5, "s", "zero speed before and after a standing sample")
    min_standstill: float = parameter(1.0, "s", "shorter stops do not count")
    distance: float = parameter(2.0, "m", "length of a window (paper)")
    max_time: float = parameter(5.0, "s", "a window that takes longer is void")
    averaging: float = parameter(2.0, "s", "mean specific force of the standing car")
    min_averaging: float = parameter(0.5, "s", "with less the event is void")
    settle: float = parameter(1.5, "s", "full: the body rocks this long after a stop")
    gravity_tolerance: float = parameter(0.5, "m/s2", "of the mean specific force")
    unsteady_max: float = parameter(
        0.05, "m/s2", "change between the halves of the averaging window: still moving (ours)"
    )
    chord_max: float = parameter(0.01, "m", "deviation of the path from a straight slope")
    way_back_max: float = parameter(
        0.05, "m", "a car that rolls back by more is flagged; tires give by less (ours)"
    )
    lift_off: float = parameter(
        1.2, "m", "full: slope of the path beyond it, when the body has lifted and pitched (ours)"
    )
    gravity_averaging: float = parameter(
        6.0, "s", "full: mean size of the specific force, wherever the body turns to (ours)"
    )
    weights: Literal["equal", "variance"] = parameter(
        "equal", "", "of the running mean; variance: 1/sd^2"
    )
    reset_on_load: bool = parameter(False, "", "start the mean anew when the load changes")
    aimed_pitch: float = parameter(
        0.0, "rad", "pitch of the body for which the headlamp is aimed: zero of the leveling (ours)"
    )
    load_step: float = parameter(0.00262, "rad", "change of inclination that is a load")


@dataclass(frozen=True)
class Stop:
    """A standstill: samples first .. last and the gyro bias there (3,), rad/s.

    still: its samples in which the body is at rest. starts, ends: the car is known to drive before
    and after it.
    """

    first: int
    last: int
    still: slice
    gyro_bias: Floats
    starts: bool
    ends: bool


def find_stops(
    drive: Drive, static: Bools, full: bool, params: StaticSlopeParameters
) -> list[Stop]:
    """Standstills of at least `min_standstill`; a gap in the speed neither starts nor ends one.

    full: the body comes to rest `settle` after the car, and stirs before the wheels do: brakes are
    released, the drive winds up. Without it the body is at rest as long as the car stands.
    """
    margin = round(params.hold_off * drive.rate)
    known = np.isfinite(drive.speed)
    force, rate = vectors(drive, "accel"), vectors(drive, "gyro")
    settle, least = (round(t * drive.rate) for t in (params.settle, params.min_averaging))
    spans = [s for s in runs(static) if (s.stop - s.start) * drive.dt >= params.min_standstill]
    # the moving sample that bounds a standstill lies one hold-off away
    starts = [s.start > 0 and bool(known[s.start - margin - 1]) for s in spans]
    ends = [s.stop < len(drive) and bool(known[s.stop + margin]) for s in spans]
    stills = list(spans)
    if full:
        for k, span in enumerate(spans):
            stop = (
                _first_stir(force[span], drive.rate, params) if ends[k] else span.stop - span.start
            )
            settled = settle if starts[k] and stop - settle >= least else 0
            stills[k] = slice(span.start + settled, span.start + stop)
    biases = _gyro_biases(rate, stills, drive.dt, params)
    return [
        Stop(span.start, span.stop - 1, stills[k], biases[k], starts[k], ends[k])
        for k, span in enumerate(spans)
    ]


def _first_stir(force: Floats, rate: float, params: StaticSlopeParameters) -> int:
    """Samples of a standstill before the force (n, 3) leaves the level that it had until then."""
    n, short = len(force), round(STIR_TIME * rate)
    while True:
        last = force[max(n - round(params.averaging * rate), 0) : n]
        half = len(last) // 2
        if half < 2 * short or not np.isfinite(last).all():
            return n
        level = last[:half]
        sums = np.cumsum(np.concatenate([np.zeros((1, 3)), last - level.mean(axis=0)]), axis=0)
        means = (sums[short:] - sums[:-short]) / short  # of the samples k .. k + short
        white = level.std(axis=0) * np.sqrt(1 / short + 1 / half)
        spread = np.maximum(white, means[: half - short].std(axis=0))
        stirs = np.flatnonzero((np.abs(means[half:]) > STIR + NOISE_MARGIN * spread).any(axis=1))
        if not len(stirs):
            return n
        n += half - len(last) + int(stirs[0])
        if stirs[0] > 0:
            return n  # else it was not level even before


def _gyro_biases(
    rate: Floats, spans: list[slice], dt: float, params: StaticSlopeParameters
) -> list[Floats]:
    """rad/s (3,) per stop: its mean rate, or the low-pass over samples at rest at its end.

    Backward in time the bias is known best at the end of the stop as well.
    """
    standing = [rate[span][np.isfinite(rate[span]).all(axis=1)] for span in spans]
    if params.gyro_bias == "mean":
        return [r.mean(axis=0) if len(r) else np.full(3, np.nan) for r in standing]
    alpha = 1 - np.exp(-2 * np.pi * params.bias_cutoff * dt)
    samples = np.concatenate([*standing, np.empty((0, 3))])
    if not len(samples):
        return [np.full(3, np.nan) for _ in spans]
    start = samples[: max(1, round(1.0 / dt))].mean(axis=0)  # mean of the first second
    filtered = exponential(samples, alpha, start)
    ends = np.cumsum([len(r) for r in standing]) - 1
    return [filtered[max(int(end), 0)] for end in ends]


def vectors(drive: Drive, kind: str) -> Floats:
    return np.stack([drive[f"imu.{kind}_{axis}"] for axis in "xyz"], axis=1)
