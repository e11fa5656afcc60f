"""Clocks of several devices on one drive: the offset between them, by cross-correlation.

Normalized cross-correlation with masks (Padfield 2012, "Masked Object Registration in the Fourier
Domain", IEEE TIP 21(5), eq. 11), of speed with speed, or of acceleration with the derivative of
speed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.ndimage import gaussian_filter1d

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.ingest.mapping import Signals
from roadlog.types import Bools, Floats, Stamps

RATE = 20.0  # Hz, grid of the correlation
SMOOTH = 0.4  # s, sd of the kernel over accelerations: engine and road shake them, not speed
SLOW = 8.0  # s, sd of the kernel whose mean is taken off: gravity on a grade, biases
HOLE = 3.0  # s between samples; across a longer one nothing is known
MIN_OVERLAP = 20.0  # s of common time
MIN_SHARE = 0.4  # of the shorter recording
MIN_CORRELATION = 0.5
APART = 5.0  # s from the peak, where a second one is another answer
MARGIN = 0.8  # the second answer's score at most, as a share of the best
FINE = 2.0  # s about the speeds' answer, where the acceleration may refine it
AGREE = 0.1  # s; clocks this near are left as they are: a receiver's latency is no offset
MAX_OFFSET = 10.0  # s; more must be told
ZONE = 900.0  # s, step of the world's time zones
MAX_ZONE = 14 * 3600.0  # s
LONGEST = 48 * 3600.0  # s of a recording whose clock can be compared
DECORRELATION = 1.0  # s; errors of samples further apart than this are independent


@dataclass(frozen=True)
class Offset:
    """What to add to a clock [s], its standard deviation, and how it was found.

    correlation: at the peak. sure: no other offset comes near.
    """

    seconds: float
    sd: float
    correlation: float
    by: str
    sure: bool


@dataclass(frozen=True)
class Group:
    """Signals of one logger: its files and what they hold."""

    files: Sequence[str]
    signals: Signals


@dataclass(frozen=True)
class _Series:
    """Values on a uniform grid of RATE from start [ns], NaN where unknown."""

    start: int
    values: Floats


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
    return result, notes


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
    if abs(offset.seconds) <= AGREE:
        return 0.0, f"{label}: clock: agrees with that of {where}: {found}"
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

    Speeds give the answer; where one of the two has an accelerometer, that refines it, because
    a receiver's speed lags.
    """
    speeds = _speed(reference), _speed(other)
    accelerations = _acceleration(reference), _acceleration(other)
    found = []
    if speeds[0] is not None and speeds[1] is not None:
        found.append(_correlate(speeds[0], speeds[1], "speed against speed"))
    coarse = next((offset for offset in found if offset and offset.sure), None)
    for a, b in ((accelerations[0], speeds[1]), (speeds[0], accelerations[1])):
        if a is None or b is None:
            continue
        pair = (a, _derivative(b)) if a is accelerations[0] else (_derivative(a), b)
        near = None if coarse is None else coarse.seconds
        found.append(_correlate(pair[0], pair[1], "acceleration against derivative of speed", near))
    offsets = [offset for offset in found if offset is not None]
    sure = [offset for offset in offsets if offset.sure]
    return sure[-1] if sure else offsets[-1] if offsets else None


def _speed(signals: Signals) -> _Series | None:
    wheels = [signals[r] for w in ("fl", "fr", "rl", "rr") if (r := f"wheel_speeds.{w}") in signals]
    for time, values in (
        *wheels[:1],
        *(signals[r] for r in ("speed.v", "gnss.speed") if r in signals),
    ):
        series = _uniform(time, np.abs(values))
        if series is not None:
            return series
    return None


def _acceleration(signals: Signals) -> _Series | None:
    if "imu.accel_x" not in signals:
        return None
    series = _uniform(*signals["imu.accel_x"])
    return None if series is None else _Series(series.start, _banded(series.values))


def _derivative(speed: _Series) -> _Series:
    return _Series(speed.start, _banded(np.gradient(speed.values) * RATE))


def _uniform(time: Stamps, values: Floats) -> _Series | None:
    """Means of the samples in each cell of the grid, interpolated across short holes."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    if len(time) < MIN_OVERLAP:
        return None
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    start = int(time[0])
    if int(time[-1]) - start > LONGEST * 1e9:
        return None  # a clock jumped
    own = (time - start) * 1e-9
    grid = np.arange(int(own[-1] * RATE) + 1) / RATE
    cell = np.minimum(np.rint(own * RATE).astype(np.int64), len(grid) - 1)
    count = np.bincount(cell, minlength=len(grid))
    there = count > 0
    means = np.bincount(cell, values, len(grid))[there] / count[there]
    moments = np.bincount(cell, own, len(grid))[there] / count[there]
    result = np.interp(grid, moments, means)
    newest = np.clip(np.searchsorted(moments, grid, side="right") - 1, 0, len(moments) - 2)
    result[moments[newest + 1] - moments[newest] > HOLE] = np.nan
    return _Series(start, result)


def _banded(values: Floats) -> Floats:
    """Values without what is slower than SLOW or faster than SMOOTH."""
    return _smoothed(values, SMOOTH) - _smoothed(values, SLOW)


def _smoothed(values: Floats, width: float) -> Floats:
    known = np.isfinite(values)
    weight = gaussian_filter1d(known.astype(np.float64), width * RATE, mode="constant")
    total = gaussian_filter1d(np.where(known, values, 0.0), width * RATE, mode="constant")
    return np.where(known, total / np.maximum(weight, 1e-9), np.nan)


def _correlate(a: _Series, b: _Series, by: str, near: float | None = None) -> Offset | None:
    """The offset of b against a with the highest score, atanh(r) sqrt(overlap).

    near: only about this offset [s].
    """
    correlation, overlap = _masked(a.values, b.values)
    lags = np.arange(len(correlation)) - (len(b.values) - 1)  # of b in a, in cells
    between = (a.start - b.start) * 1e-9
    seconds = between + lags / RATE
    shorter = min(np.isfinite(a.values).sum(), np.isfinite(b.values).sum()) / RATE
    possible = overlap / RATE >= max(MIN_OVERLAP, MIN_SHARE * shorter)
    if near is not None:
        possible &= np.abs(seconds - near) <= FINE
    if not possible.any():
        return None
    score = np.where(
        possible, np.arctanh(np.clip(correlation, -0.999, 0.999)) * np.sqrt(overlap), -np.inf
    )
    best = int(np.argmax(score))
    elsewhere = np.abs(lags - lags[best]) > APART * RATE
    second = float(score[elsewhere].max()) if elsewhere.any() else -np.inf
    r = float(correlation[best])
    shift, curvature = 0.0, 0.0
    if 0 < best < len(score) - 1:
        left, middle, right = correlation[best - 1 : best + 2]
        curvature = float(2 * middle - left - right) * RATE**2
        if curvature > 0 and possible[best - 1] and possible[best + 1]:
            shift = float(right - left) / 2 / (2 * middle - left - right)
    independent = float(overlap[best]) / RATE / DECORRELATION
    # the peak's curvature is the information on the lag: sd^2 = (1 - r^2) / (n r'')
    sd = np.sqrt(max(1 - r**2, 0.0) / (independent * curvature)) if curvature > 0 else np.inf
    sure = r >= MIN_CORRELATION and second <= MARGIN * float(score[best])
    if near is not None:
        sure = (
            r >= MIN_CORRELATION
            and 0 < best < len(score) - 1
            and bool(possible[best - 1 : best + 2].all())
        )
    return Offset(float(seconds[best] + shift / RATE), float(sd), r, by, sure)


def _masked(a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Correlation coefficient and number of common samples at every lag of b in a."""
    size = len(a) + len(b) - 1
    fast = next_fast_len(size, real=True)
    known_a, known_b = np.isfinite(a), np.isfinite(b)
    values_a = np.where(known_a, a - np.nanmean(a), 0.0)
    values_b = np.where(known_b, b - np.nanmean(b), 0.0)

    def product(left: Floats | Bools, right: Floats | Bools) -> Floats:
        spectrum = rfft(left, fast) * rfft(right[::-1], fast)
        result: Floats = irfft(spectrum, fast)[:size]
        return result

    count = np.rint(product(known_a, known_b))
    n = np.maximum(count, 1.0)
    sum_a, sum_b = product(values_a, known_b), product(known_a, values_b)
    spread_a = product(values_a**2, known_b) - sum_a**2 / n
    spread_b = product(known_a, values_b**2) - sum_b**2 / n
    together = product(values_a, values_b) - sum_a * sum_b / n
    floor = 1e-6 * max(float(np.nanvar(a) * len(a)), float(np.nanvar(b) * len(b)), 1e-12)
    usable = (spread_a > floor) & (spread_b > floor)
    scale = np.sqrt(np.where(usable, spread_a * spread_b, 1.0))
    return np.where(usable, np.clip(together / scale, -1, 1), 0.0), count
