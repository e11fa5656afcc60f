"""A log's columns for other tools, in one wide table, minute by minute.

A row is a stamp at which any chosen channel has a message; a cell is empty where its channel has
none there. On a grid (`every`) every row has every signal, as estimators see it. Signals are named
by their role, so that `roadlog ingest` reads the file back; other columns are `/topic.field`.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from roadlog.drive import resample
from roadlog.errors import ConfigError, LogReadError, near
from roadlog.export_files import FORMATS, Column
from roadlog.files import replacing
from roadlog.for_viewers import is_for_viewers
from roadlog.log import DriveLog
from roadlog.signals import SECTIONS, SIGNALS, Signal
from roadlog.storage import LogReader, Table
from roadlog.types import Bools, Floats, Stamps
from roadlog.units import DEG

WINDOW = 60 * 10**9  # ns written at a time
MARGIN = 10 * 10**9  # ns beside a window that interpolation sees
EMPTIEST = 100  # rows of a grid per message, beyond which a clock must have jumped
FEW_ROWS = 100_000
SLOWEST = 1.0  # Hz, of messages with their own times

WAY = Column("distance", "", "distance", np.dtype(np.float64), "m")  # of rows along the way

_STEP = re.compile(r"(\d{1,9}(?:\.\d{0,9})?|\.\d{1,9}) ?(s|m|Hz)")
_RADIANS = re.compile(r"rad\b")
_SECTION_OF = {section.topic: section.name for section in SECTIONS.values()}


def export(
    log: Path,
    out: Path,
    topics: Sequence[str] = (),
    roles: Sequence[str] = (),
    every: str | None = None,
    degrees: bool = False,
) -> tuple[int, list[Column], list[str]]:
    """Write chosen channels of a log to a file, whole or not at all; its ending tells the format.

    topics, roles: what to take, default all channels but those for other viewers. every: a common
    grid from the first message, `1s`, `10m` along the way (beside the distance), `50Hz`; None
    keeps the messages' own times. degrees: instead of radians. Returns rows, columns, losses.
    Raises LogReadError, LogWriteError, ConfigError for a name that is not there.
    """
    if out.suffix.lower() not in FORMATS:
        raise ConfigError(f"{out}: write to a file that ends in {', '.join(FORMATS)}")
    step, unit = (0.0, "") if every is None else _step(every)
    grid = _along(log, step) if unit == "m" else None
    rate = {"": None, "m": SLOWEST, "s": 1 / (step or 1), "Hz": step}[unit]
    with LogReader(log) as reader:
        columns = _columns(reader, topics, roles)
        if degrees:
            columns = [_in_degrees(column) for column in columns]
        if reader.start_ns is None or reader.end_ns is None or not columns:
            raise LogReadError(f"{log}: nothing to export: the chosen channels hold no numbers")
        _check_span(reader, rate)
        opened = FORMATS[out.suffix.lower()]
        rows, written = 0, [*([] if grid is None else [WAY]), *columns]
        with replacing(out) as file, opened(file, written, reader.start_ns) as put:
            for start in _windows(reader, rate):
                end = min(start + WINDOW, reader.end_ns + 1)
                time, block = _block(reader, columns, start, end, rate, grid)
                rows += len(time)
                cells = [_scaled(c, *cell) for c, cell in zip(columns, block, strict=True)]
                if grid is not None:
                    way = np.round(step * np.searchsorted(grid, time), 6)
                    cells.insert(0, (way, np.isfinite(way)))
                put(time, cells)
        return rows, written, list(reader.losses)


def _step(text: str) -> tuple[float, str]:
    """The number and its unit: s, m or Hz. Raises ConfigError."""
    parts = _STEP.fullmatch(text.strip())
    step = float(parts[1]) if parts else 0.0
    if parts is None or not 1e-5 <= step <= 1e5:
        raise ConfigError(
            f"--every: '{text}' is no step: a number from 0.00001 to 100000 and s, m (along the "
            f"way) or Hz, as in 0.1s, 10m, 50Hz"
        )
    return step, parts[2]


def _along(log: Path, step: float) -> Stamps:
    """Stamps at which the car has gone on by `step` m. Raises LogReadError without a speed."""
    drive = DriveLog(log).drive()
    if not drive.has_speed or not np.isfinite(drive.speed).any():
        raise LogReadError(f"{log}: has no speed that would tell the way; give --every in s")
    known = np.isfinite(drive.speed)
    speed = np.interp(drive.time, drive.time[known], np.abs(drive.speed[known]))
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * drive.dt)])
    marks = np.arange(0.0, way[-1], step)
    place = np.searchsorted(way, marks)  # where it stands, the moment it comes to stand
    before = np.maximum(place - 1, 0)
    share = (marks - way[before]) / np.maximum(way[place] - way[before], 1e-12)
    seconds = drive.time[before] + share * (drive.time[place] - drive.time[before])
    stamps: Stamps = drive.start_ns + np.round(seconds * 1e9).astype(np.int64)
    return stamps


def _in_degrees(column: Column) -> Column:
    """The same in degrees where it is in radians."""
    if not _RADIANS.match(column.unit):
        return column
    return replace(column, unit=_RADIANS.sub("deg", column.unit), factor=1 / DEG)


def _scaled(column: Column, values: NDArray, known: Bools) -> tuple[NDArray, Bools]:
    return (values if column.factor == 1 else values * column.factor), known


def _windows(reader: LogReader, rate: float | None) -> Iterator[int]:
    """Starts of the windows that hold anything; on a grid of all, which has rows in each."""
    start, end = reader.start_ns or 0, reader.end_ns or 0
    if rate:
        yield from range(start, end + 1, WINDOW)
        return
    done = -1
    for first, last in sorted((c.start_ns, c.end_ns) for c in reader.contents.chunks if c.indexes):
        begin = max(done + 1, (first - start) // WINDOW)
        done = max(done, (last - start) // WINDOW)
        yield from (start + k * WINDOW for k in range(begin, done + 1))


def _check_span(reader: LogReader, rate: float | None) -> None:
    """Raise LogReadError where time jumps, so that most rows or windows would be empty."""
    start, end = reader.start_ns or 0, reader.end_ns or 0
    messages = sum(channel.count for channel in reader.channels)
    rows = (end - start) * 1e-9 * (rate or SLOWEST)
    if rows <= max(FEW_ROWS, EMPTIEST * messages):
        return
    chunks = sorted((c.start_ns, c.end_ns) for c in reader.contents.chunks if c.indexes)
    last, jump = start, (0, start)
    for first, behind in chunks:
        jump = max(jump, (first - last, last))
        last = max(last, behind)
    days, at = jump[0] / 86400e9, np.datetime64(jump[1], "ns")
    raise LogReadError(
        f"{reader.path}: its clock jumps by {days:.1f} days after {at} UTC: {rows:.0f} rows for "
        f"{messages} messages; put the clock right, or choose topics without the jump"
    )


def _columns(reader: LogReader, topics: Sequence[str], roles: Sequence[str]) -> list[Column]:
    """Fields with any value, one topic in memory at a time."""
    there = {channel.topic for channel in reader.channels if channel.count}
    units = {channel.topic: channel.metadata for channel in reader.channels}
    for topic in topics:
        if topic not in there:
            raise ConfigError(f"{reader.path}: no topic '{topic}'. {near(topic, there)}")
    by_role: dict[str, set[str]] = {}
    for role in roles:
        if role not in SIGNALS:
            raise ConfigError(f"'{role}' is no role. {near(role, SIGNALS)}")
        section = SECTIONS[role.split(".")[0]]
        by_role.setdefault(section.topic, set()).add(SIGNALS[role].field)
    everything = {topic for topic in there if not is_for_viewers(topic)}
    chosen = sorted({*topics, *by_role} if topics or roles else everything)
    found = []
    for topic in (topic for topic in chosen if topic in there):
        table, is_whole = reader.read([topic])[topic], topic in topics or not roles
        if table.unread and is_whole:
            reader.losses.append(table.unread)
        for field, values in table.columns.items():
            wanted = is_whole or field in by_role.get(topic, ())
            if not wanted or values.dtype.kind not in "bifu":
                continue
            if values.dtype.kind == "f" and not np.isfinite(values).any():
                continue  # a field that the log does not know
            section_name = _SECTION_OF.get(topic)
            name = f"{section_name}.{field}" if section_name else f"{topic}.{field}"
            unit = SIGNALS[name].unit if name in SIGNALS else units[topic].get(f"unit.{field}", "")
            found.append(Column(name, topic, field, values.dtype, unit))
    lacking = [r for r in roles if r not in {column.name for column in found}]
    if lacking:
        has = [r for r in SIGNALS if SECTIONS[r.split(".")[0]].topic in there]
        raise ConfigError(
            f"{reader.path}: the log does not know {', '.join(lacking)}. {near(lacking[0], has)}"
        )
    return found


def _block(
    reader: LogReader,
    columns: Sequence[Column],
    start: int,
    end: int,
    rate: float | None,
    marks: Stamps | None,
) -> tuple[Stamps, list[tuple[NDArray, Bools]]]:
    """Stamps of one window, and values of each column with where it has any."""
    margin = MARGIN if rate else 0
    fields: dict[str, list[str]] = {}
    for column in columns:
        fields.setdefault(column.topic, []).append(column.field)
    tables = reader.read(fields, fields=fields, start_ns=start - margin, end_ns=end + margin)
    if rate:
        time = _grid(reader.start_ns or 0, start, end, rate)
        if marks is not None:
            time = marks[(marks >= start) & (marks < end)]
        return time, [_on_grid(tables[c.topic], c, time, start) for c in columns]
    keys = {topic: _keys(table.time) for topic, table in tables.items()}
    union = np.unique(np.concatenate(list(keys.values()))) if keys else np.empty(0, _KEY)
    places = {topic: np.searchsorted(union, key) for topic, key in keys.items()}
    block = []
    for column in columns:
        own = tables[column.topic].columns.get(column.field)
        values = np.zeros(len(union), column.dtype)
        known = np.zeros(len(union), np.bool_)
        if own is not None and len(own):
            values[places[column.topic]] = own
            known[places[column.topic]] = True
        block.append((values, known))
    return union["time"].copy(), block


def _grid(origin: int, start: int, end: int, rate: float) -> Stamps:
    """Stamps of a grid from `origin` on in [start, end)."""
    first = -(-(start - origin) * rate // 1e9)
    last = -(-(end - origin) * rate // 1e9)
    time: Stamps = origin + np.round(np.arange(first, last) / rate * 1e9).astype(np.int64)
    return time


_KEY = np.dtype([("time", np.int64), ("again", np.int64)])


def _keys(time: Stamps) -> NDArray:
    """Stamps with a count of how often each was there before: two messages may share one."""
    keys = np.zeros(len(time), _KEY)
    keys["time"] = np.sort(time)
    new = np.concatenate([[True], np.diff(keys["time"]) != 0])[: len(time)]
    place = np.arange(len(time))
    keys["again"] = place - np.maximum.accumulate(np.where(new, place, 0))
    return keys


def _on_grid(table: Table, column: Column, time: Stamps, start: int) -> tuple[NDArray, Bools]:
    values = table.columns.get(column.field)
    if values is None or not len(table):
        return np.zeros(len(time), column.dtype), np.zeros(len(time), np.bool_)
    role = SIGNALS.get(column.name)
    kind = "analog" if column.dtype.kind == "f" else "hold"
    signal = role or Signal(column.name, column.field, "", kind)  # type: ignore[arg-type]
    own: Floats = np.multiply(table.time - start, 1e-9)
    at: Floats = np.multiply(time - start, 1e-9)
    result = resample(own, values.astype(np.float64), at, signal)
    if signal.kind == "angle":
        result = (result + np.pi) % (2 * np.pi) - np.pi
    known = np.isfinite(result)
    return np.where(known, result, 0).astype(column.dtype), known
