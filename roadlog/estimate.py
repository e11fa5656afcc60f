"""Estimate: what an estimator gives back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.columnar import Columnar
from roadlog.drive import Drive
from roadlog.signals import ANGLES, ANGLES_SCHEMA, FLAGS, estimate_topic
from roadlog.storage.table import Table
from roadlog.types import Bools, Flags, Floats, Stamps

MAX_ANGLE = math.radians(45.0)  # rad; steeper is no road that a car drives, and no body on it


@dataclass(frozen=True)
class Detail:
    """A further output of an estimator: a channel of its own beside the angles.

    schema: full name of the message (schemas/roadlog/v1). time: seconds on the drive's clock.
    """

    schema: str
    time: Floats
    columns: Mapping[str, NDArray]


@dataclass(frozen=True)
class Estimate(Columnar):
    """Angles over the drive with their uncertainty.

    time: seconds on the drive's clock, (n,). angles: name (one of ANGLES) -> rad, NaN where there
    is none. sd: the same names -> rad, 1 standard deviation. valid: the values may be used.
    flags: bits of `signals.FLAGS`. details: name -> further channels (internals, forces, events).
    notes: what a user should know of this run, e.g. a parameter that was only a default.
    innovations: measurement -> measured less predicted in standard deviations, (n,), NaN where
    there was none; of a filter that tells them.
    parameters and run_time are filled in by `estimators.run`.
    """

    time: Floats
    angles: Mapping[str, Floats]
    sd: Mapping[str, Floats] = field(default_factory=dict)
    valid: Bools | None = None
    flags: Flags | None = None
    details: Mapping[str, Detail] = field(default_factory=dict)
    notes: Sequence[str] = ()
    innovations: Mapping[str, Floats] = field(default_factory=dict)
    name: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    run_time: float = 0.0  # s

    def __getattr__(self, name: str) -> Floats:
        """`estimate.grade`, `estimate.grade_sd`: the angles and standard deviations by name."""
        if name in ANGLES and name in self.angles:
            return self.angles[name]
        if name.endswith("_sd") and name[:-3] in self.sd:
            return self.sd[name[:-3]]
        raise AttributeError(f"this estimate has no '{name}'; it has {', '.join(self.angles)}")

    @property
    def usable(self) -> Bools:
        """`valid`, or where no mask was given: any angle known."""
        if self.valid is not None:
            return self.valid
        known = np.zeros(len(self.time), np.bool_)
        for values in self.angles.values():
            known |= np.isfinite(values)
        return known

    def to_columns(self) -> dict[str, NDArray]:
        """`time` in s, each angle and its `_sd` in rad, `valid`, `flags`."""
        columns: dict[str, NDArray] = {"time": self.time, **self.angles}
        columns |= {f"{angle}_sd": values for angle, values in self.sd.items()}
        columns["valid"] = self.usable
        if self.flags is not None:
            columns["flags"] = self.flags
        return columns

    def bounded(self) -> Estimate:
        """The same, not valid where every angle is unknown or one is beyond any road or car.

        Such a sample gets the flag `rejected`; its angles stay as they are, to be looked at.
        """
        if not self.angles:
            return self
        known = np.zeros(len(self.time), np.bool_)
        implausible = np.zeros(len(self.time), np.bool_)
        for values in self.angles.values():
            known |= np.isfinite(values)
            implausible |= np.abs(values) > MAX_ANGLE
        flags = np.zeros(len(self.time), np.uint32) if self.flags is None else self.flags
        return replace(
            self,
            valid=self.usable & known & ~implausible,
            flags=flags | np.where(implausible, FLAGS["rejected"], 0).astype(flags.dtype),
        )

    def tables(self, drive: Drive, name: str = "") -> list[Table]:
        """The channels that hold this estimate in a log."""
        name = name or self.name
        unknown = np.full(len(self.time), np.nan)
        columns: dict[str, NDArray] = {a: self.angles.get(a, unknown) for a in ANGLES}
        columns |= {f"{a}_sd": self.sd.get(a, unknown) for a in ANGLES}
        flags = np.zeros(len(self.time), np.uint32) if self.flags is None else self.flags
        columns |= {"flags": flags.astype(np.uint32), "valid": self.usable}
        tables = [Table(estimate_topic(name), ANGLES_SCHEMA, _ns(drive, self.time), columns)]
        for key, detail in self.details.items():
            time = _ns(drive, detail.time)
            tables.append(Table(estimate_topic(name, key), detail.schema, time, detail.columns))
        return tables


def _ns(drive: Drive, time: Floats) -> Stamps:
    return drive.start_ns + np.round(time * 1e9).astype(np.int64)


def complete_angles(angles: Mapping[str, Floats]) -> dict[str, Floats]:
    """Add inclination = grade + pitch and roll_total = bank + roll where both parts are there."""
    result = dict(angles)
    for total, road, body in (("inclination", "grade", "pitch"), ("roll_total", "bank", "roll")):
        if total not in result and road in result and body in result:
            result[total] = result[road] + result[body]
    return result
