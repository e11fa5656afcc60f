"""What is in a log, whether it makes sense, and which estimators can run: `roadlog info`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive, stale_limit
from roadlog.errors import LogReadError
from roadlog.log import DriveLog
from roadlog.signals import SECTIONS, SIGNALS
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

# Plausibility limits: what an ordinary car on an ordinary road does not exceed.
MAX_TILT = 20.0  # deg, mean specific force against the z axis
GRAVITY_TOLERANCE = 0.5  # m/s2, mean size of the specific force against g
MAX_SPEED = 70.0  # m/s
MAX_RATE = 3.0  # rad/s, median of the largest gyro rates


@dataclass(frozen=True)
class ChannelSummary:
    """One channel: rate in Hz, longest gap in s, jitter = sd of the intervals in s."""

    topic: str
    schema: str
    messages: int
    rate: float | None
    jitter: float | None
    gaps: int
    longest_gap: float | None
    not_monotonic: int


@dataclass(frozen=True)
class SignalSummary:
    """One signal: its role and unit, share of NaN, smallest, mean and largest value."""

    role: str
    unit: str
    nan_share: float
    minimum: float | None
    mean: float | None
    maximum: float | None


@dataclass(frozen=True)
class LogSummary:
    """Everything that `roadlog info` says."""

    log: str
    duration: float
    channels: list[ChannelSummary]
    signals: list[SignalSummary]
    warnings: list[str]
    can_run: list[str]
    cannot_run: dict[str, str]


def summarize(log: DriveLog) -> LogSummary:
    """Look through a whole log. Raises LogReadError when the file cannot be read."""
    from roadlog import estimators

    tables = log.tables()
    drive: Drive | None = None
    try:
        drive = log.drive()
        warnings = implausible(drive)
    except LogReadError as error:
        warnings = [str(error)]
    can_run, cannot_run = [], {}
    for estimator in estimators.all_estimators():
        missing = estimator.missing(drive) if drive is not None else list(estimator.needs)
        if missing:
            cannot_run[estimator.name] = f"no {', no '.join(missing)}"
        else:
            can_run.append(estimator.name)
    span = 0 if log.start_ns is None or log.end_ns is None else log.end_ns - log.start_ns
    return LogSummary(
        str(log.path),
        span * 1e-9,
        [_channel(table) for table in tables.values()],
        _signals(tables),
        warnings,
        can_run,
        cannot_run,
    )


def implausible(drive: Drive) -> list[str]:
    """Sentences on units, axes and signs that cannot be, each with what to do."""
    found = []
    if all(f"imu.accel_{axis}" in drive for axis in "xyz"):
        found += _gravity(np.array([np.nanmean(drive[f"imu.accel_{axis}"]) for axis in "xyz"]))
    if drive.has_speed:
        top = float(np.nanmax(np.abs(drive.speed)))
        if top > MAX_SPEED:
            found.append(f"speed reaches {top:.0f} m/s: is its unit km/h? Say so in the profile")
    for axis in "xyz":
        role = f"imu.gyro_{axis}"
        if role in drive and np.nanpercentile(np.abs(drive[role]), 95) > MAX_RATE:
            found.append(f"{role} exceeds {MAX_RATE} rad/s often: is its unit deg/s?")
    return found


def _gravity(mean: Floats) -> list[str]:
    size = float(np.linalg.norm(mean))
    if abs(size - 1.0) < 0.1:
        return ["accelerations are about 1 at rest: their unit is g, say so in the profile"]
    if abs(size - G) > GRAVITY_TOLERANCE:
        return [f"mean specific force is {size:.2f} m/s2 instead of 9.81: check unit and scale"]
    tilt = float(np.degrees(np.arccos(np.clip(mean[2] / size, -1, 1))))
    if tilt > 180 - MAX_TILT:
        return ["gravity reads -9.81 on z: turn all accelerometer signs in the profile"]
    if tilt > MAX_TILT:
        axis = "xyz"[int(np.argmax(np.abs(mean)))]
        return [
            f"gravity is {tilt:.0f} deg off z, mostly on {axis}: give the profile a [imu] mount"
        ]
    return []


def _channel(table: Table) -> ChannelSummary:
    steps = np.diff(table.time) * 1e-9
    if len(steps) == 0 or not (steps > 0).any():
        return ChannelSummary(table.topic, table.schema, len(table), None, None, 0, None, 0)
    ordered = np.sort(table.time - table.time.min()) * 1e-9
    limit = stale_limit(ordered)
    return ChannelSummary(
        table.topic,
        table.schema,
        len(table),
        float(1 / np.median(steps[steps > 0])),
        float(np.std(steps[steps <= limit])),
        int((steps > limit).sum()),
        float(steps.max()),
        int((steps <= 0).sum()),
    )


def _signals(tables: dict[str, Table]) -> list[SignalSummary]:
    result = []
    for section in SECTIONS.values():
        table = tables.get(section.topic)
        if table is None:
            continue
        for signal in section.signals:
            values = np.asarray(table.columns.get(signal.field, []), np.float64)
            known = values[np.isfinite(values)]
            if len(known):
                result.append(
                    SignalSummary(
                        signal.role,
                        SIGNALS[signal.role].unit,
                        1 - len(known) / len(values),
                        float(known.min()),
                        float(known.mean()),
                        float(known.max()),
                    )
                )
    return result
