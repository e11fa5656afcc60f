"""Profiles over time or distance: what a scenario's speed, grade, bank and curvature are made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.errors import ConfigError
from roadlog.types import Floats

Window = Literal["boxcar", "hann", "cosine"]


def smooth(values: Floats, step: float, width: float, window: Window = "boxcar") -> Floats:
    """Weighted moving average of uniform samples; ends are held. width in units of `step`'s."""
    half = round(width / step / 2)
    if half < 1:
        return values
    inside = np.arange(-half, half + 1) / (half + 0.5)
    weights = {
        "boxcar": np.ones(len(inside)),
        "hann": 1 + np.cos(np.pi * inside),
        "cosine": np.cos(np.pi / 2 * inside),
    }[window]
    padded = np.pad(values, half, mode="edge")
    if window == "boxcar":  # a running sum is exact enough and far cheaper for long windows
        total = np.concatenate([[0.0], np.cumsum(padded - padded[0])])
        return padded[0] + (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    from scipy.signal import oaconvolve

    result: Floats = oaconvolve(padded, weights / weights.sum(), mode="valid")
    return result


@dataclass(frozen=True)
class Knots:
    """Straight lines between points, then one moving average after the other.

    points: (abscissa, value), abscissa ascending, s or m; held outside. smoothing: widths of the
    averages in the abscissa's unit. over: what the abscissa is; time counts along the reference
    speed where a road is meant.
    """

    points: tuple[tuple[float, float], ...]
    smoothing: tuple[float, ...] = ()
    window: Window = "boxcar"
    over: Literal["distance", "time"] = "distance"

    def __post_init__(self) -> None:
        abscissa = [point[0] for point in self.points]
        if not self.points or any(b < a for a, b in zip(abscissa, abscissa[1:], strict=False)):
            raise ConfigError(f"points {self.points}: need at least one, abscissa ascending")

    def sample(self, x: Floats, rng: np.random.Generator | None = None) -> Floats:
        """Values at uniform abscissas."""
        del rng  # nothing here is drawn by chance
        knots = np.array(self.points)
        values: Floats = np.interp(x, knots[:, 0], knots[:, 1])
        for width in self.smoothing:
            values = smooth(values, x[1] - x[0], width, self.window)
        return values


@dataclass(frozen=True)
class Sine:
    """mean + amplitude sin(2 pi x / period); period in s or m."""

    mean: float
    amplitude: float
    period: float
    over: Literal["distance", "time"] = "distance"

    def sample(self, x: Floats, rng: np.random.Generator | None = None) -> Floats:
        """Values at abscissas."""
        del rng
        return self.mean + self.amplitude * np.sin(2 * np.pi * x / self.period)


@dataclass(frozen=True)
class Hills:
    """White noise over distance smoothed by a Gaussian: a slope that nobody planned.

    sd: of the slope, -. length: standard deviation of the Gaussian, m. Another seed, another road.
    """

    sd: float
    length: float
    over: Literal["distance", "time"] = "distance"

    def sample(self, x: Floats, rng: np.random.Generator | None = None) -> Floats:
        """Values at uniform abscissas, drawn from `rng` on a grid of its own."""
        from scipy.ndimage import gaussian_filter1d

        if rng is None:
            raise ConfigError("hills need a seed")
        step = self.length / 10
        count = int((x[-1] - x[0]) / step) + 100  # more than the kernel's reach at both ends
        white = rng.standard_normal(count)
        # variance of white noise behind a Gaussian of sigma samples: 1 / (2 sqrt(pi) sigma)
        gain = self.sd * np.sqrt(2 * np.sqrt(np.pi) * self.length / step)
        grid = x[0] + step * (np.arange(count) - 50)
        slope = gain * gaussian_filter1d(white, self.length / step)
        from scipy.interpolate import CubicSpline

        values: Floats = CubicSpline(grid, slope)(x)
        return values


Profile = Knots | Sine | Hills


def sampled(profile: Profile | float, x: Floats, rng: np.random.Generator | None = None) -> Floats:
    """Values of a profile; a number is constant."""
    if isinstance(profile, (int, float)):
        return np.full(len(x), float(profile))
    return profile.sample(x, rng)


def accelerations(
    start: float,
    pieces: Iterable[tuple[float, float, float]],
    smoothing: tuple[float, ...] = (),
    window: Window = "boxcar",
    base: float = 0.0,
    end: float = 0.0,
) -> Knots:
    """Speed over time from pieces (t0, t1, acceleration) on top of `base`, until `end`.

    start: m/s. Smoothing the speed smooths the acceleration in the same way.
    """
    points = [(0.0, start)]
    for t0, t1, acceleration in pieces:
        for t, a in ((t0, base), (t1, base + acceleration)):
            last, speed = points[-1]
            points.append((t, speed + a * (t - last)))
    last, speed = points[-1]
    if end > last:
        points.append((end, speed + base * (end - last)))
    return Knots(tuple(points), smoothing, window, "time")


@dataclass(frozen=True)
class StopAndGo:
    """A drive through a town: start, cruise with a slow oscillation, brake, wait, again.

    Ranges are (least, most) of uniform draws; another seed, another drive. Defaults: Kim chapter,
    section 3.11.
    """

    stops: int = 14
    acceleration: tuple[float, float] = (1.2, 2.5)  # m/s2
    braking: tuple[float, float] = (1.2, 2.8)  # m/s2
    cruise: tuple[float, float] = (9.0, 16.0)  # m/s
    cruise_time: tuple[float, float] = (20.0, 60.0)  # s
    wait: tuple[float, float] = (8.0, 30.0)  # s
    oscillation: float = 0.05  # amplitude over the cruising speed
    oscillation_period: float = 15.0  # s
    smoothing: tuple[float, ...] = (0.5, 0.25)  # s, of the acceleration

    def knots(self, rng: np.random.Generator) -> Knots:
        """Speed over time; ends at rest."""
        points = [(0.0, 0.0)]

        def go(duration: float, speed: float) -> None:
            points.append((points[-1][0] + duration, speed))

        for _ in range(self.stops):
            cruise = rng.uniform(*self.cruise)
            go(rng.uniform(*self.wait), 0.0)
            go(cruise / rng.uniform(*self.acceleration), cruise)
            duration = rng.uniform(*self.cruise_time)
            for x in np.linspace(0.0, 1.0, 25)[1:]:
                waves = x * np.round(duration / self.oscillation_period)
                factor = 1 + self.oscillation * np.sin(2 * np.pi * waves)
                go(duration / 24, float(cruise * factor))
            go(cruise / rng.uniform(*self.braking), 0.0)
        go(rng.uniform(*self.wait), 0.0)
        return Knots(tuple(points), self.smoothing, over="time")


@dataclass(frozen=True)
class Launches:
    """Motions from rest to rest, one after the other: stand, accelerate, brake, stand.

    Steps in acceleration; Kim chapter, section 3.11 (`kim2023-mc`).
    """

    acceleration: float = 2.0  # m/s2
    motions: int = 50
    duration: float = 3.0  # s, of each acceleration and of each braking
    wait: float = 3.0  # s, before and after each motion
    smoothing: tuple[float, ...] = ()

    def knots(self, rng: np.random.Generator) -> Knots:
        """Speed over time."""
        del rng
        period = 2 * (self.wait + self.duration)
        top = self.acceleration * self.duration
        points = []
        for k in range(self.motions):
            start = k * period + self.wait
            points += [(start, 0.0), (start + self.duration, top)]
            points += [(start + 2 * self.duration, 0.0)]
        points.append((self.motions * period, 0.0))
        return Knots(tuple(points), self.smoothing, over="time")
