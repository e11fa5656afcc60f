"""Frames through a profile to tables: units, validity, clocks, mounting."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest.frame import Frame
from roadlog.ingest.profile import AXES, Entry, Profile, find
from roadlog.signals import SECTIONS, SIGNALS, Section
from roadlog.storage import Table, schemas
from roadlog.types import Bools, Floats, Stamps
from roadlog.units import to_si

SLOW_SECTIONS = ("speed", "gnss", "barometer")  # of devices that fast tables repeat
REPEATS = 5  # rows; a value that typically stays this long is held, not measured anew
NEGLIGIBLE = 1e-9  # a mount coefficient below this does not use its axis


@dataclass(frozen=True)
class Mapped:
    """One signal that was mapped: where it came from and how many samples of it are usable."""

    role: str
    source: str
    file: str
    unit: str
    samples: int
    invalid: int


def apply(profile: Profile, frames: list[Frame]) -> tuple[list[Table], list[Mapped], list[str]]:
    """Tables of every section that the profile maps, what was mapped, and what was left over.

    Signals of a section are put on the union of their stamps, NaN where one has no value. Raises
    ConfigError when a name is not in the source, LogReadError when a section has no usable value.
    """
    tables, mapped, used = [], [], set()
    for name, entries in profile.entries.items():
        values: dict[str, tuple[Stamps, Floats]] = {}
        for key, entry in entries.items():
            frame, column = find(entry.source, entry, frames)
            used.add((id(frame), column))
            if entry.valid:
                used.add((id(frame), entry.valid.name))
            time, samples = _samples(entry, frame, column)
            if name in SLOW_SECTIONS:
                fresh = refreshed(time, samples)
                time, samples = time[fresh], samples[fresh]
            values[key] = time, samples
            usable = int(np.isfinite(samples).sum())
            place = f"{frame.name}.{column}" if frame.name else column
            unit = entry.unit or "-"
            mapped.append(
                Mapped(entry.role, place, frame.file, unit, usable, len(samples) - usable)
            )
        if values:
            tables.append(_table(SECTIONS[name], values, profile.mounts.get(name)))
    over = [
        f"{frame.name}.{column}" if frame.name else column
        for frame in frames
        for column in frame.columns
        if (id(frame), column) not in used
    ]
    if not any(len(table) for table in tables):
        raise LogReadError("the sources hold no usable sample of any mapped signal")
    return tables, mapped, over


def _samples(entry: Entry, frame: Frame, column: str) -> tuple[Stamps, Floats]:
    """Stamps and SI values of one entry; NaN where invalid."""
    raw = _numbers(frame.columns[column], entry.role)
    expected = SIGNALS[entry.role].unit
    factor = to_si(entry.unit, expected) if entry.unit else 1.0
    values: Floats = (raw * entry.scale + entry.offset) * factor
    values[~np.isfinite(values)] = np.nan
    if entry.valid is not None:
        if entry.valid.name not in frame.columns:
            raise ConfigError(
                f"{entry.role}: valid needs '{entry.valid.name}' in the same message as "
                f"'{column}' ({', '.join(frame.columns)})"
            )
        values[~entry.valid.holds(_numbers(frame.columns[entry.valid.name], entry.role))] = np.nan
    return frame.time - round(entry.delay * 1e9), values


def refreshed(time: Stamps, values: Floats) -> Bools:
    """Which rows bring a new value, where a fast table repeats a slow device's last one.

    A phone writes its 1 Hz fix into every row of a 25 Hz table; taken as samples, these are steps
    with an infinite slope. Rows of a change are kept, and while nothing changes (standstill) one
    row for each typical interval between changes.
    """
    changes = np.flatnonzero(np.diff(values, prepend=np.nan) != 0)
    if len(changes) < 3 or np.median(np.diff(changes)) < REPEATS:
        return np.ones(len(values), np.bool_)
    keep = np.zeros(len(values), np.bool_)
    keep[changes] = True
    interval = float(np.median(np.diff(time[changes])))
    for a, b in zip(changes, [*changes[1:], len(values)], strict=True):
        stop = time[b - 1] if b - a > REPEATS else time[a]
        alive: Floats = np.arange(time[a], stop, interval)[1:]
        # a fix that comes a little late is no standstill
        keep[a + np.searchsorted(time[a:b], alive[: len(alive) - (b < len(values))])] = True
    return keep


def _numbers(values: NDArray, role: str) -> Floats:
    try:
        return np.array(values, np.float64)
    except (TypeError, ValueError):
        raise ConfigError(
            f"{role}: its source holds text, not numbers (e.g. {values[0]!r})"
        ) from None


def _table(
    section: Section, values: dict[str, tuple[Stamps, Floats]], mount: Floats | None
) -> Table:
    time, columns = _united(values)
    if mount is not None:
        for kind in ("accel", "gyro"):
            _rotate(columns, kind, mount)
    known = np.zeros(len(time), np.bool_)
    for column in columns.values():
        known |= np.isfinite(column)
    time, columns = time[known], {name: column[known] for name, column in columns.items()}
    complete: dict[str, NDArray] = {}
    for name, dtype in schemas.columns(section.schema).items():
        if name in columns:
            complete[name] = columns[name]
        elif name == "valid":
            complete[name] = np.ones(len(time), np.bool_)  # every row left has a value
        else:
            blank = np.nan if dtype.kind == "f" else 0
            complete[name] = np.full(len(time), blank, dtype)
    return Table(section.topic, section.schema, time, complete)


def _united(values: dict[str, tuple[Stamps, Floats]]) -> tuple[Stamps, dict[str, Floats]]:
    """All signals on the union of their stamps; repeated stamps of one signal keep the last."""
    stamps = [time for time, _ in values.values()]
    first = stamps[0]
    if np.all(np.diff(first) > 0) and all(np.array_equal(time, first) for time in stamps):
        return first, {name: column for name, (_, column) in values.items()}
    union: Stamps = np.unique(np.concatenate(stamps))
    columns = {}
    for name, (time, column) in values.items():
        column_union = np.full(len(union), np.nan)
        column_union[np.searchsorted(union, time)] = column
        columns[name] = column_union
    return union, columns


def _rotate(columns: dict[str, Floats], kind: str, mount: Floats) -> None:
    """Turn one sensor triad to vehicle axes; an axis that needs an unmapped one is an error."""
    names = [f"{kind}_{axis}" for axis in AXES]
    there = [name in columns for name in names]
    if not any(there):
        return
    size = len(next(iter(columns.values())))
    sensor = [columns.get(name, np.zeros(size)) for name in names]
    for name in names:
        columns.pop(name, None)
    for row, name in zip(mount, names, strict=True):
        needs = [abs(c) > NEGLIGIBLE for c in row]
        if any(need and not has for need, has in zip(needs, there, strict=True)):
            if sum(needs) > 1:
                lacking = [
                    n for n, need, has in zip(names, needs, there, strict=True) if need > has
                ]
                raise ConfigError(f"imu: mount turns several axes; map {', '.join(lacking)} too")
            continue
        columns[name] = sum(
            (c * s for c, s, need in zip(row, sensor, needs, strict=True) if need), np.zeros(size)
        )


def gaps(tables: Iterable[Table], minimum: float = 1.0) -> list[str]:
    """Sentences on the holes of more than `minimum` seconds and 5 median intervals of a signal."""
    found = []
    for table in tables:
        # messages of one burst lie apart by milliseconds: each signal has its own interval
        times = {table.time[np.isfinite(c)].tobytes() for c in table.columns.values()}
        holes = [hole for raw in times for hole in _holes(np.frombuffer(raw, np.int64), minimum)]
        if holes:
            longest, at = max(holes)
            after = (at - int(table.time[0])) * 1e-9
            count = "1 gap" if len(holes) == 1 else f"{len(holes)} gaps"
            found.append(f"{table.topic}: {count}, longest {longest:.2f} s at {after:.1f} s")
    return found


def _holes(time: Stamps, minimum: float) -> list[tuple[float, int]]:
    """Length [s] and start [ns] of each hole."""
    if len(time) < 3:
        return []
    steps = np.diff(time) * 1e-9
    wide = steps > max(minimum, 5 * float(np.median(steps)))
    return list(zip(steps[wide].tolist(), time[:-1][wide].tolist(), strict=True))
