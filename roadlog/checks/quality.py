"""What an inertial sensor is worth: vibrating, coarse, clipped, drifting.

By the samples as they were taken. None of these faults can be put right; the standard deviations
of the estimators grow with most of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from roadlog.checks.finding import Finding
from roadlog.checks.values import speed_at
from roadlog.drive import runs, stale_limit
from roadlog.signals import AXES, IMU_TOPIC
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

SLOWEST = 0.25  # s between samples
LOW_RATE = 15.0  # Hz; wheels and engine mounts shake a body at 8 to 15 Hz and above
GAP, GAPS = 0.2, 0.05  # s without samples that no estimator bridges; share of the log
VIBRATION = 2.0  # m/s2 from sample to sample; the roughest of the public drives has 0.7
COARSE = {"accel": 0.15, "gyro": float(np.radians(0.4))}  # m/s2, rad/s: 0.9 deg of grade
CLIPPED = 0.005  # share of samples at one end
PILE = 4.0  # times as many as at the value beside it: what a limit does, and no coarse sensor
FEW = 30  # distinct values, below which none is told
NOT_GRAVITY = 0.1  # share by which a standing accelerometer's size may differ from g
STOP = 3.0  # s that the car stands
STANDING = 0.05  # m/s
SETTLING = 1.0  # s at either end of a stop that a body rocks
DRIFTED = {"accel": 0.12, "gyro": float(np.radians(0.12))}  # m/s2, rad/s from stop to stop
SURE = 5.0  # standard errors of a stop's mean
QUIET = {"accel": 0.5, "gyro": float(np.radians(2.0))}  # sd; somebody moves the sensor beyond it


def inertial(tables: Mapping[str, Table]) -> list[Finding]:
    """Findings on the accelerometers and gyros of a log, all in SI units, stamps in order."""
    table = tables.get(IMU_TOPIC)
    if table is None or len(table) < 10:
        return []
    found = list(_slow(table))
    for kind in ("accel", "gyro"):
        known = {
            f"imu.{kind}_{axis}": values[np.isfinite(values)]
            for axis in AXES
            if (values := np.asarray(table.columns.get(f"{kind}_{axis}", []), np.float64)).size
        }
        known = {role: values for role, values in known.items() if len(values) >= 10}
        found += [*_coarse(kind, known), *_clipped(known)]
        if kind == "accel":
            found += _vibrating(known)
    return found + list(_drift(tables, table))


def _fault(check: str, roles: list[str], text: str, advice: str, value: float) -> Finding:
    return Finding(check, "fault", tuple(roles), text, advice, None, value)


def _slow(table: Table) -> Iterator[Finding]:
    steps = np.diff(table.time) * 1e-9
    usual = float(np.median(steps))
    if usual > SLOWEST:
        yield _fault(
            "slow",
            ["imu"],
            f"comes every {usual:.2g} s only",
            "a car rocks and turns faster: log the inertial sensor at 10 Hz or more",
            1 / usual,
        )
        return
    if usual > 1 / LOW_RATE:
        yield Finding(
            "low_rate",
            "note",
            ("imu",),
            f"comes at {1 / usual:.3g} Hz: what shakes the car faster folds into it as noise",
            "log it at 50 Hz or more, or let the logger average before it leaves samples out",
            value=1 / usual,
        )
    lost = steps[steps > max(stale_limit(np.multiply(table.time, 1e-9)), GAP)]
    share = float(lost.sum() / max(steps.sum(), 1e-9))
    if share > GAPS:
        yield _fault(
            "gaps",
            ["imu"],
            f"is missing for {100 * share:.0f} % of the time, in {len(lost)} pieces",
            "the logger or its bus loses messages: angles are unknown there",
            share,
        )


def _vibrating(known: Mapping[str, Floats]) -> Iterator[Finding]:
    """White noise of this size between neighbors: second differences, by their median."""
    sizes = {
        role: float(np.median(np.abs(np.diff(x, 2)))) / 0.6745 / np.sqrt(6)
        for role, x in known.items()
    }
    roles = [role for role, size in sizes.items() if size > VIBRATION]
    if roles:
        size = max(sizes.values())
        yield _fault(
            "vibration",
            roles,
            f"vibrate by {size:.1f} m/s2 from sample to sample",
            "a loose mount, or an engine whose vibration is faster than the samples: fasten the "
            "sensor, or log it faster behind a low-pass",
            size,
        )


def _coarse(kind: str, known: Mapping[str, Floats]) -> Iterator[Finding]:
    steps = {role: _step(x) for role, x in known.items()}
    roles = [role for role, step in steps.items() if step > COARSE[kind]]
    if roles:
        step = max(steps.values())
        size = f"{step:.2g} m/s2" if kind == "accel" else f"{np.degrees(step):.2g} deg/s"
        yield _fault(
            "coarse",
            roles,
            f"change by steps of {size}",
            "the sensor's range is too large for a car, or its bits too few: log it finer",
            step,
        )


def _clipped(known: Mapping[str, Floats]) -> Iterator[Finding]:
    for role, x in known.items():
        values, counts = np.unique(x, return_counts=True)
        if len(values) < FEW:
            continue
        for end, beside in ((0, 1), (-1, -2)):
            share = float(counts[end] / len(x))
            if share > CLIPPED and counts[end] > PILE * counts[beside]:
                yield _fault(
                    "clipped",
                    [role],
                    f"stops at {values[end]:.4g} in {100 * share:.1f} % of the samples",
                    "it is clipped: choose a larger range",
                    share,
                )


def _drift(tables: Mapping[str, Table], table: Table) -> Iterator[Finding]:
    """Whether the standing sensor reads otherwise at one stop than at another.

    Gyros by axis; of the accelerometers only their size together, which no slope changes.
    """
    stops = list(_stops(tables, table))
    if len(stops) < 2:
        return
    for kind in ("gyro", "accel"):
        names = [f"{kind}_{axis}" for axis in AXES]
        if not all(name in table.columns for name in names):
            continue
        x = np.stack([np.asarray(table.columns[name], np.float64) for name in names])
        parts = [x[:, rows] for rows in stops if np.isfinite(x[:, rows]).any(axis=1).all()]
        quiet = [part for part in parts if (np.nanstd(part, axis=1) < QUIET[kind]).all()]
        if len(quiet) < 2:
            continue
        means = np.array([np.nanmean(part, axis=1) for part in quiet])
        if kind == "accel":
            means = np.linalg.norm(means, axis=1)[:, None]
            if abs(float(np.mean(means)) / G - 1) > NOT_GRAVITY:
                continue  # another unit, or no gravity in it: said elsewhere
        change = np.ptp(means, axis=0)
        least = np.maximum(DRIFTED[kind], _by_chance(x, quiet))
        if kind == "accel":
            least = least.max(keepdims=True)
        roles = [f"imu.{name}" for name in names]
        if kind == "gyro":
            roles = [r for r, c, most in zip(roles, change, least, strict=True) if c > most]
        size = float(np.nanmax(change))
        if (change > least).any():
            by = f"{size:.2f} m/s2" if kind == "accel" else f"{np.degrees(size):.2f} deg/s"
            yield _fault(
                "drift",
                roles,
                f"read otherwise by {by} from one stop to another",
                "its bias wanders, by its temperature for one: let it warm up before the drive",
                size,
            )


def _by_chance(x: Floats, stops: list[Floats]) -> Floats:
    """(3,), by which the mean of x (3, n) over two stops differs at most without any drift."""
    white = np.array([np.nanstd(part, axis=1) / np.sqrt(part.shape[1]) for part in stops])
    most: Floats = SURE * np.sqrt(2) * white.max(axis=0)
    return most + [_step(values[np.isfinite(values)]) for values in x]


def _step(x: Floats) -> float:
    """The usual difference between neighboring values of x; 0 where there are too few."""
    values = np.unique(x)
    return float(np.median(np.diff(values))) if len(values) > 2 else 0.0


def _stops(tables: Mapping[str, Table], table: Table) -> Iterator[slice]:
    """Rows of the IMU in which the car stands for long."""
    shown = speed_at(tables, table.time)
    if shown is None or not (shown > STANDING).any():
        return
    for run in runs(shown <= STANDING):
        seconds = (table.time[run] - table.time[run.start]) * 1e-9
        inside = np.flatnonzero((seconds > SETTLING) & (seconds < seconds[-1] - SETTLING))
        if seconds[-1] > STOP and len(inside) > 3:
            yield slice(run.start + inside[0], run.start + inside[-1] + 1)
