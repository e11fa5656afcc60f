"""Long tables: a row for each value, with its time, name, unit, often a position (Car Scanner).

Car Scanner: `SECONDS` of the day, `PID` as the name, `VALUE`, `UNITS`, `LATITUDE`, `LONGTITUDE` (so
spelled) repeated in every row; about 5 values a second from the bus, the phone's speed and
altitude at 1 Hz.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest.formats import times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.csv_layout import TextLayout, layout
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile

TIME = ("seconds", "time", "timestamp", "t", "datetime", "time_ms", "time_s")
NAME = ("pid", "name", "signal", "sensor", "parameter", "channel", "variable", "key", "metric")
VALUE = ("value", "values", "val")
UNIT = ("units", "unit")
HEAD = 1 << 18  # bytes of the first rows, which tell the names
STILL = 1_000_000_000  # ns
POSITION = ("latitude", "longitude", "longtitude")


def _column(names: list[str], among: tuple[str, ...]) -> int:
    """Where the first name of a kind stands; -1 for nowhere."""
    return next((k for k, name in enumerate(names) if name.strip().lower() in among), -1)


def recognizes(path: Path) -> bool:
    """Whether a text table has a time, a name and a value in each row."""
    try:
        names = layout(path).names
    except (LogReadError, ConfigError):
        return False
    return min(_column(names, among) for among in (TIME, NAME, VALUE)) >= 0


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Those of the first rows, as `NAME (unit)`, and of the positions; none of another table."""
    del dbc
    if not recognizes(path):
        return set()
    found = layout(path)
    with path.open("rb") as file:
        file.seek(found.start)
        lines = file.read(HEAD).decode(found.encoding, "replace").splitlines()[:-1]
    name, unit = (_column(found.names, k) for k in (NAME, UNIT))
    rows = [r for r in csv.reader(lines, delimiter=found.delimiter) if len(r) > max(name, unit)]
    position = [n for n in found.names if n.lower() in POSITION]
    return {_named(row, name, unit) for row in rows} | set(position)


def _named(row: Sequence[str], name: int, unit: int) -> str:
    return f"{row[name]} ({row[unit]})" if unit >= 0 and row[unit] else row[name]


def read(path: Path, profile: Profile | None = None, dbc: Sequence[Path] = ()) -> Recording:
    """One frame, each name its column `NAME (unit)`, and the positions.

    Raises LogReadError where no row has a time and a number.
    """
    del profile, dbc
    found = layout(path)
    time, name, value, unit = (_column(found.names, k) for k in (TIME, NAME, VALUE, UNIT))
    series: dict[str, tuple[list[str], list[float]]] = {}
    places: list[tuple[str, ...]] = []
    position = [k for k, n in enumerate(found.names) if n.lower() in POSITION]
    bad = 0
    for row in _rows(path, found):
        try:
            number = float(row[value].replace(",", "."))
            key = _named(row, name, unit)
            stamps, values = series.setdefault(key, ([], []))
            moment = row[time]
        except (ValueError, IndexError):
            bad += 1
            continue
        stamps.append(moment)
        values.append(number)
        if position and all(k < len(row) and row[k] for k in position):
            places.append((moment, *(row[k] for k in position)))
    if not series:
        raise LogReadError(f"{path}: no row has a time and a number")
    frames = [_frame(path, s, {key: np.array(v)}) for key, (s, v) in series.items()]
    if places:
        moments, *columns = zip(*places, strict=True)
        names = [found.names[k] for k in position]
        fixes = {n: _numbers(c) for n, c in zip(names, columns, strict=True)}
        frames.append(_renewed(_frame(path, list(moments), fixes)))
    merged = Frame("", path.name, *_merged(frames))
    losses = (f"{path.name}: {bad} rows without a time and a number left out",) if bad else ()
    return Recording((merged,), losses)


def _rows(path: Path, found: TextLayout) -> list[list[str]]:
    text = path.read_bytes()[found.start :].decode(found.encoding, "replace")
    return list(csv.reader(text.splitlines(), delimiter=found.delimiter))


def _numbers(texts: tuple[str, ...]) -> np.ndarray:
    return np.array([float(t.replace(",", ".")) if t else np.nan for t in texts])


def _frame(path: Path, moments: list[str], columns: dict[str, np.ndarray]) -> Frame:
    try:
        raw = np.array([float(m.replace(",", ".")) for m in moments])
        time, keep = times.stamps(raw, "" if raw[0] > 1e8 else "s", str(path))
    except ValueError:
        time, keep = times.from_texts(moments, str(path))
    return Frame("", path.name, time, {c: v[keep] for c, v in columns.items()})


def _renewed(fixes: Frame) -> Frame:
    """The rows that bring a new position; of one that stays, one each STILL."""
    keep: list[int] = []
    last = 0
    rows = np.column_stack(list(fixes.columns.values()))
    for k in range(len(rows)):
        if not keep or (rows[k] != rows[last]).any() or fixes.time[k] - fixes.time[last] >= STILL:
            keep.append(k)
            last = k
    columns = {name: values[keep] for name, values in fixes.columns.items()}
    return replace(fixes, time=fixes.time[keep], columns=columns)


def _merged(frames: list[Frame]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """All on the union of their stamps, NaN where one has no value."""
    time = np.unique(np.concatenate([f.time for f in frames]))
    columns = {}
    for one in frames:
        rows = np.searchsorted(time, one.time)
        for name, values in one.columns.items():
            columns[name] = np.full(len(time), np.nan)
            columns[name][rows] = values
    return time, columns


FORMAT = Format(
    name="long_table",
    about="long tables",
    recognizes=recognizes,
    read=read,
    names=names,
)
