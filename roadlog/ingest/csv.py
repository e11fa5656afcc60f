"""Text tables: comma, semicolon or tab separated, decimal points or commas, any time column."""

from __future__ import annotations

import csv
from collections.abc import Collection
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.ingest import times
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Clock, Profile
from roadlog.types import Floats, Stamps

SUFFIXES = (".csv", ".tsv", ".txt", ".dat")
BLOCK = 20_000  # rows parsed at a time: bounds the memory of text beside that of numbers
_BLANKS = frozenset(("", "-", "na", "n/a", "null", "none", "nan"))


def recognizes(path: Path) -> bool:
    """Whether the file looks like a text table: a text suffix and a header of several names."""
    return path.is_file() and path.suffix.lower() in SUFFIXES and len(header(path)) > 1


def header(path: Path) -> list[str]:
    """Column names, stripped. Raises LogReadError when there is no text in the file."""
    with _open(path) as file:
        line = file.readline()
    if not line.strip():
        raise LogReadError(f"{path}: is empty; nothing to ingest")
    return [name.strip() for name in next(csv.reader([line], delimiter=_delimiter(line)))]


def read(path: Path, profile: Profile) -> Recording:
    """The columns that the profile reads; of the others only the names (as empty columns).

    Raises LogReadError naming the row, ConfigError when there is no time column.
    """
    names = header(path)
    if len(set(names)) < len(names):
        twice = sorted({name for name in names if names.count(name) > 1})
        raise LogReadError(f"{path}: column {', '.join(twice)} is there twice; rename one")
    clock = _time_column(names, profile.clock, path)
    columns, losses = _columns(path, names, {clock, *profile.names})
    if not len(columns[clock]):
        raise LogReadError(f"{path}: has a header but no rows")
    time, keep = _stamps(columns.pop(clock), profile.clock.unit, path)
    if not keep.all():
        losses.append(f"{path.name}: {int((~keep).sum())} rows without a time left out")
    values = {
        n: columns[n][keep] if n in columns else _Absent(len(time)) for n in names if n != clock
    }
    return Recording((Frame("", path.name, time, values),), tuple(losses))


def _Absent(size: int) -> NDArray:
    """A column that nobody asked for: its name counts, its values take no memory."""
    return np.broadcast_to(np.float64("nan"), size)


def _open(path: Path) -> TextIO:
    try:
        with path.open("rb") as file:
            head = file.read(4)
        encoding = "utf-16" if head[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
        # a stray byte of another encoding may stand in a unit or a remark, not in a number
        return path.open(encoding=encoding, errors="replace", newline="")
    except OSError as error:
        raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error


def _delimiter(line: str) -> str:
    return max(("\t", ";", ","), key=line.count)


def _time_column(names: list[str], clock: Clock, path: Path) -> str:
    if clock.column:
        if clock.column not in names:
            raise ConfigError(
                f"{path}: no time column '{clock.column}'. {near(clock.column, names)}"
            )
        return clock.column
    folded = {name.lower(): name for name in reversed(names)}
    for name in times.TIME_NAMES:
        if name in folded:
            return folded[name]
    raise ConfigError(
        f'{path}: which column is the time? Say [time] column = "..." in the profile. '
        + near("time", names)
    )


def _columns(path: Path, names: list[str], wanted: Collection[str]) -> tuple[dict, list[str]]:
    """Wanted columns as numbers where every value is one, else as text."""
    picks = [(k, name) for k, name in enumerate(names) if name in wanted]
    blocks: dict[str, list[NDArray]] = {name: [] for _, name in picks}
    short = 0
    with _open(path) as file:
        delimiter = _delimiter(file.readline())
        rows: list[list[str]] = []
        try:
            for row in csv.reader(file, delimiter=delimiter):
                if len(row) == len(names):
                    rows.append(row)
                elif len(row) == len(names) + 1 and not row[-1].strip():
                    rows.append(row[:-1])  # a delimiter at the end of the line
                elif row:
                    short += 1
                if len(rows) == BLOCK:
                    _take(rows, picks, blocks, delimiter)
            _take(rows, picks, blocks, delimiter)
        except csv.Error as error:
            raise LogReadError(f"{path}: is no text table: {error}") from error
    losses = [f"{path.name}: {short} rows without {len(names)} fields left out"] if short else []
    return {name: _joined(parts) for name, parts in blocks.items()}, losses


def _take(
    rows: list[list[str]],
    picks: list[tuple[int, str]],
    blocks: dict[str, list[NDArray]],
    delimiter: str,
) -> None:
    for k, name in picks:
        blocks[name].append(_parsed([row[k] for row in rows], delimiter != ","))
    rows.clear()


def _parsed(texts: list[str], commas: bool) -> NDArray:
    try:
        return np.array(texts, np.float64)
    except ValueError:
        pass
    if commas:
        texts = [text.replace(",", ".") for text in texts]
    try:
        return np.array(["nan" if t.strip().lower() in _BLANKS else t for t in texts], np.float64)
    except ValueError:
        return np.array(texts, object)


def _joined(parts: list[NDArray]) -> NDArray:
    if any(part.dtype == object for part in parts):
        parts = [part.astype(object) for part in parts]
    return np.concatenate(parts) if parts else np.empty(0)


def _stamps(values: NDArray, unit: str, path: Path) -> tuple[Stamps, NDArray[np.bool_]]:
    """ns of each row with a time, and which rows have one."""
    if values.dtype == object:
        keep = np.array([bool(str(value).strip()) for value in values])
        return times.from_texts([str(v) for v in values[keep]], str(path)), keep
    numbers: Floats = values.astype(np.float64)
    keep = np.isfinite(numbers)
    if not keep.any():
        raise LogReadError(f"{path}: the time column holds no number")
    try:
        return times.from_numbers(numbers[keep], unit or times.guess_unit(numbers[keep])), keep
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
