"""The simulated satellite receiver, and the barometer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.geo import TransverseMercator
from roadlog.simulate.motion import Motion
from roadlog.simulate.sampling import (
    Columns,
    at,
    clock,
    gauss_markov,
    stream,
    without_errors,
    wrapped,
)


@dataclass(frozen=True)
class GnssReceiver:
    """Satellite receiver with two antennas; messages carry the epoch's time."""

    rate: float = 10.0  # Hz, 0 = none
    position: tuple[float, float, float] = (-0.2, 0.0, 0.85)  # m from the reference point
    horizontal_noise: float = 0.5  # m, Gauss-Markov
    vertical_noise: float = 1.0  # m, Gauss-Markov
    wander_time: float = 60.0  # s, of both
    speed_noise: float = 0.03  # m/s, each horizontal axis
    climb_noise: float = 0.045  # m/s
    two_antennas: bool = True
    heading_noise: float = float(np.radians(0.15))  # rad
    roll_noise: float = float(np.radians(0.20))  # rad
    latency: float = 0.0  # s by which the stamps are late: a receiver that stamps on arrival

    def ideal(self) -> GnssReceiver:
        """The same channel without any error, at the reference point."""
        zero = "horizontal_noise vertical_noise speed_noise climb_noise heading_noise roll_noise"
        return without_errors(self, zero, position=(0.0, 0.0, 0.0), latency=0.0)

    def measure(self, motion: Motion, seed: int) -> Columns:
        """Section gnss; nothing when the motion has no place on earth."""
        if not self.rate or motion.attitude is None:
            return {}
        assert motion.position is not None
        assert motion.velocity is not None
        rng = stream(seed, "gnss")
        time = clock(motion, self.rate)
        time = time[time - self.latency >= motion.time[0] - 1e-9]
        epoch = time - self.latency
        near = np.clip(np.searchsorted(motion.time, epoch - 1e-9), 0, len(motion.time) - 1)
        attitude, arm = motion.attitude[near], motion.arm(self.position)
        place = motion.position[near] + attitude @ arm
        turning = np.cross(motion.rate[near], arm)
        velocity = motion.velocity[near] + np.einsum("nij,nj->ni", attitude, turning)
        n = len(time)
        wander = gauss_markov(rng, n, 3, self.wander_time * self.rate)
        place = place + wander * [self.horizontal_noise, self.horizontal_noise, self.vertical_noise]
        white = rng.standard_normal((n, 5))
        velocity = velocity + white[:, :3] * [self.speed_noise, self.speed_noise, self.climb_noise]
        unknown = np.full(n, np.nan)
        two = self.two_antennas
        heading = (
            np.arctan2(attitude[:, 1, 0], attitude[:, 0, 0]) + self.heading_noise * white[:, 3]
        )
        roll = np.arcsin(attitude[:, 2, 1]) + self.roll_noise * white[:, 4]
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        plane = TransverseMercator(*motion.home[:2])
        latitude, longitude = plane.inverse(place[:, 0], place[:, 1])
        fields = {
            "latitude": latitude,
            "longitude": longitude,
            "altitude": motion.home[2] + place[:, 2],
            "speed": speed,
            "course": np.arctan2(velocity[:, 1], velocity[:, 0]),
            "climb": velocity[:, 2],
            "heading": wrapped(heading) if two else unknown,
            "roll": roll if two else unknown,
            "horizontal_accuracy": np.full(n, self.horizontal_noise),
            "vertical_accuracy": np.full(n, self.vertical_noise),
            "speed_accuracy": np.full(n, self.speed_noise),
            "course_accuracy": np.minimum(self.speed_noise / np.maximum(speed, 1e-3), np.pi),
            "climb_accuracy": np.full(n, self.climb_noise),
            "heading_accuracy": np.full(n, self.heading_noise) if two else unknown,
            "roll_accuracy": np.full(n, self.roll_noise) if two else unknown,
        }
        return {"gnss": (time, fields)}


@dataclass(frozen=True)
class Barometer:
    """Altitude from air pressure: smooth, with an unknown and wandering zero."""

    rate: float = 0.0  # Hz, 0 = none
    offset: float = 35.0  # m
    noise: float = 0.15  # m sd of a sample
    drift_sd: float = 1.0  # m, Gauss-Markov
    drift_time: float = 300.0  # s

    def ideal(self) -> Barometer:
        """The same channel without any error."""
        return without_errors(self, "offset noise drift_sd")

    def measure(self, motion: Motion, seed: int) -> Columns:
        """Section barometer; nothing when the motion has no place on earth."""
        if not self.rate or motion.position is None:
            return {}
        rng = stream(seed, "barometer")
        time = clock(motion, self.rate)
        height = at(motion, motion.position[:, 2], time) + motion.home[2] + self.offset
        height = (
            height
            + self.drift_sd * gauss_markov(rng, len(time), 1, self.drift_time * self.rate).ravel()
        )
        noise = self.noise * rng.standard_normal(len(time))
        return {"barometer": (time, {"altitude": height + noise})}
