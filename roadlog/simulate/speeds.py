"""Speeds over time: pieces of acceleration, drives through a town, tours that suit their road."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from roadlog.simulate.profiles import Knots, Profile, Window, sampled
from roadlog.types import Floats

TOUR_STEP = 0.5  # m


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

    Ranges are (least, most) of uniform draws; another seed, another drive. Defaults:
    docs/methods/kim2023.md#scenarios.
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

    Steps in acceleration; docs/methods/kim2023.md#scenarios (`kim2023-mc`).
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


@dataclass(frozen=True)
class Tour:
    """A drive that suits its road: limits on speed and acceleration, stops at places.

    length: m that are driven, from rest to rest. lateral: m/s2 in bends. stops: (m, s) place on the
    road and wait there.
    """

    length: float
    cruise: Profile | float = 14.0  # m/s, over distance
    lateral: float = 2.5  # m/s2
    acceleration: float = 1.8  # m/s2
    braking: float = 2.0  # m/s2
    stops: tuple[tuple[float, float], ...] = ()
    wait: float = 5.0  # s, at the beginning and at the end
    smoothing: tuple[float, ...] = (1.0,)  # s

    def over(self, curvature: Profile | float, start: float) -> Knots:
        """Speed over time on a road of that curvature, from `start` m along it."""
        s: Floats = start + np.multiply(np.arange(round(self.length / TOUR_STEP) + 1), TOUR_STEP)
        bend = np.abs(sampled(curvature, s))
        limit = np.minimum(sampled(self.cruise, s), np.sqrt(self.lateral / np.maximum(bend, 1e-6)))
        stops = {len(s) - 1: self.wait}
        for place, wait in self.stops:
            stops[int(np.argmin(np.abs(s - place)))] = wait
        square = limit**2
        square[[0, *stops]] = 0.0
        for k in range(1, len(s)):
            square[k] = min(square[k], square[k - 1] + 2 * self.acceleration * TOUR_STEP)
        for k in range(len(s) - 2, -1, -1):
            square[k] = min(square[k], square[k + 1] + 2 * self.braking * TOUR_STEP)
        speed: Floats = np.sqrt(square)
        points, t = [(0.0, 0.0), (self.wait, 0.0)], self.wait
        for k in range(1, len(s)):
            t += 2 * TOUR_STEP / (speed[k - 1] + speed[k])
            points.append((float(t), float(speed[k])))
            if k in stops:
                t += stops[k]
                points.append((float(t), 0.0))
        return Knots(tuple(points), self.smoothing, over="time")
