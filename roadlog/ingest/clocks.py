"""Clocks of several devices on one drive: the offset between them, by cross-correlation.

Normalized cross-correlation with masks (Padfield 2012, "Masked Object Registration in the Fourier
Domain", IEEE TIP 21(5), eq. 11), of speed with speed, or of acceleration with the derivative of
speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.filters.correlate import correlate
from roadlog.filters.lowpass import gaussian_mean
from roadlog.ingest.grid import Signals
from roadlog.motion.lag import SpeedTrack, shift
from roadlog.types import Floats, Stamps

GRID_RATE = 20.0  # Hz, grid of the correlation
SMOOTH = 0.4  # s, sd of the kernel over accelerations: engine and road shake them, not speed
SLOW = 8.0  # s, sd of the kernel whose mean is taken off: gravity on a grade, biases
HOLE = 3.0  # s between samples; across a longer one nothing is known
MIN_OVERLAP = 20.0  # s of common time
MIN_SHARE = 0.4  # of the shorter recording
MIN_CORRELATION = 0.5
APART = 5.0  # s from the peak, where a second one is another answer
MARGIN = 0.8  # the second answer's score at most, as a share of the best
FINE = 2.0  # s about the speeds' answer, where the acceleration is looked at
MAX_OFFSET = 10.0  # s; more must be told
ZONE = 900.0  # s, step of the world's time zones
MAX_ZONE = 14 * 3600.0  # s
MAX_RECORDING = 48 * 3600.0  # s of a recording whose clock can be compared
SECOND = 1_000_000_000  # ns


@dataclass(frozen=True)
class Offset:
    """What to add to a clock [s], its standard deviation, and how it was found.

    interval: s between the samples of the slower signal. correlation: at the peak. sure: no other
    offset comes near.
    """

    seconds: float
    sd: float
    interval: float
    correlation: float
    by: str
    sure: bool

    @property
    def applies(self) -> bool:
        """Whether it is other than 0 beyond doubt, and known to half a sample."""
        return abs(self.seconds) > 2 * self.sd and self.sd <= 0.5 * self.interval


@dataclass(frozen=True)
class Group:
    """Signals of one logger: its files and what they hold."""

    files: Sequence[str]
    signals: Signals


@dataclass(frozen=True)
class _Side:
    """What one recording has to compare: a speed, or an acceleration.

    start: ns, of the grid and of the track's times. band: acceleration at GRID_RATE, without what
    is slower or faster than the car; speed: on the grid, where it is one. NaN where unknown.
    track: the same at its own stamps.
    """

    start: int
    band: Floats
    speed: Floats | None
    track: SpeedTrack


def merged(groups: Sequence[Group], fixed: Mapping[str, float]) -> tuple[Signals, list[str]]:
    """Signals of all groups on the clock of the first, and sentences on the clocks.

    fixed: file name -> s to add to its clock. Where two groups have a role, the later one counts.
    Raises LogReadError for clocks that cannot be brought together, ConfigError for a fixed offset
    of no file.
    """
    for name in fixed:
        if not any(name in group.files for group in groups):
            known = [file for group in groups for file in group.files]
            raise ConfigError(f"--time-offset: no source '{name}'. {near(name, known)}")
    groups = [group for group in groups if group.signals]
    result: Signals = {}
    notes = []
    for group in groups:
        shift = next((fixed[name] for name in group.files if name in fixed), None)
        if shift is not None:
            notes.append(f"{_label(group)}: clock: {shift:+.3f} s added, as given")
        elif result:
            shift, note = _aligned(result, group, _label(groups[0]))
            notes.append(note)
        moved = round((shift or 0.0) * 1e9)
        result |= {
            role: (time + moved if moved else time, values)
            for role, (time, values) in group.signals.items()
        }
    return _after_zero(result, notes)


def _after_zero(signals: Signals, notes: list[str]) -> tuple[Signals, list[str]]:
    """The same, all moved by whole seconds where a stamp lies before 0: a log holds none there."""
    first = min((int(time.min()) for time, _ in signals.values() if len(time)), default=0)
    if first >= 0:
        return signals, notes
    seconds = -(first // SECOND)
    said = f"the clock begins at {first * 1e-9:.3f} s: all stamps moved by +{seconds} s"
    moved = {role: (time + seconds * SECOND, v) for role, (time, v) in signals.items()}
    return moved, [*notes, said]


def _label(group: Group) -> str:
    return group.files[0] + (f" and {len(group.files) - 1} more" if len(group.files) > 1 else "")


def _aligned(reference: Signals, group: Group, where: str) -> tuple[float, str]:
    """The offset of a group and a sentence on it. Raises LogReadError."""
    offset = estimate(reference, group.signals)
    label = _label(group)
    own = [time for time, _ in group.signals.values() if len(time)]
    theirs = [time for time, _ in reference.values() if len(time)]
    together = min(t.max() for t in own) > min(t.min() for t in theirs) and min(
        t.min() for t in own
    ) < max(t.max() for t in theirs)
    if offset is None or not offset.sure:
        quality = (
            "nothing to compare" if offset is None else f"best correlation {offset.correlation:.2f}"
        )
        if together:
            return (
                0.0,
                f"{label}: clock: taken as that of {where} ({quality}); --time-offset sets it",
            )
        raise LogReadError(
            f"{label}: its stamps do not overlap those of {where}, and the offset cannot be "
            f"estimated ({quality}); give --time-offset {group.files[0]}=SECONDS"
        )
    found = (
        f"{offset.seconds:+.3f} s (sd {offset.sd:.3f} s, correlation {offset.correlation:.2f}, "
        f"{offset.by})"
    )
    if abs(offset.seconds) <= 2 * offset.sd:
        return 0.0, f"{label}: clock: agrees with that of {where}: {found}"
    if not offset.applies and together:
        return 0.0, (
            f"{label}: clock: taken as that of {where}: {found} is not known to half a sample "
            f"({0.5 * offset.interval:.3f} s); --time-offset sets it"
        )
    zone = round(offset.seconds / ZONE) * ZONE
    zone = zone if abs(zone) <= MAX_ZONE else 0.0
    if abs(offset.seconds - zone) > MAX_OFFSET:
        raise LogReadError(
            f"{label}: its clock differs from that of {where} by {found}, more than "
            f"{MAX_OFFSET:.0f} s beside a time zone; if that is so, give "
            f"--time-offset {group.files[0]}={offset.seconds:.3f}"
        )
    hours = f", {zone / 3600:+g} h of it a time zone" if zone else ""
    return offset.seconds, f"{label}: clock: set to that of {where} by {found}{hours}"


def estimate(reference: Signals, other: Signals) -> Offset | None:
    """What to add to the other recording's stamps; None where nothing can be compared.

    Found by correlation on a grid, then to a fraction of a sample by `motion.lag`. Speeds give the
    answer; where one of the two has an accelerometer, that refines it, because a receiver's speed
    lags.
    """
    speeds = _speed(reference), _speed(other)
    accelerations = _acceleration(reference), _acceleration(other)
    best: Offset | None = None
    for ours, theirs, by in (
        (speeds[0], speeds[1], "speed against speed"),
        (accelerations[0], speeds[1], "acceleration against speed"),
        (speeds[0], accelerations[1], "speed against acceleration"),
    ):
        if ours is None or theirs is None:
            continue
        found = _compared(ours, theirs, by, best.seconds if best and best.sure else None)
        if found is not None and (found.sure or best is None or not best.sure):
            best = found
    return best


def _compared(ours: _Side, theirs: _Side, by: str, near: float | None) -> Offset | None:
    """The offset by one pair of signals, not sure where the fine answer is none."""
    offset = _correlate(ours, theirs, by, near)
    if offset is None or not offset.sure:
        return offset
    apart = (ours.start - theirs.start) * 1e-9
    fine = shift(ours.track, theirs.track, offset.seconds - apart)
    if fine is None:
        return replace(offset, sure=False)
    return replace(offset, seconds=fine.seconds + apart, sd=fine.sd, interval=fine.interval)


def _speed(signals: Signals) -> _Side | None:
    wheels = [signals[r] for w in ("fl", "fr", "rl", "rr") if (r := f"wheel_speeds.{w}") in signals]
    for time, values in (
        *wheels[:1],
        *(signals[r] for r in ("speed.v", "gnss.speed") if r in signals),
    ):
        gridded = _uniform(time, np.abs(values))
        if gridded is not None:
            start, speed = gridded
            track = SpeedTrack.of_speed(np.multiply(time - start, 1e-9), np.abs(values))
            return _Side(start, _banded(np.gradient(speed) * GRID_RATE), speed, track)
    return None


def _acceleration(signals: Signals) -> _Side | None:
    if "imu.accel_x" not in signals:
        return None
    time, values = signals["imu.accel_x"]
    gridded = _uniform(time, values)
    if gridded is None:
        return None
    start, acceleration = gridded
    track = SpeedTrack.of_acceleration(np.multiply(time - start, 1e-9), values)
    return _Side(start, _banded(acceleration), None, track)


def _uniform(time: Stamps, values: Floats) -> tuple[int, Floats] | None:
    """Start in ns and means of the samples in each cell of GRID_RATE, short holes interpolated."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < MIN_OVERLAP:
        return None
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    start = int(time[0])
    if int(time[-1]) - start > MAX_RECORDING * 1e9:
        return None  # a clock jumped
    own = (time - start) * 1e-9
    grid = np.arange(int(own[-1] * GRID_RATE) + 1) / GRID_RATE
    cell = np.minimum(np.rint(own * GRID_RATE).astype(np.int64), len(grid) - 1)
    count = np.bincount(cell, minlength=len(grid))
    there = count > 0
    means = np.bincount(cell, values, len(grid))[there] / count[there]
    moments = np.bincount(cell, own, len(grid))[there] / count[there]
    result = np.interp(grid, moments, means)
    newest = np.clip(np.searchsorted(moments, grid, side="right") - 1, 0, len(moments) - 2)
    result[moments[newest + 1] - moments[newest] > HOLE] = np.nan
    return start, result


def _banded(values: Floats) -> Floats:
    """Values without what is slower than SLOW or faster than SMOOTH."""
    return _smoothed(values, SMOOTH) - _smoothed(values, SLOW)


def _smoothed(values: Floats, width: float) -> Floats:
    return np.where(np.isfinite(values), gaussian_mean(values, width * GRID_RATE)[0], np.nan)


def _correlate(ours: _Side, theirs: _Side, by: str, near: float | None) -> Offset | None:
    """The offset of theirs with the highest score, atanh(r) sqrt(overlap), to a cell of the grid.

    near: only about this offset [s].
    """
    both = ours.speed is not None and theirs.speed is not None
    a, b = (side.speed if both and side.speed is not None else side.band for side in (ours, theirs))
    correlation, overlap = _masked(a, b)
    lags = np.arange(len(correlation)) - (len(b) - 1)  # of b in a, in cells
    seconds = (ours.start - theirs.start) * 1e-9 + lags / GRID_RATE
    shorter = min(np.isfinite(a).sum(), np.isfinite(b).sum()) / GRID_RATE
    possible = overlap / GRID_RATE >= max(MIN_OVERLAP, MIN_SHARE * shorter)
    if near is not None:
        possible &= np.abs(seconds - near) <= FINE
    if not possible.any():
        return None
    score = np.where(
        possible, np.arctanh(np.clip(correlation, -0.999, 0.999)) * np.sqrt(overlap), -np.inf
    )
    best = int(np.argmax(score))
    elsewhere = np.abs(lags - lags[best]) > APART * GRID_RATE
    second = float(score[elsewhere].max()) if elsewhere.any() else -np.inf
    r = float(correlation[best])
    sure = r >= MIN_CORRELATION and second <= MARGIN * float(score[best])
    if near is not None:  # a peak, and no edge
        inner = 0 < best < len(score) - 1 and bool(possible[best - 1 : best + 2].all())
        sure = r >= MIN_CORRELATION and inner
    return Offset(float(seconds[best]), np.inf, np.inf, r, by, sure)


def _masked(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Correlation coefficient and number of common samples at every lag of b in a."""
    known_a, known_b = np.isfinite(a), np.isfinite(b)
    values_a = np.where(known_a, a - np.nanmean(a), 0.0)
    values_b = np.where(known_b, b - np.nanmean(b), 0.0)

    count = np.rint(correlate(known_a, known_b))
    n = np.maximum(count, 1.0)
    sum_a, sum_b = correlate(values_a, known_b), correlate(known_a, values_b)
    spread_a = correlate(values_a**2, known_b) - sum_a**2 / n
    spread_b = correlate(known_a, values_b**2) - sum_b**2 / n
    together = correlate(values_a, values_b) - sum_a * sum_b / n
    floor = 1e-6 * max(float(np.nanvar(a) * len(a)), float(np.nanvar(b) * len(b)), 1e-12)
    usable = (spread_a > floor) & (spread_b > floor)
    scale = np.sqrt(np.where(usable, spread_a * spread_b, 1.0))
    return np.where(usable, np.clip(together / scale, -1, 1), 0.0), count
