"""One line of a plot, and how a track of another clock becomes one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import stale_limit
from roadlog.estimate import Estimate
from roadlog.metrics import DEFAULT_SKIP
from roadlog.types import Bools, Floats
from roadlog.view.runs import Run

CLOCK_SHARE = 1.5  # intervals of the drive; rarer samples are joined by a line


@dataclass(frozen=True)
class Curve:
    """One line: time s from the start of the drive, values, sd of the values or None.

    distance: m along the drive at the same samples; None when the log has no speed. since: s, from
    which errors count, the others being of an estimator that settles.
    """

    time: Floats
    values: Floats
    sd: Floats | None = None
    distance: Floats | None = None
    since: float = 0.0

    @property
    def counted(self) -> Bools:
        """The values that an RMSE is of."""
        return np.isfinite(self.values) & (self.time >= self.since)


def settled(estimate: Estimate) -> float:
    """s, from which the errors of an estimate count, as in `roadlog evaluate`."""
    return float(estimate.time[0]) + DEFAULT_SKIP


def on_clock(run: Run, own: Floats, values: Floats, sd: Floats, since: float = 0.0) -> Curve:
    """The samples next to the drive's times; between samples that are rarer a line is drawn.

    All curves of a drive share its times, so that a recording holds them once. NaN where no
    sample is near.
    """
    time = run.drive.time
    unknown = np.full(len(time), np.nan)
    if len(own) < 2:
        return Curve(time, unknown, None, run.distance, since)
    after = np.clip(np.searchsorted(own, time), 1, len(own) - 1)
    before = after - 1
    nearest = np.where(time - own[before] <= own[after] - time, before, after)
    if float(np.median(np.diff(own))) <= CLOCK_SHARE * run.drive.dt:
        near = np.abs(own[nearest] - time) <= stale_limit(own)
        shown, width = values[nearest], sd[nearest]
    else:
        inside = (time >= own[0]) & (time <= own[-1])
        near = inside & (own[after] - own[before] <= stale_limit(own))
        shown, width = np.interp(time, own, values), np.interp(time, own, sd)
    known = bool(np.isfinite(sd).any())
    return Curve(
        time,
        np.where(near, shown, np.nan),
        np.where(near, width, np.nan) if known else None,
        run.distance,
        since,
    )
