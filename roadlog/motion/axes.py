"""Which way the axes of an inertial sensor point, and which sign is wrong: by what the drive shows.

Every explanation (a mounting by right angles, an accelerometer of the opposite sign as on iOS, one
reversed signal) is scored by how well the pairs of `_Pairs` then agree, less a price for what it
assumes. The simplest one that explains the drive wins; a right log explains itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import numpy as np

from roadlog.motion.evidence import Evidence, correlation
from roadlog.signals import AXES
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

PRICE = 0.3  # of correlation, for each assumption
MIN_GAIN = 0.3  # of correlation that an explanation must win beyond its price
TIE = 0.1  # explanations closer than this are told apart by nothing in the log
UPRIGHT = 0.8  # cosine: within 37 deg of the axis, mountings by right angles are told apart


@dataclass(frozen=True)
class Explanation:
    """mount: rows of the rotation by right angles, vehicle = mount @ sensor. reversed: roles with
    the wrong sign after it (`imu.accel` = all three, as on iOS). exchanged: two roles whose columns
    are each other's. score: sum of correlations less the price."""

    mount: tuple[tuple[int, int, int], ...]
    reversed: tuple[str, ...] = ()
    exchanged: tuple[str, ...] = ()
    score: float = 0.0

    @property
    def turned(self) -> bool:
        """Whether the sensor's axes are not the vehicle's."""
        return self.mount != STRAIGHT

    @property
    def is_plain(self) -> bool:
        """Whether the log is right as it is."""
        return not (self.turned or self.reversed or self.exchanged)

    def toml(self) -> str:
        """The mount as a profile says it."""
        names = [_axis_name(row) for row in self.mount]
        return f'{{ forward = "{names[0]}", left = "{names[1]}" }}'


STRAIGHT = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Verdict:
    """mean (3,): m/s2, median specific force of the sensor's axes, where all are known. best: None
    where the log explains itself. rivals: other explanations that nothing in the log tells from
    the best one."""

    mean: Floats | None
    best: Explanation | None
    rivals: tuple[Explanation, ...] = ()


def judge(evidence: Evidence) -> Verdict | None:
    """Which explanation of the axes wins; None where there is no inertial sensor."""
    if not any(role.startswith("imu.") for role in evidence.signals):
        return None
    accel = evidence.triad("accel")
    mean: Floats | None = None
    if accel is not None and np.isfinite(accel).any(axis=1).all():
        mean = np.nanmedian(accel, axis=1)
    best, *others = ranked = explain(evidence, mean)
    plain = next(e for e in ranked if e.is_plain)
    if best is plain or best.score - plain.score < MIN_GAIN:
        return Verdict(mean, None)
    return Verdict(mean, best, tuple(e for e in others if best.score - e.score < TIE))


def explain(evidence: Evidence, mean: Floats | None) -> list[Explanation]:
    """Explanations, best first; those within TIE of the best one are as good.

    mean: mean specific force of the sensor's axes in m/s2, where all three are known.
    """
    pairs = _Pairs(evidence, mean)
    scored = []
    for candidate in _candidates(evidence, mean):
        assumed = len(candidate.reversed) + candidate.turned + bool(candidate.exchanged)
        scored.append(replace(candidate, score=pairs.score(candidate) - PRICE * assumed))
    return sorted(scored, key=lambda e: -e.score)


def _candidates(evidence: Evidence, mean: Floats | None) -> Iterator[Explanation]:
    single = [f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in AXES]
    single += ["steering.road_wheel_angle"]
    for role in ["", *(role for role in single if role in evidence)]:
        yield Explanation(STRAIGHT, (role,) if role else ())
    for kind, (a, b) in product(("accel", "gyro"), combinations(AXES, 2)):
        both = f"imu.{kind}_{a}", f"imu.{kind}_{b}"
        if all(role in evidence for role in both):
            yield Explanation(STRAIGHT, exchanged=both)
    if mean is None:
        return
    for mount in _rotations():
        up = float(np.dot(mount[2], mean)) / float(np.linalg.norm(mean))
        if mount != STRAIGHT and up > UPRIGHT:
            yield Explanation(mount)
        if up < -UPRIGHT:
            yield Explanation(mount, ("imu.accel",))


def _rotations() -> Iterator[tuple[tuple[int, int, int], ...]]:
    for order in permutations(range(3)):
        for signs in product((1, -1), repeat=3):
            matrix = np.zeros((3, 3), np.int64)
            matrix[range(3), order] = signs
            if round(float(np.linalg.det(matrix))) == 1:
                yield tuple((int(a), int(b), int(c)) for a, b, c in matrix)


class _Pairs:
    """Pairs of signals that agree in a right log, for any choice of axes and signs."""

    def __init__(self, evidence: Evidence, mean: Floats | None) -> None:
        e = evidence
        self.rate = e.rate
        self.mean = mean
        sources = e.speeds()
        speed = next(iter(sources.values())) if sources else np.full(_size(e), np.nan)
        missing = np.full(_size(e), np.nan)
        accel = [e.signals.get(f"imu.accel_{axis}", missing) for axis in AXES]
        gyro = [e.signals.get(f"imu.gyro_{axis}", missing) for axis in AXES]
        self.accel = np.stack([e.band(a) for a in accel])
        self.gyro = np.stack([e.band(g) for g in gyro])
        self.turn = np.stack([e.band(speed * g) for g in gyro])
        self.accel_slope = np.stack([e.band(e.slope(a)) for a in accel]) / G
        self.turn_slope = np.stack([e.band(e.slope(speed * g)) for g in gyro]) / G
        dv = e.slope(speed)
        self.dv, self.ddv = e.band(dv), e.band(e.slope(dv)) / G
        self.forward = self._direction(self.accel, self.dv)
        self.yaw = {name: self._direction(self.gyro, t) for name, t in yaw_rates(e, speed).items()}
        self.known: dict[tuple, float] = {}

    def score(self, candidate: Explanation) -> float:
        """Sum of the correlations of all pairs."""
        mount = np.array(candidate.mount, np.float64)
        a, g = mount.copy(), mount.copy()
        if candidate.exchanged:
            rows = [AXES.index(role[-1]) for role in candidate.exchanged]
            triad = a if "accel" in candidate.exchanged[0] else g
            triad[rows] = triad[rows[::-1]]
        for role in candidate.reversed:
            if role == "imu.accel":
                a = -a
            elif role.startswith("imu."):
                row = AXES.index(role[-1])
                (a if "accel" in role else g)[row] *= -1
        total = float(a[0] @ self.forward)
        if self.mean is not None:
            total += float(a[2] @ self.mean) / float(np.linalg.norm(self.mean))
        for name, direction in self.yaw.items():
            turned = -1.0 if name in candidate.reversed else 1.0
            total += turned * float(g[2] @ direction)
        return total + self._lateral(a, g) + self._pitch(a, g) + self._roll(a, g)

    def _lateral(self, a: Floats, g: Floats) -> float:
        return self._cached("lateral", (a[1], g[2]), a[1] @ self.accel, g[2] @ self.turn)

    def _pitch(self, a: Floats, g: Floats) -> float:
        climb = a[0] @ self.accel_slope - self.ddv
        return self._cached("pitch", (a[0], g[1]), -g[1] @ self.gyro, climb)

    def _roll(self, a: Floats, g: Floats) -> float:
        lean = a[1] @ self.accel_slope - g[2] @ self.turn_slope
        return self._cached("roll", (a[1], g[0], g[2]), g[0] @ self.gyro, lean)

    def _cached(self, name: str, rows: tuple[Floats, ...], x: Floats, y: Floats) -> float:
        key = (name, *(tuple(row) for row in rows))
        if key not in self.known:
            self.known[key] = correlation(x, y, self.rate)[0]
        return self.known[key]

    def _direction(self, triad: Floats, target: Floats) -> Floats:
        """Which sensor axis goes with a target: unit vector times the best correlation."""
        found = [correlation(target, row, self.rate) for row in triad]
        r = np.array([pair[0] for pair in found])
        share = np.array([p[0] * p[1] if p[0] else 0.0 for p in found])
        length = float(np.linalg.norm(share))
        return share / length * np.abs(r).max() if length > 0 else np.zeros(3)


def yaw_rates(e: Evidence, speed: Floats) -> dict[str, Floats]:
    """Yaw rate in the band, up to a scale, by everything but the gyro."""
    found = {}
    if e.course_rate is not None:
        found["course"] = e.band(e.course_rate)
    if all(f"wheel_speeds.{w}" in e for w in ("rl", "rr")):
        found["wheels"] = e.band(e["wheel_speeds.rr"] - e["wheel_speeds.rl"])
    if "steering.road_wheel_angle" in e:
        found["steering.road_wheel_angle"] = e.band(speed * e["steering.road_wheel_angle"])
    return found


def _size(e: Evidence) -> int:
    return len(next(iter(e.signals.values())))


def _axis_name(row: tuple[int, int, int]) -> str:
    k = int(np.argmax(np.abs(row)))
    return ("+" if row[k] > 0 else "-") + AXES[k]
