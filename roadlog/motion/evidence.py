"""What a drive says about itself: pairs of signals that physics ties together.

Every pair is compared in a band around 0.1 Hz, where a car's maneuvers are: above it lie vibration
and quantization, below it sensor biases and the slope of the road. Correlations carry signs and
axes, ratios of size carry units, the lag of the best correlation carries clocks.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from roadlog.drive import Drive, nan_mean
from roadlog.filters.correlate import correlate
from roadlog.filters.lowpass import gaussian_mean
from roadlog.geo import TransverseMercator
from roadlog.once import once
from roadlog.signals import AXES, WHEELS
from roadlog.types import Floats

EVIDENCE_RATE = 10.0  # Hz, of the comparison
FAST, SLOW = 0.5, 4.0  # s, sd of the two Gaussian windows whose difference is the band
MIN_WEIGHT = 0.5  # share of a window that must be known
MAX_LAG = 20.0  # s, searched between two clocks
NEAR_LAG = 1.0  # s, of sensors and filters: searched first
AS_GOOD = 0.9  # of the best correlation: of peaks as good, the one nearest to no lag counts
TRACK_WIDTH = 1.0  # s, sd of the smoothing of positions before they are differentiated
MIN_OVERLAP = 20.0  # s that two signals must share at a lag
LAG_BLOCK = 60.0  # s, of a lag estimate of its own
COURSE_SPEED = 3.0  # m/s; below it a course means nothing
SIGNIFICANT = 4.0  # sd of Fisher's z


@dataclass(frozen=True)
class Lag:
    """How far `late` lies behind another signal: lag and its sd in s, at correlation r.

    ratio: size of the other signal over the size of `late`, both in the band.
    """

    lag: float
    sd: float
    r: float
    ratio: float


@dataclass(frozen=True)
class Evidence:
    """A drive's signals at 10 Hz, and what the checks compare of them."""

    rate: float
    signals: Mapping[str, Floats]

    @staticmethod
    def of(drive: Drive) -> Evidence:
        """Block means of every signal of a drive."""
        return _evidence(drive)

    def triad(self, kind: str) -> Floats | None:
        """Three rows of accelerations or rates; None unless all axes are there."""
        roles = [f"imu.{kind}_{axis}" for axis in AXES]
        if not all(role in self for role in roles):
            return None
        return np.stack([self[role] for role in roles])

    @staticmethod
    def block(values: Floats, rate: float) -> Floats:
        """One more signal of `rate` Hz, as `of` does it."""
        return _block_mean(values, max(1, round(rate / EVIDENCE_RATE)))

    def __contains__(self, role: str) -> bool:
        return role in self.signals

    def __getitem__(self, role: str) -> Floats:
        return self.signals[role]

    def band(self, values: Floats) -> Floats:
        """What varies with the car's maneuvers; NaN where too little is known."""
        return self.smooth(values, FAST) - self.smooth(values, SLOW)

    def smooth(self, values: Floats, width: float) -> Floats:
        """Gaussian mean (sd `width` in s) of what is known; NaN where too little is."""
        mean, weight = gaussian_mean(values, width * self.rate, truncate=3.0)
        return np.where(np.isfinite(values) & (weight >= MIN_WEIGHT), mean, np.nan)

    def slope(self, values: Floats) -> Floats:
        """Rate of change per second."""
        return np.gradient(values) * self.rate if len(values) > 1 else np.full(len(values), np.nan)

    @cached_property
    def track(self) -> tuple[Floats, Floats] | None:
        """Speed in m/s and course rate in rad/s from the positions of the fixes."""
        if "gnss.latitude" not in self or "gnss.longitude" not in self:
            return None
        latitude, longitude = self["gnss.latitude"], self["gnss.longitude"]
        known = np.flatnonzero(np.isfinite(longitude))
        first = float(longitude[known[0]]) if len(known) else 0.0
        plane = TransverseMercator(float(np.nanmean(latitude)), first)
        east, north = plane.forward(latitude, longitude)
        v_north, v_east = (self.slope(self.smooth(x, TRACK_WIDTH)) for x in (north, east))
        speed = np.hypot(v_north, v_east)
        course = np.where(speed > COURSE_SPEED, np.arctan2(v_north, v_east), np.nan)
        return speed, course

    def speeds(self) -> dict[str, Floats]:
        """Every source of speed: `wheel_speeds` (mean), `speed.v`, `gnss.speed`."""
        wheels = [self[f"wheel_speeds.{w}"] for w in WHEELS if f"wheel_speeds.{w}" in self]
        found = {"wheel_speeds": nan_mean(np.stack(wheels))} if wheels else {}
        return found | {role: self[role] for role in ("speed.v", "gnss.speed") if role in self}

    @cached_property
    def course_rate(self) -> Floats | None:
        """rad/s, of the track; NaN where the car hardly moves. None without positions."""
        if self.track is None:
            return None
        course = self.track[1].copy()
        known = np.isfinite(course)
        course[known] = np.unwrap(course[known])
        return self.slope(course)

    def lag(self, other: Floats, late: Floats, reach: float = MAX_LAG) -> Lag | None:
        """Lag of `late` behind `other` within `reach` s, both in the band already.

        None where they share too little.
        """
        lags, r = _correlations(other, late, self.rate, reach)
        if not len(lags) or not np.isfinite(r).any():
            return None
        peak = _nearest_peak(lags, np.abs(r))
        if peak is None:
            return None
        sign = np.sign(r[peak])
        found = _refined(lags, sign * r, peak)
        shift = round(float(lags[peak]) * self.rate)
        x, y = shifted(other, late, shift)
        both = np.isfinite(x) & np.isfinite(y)
        ratio = float(np.std(x[both]) / np.std(y[both])) if np.std(y[both]) > 0 else np.nan
        own = [
            found for _, found, r_own in self.block_lags(other, late, LAG_BLOCK) if r_own * sign > 0
        ]
        spread = 1.4826 * float(np.median(np.abs(np.array(own) - np.median(own)))) if own else 0.0
        sd = spread / np.sqrt(len(own)) if len(own) > 2 else np.nan
        return Lag(found, float(sd), float(r[peak]), ratio)

    def block_lags(
        self, other: Floats, late: Floats, width: float
    ) -> list[tuple[float, float, float]]:
        """(middle, lag, correlation) of each block of `width` s that has enough in it."""
        size = round(width * self.rate)
        result = []
        for start in range(0, len(other) - size // 2, size):
            part = slice(start, start + size)
            lags, r = _correlations(other[part], late[part], self.rate, MAX_LAG)
            if len(lags) and np.isfinite(r).any():
                peak = int(np.nanargmax(np.abs(r)))
                found = _refined(lags, np.abs(r), peak)
                result.append(((start + size / 2) / self.rate, found, float(r[peak])))
        return result


def unexplained(late: Floats, by: Floats, shift: int) -> float:
    """Share of the variance of late(t + shift) that no sum of the rows of `by` (m, n) explains."""
    y, columns = shifted(late, by.T, -shift)
    known = np.isfinite(y) & np.isfinite(columns).all(axis=1)
    left = y[known] - columns[known] @ np.linalg.lstsq(columns[known], y[known], rcond=None)[0]
    return float((left @ left) / (y[known] @ y[known]))


def correlation(x: Floats, y: Floats, rate: float) -> tuple[float, float]:
    """Correlation (0 where it is not significant) and size of y over size of x.

    Significance by Fisher's z with as many independent samples as the band lets through: one
    each 2 FAST seconds.
    """
    known = np.isfinite(x) & np.isfinite(y)
    count = known.sum() / rate / (2 * FAST)
    if count < 10:
        return 0.0, np.nan
    x, y = x[known], y[known]
    sx, sy = float(np.std(x)), float(np.std(y))
    if sx <= 0 or sy <= 0:
        return 0.0, np.nan
    r = float(np.mean((x - x.mean()) * (y - y.mean())) / (sx * sy))
    z = np.arctanh(np.clip(r, -0.999999, 0.999999)) * np.sqrt(count - 3)
    return (r if abs(z) > SIGNIFICANT else 0.0), sy / sx


def _nearest_peak(lags: Floats, size: Floats) -> int | None:
    """Of the peaks that are as good as the best, the one nearest to no lag (periodic motion)."""
    sides = np.where(np.isfinite(size), size, -1.0)
    inner = np.flatnonzero((sides[1:-1] >= sides[:-2]) & (sides[1:-1] >= sides[2:])) + 1
    good = inner[sides[inner] >= AS_GOOD * np.nanmax(size)]
    return int(good[np.argmin(np.abs(lags[good]))]) if len(good) else None


def _correlations(x: Floats, y: Floats, rate: float, reach_s: float) -> tuple[Floats, Floats]:
    """Lags of y behind x in s and the correlation of x(t) with y(t + lag); none of no samples."""
    if not len(x):
        return np.empty(0), np.empty(0)
    mx, my = (np.isfinite(values).astype(np.float64) for values in (x, y))
    x0, y0 = np.where(mx > 0, x, 0.0), np.where(my > 0, y, 0.0)
    reach = min(round(reach_s * rate), len(x) - 1)
    middle = len(x) - 1
    window = slice(middle - reach, middle + reach + 1)

    def sums(a: Floats, b: Floats) -> Floats:
        return correlate(b, a)[window]

    shared = sums(mx, my)
    with np.errstate(invalid="ignore", divide="ignore"):
        r = sums(x0, y0) / np.sqrt(sums(x0**2, my) * sums(mx, y0**2))
    r[(shared < MIN_OVERLAP * rate) | ~np.isfinite(r)] = np.nan
    return np.arange(-reach, reach + 1) / rate, np.clip(r, -1, 1)


def _refined(lags: Floats, r: Floats, peak: int) -> float:
    """Vertex of the parabola through a peak and its neighbors."""
    if not 0 < peak < len(r) - 1 or not np.isfinite(r[peak - 1 : peak + 2]).all():
        return float(lags[peak])
    left, top, right = r[peak - 1 : peak + 2]
    curvature = left - 2 * top + right
    step = 0.5 * (left - right) / curvature if curvature < 0 else 0.0
    return float(lags[peak] + step * (lags[1] - lags[0]))


def shifted(x: Floats, y: Floats, shift: int) -> tuple[Floats, Floats]:
    """x(t) beside y(t + shift)."""
    if shift >= 0:
        return x[: len(x) - shift], y[shift:]
    return x[-shift:], y[: len(y) + shift]


@once
def _evidence(drive: Drive) -> Evidence:
    size = max(1, round(drive.rate / EVIDENCE_RATE))
    means = {role: _block_mean(x, size) for role, x in drive.signals.items()}
    return Evidence(drive.rate / size, means)


def _block_mean(values: Floats, size: int) -> Floats:
    count = len(values) // size
    return nan_mean(values[: count * size].reshape(count, size).T)
