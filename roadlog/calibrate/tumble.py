"""Zeros and scales of accelerometer and gyro from a log of an IMU that rests in many positions.

Source: docs/calibration.md#many-positions, the reference that Kim 2023's accelerometer rests on.
At rest the specific force has the size of gravity, whichever way the IMU lies; between two rests
the gyro must turn gravity from one direction to the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from roadlog.calibrate.constant import Constant, unknown
from roadlog.calibrate.mounting import triad
from roadlog.drive import Drive, runs
from roadlog.estimators.kim2023.strapdown import to_navigation, turn
from roadlog.signals import AXES
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

LEAST_REST = 1.0  # s
EDGE = 0.2  # s, at both ends of a rest that do not count: the hand lets go
WINDOW = 0.5  # s, in which a resting IMU's signals spread no more than their noise
QUIET = 3.0  # times the smallest spread that is found in the log
STILL_RATE = np.radians(2.0)  # rad/s, besides the gyro's zero
APART = np.radians(20.0)  # between two positions
LEAST = 6  # positions: as many as there are unknowns
GRAVITY_SD = 0.015  # m/s2, local gravity between the equator and the poles
STEPS = 5  # of Gauss and Newton
MAX_ZERO, MAX_SCALE = 0.3, 0.005  # m/s2, share: known worse than this, it is not known
KINDS = ("accel_zero", "accel_scale", "gyro_zero", "gyro_scale")
UNITS = {"accel_zero": "m/s2", "accel_scale": "-", "gyro_zero": "rad/s", "gyro_scale": "-"}


@dataclass(frozen=True)
class Rest:
    """One position: its samples, mean specific force and rate (3,), and standard errors of both."""

    span: slice
    force: Floats
    rate: Floats
    force_sd: float
    rate_sd: float


def rests(drive: Drive) -> list[Rest]:
    """Where the IMU lies still for a second and more; none where the car drives."""
    force, rate = triad(drive, "accel"), triad(drive, "gyro")
    if drive.has_speed and not drive.standstill[np.isfinite(drive.speed)].all():
        return []
    count = max(2, round(WINDOW * drive.rate))
    quiet = np.ones(len(drive), np.bool_)
    for signal in (force, rate):
        spread = _moving_sd(signal, count)
        quiet &= spread < QUIET * max(float(np.percentile(spread, 5)), 1e-9)
    if not quiet.any():
        return []
    zero = np.median(rate[quiet], axis=0)
    quiet &= _mean(np.linalg.norm(rate - zero, axis=1), count) < STILL_RATE
    edge = round(EDGE * drive.rate)
    found = []
    for run in runs(quiet):
        span = slice(run.start + edge, run.stop - edge)
        n = span.stop - span.start
        if n * drive.dt >= LEAST_REST:
            means = force[span].mean(axis=0), rate[span].mean(axis=0)
            sds = (float(np.sqrt(part[span].var(axis=0).mean() / n)) for part in (force, rate))
            found.append(Rest(span, *means, *sds))
    return found


def positions(found: list[Rest]) -> int:
    """How many different ones."""
    kept: list[Floats] = []
    for rest in found:
        up = rest.force / np.linalg.norm(rest.force)
        if all(up @ other < np.cos(APART) for other in kept):
            kept.append(up)
    return len(kept)


def is_tumble(drive: Drive) -> bool:
    """Whether a log is of an IMU in many positions, and of no drive."""
    roles = [f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in AXES]
    return all(role in drive for role in roles) and positions(rests(drive)) >= LEAST


def tumble(drive: Drive) -> list[Constant]:
    """Zero and scale of each axis of both sensors, in the axes in which the log holds them."""
    found = rests(drive)
    zero, scale, sds, miss = _accelerometer(found)
    evidence = (
        f"{positions(found)} positions, {len(found)} rests; gravity missed by {miss:.4f} m/s2"
    )
    constants = _of("accel_zero", zero, sds[:3], evidence, MAX_ZERO)
    constants += _of("accel_scale", scale, sds[3:], evidence, MAX_SCALE)
    weights = np.array([1 / r.rate_sd**2 for r in found])
    rates = np.array([r.rate for r in found])
    gyro_zero = np.average(rates, axis=0, weights=weights)
    spread = np.sqrt(np.average((rates - gyro_zero) ** 2, axis=0, weights=weights))
    gyro_sd = np.maximum(spread, found[0].rate_sd) / np.sqrt(len(found))
    constants += _of("gyro_zero", gyro_zero, gyro_sd, f"{len(found)} rests", np.inf)
    up = [_unit(scale * (r.force - zero)) for r in found]
    turning = _gyro_scale(drive, found, up, float(np.max(sds[:3])) / G, gyro_zero)
    if turning is None:
        reason = "needs turns by a quarter and more about every axis"
        return constants + [unknown(f"gyro_scale_{axis}", "-", reason) for axis in AXES]
    return constants + _of("gyro_scale", *turning, "turns between the rests", MAX_SCALE)


def _of(kind: str, values: Floats, sds: Floats, evidence: str, worst: float) -> list[Constant]:
    return [
        Constant(f"{kind}_{axis}", UNITS[kind], float(value), float(sd), evidence)
        if sd < worst
        else unknown(f"{kind}_{axis}", UNITS[kind], "needs positions with this axis up and down")
        for axis, value, sd in zip(AXES, values, sds, strict=True)
    ]


def _accelerometer(found: list[Rest]) -> tuple[Floats, Floats, Floats, float]:
    """Zero and scale so that |scale (f - zero)| = g; sds (6,); what is left, m/s2 RMS."""
    force = np.array([rest.force for rest in found])
    x = np.concatenate([np.zeros(3), np.ones(3)])
    for _ in range(STEPS):
        true = x[3:] * (force - x[:3])
        size = np.linalg.norm(true, axis=1)
        unit = true / size[:, None]
        J = np.hstack([-unit * x[3:], unit * (force - x[:3])])
        x = x + np.linalg.lstsq(J, G - size, rcond=None)[0]
    left = G - np.linalg.norm(x[3:] * (force - x[:3]), axis=1)
    free = max(len(force) - 6, 1)
    noise = max(float(left @ left) / free, max(rest.force_sd for rest in found) ** 2)
    told = np.linalg.matrix_rank(J) == len(x)
    variance = noise * np.diag(np.linalg.inv(J.T @ J)) if told else np.full(len(x), np.inf)
    variance[3:] += (GRAVITY_SD / G) ** 2
    return x[:3], x[3:], np.sqrt(variance), float(np.sqrt(np.mean(left**2)))


def _gyro_scale(
    drive: Drive, found: list[Rest], up: list[Floats], up_sd: float, zero: Floats
) -> tuple[Floats, Floats] | None:
    """Scale of each axis and its standard error; None where the turns do not show all three.

    up: unit vectors at the rests, up_sd: rad, by which the accelerometer's zero leaves them open.
    """
    rate = triad(drive, "gyro") - zero
    known = np.isfinite(drive["imu.gyro_x"])
    pairs = [
        (rate[a.span.stop : b.span.start], up[k], up[k + 1])
        for k, (a, b) in enumerate(pairwise(found))
        if known[a.span.stop : b.span.start].all() and up[k] @ up[k + 1] < np.cos(APART)
    ]
    if len(pairs) < 2:
        return None

    def missed(scale: Floats) -> Floats:
        return np.concatenate([_turned(scale * w, drive.dt, a) - b for w, a, b in pairs])

    scale, step = np.ones(3), 1e-4
    for _ in range(STEPS):
        left = missed(scale)
        J = np.stack([(missed(scale + step * e) - left) / step for e in np.eye(3)], axis=1)
        if np.linalg.cond(J) > 1e3:
            return None
        scale = scale - np.linalg.lstsq(J, left, rcond=None)[0]
    left = missed(scale)
    free = max(len(left) - len(pairs) - 3, 1)  # a direction has two components
    noise = float(left @ left) / free + 2 * up_sd**2  # both ends of a turn
    variance = noise * np.diag(np.linalg.inv(J.T @ J))
    return scale, np.sqrt(variance)


def _turned(rate: Floats, dt: float, up: Floats) -> Floats:
    """Where up points in an IMU's axes after it turned at these rates, rad/s (n, 3)."""
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for w in rate:
        q = turn(q, w[0], w[1], w[2], dt)
    back = np.array([q[0], -q[1], -q[2], -q[3]])
    return np.array(to_navigation(back, up[0], up[1], up[2]))


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)


def _mean(values: Floats, count: int) -> Floats:
    from scipy.ndimage import uniform_filter1d

    found: Floats = uniform_filter1d(values, count, axis=0, mode="nearest")
    return found


def _moving_sd(signal: Floats, count: int) -> Floats:
    """(n,) of a signal (n, 3): the largest of its axes."""
    centered = signal - signal.mean(axis=0)
    variance = _mean(centered**2, count) - _mean(centered, count) ** 2
    spread: Floats = np.sqrt(np.maximum(variance, 0.0)).max(axis=1)
    return spread
