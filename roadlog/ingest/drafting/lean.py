"""A sensor that leans: its mounting beyond right angles, by gravity and by the way the car gathers
speed.

A phone in a holder leans by up to 45 deg. Its axes are turned level first, by the smallest rotation
that brings the mean specific force onto the nearest axis; then right angles are told apart as of
any sensor; then what is left in yaw is the angle between the level specific force and what speed
and turns say that it is. Good to the mean grade and to a degree of yaw; `roadlog calibrate` finds
the rest. On a drive that goes mostly up or down a sensor that lies right looks as if it leaned: the
mean slope by the altitudes, or a steep one where there are none, is not taken for a lean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.motion.axes import Verdict, judge
from roadlog.motion.evidence import Evidence
from roadlog.types import Floats

LEANS = np.radians(5.0)  # beside the mean slope, from which a right angle is no mounting
STEEP = np.radians(4.0)  # mean slope of a drive without altitudes that may still be a hill
WAY = 500.0  # m, over which altitudes tell the mean slope
ALTITUDE_WIDTH = 4.0  # s, sd of their smoothing
FOLLOWS = 0.5  # correlation from which the specific force tells the yaw


@dataclass(frozen=True)
class Lean:
    """The verdict on the level sensor's axes, and the matrix of it all where it leans.

    matrix: vehicle = matrix @ sensor; None where right angles say it. lean: rad, of the mean
    specific force off the nearest axis.
    """

    verdict: Verdict
    matrix: Floats | None
    lean: float

    @property
    def toml(self) -> str:
        """The matrix as a profile says it."""
        rows = [] if self.matrix is None else np.round(self.matrix, 4).tolist()
        return f"{{ matrix = {rows}, drafted = true }}"


def mounting(evidence: Evidence) -> Lean | None:
    """How an inertial sensor lies in the car; None where there is none."""
    level = _level(evidence)
    lean = 0.0 if level is None else float(np.arccos(np.clip((np.trace(level) - 1) / 2, -1, 1)))
    if level is None or lean < LEANS + _mean_slope(evidence):
        verdict = judge(evidence)
        return None if verdict is None else Lean(verdict, None, lean)
    turned = _turned(evidence, level)
    verdict = judge(turned)
    if verdict is None:
        return None
    right = np.eye(3) if verdict.best is None else np.array(verdict.best.mount, np.float64)
    sign = -1.0 if verdict.best and verdict.best.reversed == ("imu.accel",) else 1.0
    yaw = _yaw(_turned(turned, right), sign)
    about = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    return Lean(verdict, about @ right @ level, lean)


def _mean_slope(evidence: Evidence) -> float:
    """rad, up or down, by the altitudes; STEEP where they do not tell."""
    speed = next(iter(evidence.speeds().values()), None)
    if speed is None or "gnss.altitude" not in evidence:
        return STEEP
    altitude = evidence.smooth(evidence["gnss.altitude"], ALTITUDE_WIDTH)
    known = np.flatnonzero(np.isfinite(altitude))
    way = float(np.nansum(speed[known[0] : known[-1]])) / evidence.rate if len(known) else 0.0
    if way < WAY:
        return STEEP
    return float(np.arctan(abs(altitude[known[-1]] - altitude[known[0]]) / way))


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
