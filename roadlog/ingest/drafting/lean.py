"""A sensor that leans: its mounting beyond right angles, by gravity and by the way the car gathers
speed.

A phone in a holder leans by up to 45 deg. Its axes are turned level first, by the smallest rotation
that brings the mean specific force onto the nearest axis; then right angles are told apart as of
any sensor; then what is left in yaw is the angle between the level specific force and what speed
and turns say that it is. Good to the mean grade and to a degree of yaw; `roadlog calibrate` finds
the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.motion.axes import Verdict, judge
from roadlog.motion.evidence import Evidence
from roadlog.types import Floats

LEANS = np.radians(5.0)  # from which a right angle is no mounting
FOLLOWS = 0.5  # correlation from which the specific force tells the yaw


@dataclass(frozen=True)
class Mounting:
    """The verdict on the level sensor's axes, and the matrix of it all where it leans.

    matrix: vehicle = matrix @ sensor; None where right angles say it.
    """

    verdict: Verdict
    matrix: Floats | None

    @property
    def toml(self) -> str:
        """The matrix as a profile says it."""
        rows = [] if self.matrix is None else np.round(self.matrix, 4).tolist()
        return f"{{ matrix = {rows}, drafted = true }}"


def mounting(evidence: Evidence) -> Mounting | None:
    """How an inertial sensor lies in the car; None where there is none."""
    level = _level(evidence)
    if level is None or np.arccos(np.clip((np.trace(level) - 1) / 2, -1, 1)) < LEANS:
        verdict = judge(evidence)
        return None if verdict is None else Mounting(verdict, None)
    turned = _turned(evidence, level)
    verdict = judge(turned)
    if verdict is None:
        return None
    right = np.eye(3) if verdict.best is None else np.array(verdict.best.mount, np.float64)
    sign = -1.0 if verdict.best and verdict.best.reversed == ("imu.accel",) else 1.0
    yaw = _yaw(_turned(turned, right), sign)
    about = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return Mounting(verdict, about @ right @ level)


def _level(evidence: Evidence) -> Floats | None:
    """The smallest rotation that brings the mean specific force onto the nearest axis."""
    accel = evidence.triad("accel")
    if accel is None or np.isnan(accel).all(axis=1).any():
        return None
    mean = np.nanmedian(accel, axis=1)
    size = float(np.linalg.norm(mean))
    if size == 0:
        return None
    k = int(np.argmax(np.abs(mean)))
    axis = np.zeros(3)
    axis[k] = np.sign(mean[k])
    cross = np.cross(mean / size, axis)
    skew = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1 + abs(mean[k]) / size))


def _turned(evidence: Evidence, rotation: Floats) -> Evidence:
    """The evidence with both triads turned."""
    signals = dict(evidence.signals)
    for kind in ("accel", "gyro"):
        triad = evidence.triad(kind)
        if triad is not None:
            rows = rotation @ triad
            signals |= {f"imu.{kind}_{a}": row for a, row in zip("xyz", rows, strict=True)}
    return Evidence(evidence.rate, signals)


def _yaw(evidence: Evidence, sign: float) -> float:
    """rad, from the x axis to the way the car goes; 0 where that does not show.

    The level specific force is that of the slope of the speed ahead and of speed times yaw rate to
    the left, turned by this angle: as complex numbers, the argument of their product.
    """
    speed = next(iter(evidence.speeds().values()), None)
    accel, gyro = evidence.triad("accel"), evidence.triad("gyro")
    if speed is None or accel is None:
        return 0.0
    slope = evidence.band(evidence.slope(speed))
    turn = np.zeros(len(slope)) if gyro is None else evidence.band(speed * gyro[2])
    ahead, aside = (sign * evidence.band(row) for row in accel[:2])
    known = np.isfinite(slope) & np.isfinite(turn) & np.isfinite(ahead) & np.isfinite(aside)
    shown, meant = (ahead + 1j * aside)[known], (slope + 1j * turn)[known]
    sizes = float(np.linalg.norm(shown) * np.linalg.norm(meant))
    together = complex(np.vdot(meant, shown))
    return float(np.angle(together)) if abs(together) > FOLLOWS * sizes > 0 else 0.0
