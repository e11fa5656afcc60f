"""When a driving-force filter runs, freezes or is off.

Source: docs/methods/luo2024.md#freezing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive, runs
from roadlog.estimators.base import flag, parameter
from roadlog.filters.gaps import age, hold
from roadlog.types import Bools, Flags, Floats


@dataclass(frozen=True)
class ScheduleParameters:
    """What debe and tfobe share; docs/methods/luo2024.md#parameters-of-debe-and-tfobe."""

    min_speed: float = parameter(1.5, "m/s", "below it the grade is held; 0: never")
    max_sd: float = parameter(0.035, "rad", "beyond this the grade is not valid; ours")
    hold_time: float = parameter(0.2, "s", "inputs are held this long")
    gap_time: float = parameter(3.0, "s", "the filter goes on this long without speed or torque")
    settle_time: float = parameter(5.0, "s", "flagged as converging after a start")


@dataclass(frozen=True)
class Schedule:
    """runs: stretches to filter, each from a known speed on. Masks (n,): frozen where the state is
    held, slow below the method's speed, unknown where an input is; since_speed (n,) s."""

    runs: list[slice]
    frozen: Bools
    slow: Bools
    unknown: Bools
    since_speed: Floats

    def outcome(
        self, drive: Drive, grade: Floats, sd: Floats, repaired: Bools, params: ScheduleParameters
    ) -> tuple[Bools, Flags]:
        """`valid` and `flags` of a grade that was filtered so, NaN where it was off."""
        running = np.isfinite(grade)
        started = np.full(len(grade), np.inf)
        for run in self.runs:
            started[run] = np.arange(run.stop - run.start) * drive.dt
        converging = running & (started < params.settle_time)
        uncertain = running & (sd > params.max_sd)
        flags = (
            flag(~running | (self.since_speed > params.hold_time), "missing")
            | flag(self.slow, "standstill")
            | flag(converging, "converging")
            | flag(repaired, "repaired")
            | flag(uncertain, "uncertain")
            | flag(self.unknown, "powertrain")
        )
        return running & ~converging & ~uncertain & ~repaired, flags


def schedule(drive: Drive, speed: Floats, known: Bools, params: ScheduleParameters) -> Schedule:
    """Where to filter: known is True where every input is, speed is NaN where it is not.

    At low speed the car's forces say nothing (a held brake reads as a steep grade), so there the
    inputs need not be known.
    """
    since_speed = age(np.isfinite(speed)) * drive.dt
    since_inputs = age(known) * drive.dt
    slow = hold(speed, round(params.gap_time * drive.rate))[0] < params.min_speed
    runnable = (since_speed <= params.gap_time) & (slow | (since_inputs <= params.gap_time))
    stretches = []
    for run in runs(runnable):
        first = np.flatnonzero(np.isfinite(speed[run]))
        if len(first):
            stretches.append(slice(run.start + int(first[0]), run.stop))
    return Schedule(stretches, slow | ~known, slow, ~known, since_speed)
