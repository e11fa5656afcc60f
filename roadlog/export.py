"""A log's columns for other tools: CSV and Parquet, in one wide table, minute by minute.

A row is a stamp at which any chosen channel has a message; a cell is empty where its channel has
none there. On a grid (`rate`) every row has every signal, as estimators see it. Signals are named
by their role, so that `roadlog ingest` reads the file back; other columns are `/topic.field`.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from roadlog.csv_text import csv_text
from roadlog.drive import resample
from roadlog.errors import ConfigError, LogReadError, MissingExtraError, near
from roadlog.files import replacing
from roadlog.for_viewers import is_for_viewers
from roadlog.signals import SECTIONS, SIGNALS, Signal
from roadlog.storage import LogReader, Table
from roadlog.types import Bools, Floats, Stamps

SUFFIXES = (".csv", ".parquet")
WINDOW = 60 * 10**9  # ns written at a time
MARGIN = 10 * 10**9  # ns beside a window that interpolation sees
TIME = "time_ns"
EMPTIEST = 100  # rows of a grid per message, beyond which a clock must have jumped
FEW_ROWS = 100_000
SLOWEST = 1.0  # Hz, of messages with their own times

_SECTION_OF = {section.topic: section.name for section in SECTIONS.values()}


@dataclass(frozen=True)
class Column:
    """One column of the output: name, where it comes from, and its type."""

    name: str
    topic: str
    field: str
    dtype: np.dtype


def export(
    log: Path,
    out: Path,
    topics: Sequence[str] = (),
    roles: Sequence[str] = (),
    rate: float | None = None,
) -> tuple[int, list[Column], list[str]]:
    """Write chosen channels of a log to a CSV or Parquet file, whole or not at all.

    topics, roles: what to take, default all channels but those for other viewers. rate: Hz of a
    common grid from the first message; None keeps the messages' own times. Returns rows, columns,
    losses. Raises LogReadError, LogWriteError, ConfigError for a name that is not there.
    """
    if out.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{out}: write to a file that ends in {' or '.join(SUFFIXES)}")
    with LogReader(log) as reader:
        columns = _columns(reader, topics, roles)
        if reader.start_ns is None or reader.end_ns is None or not columns:
            raise LogReadError(f"{log}: nothing to export: the chosen channels hold no numbers")
        _check_span(reader, rate)
        opened = _csv if out.suffix.lower() == ".csv" else _parquet
        rows = 0
        with replacing(out) as file, opened(file, columns) as put:
            for start in _windows(reader, rate):
                end = min(start + WINDOW, reader.end_ns + 1)
                time, block = _block(reader, columns, start, end, rate)
                rows += len(time)
                put(time, block)
        return rows, columns, list(reader.losses)


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
        for field, values in reader.read([topic])[topic].columns.items():
            wanted = topic in topics or not roles or field in by_role.get(topic, ())
            if not wanted or values.dtype.kind not in "bifu":
                continue
            if values.dtype.kind == "f" and not np.isfinite(values).any():
                continue  # a field that the log does not know
            section_name = _SECTION_OF.get(topic)
            name = f"{section_name}.{field}" if section_name else f"{topic}.{field}"
            found.append(Column(name, topic, field, values.dtype))
    lacking = [r for r in roles if r not in {column.name for column in found}]
    if lacking:
        has = [c.name for c in found]
        raise ConfigError(
            f"{reader.path}: the log does not know {', '.join(lacking)}. {near(lacking[0], has)}"
        )
    return found


def _block(
    reader: LogReader, columns: Sequence[Column], start: int, end: int, rate: float | None
) -> tuple[Stamps, list[tuple[NDArray, Bools]]]:
    """Stamps of one window, and values of each column with where it has any."""
    margin = MARGIN if rate else 0
    fields: dict[str, list[str]] = {}
    for column in columns:
        fields.setdefault(column.topic, []).append(column.field)
    tables = reader.read(fields, fields=fields, start_ns=start - margin, end_ns=end + margin)
    if rate:
        origin = reader.start_ns or 0
        first = -(-(start - origin) * rate // 1e9)
        last = -(-(end - origin) * rate // 1e9)
        grid = np.arange(first, last) / rate
        time: Stamps = origin + np.round(grid * 1e9).astype(np.int64)
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


Put = Callable[[Stamps, Sequence[tuple[NDArray, Bools]]], None]


@contextmanager
def _csv(file: IO[bytes], columns: Sequence[Column]) -> Iterator[Put]:
    text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
    text.write(csv_text([TIME, *(c.name for c in columns)], ()).rstrip() + "\n")

    def put(time: Stamps, block: Sequence[tuple[NDArray, Bools]]) -> None:
        cells = [list(map(str, time.tolist()))]
        for values, known in block:
            plain = (values.astype(np.int64) if values.dtype.kind == "b" else values).tolist()
            # repr is the shortest text that gives the same number back
            there = (known & np.isfinite(values)).tolist()
            cells.append([repr(x) if k else "" for x, k in zip(plain, there, strict=True)])
        text.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))

    yield put
    text.flush()
    text.detach()


@contextmanager
def _parquet(file: IO[bytes], columns: Sequence[Column]) -> Iterator[Put]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError("a Parquet file", "table") from None
    fields = [pa.field(TIME, pa.int64())]
    fields += [pa.field(c.name, pa.from_numpy_dtype(c.dtype), metadata=_unit(c)) for c in columns]
    schema = pa.schema(fields)
    with pq.ParquetWriter(file, schema, compression="zstd") as writer:

        def put(time: Stamps, block: Sequence[tuple[NDArray, Bools]]) -> None:
            arrays = [pa.array(time)]
            arrays += [pa.array(values, mask=~known) for values, known in block]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))

        yield put


def _unit(column: Column) -> Mapping[Any, Any] | None:
    signal = SIGNALS.get(column.name)
    return {"unit": signal.unit} if signal else None
