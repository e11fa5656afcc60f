"""How far one recording's clock lies from another's, to a fraction of a sample, with an honest sd.

A speed, or an acceleration integrated to one, is compared with another at the stamps of the slower
of the two: nothing is put on a grid first, both go through the same differences, and so neither
rate nor filter moves the answer. The equation solved is that of an instrument, the slower signal's
own central difference (Reiersol 1945): white noise in either signal has no part in its mean. The
sd is that of the sums of its terms over blocks, which holds whatever the errors' spectrum is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.filters.lowpass import gaussian_mean
from roadlog.types import Bools, Floats

SPAN = 0.8  # s over which differences are taken: engine and road shake a sensor, not the speed
SLOW = 8.0  # s, sd of the kernel whose mean is taken off: gravity on a grade, biases
HOLE = 3.0  # s between samples, or HOLE_INTERVALS of them; across a longer one nothing is known
HOLE_INTERVALS = 2.5
CELL = 0.1  # s; faster samples are taken together
BLOCKS = (8.0, 16.0, 32.0)  # s; sums over these lengths are taken for independent, the worst counts
MIN_BLOCKS = 4
ROUNDS = 50  # of the spline's equations; each halves what is left of the error
NORMAL = 1.96  # sd, 97.5 % point of the normal distribution
MAX_COMPARED = (
    3600.0  # s of the recordings that are compared: an hour tells a clock to a millisecond
)
NEAR = 2.0  # s about the first answer, where the equation may have its root
STEPS = 20  # of Newton's method
CONVERGED = 1e-5  # s


@dataclass(frozen=True)
class SpeedTrack:
    """A speed over time, up to a constant in each run: its times in s, ascending, and m/s."""

    time: Floats
    value: Floats

    @classmethod
    def of_speed(cls, time: Floats, speed: Floats) -> SpeedTrack:
        """Of the known samples of a speed."""
        known = np.isfinite(speed)
        return cls(*_once(time[known], speed[known]))

    @classmethod
    def of_acceleration(cls, time: Floats, accel: Floats) -> SpeedTrack:
        """Of the known samples of an acceleration, by the trapezoidal rule."""
        known = np.isfinite(accel)
        time, accel = _once(time[known], accel[known])
        steps = 0.5 * (accel[1:] + accel[:-1]) * np.diff(time)
        return cls(time, np.concatenate([[0.0], np.cumsum(steps)])[: len(time)])

    @property
    def interval(self) -> float:
        """s, median step of the samples."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else np.inf

    @property
    def hole(self) -> float:
        """s, step from which nothing is known between two samples."""
        return max(HOLE, HOLE_INTERVALS * self.interval)

    def between(self, start: float, end: float) -> SpeedTrack:
        """The part in [start, end]."""
        part = slice(*np.searchsorted(self.time, (start, end)))
        return SpeedTrack(self.time[part], self.value[part])


@dataclass(frozen=True)
class Shift:
    """What to add to the stamps of one track to have them on the clock of another [s], its sd,
    and the interval [s] of the slower of the two."""

    seconds: float
    sd: float
    interval: float


def shift(reference: SpeedTrack, other: SpeedTrack, near: float) -> Shift | None:
    """The shift of `other` that makes the two agree, within NEAR of a first answer [s].

    None where they share too little, or where the equation has no root there.
    """
    start = max(reference.time[0], other.time[0] + near) if len(other.time) else 0.0
    reference = reference.between(start - NEAR, start + MAX_COMPARED)
    other = other.between(start - near - NEAR, start - near + MAX_COMPARED)
    if min(len(reference.time), len(other.time)) < 4:
        return None
    if other.interval >= reference.interval:
        return _Equation(reference, other).root(near)
    found = _Equation(other, reference).root(-near)
    return None if found is None else Shift(-found.seconds, found.sd, found.interval)


@dataclass(frozen=True)
class Spline:
    """The natural cubic spline through a track; `bend`: its second derivative at the samples."""

    time: Floats
    value: Floats
    bend: Floats

    @classmethod
    def through(cls, track: SpeedTrack) -> Spline:
        """Of all samples."""
        step = np.diff(track.time)
        rate = np.diff(track.value) / step
        both = step[:-1] + step[1:]
        before = step[:-1] / both
        wanted = 6 * np.diff(rate) / both
        bend = np.zeros(len(track.time))
        for _ in range(ROUNDS):
            bend[1:-1] = 0.5 * (wanted - before * bend[:-2] - (1 - before) * bend[2:])
        return cls(track.time, track.value, bend)

    def __call__(self, at: Floats, place: NDArray) -> Floats:
        """At times between the samples `place` and the ones after."""
        step = self.time[place + 1] - self.time[place]
        u = (at - self.time[place]) / step
        w = 1 - u
        bent = (w**3 - w) * self.bend[place] + (u**3 - u) * self.bend[place + 1]
        return w * self.value[place] + u * self.value[place + 1] + bent * step**2 / 6


class _Equation:
    """sum of z (slow(t) - a fast(t + x)) = 0 over differences at the slow track's stamps.

    Stamps denser than CELL are taken together, as means of both signals over the same stamps.
    """

    def __init__(self, fast: SpeedTrack, slow: SpeedTrack) -> None:
        self.size = max(1, round(CELL / slow.interval))
        self.stamps = slow.time[: len(slow.time) // self.size * self.size]
        self.interval = slow.interval
        self.step = slow.interval * self.size
        self.lag = max(1, round(SPAN / self.step))
        self.time = self._means(self.stamps)
        self.run = _runs(slow)[self.size - 1 :: self.size]
        self.spline = Spline.through(fast)
        self.fast, self.run_of_fast = fast.time, _runs(fast)
        self.own = self._differences(self._means(slow.value[: len(self.stamps)]), self.run)
        self.instrument = self._turn(self.own)

    def root(self, near: float) -> Shift | None:
        """By Newton's method from a first answer."""
        x = near
        for _ in range(STEPS):
            terms = self._terms(x)
            if terms is None:
                return None
            score, gain, sums = terms
            step = score / gain if gain else np.inf
            x += float(np.clip(step, -0.5, 0.5))
            if abs(x - near) > NEAR:
                return None
            if abs(step) < CONVERGED:
                break
        spread = max((_spread(part) for part in sums if len(part) >= MIN_BLOCKS), default=np.inf)
        return Shift(x, spread / abs(gain), self.interval) if np.isfinite(spread) else None

    def _terms(self, x: float) -> tuple[float, float, list[Floats]] | None:
        """The sum, its derivative for x, and its parts by blocks of time; None for too few."""
        at = self.stamps + x
        place = np.clip(np.searchsorted(self.fast, at, side="right") - 1, 0, len(self.fast) - 2)
        inside = (at >= self.fast[0]) & (at <= self.fast[-1])
        inside &= self.run_of_fast[place] == self.run_of_fast[place + 1]
        value = np.where(inside, self.spline(at, place), np.nan)
        run = np.where(self._means(inside) == 1, self.run_of_fast[place][:: self.size], -1)
        model = self._differences(self._means(value), run)
        moved = self._turn(model)
        used = np.isfinite(model) & np.isfinite(self.own)
        counts = used & np.isfinite(self.instrument) & np.isfinite(moved)
        if counts.sum() * self.step < MIN_BLOCKS * BLOCKS[0]:
            return None
        own, model = (self._banded(np.where(used, v, np.nan)) for v in (self.own, model))
        scale = float(own[used] @ model[used]) / max(float(model[used] @ model[used]), 1e-12)
        z = self.instrument[counts]
        score = z * (own - scale * model)[counts]
        time = self.time[: len(counts)][counts]
        sums = [_sums(time, score, length) for length in BLOCKS]
        return float(score.sum()), scale * float(z @ moved[counts]), sums

    def _means(self, values: Floats | Bools) -> Floats:
        means: Floats = values[: len(self.stamps)].reshape(-1, self.size).mean(axis=1)
        return means

    def _differences(self, values: Floats, run: NDArray) -> Floats:
        found = values[self.lag :] - values[: -self.lag]
        return np.where(run[self.lag :] == run[: -self.lag], found, np.nan)

    def _turn(self, values: Floats) -> Floats:
        """Rate of change by central differences: its noise is not that of the value between."""
        turn = np.full(len(values), np.nan)
        turn[self.lag : -self.lag] = values[2 * self.lag :] - values[: -2 * self.lag]
        return turn / (2 * self.lag * self.step)

    def _banded(self, values: Floats) -> Floats:
        """Without what is slower than SLOW."""
        slow, _ = gaussian_mean(values, SLOW / self.step)
        return np.where(np.isfinite(values), values - slow, 0.0)


def _sums(time: Floats, score: Floats, length: float) -> Floats:
    """By blocks of time, those that are empty left out."""
    _, block = np.unique(((time - time[0]) / length).astype(np.int64), return_inverse=True)
    return np.bincount(block, score).astype(np.float64)


def _spread(sums: Floats) -> float:
    """sd of the total of independent sums of mean zero, wider where these are few."""
    count = len(sums)
    variance = float((sums**2).sum()) * count / (count - 1)
    return float(np.sqrt(variance)) * _student(count - 1) / NORMAL


def _student(freedom: int) -> float:
    """97.5 % point of Student's t, to 0.1 % (Abramowitz and Stegun 1964, 26.7.5)."""
    z = NORMAL
    terms = (
        z,
        (z**3 + z) / 4,
        (5 * z**5 + 16 * z**3 + 3 * z) / 96,
        (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384,
        (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160,
    )
    return sum(term / freedom**k for k, term in enumerate(terms))


def _runs(track: SpeedTrack) -> NDArray:
    """The number of the run without a hole that each sample belongs to."""
    return np.concatenate([[0], np.cumsum(np.diff(track.time) > track.hole)])


def _once(time: Floats, values: Floats) -> tuple[Floats, Floats]:
    """In order of time, the first of those with one stamp."""
    time, first = np.unique(time, return_index=True)
    return time, values[first]
