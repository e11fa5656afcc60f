"""The logs that are shown, read once: signals, truth, estimates and their details."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from roadlog.drive import Drive
from roadlog.errors import MissingSignalError, near
from roadlog.estimate import Estimate
from roadlog.log import DriveLog
from roadlog.signals import INPUTS, TRUTH_TOPIC, estimate_topic, truth_topic
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.view.colors import RUN_MARK

EVENTS, WINDOWS = "events", "windows"  # details of static_slope
MOTION = truth_topic("motion")


@dataclass(frozen=True)
class Run:
    """One log as read.

    name: empty for the only log, else what tells it from the others. drive: at the rate shown.
    distance: m driven at `drive.time`, None without a speed. estimates: label -> angles. tables:
    further channels by topic.
    """

    name: str
    log: DriveLog
    drive: Drive
    distance: Floats | None
    truth: Estimate | None
    estimates: Mapping[str, Estimate]
    tables: Mapping[str, Table] = field(repr=False)

    def labeled(self, name: str) -> str:
        """A name as it is shown: with the run behind it when there are several."""
        return f"{name}{RUN_MARK}{self.name}" if self.name else name

    def distance_at(self, time: Floats) -> Floats | None:
        """m at other times, s; None without a speed."""
        if self.distance is None:
            return None
        return np.interp(time, self.drive.time, self.distance)

    def same_drive(self, other: Run) -> bool:
        """Whether both are runs of one drive: equal signals at equal times."""
        mine, others = self.drive, other.drive
        return (
            mine.start_ns == others.start_ns
            and mine.signals.keys() == others.signals.keys()
            and all(
                np.array_equal(values, others.signals[role], equal_nan=True)
                for role, values in mine.signals.items()
            )
        )


class Loaded(NamedTuple):
    """What is read of one log. wanted: its estimates that are shown."""

    name: str
    log: DriveLog
    wanted: Sequence[str]
    tables: Mapping[str, Table]


def load(logs: Sequence[DriveLog], estimators: Sequence[str]) -> Iterator[Loaded]:
    """Read what is shown of every log. Raises MissingSignalError, LogReadError."""
    known = {name for log in logs for name in log.estimators}
    for name in estimators:
        if name not in known:
            where = ", ".join(str(log.path) for log in logs)
            raise MissingSignalError(f"{where}: no estimate '{name}'. {near(name, known)}")
    for log, name in zip(logs, _names(logs), strict=True):
        wanted = [e for e in log.estimators if not estimators or e in estimators]
        details = [estimate_topic(e, d) for e in wanted for d in (EVENTS, WINDOWS)]
        topics = [*(s.topic for s in INPUTS), TRUTH_TOPIC, MOTION, *map(estimate_topic, wanted)]
        yield Loaded(name, log, wanted, log.tables([*topics, *details]))


def run_of(loaded: Loaded, drive: Drive) -> Run:
    """A log as it is shown, its signals as they are in `drive`."""
    name, log, wanted, tables = loaded
    true = tables.get(TRUTH_TOPIC)
    run = Run(
        name,
        log,
        drive,
        _distance(drive),
        Estimate.from_table(true, drive.start_ns) if true is not None and len(true) else None,
        {},
        tables,
    )
    estimates = {
        run.labeled(e): Estimate.from_table(tables[estimate_topic(e)], drive.start_ns, e)
        for e in wanted
    }
    return Run(name, log, drive, run.distance, run.truth, estimates, tables)


def _distance(drive: Drive) -> Floats | None:
    """m along the drive by the speed; over a gap of the speed by its neighbors."""
    if not drive.has_speed:
        return None
    known = np.isfinite(drive.speed)
    if not known.any():
        return None
    speed = np.interp(drive.time, drive.time[known], np.abs(drive.speed[known]))
    steps = 0.5 * (speed[1:] + speed[:-1]) * drive.dt
    return np.concatenate([[0.0], np.cumsum(steps)])


def _names(logs: Sequence[DriveLog]) -> list[str]:
    """Short names that tell the logs apart: the file's, with its folder's or a number if needed."""
    if len(logs) == 1:
        return [""]
    stems = [log.path.stem for log in logs]
    if len(set(stems)) == len(stems):
        return stems
    longer = [f"{log.path.resolve().parent.name}-{log.path.stem}" for log in logs]
    if len(set(longer)) == len(longer):
        return longer
    return [f"{k + 1}-{stem}" for k, stem in enumerate(stems)]
