"""Faults that loggers, buses and sensors put into a drive, as functions from tables to tables."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.signals import INPUTS, SECTIONS
from roadlog.storage import Table

START, STOP = 40.0, 50.0  # s into the drive: where a passing fault acts
LENGTH = 140.0  # s of the pass that are driven: climbs, hairpins, a stop
GROUPS = {
    "imu": ("imu",),
    "speed": ("speed", "wheel_speeds"),
    "gnss": ("gnss",),
    "actuators": ("wheel_torques", "powertrain", "steering"),
}
BIAS = {"accel_x": 0.5, "accel_y": 0.5, "accel_z": 0.5, "gyro_x": 0.02, "gyro_y": 0.02}
BIAS |= {"gyro_z": 0.02, "v": 0.5, "fl": 0.5, "fr": 0.5, "rl": 0.5, "rr": 0.5}

Change = Callable[[Table, float], Table]  # a table and the drive's start in ns


@dataclass(frozen=True)
class Fault:
    """One fault on a group of inputs.

    ends: s into the drive, where it passes; infinite where it does not. blinding: while it lasts
    the group says nothing.
    """

    name: str
    change: Change
    ends: float = math.inf
    blinding: bool = False


def _values(change: Callable[[str, np.ndarray, np.ndarray], np.ndarray]) -> Change:
    """From (field, seconds, values) -> values, on every analog field."""

    def apply(table: Table, start: float) -> Table:
        seconds = (table.time - start) * 1e-9
        columns = {
            name: change(name, seconds, np.array(values, np.float64))
            if np.issubdtype(np.asarray(values).dtype, np.floating)
            else values
            for name, values in table.columns.items()
        }
        return dataclasses.replace(table, columns=columns)

    return apply


def _burst(value: float) -> Change:
    return _values(lambda _, t, x: np.where((t >= START) & (t < STOP), value, x))


def _frozen(_: str, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    inside = (t >= START) & (t < STOP)
    return np.where(inside, x[np.argmax(inside)], x)


def _spiked(_: str, t: np.ndarray, x: np.ndarray) -> np.ndarray:
    spike = (t >= START) & (t < STOP) & (np.arange(len(x)) % 50 == 0)
    return np.where(spike, 50.0, x)


def _gap(length: float) -> Change:
    def apply(table: Table, start: float) -> Table:
        t = (table.time - start) * 1e-9
        return rows(table, (t < START) | (t >= START + length))

    return apply


def _delayed(table: Table, _: float) -> Table:
    return dataclasses.replace(table, time=table.time + 200_000_000)


def rows(table: Table, keep: np.ndarray) -> Table:
    """Some of the rows."""
    columns = {name: np.asarray(values)[keep] for name, values in table.columns.items()}
    return dataclasses.replace(table, time=table.time[keep], columns=columns)


def _jump(seconds: float) -> Change:
    def apply(table: Table, start: float) -> Table:
        late = table.time - start > START * 1e9
        return dataclasses.replace(table, time=table.time + np.where(late, round(seconds * 1e9), 0))

    return apply


def _doubled(table: Table, _: float) -> Table:
    return rows(table, np.repeat(np.arange(len(table)), 2))


OF_A_GROUP = (
    Fault("removed", lambda table, _: rows(table, np.zeros(len(table), np.bool_)), blinding=True),
    Fault("delayed by 200 ms", _delayed),
    Fault("frozen for 10 s", _values(_frozen), ends=STOP),
    Fault("spikes of 50 for 10 s", _values(_spiked), ends=STOP),
    Fault("biased", _values(lambda name, _, x: x + BIAS.get(name, 0.0))),
    Fault("scaled by 1.05", _values(lambda _, __, x: 1.05 * x)),
    Fault("sign reversed", _values(lambda _, __, x: -x)),
    Fault("gap of 1 s", _gap(1.0), START + 1.0, blinding=True),
    Fault("gap of 10 s", _gap(10.0), START + 10.0, blinding=True),
    Fault("gap of 60 s", _gap(60.0), START + 60.0, blinding=True),
    Fault("NaN for 10 s", _burst(np.nan), STOP, blinding=True),
    Fault("infinity for 10 s", _burst(np.inf), STOP, blinding=True),
)
OF_THE_LOG = (
    Fault("clock jumps 30 s ahead", _jump(30.0)),
    Fault("clock jumps 5 s back", _jump(-5.0)),
    Fault("every stamp twice", _doubled),
)


def inject(tables: Sequence[Table], fault: Fault, group: str | None = None) -> list[Table]:
    """The drive with that fault on one group of inputs, or on every input."""
    start = min(int(table.time[0]) for table in tables)
    sections = GROUPS[group] if group else [section.name for section in INPUTS]
    topics = {SECTIONS[name].topic for name in sections}
    return [fault.change(t, start) if t.topic in topics else t for t in tables]


def pass_drive() -> tuple[list[Table], list[Table], Vehicle]:
    """Inputs, truth and car of the first part of `mountain`, with sensors."""
    from support.drives import simulated

    drive = simulated("mountain", seed=1)
    start = min(int(table.time[0]) for table in drive.tables)
    tables = [rows(t, t.time - start < LENGTH * 1e9) for t in drive.tables]
    known = {section.topic for section in INPUTS}
    return (
        [t for t in tables if t.topic in known],
        [t for t in tables if t.topic not in known],
        drive.vehicle,
    )


def real_minute(shared: Path) -> tuple[list[Table], list[Table], Vehicle]:
    """Inputs, truth and (default) car of the comma2k19 minute."""
    from roadlog.ingest import ingest

    known = {section.topic for section in INPUTS}
    tables = ingest([shared / "comma2k19"]).tables
    return (
        [t for t in tables if t.topic in known],
        [t for t in tables if t.topic not in known],
        Vehicle(),
    )
