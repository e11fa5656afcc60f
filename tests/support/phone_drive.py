"""A drive as a phone, a receiver or a camera in the car sees it: exact signals at any times."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from roadlog.units import STANDARD_GRAVITY as G

START = datetime(2026, 3, 1, 9, 0, 0, tzinfo=UTC)
EPOCH = START.timestamp()
LATITUDE, LONGITUDE, HEIGHT = 47.0, 11.0, 600.0  # a made-up place
RADIUS = 6_378_137.0  # m
FLAT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # x right, y forward, z up
STEP = 0.02  # s, of the path


@dataclass(frozen=True)
class PhoneDrive:
    """Pulls away after 10 s, then hills and bends; `stop` brings it to a stop at the end.

    Angles in rad, ISO 8855 axes.
    """

    duration: float = 120.0
    stop: bool = False

    def ease(self, t: np.ndarray) -> np.ndarray:
        u = np.clip((t - 10) / 12, 0, 1)
        rising = u**3 * (10 - 15 * u + 6 * u * u)
        if self.stop:
            u = np.clip((self.duration - 10 - t) / 12, 0, 1)
            rising = rising * u**3 * (10 - 15 * u + 6 * u * u)
        return rising

    def speed(self, t: np.ndarray) -> np.ndarray:
        wave = 5 * np.sin(2 * np.pi * t / 47) + 2 * np.sin(2 * np.pi * t / 19)
        return self.ease(t) * (15 + wave)

    def grade(self, t: np.ndarray) -> np.ndarray:
        return self.ease(t) * 0.06 * np.sin(2 * np.pi * t / 90)

    def yaw_rate(self, t: np.ndarray) -> np.ndarray:
        return self.ease(t) * 0.12 * np.sin(2 * np.pi * t / 31)

    def imu(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Specific force in m/s2 and rate in rad/s, (n, 3), vehicle axes."""
        v, g, r = self.speed(t), self.grade(t), self.yaw_rate(t)
        dv, dg = ((f(t + 1e-3) - f(t - 1e-3)) / 2e-3 for f in (self.speed, self.grade))
        force = np.stack([dv + G * np.sin(g), v * r * np.cos(g), G * np.cos(g) + v * dg], -1)
        rate = np.stack([r * np.sin(g), -dg, r * np.cos(g)], -1)
        return force, rate

    def fixes(self, t: np.ndarray) -> dict[str, np.ndarray]:
        """latitude, longitude in deg, altitude in m, course in deg from north, speed, climb."""
        grid = np.arange(-STEP, self.duration + 1, STEP)
        v, g = self.speed(grid), self.grade(grid)
        yaw = np.radians(40) + np.cumsum(self.yaw_rate(grid + STEP / 2)) * STEP
        east, north, up = (
            np.cumsum(x) * STEP
            for x in (v * np.cos(g) * np.cos(yaw), v * np.cos(g) * np.sin(yaw), v * np.sin(g))
        )
        cosine = np.cos(np.radians(LATITUDE))
        return {
            "latitude": LATITUDE + np.degrees(np.interp(t, grid, north) / RADIUS),
            "longitude": LONGITUDE + np.degrees(np.interp(t, grid, east) / RADIUS / cosine),
            "altitude": HEIGHT + np.interp(t, grid, up),
            "course": (90 - np.degrees(np.interp(t, grid, yaw))) % 360,
            "speed": self.speed(t),
            "climb": self.speed(t) * np.sin(self.grade(t)),
        }

    def phone(self, t: np.ndarray, lies: np.ndarray = FLAT) -> tuple[np.ndarray, np.ndarray]:
        """What a phone shows: `lies` turns vehicle axes to the phone's (flat, top forward)."""
        force, rate = self.imu(t)
        return force @ lies.T, rate @ lies.T
