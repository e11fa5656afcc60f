"""Estimate: angles over a drive, whether just made, stored in a log, or the truth."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from roadlog.columnar import Columnar
from roadlog.errors import ConfigError
from roadlog.signals import ANGLES, ANGLES_SCHEMA, FLAGS, estimate_topic
from roadlog.storage.table import Table
from roadlog.types import Bools, Flags, Floats, Stamps
from roadlog.version import __version__

if TYPE_CHECKING:
    from roadlog.metrics import Errors

MAX_ANGLE = math.radians(45.0)  # rad; steeper is no road that a car drives, and no body on it


@dataclass(frozen=True, eq=False, repr=False)
class Detail(Columnar):
    """A further output of an estimator: a channel of its own beside the angles.

    schema: full name of the message (schemas/roadlog/v1). time: seconds on the drive's clock.
    """

    schema: str
    time: Floats
    columns: Mapping[str, NDArray]

    def to_columns(self) -> dict[str, NDArray]:
        """`time` in s and the fields of the message."""
        return {"time": self.time, **self.columns}

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        return f"<Detail {self.schema}: {len(self)} rows of {', '.join(self.columns)}>"


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Columnar):
    """Angles over the drive with their uncertainty; also what a log holds of one, and the truth.

    time: seconds on the drive's clock, (n,). angles: name (one of ANGLES) -> rad, NaN where there
    is none. sd: the same names -> rad, 1 standard deviation, NaN where unknown. valid: the values
    may be used; where it is not given, any known angle may. flags: bits of `signals.FLAGS`.
    details: name -> further channels (internals, forces, events). notes: what a user should know of
    this run, e.g. a parameter that was only a default. innovations: measurement -> measured less
    predicted in standard deviations, (n,), NaN where there was none; of a filter that tells them.

    What follows is filled in by `estimators.run`. start_ns: ns since 1970 at time 0, None where
    nobody said. inputs: the signals that the drive had.
    """

    time: Floats
    angles: Mapping[str, Floats]
    sd: Mapping[str, Floats] = field(default_factory=dict)
    valid: Bools = None  # type: ignore[assignment]  # is filled in
    flags: Flags = None  # type: ignore[assignment]  # is filled in
    details: Mapping[str, Detail] = field(default_factory=dict)
    notes: Sequence[str] = ()
    innovations: Mapping[str, NDArray[np.float32]] = field(default_factory=dict)
    name: str = ""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    run_time: float = 0.0  # s
    start_ns: int | None = None
    engine: str = ""
    inputs: Sequence[str] = ()

    def __post_init__(self) -> None:
        unknown = np.broadcast_to(np.float64("nan"), len(self.time))
        filled: dict[str, Any] = {"sd": {a: self.sd.get(a, unknown) for a in self.angles}}
        if self.valid is None:
            filled["valid"] = self._any_known()
        if self.flags is None:
            filled["flags"] = np.zeros(len(self.time), np.uint32)
        for name, value in filled.items():
            object.__setattr__(self, name, value)

    @classmethod
    def from_table(
        cls,
        table: Table,
        start_ns: int | None = None,
        name: str = "",
        record: Mapping[str, str] | None = None,
    ) -> Estimate:
        """The columns of one RoadAngles channel; only angles that are known at some time.

        start_ns: time 0, the first message where it is not given. record: the metadata that
        `record` made.
        """
        if start_ns is None:
            start_ns = int(table.time[0]) if len(table) else 0
        angles, sd = {}, {}
        for angle in ANGLES:
            values = np.asarray(table.columns[angle], np.float64)
            if not np.isnan(values).all():
                angles[angle] = values
                sd[angle] = np.asarray(table.columns[f"{angle}_sd"], np.float64)
        said = record or {}
        return cls(
            np.multiply(table.time - start_ns, 1e-9),
            angles,
            sd,
            np.asarray(table.columns["valid"], np.bool_),
            np.asarray(table.columns["flags"], np.uint32),
            notes=[note for note in said.get("notes", "").split("\n") if note],
            name=name,
            parameters=json.loads(said.get("parameters", "{}")),
            start_ns=start_ns,
            engine=said.get("engine", ""),
            inputs=tuple(role for role in said.get("inputs", "").split(", ") if role),
        )

    def __getattr__(self, name: str) -> Floats:
        """`estimate.grade`, `estimate.grade_sd`: the angles and standard deviations by name."""
        known = {} if name.startswith("_") else self.__dict__  # empty while it is being copied
        angles, sd = known.get("angles", {}), known.get("sd", {})
        if name in ANGLES and name in angles:
            return angles[name]
        if name.endswith("_sd") and name[:-3] in sd:
            return sd[name[:-3]]
        raise AttributeError(f"this estimate has no '{name}'; it has {', '.join(angles)}")

    def __len__(self) -> int:
        return len(self.time)

    def __repr__(self) -> str:
        seconds = f"{self.time[-1] - self.time[0]:.1f} s" if len(self) else "empty"
        share = f", {100 * float(self.valid.mean()):.1f} % valid" if len(self) else ""
        name = self.name or "angles"
        return f"<Estimate {name}: {', '.join(self.angles) or 'no angle'}; {seconds}{share}>"

    @property
    def time_ns(self) -> Stamps:
        """ns since 1970 of each sample. Raises ConfigError where the start is not known."""
        return self.start + np.round(self.time * 1e9).astype(np.int64)

    @property
    def start(self) -> int:
        """`start_ns`, or ConfigError."""
        if self.start_ns is None:
            raise ConfigError(
                f"estimate '{self.name}' does not know when it begins: make it by `estimators.run` "
                f"or give it the drive's start_ns"
            )
        return self.start_ns

    @property
    def known(self) -> tuple[str, ...]:
        """The angles that have a value at some time."""
        return tuple(a for a, values in self.angles.items() if not np.isnan(values).all())

    @property
    def attributes(self) -> dict[str, Any]:
        """Name, start and engine, as far as they are known."""
        said = {"name": self.name, "start_ns": self.start_ns, "engine": self.engine}
        return {key: value for key, value in said.items() if value not in ("", None)}

    def errors(self, truth: Estimate, skip: float = 0.0) -> Errors:
        """This less the truth, at the truth's times, by absolute time.

        skip: s at the start of this estimate that do not count. Raises ConfigError where one of
        them does not know its start.
        """
        from roadlog.metrics import errors

        return errors(self, truth, skip)

    def to_columns(self) -> dict[str, NDArray]:
        """`time` in s, each angle and its `_sd` in rad, `valid`, `flags`."""
        columns: dict[str, NDArray] = {"time": self.time, **self.angles}
        columns |= {f"{angle}_sd": values for angle, values in self.sd.items()}
        return columns | {"valid": self.valid, "flags": self.flags}

    def bounded(self) -> Estimate:
        """The same, not valid where every angle is unknown or one is beyond any road or car.

        Such a sample gets the flag `rejected`; its angles stay as they are, to be looked at.
        """
        if not self.angles:
            return self
        implausible = np.zeros(len(self.time), np.bool_)
        for values in self.angles.values():
            implausible |= np.abs(values) > MAX_ANGLE
        rejected = np.where(implausible, FLAGS["rejected"], 0).astype(self.flags.dtype)
        valid = self.valid & self._any_known() & ~implausible
        return replace(self, valid=valid, flags=self.flags | rejected)

    def _any_known(self) -> Bools:
        known = np.zeros(len(self.time), np.bool_)
        for values in self.angles.values():
            known |= np.isfinite(values)
        return known

    def tables(self) -> list[Table]:
        """The channels that hold this estimate in a log."""
        unknown = np.full(len(self.time), np.nan)
        columns: dict[str, NDArray] = {a: self.angles.get(a, unknown) for a in ANGLES}
        columns |= {f"{a}_sd": self.sd.get(a, unknown) for a in ANGLES}
        columns |= {"flags": self.flags.astype(np.uint32), "valid": self.valid}
        tables = [Table(estimate_topic(self.name), ANGLES_SCHEMA, self.time_ns, columns)]
        for key, detail in self.details.items():
            stamps = self.start + np.round(detail.time * 1e9).astype(np.int64)
            topic = estimate_topic(self.name, key)
            tables.append(Table(topic, detail.schema, stamps, detail.columns))
        return tables

    def record(self) -> dict[str, str]:
        """The metadata record of a log on this estimate; nothing in it changes from run to run."""
        return {
            "parameters": json.dumps(dict(self.parameters), sort_keys=True),
            "engine": self.engine,
            "roadlog": __version__,
            "inputs": ", ".join(sorted(self.inputs)),
            "duration": f"{self.time[-1]:.3f} s",
            "notes": "\n".join(self.notes),
        }


def complete_angles(angles: Mapping[str, Floats]) -> dict[str, Floats]:
    """Add inclination = grade + pitch and roll_total = bank + roll where both parts are there."""
    result = dict(angles)
    for total, road, body in (("inclination", "grade", "pitch"), ("roll_total", "bank", "roll")):
        if total not in result and road in result and body in result:
            result[total] = result[road] + result[body]
    return result
