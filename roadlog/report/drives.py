"""Logs to passes: the stored estimate of each drive, or one that is made now."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.estimate import Estimate
from roadlog.log import DriveLog
from roadlog.report.sources import FoundLog, local_copy
from roadlog.roads.passes import Pass, pass_of


@dataclass(frozen=True)
class Driven:
    """What came of one log: its pass, or why there is none; losses of the log besides."""

    name: str
    road: Pass | None
    why: str = ""
    losses: tuple[str, ...] = ()


def driven(sources: Sequence[FoundLog], estimator: str) -> Iterator[Driven]:
    """The pass of each log, one log in memory at a time; a log that cannot be used says why."""
    for source in sources:
        try:
            with local_copy(source) as path, DriveLog(path) as log:
                yield _driven(log, source.name, estimator)
        except RoadlogError as error:
            yield Driven(source.name, None, str(error))


def _driven(log: DriveLog, name: str, estimator: str) -> Driven:
    drive = log.drive()
    if estimator in log.estimators:
        estimate = log.stored(estimator)
        shape = log.detail(estimator, "shape")
        if shape is not None:
            estimate = replace(estimate, details={"shape": shape})
    else:
        estimate = estimators.run(estimator, drive, log.vehicle)
    road = pass_of(drive, estimate, log.vehicle, name)
    why = "" if road is not None else _why(drive, estimate)
    return Driven(name, road, why, tuple(log.losses))


def _why(drive: Drive, estimate: Estimate) -> str:
    """What a drive without a pass lacks."""
    if not {"gnss.latitude", "gnss.longitude"} <= set(drive.signals):
        return "needs positions"
    if not drive.has_speed:
        return "needs a speed"
    if "grade" not in estimate.angles or not np.isfinite(estimate.sd.get("grade", np.nan)).any():
        return f"needs a grade with its sd, and {estimate.name} gives none"
    if not estimate.valid.any():
        return f"the grade of {estimate.name} is valid nowhere; `roadlog estimate` says why"
    return "nowhere is a position known on the move where the grade is valid"
