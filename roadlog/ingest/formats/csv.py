"""Text tables: comma, semicolon or tab separated, decimal points or commas, any time column."""

from __future__ import annotations

import codecs
import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError
from roadlog.ingest.formats import times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.spool import Spool

BLOCK = 1 << 24  # bytes parsed at a time: bounds the memory of text beside that of numbers
HEAD = 1 << 16  # bytes in which the header and the first row are
WORD = 64  # bytes of a cell that is no number; no date is longer
SHORTEST_ROW = 2  # bytes
PREAMBLE = ("#", "%", "//", "sep=")  # comments, and Excel's word on the delimiter
_BLANKS = frozenset(("", "-", "na", "n/a", "null", "none", "nan", "inf", "-inf"))


@dataclass(frozen=True)
class Layout:
    """How a text table is written.

    encoding: of the text. delimiter: between fields. names, units: of the columns, units where a
    row under the names has them. start: bytes before the first row of numbers.
    """

    encoding: str
    delimiter: str
    names: list[str]
    units: dict[str, str]
    start: int


def recognizes(path: Path) -> bool:
    """Whether the file looks like a text table: text, and a first line of several names."""
    if not path.is_file():
        return False
    try:
        return len(layout(path).names) > 1
    except LogReadError:
        return False


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Column names."""
    del dbc
    return set(layout(path).names)


def layout(path: Path) -> Layout:
    """Encoding, delimiter and names. Raises LogReadError when it is no text table."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error
    encoding = _encoding(head)
    if not encoding.startswith("utf-16"):
        head = head.rstrip(b"\0")  # a block that a logger did not come to fill
        if b"\0" in head:
            raise LogReadError(f"{path}: is no text table")
    lines = _lines(head, encoding)
    start = 0
    delimiter = ""
    while lines and (not lines[0][0].strip() or lines[0][0].lstrip().startswith(PREAMBLE)):
        line, size = lines.pop(0)
        start += size
        if line.startswith("sep="):
            delimiter = line.strip()[4:5]
    if not lines:
        raise LogReadError(f"{path}: is empty; nothing to ingest")
    if start + lines[0][1] >= HEAD:
        raise LogReadError(f"{path}: is no text table: its first line does not end")
    delimiter = delimiter or max(("\t", ";", ","), key=lines[0][0].count)
    header = [name.strip() for name in _fields(lines[0][0], delimiter)]
    if header and not header[-1]:
        header.pop()  # a delimiter at the end of the line
    start += lines[0][1]
    units: dict[str, str] = {}
    if len(lines) > 2 and lines[1][0].strip() and not any(map(str.isdigit, lines[1][0])):
        below = (unit.strip(" []()") for unit in _fields(lines[1][0], delimiter))
        units = dict(zip(header, below, strict=False))
        start += lines[1][1]
    return Layout(encoding, delimiter, header, units, start)


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """The columns that the profile reads; of the others only the names (as empty columns).

    Raises LogReadError naming the row, ConfigError when there is no time column.
    """
    del dbc
    found = layout(path)
    if len(set(found.names)) < len(found.names):
        twice = sorted({name for name in found.names if name and found.names.count(name) > 1})
        if twice:
            raise LogReadError(f"{path}: column {', '.join(twice)} is there twice; rename one")
    if all(_is_number(name) for name in found.names):
        raise LogReadError(f"{path}: its first line holds numbers; put the columns' names there")
    clock = times.time_column(found.names, profile.clock.column, str(path))
    wanted = [clock, *(n for n in found.names if n != clock and profile.reads(n))]
    reading = _Reading(path, found, wanted, profile.clock.unit)
    with path.open("rb") as file:
        file.seek(found.start)
        for block in _blocks(file, found.encoding):
            reading.take(block)
    time = reading.time.column()
    if not len(time):
        reading.nothing()
    columns = {
        n: reading.column(n) if n in wanted else absent(len(time))
        for n in found.names
        if n != clock
    }
    return Recording((Frame("", path.name, time, columns, found.units),), tuple(reading.losses()))


class _Reading:
    """Columns of one file as its blocks come."""

    def __init__(self, path: Path, found: Layout, wanted: list[str], unit: str) -> None:
        self.path = path
        self.layout = found
        self.wanted = wanted
        self.unit = unit
        self.time = Spool(np.int64)
        self.columns = [Spool(np.float64) for _ in wanted[1:]]
        self.picks = np.full(len(found.names), -1)
        for place, name in enumerate(wanted):
            self.picks[found.names.index(name)] = place
        self.rows = self.bad = self.odd = self.timeless = 0
        self.numbers = [0] * len(wanted)
        self.texts: dict[int, tuple[int, str, int]] = {}  # place -> row, text, count
        self.rest = b""
        self.room: tuple[NDArray, ...] = ()

    def take(self, block: bytes) -> None:
        """Parse a block; what is left of it waits for the next one."""
        from roadlog.ingest.formats import numbers

        data = np.frombuffer(self.rest + block, np.uint8)
        comma = self.layout.delimiter != ","
        position = 0
        while position < len(data):
            if not self.room:
                rows = max(1024, int(min(len(data), BLOCK) // (SHORTEST_ROW * len(self.picks))))
                self.room = numbers.room(min(rows, BLOCK // 64), len(self.wanted))
            here = data[position:]
            rows, used, bad, odd = numbers.parse(
                here, ord(self.layout.delimiter), comma, len(self.picks), self.picks, *self.room
            )
            self.odd = self.odd if self.bad else odd
            self.bad += bad
            self._keep(here, rows)
            if not used:
                break
            position += used
        self.rest = data[position:].tobytes()
        if len(self.rest) > BLOCK:
            raise LogReadError(f"{self.path}: is no text table: a quote or line does not end")

    def _keep(self, data: NDArray, rows: int) -> None:
        from roadlog.ingest.formats import numbers

        kinds, values, integers, spans = (part[:rows] for part in self.room)
        if not rows:
            return

        def text(row: int, place: int) -> str:
            start, end = spans[row, place]
            return _decoded(data[start : min(end, start + WORD)].tobytes()).strip().strip('"')

        time = kinds[:, 0]
        if 2 * (time == numbers.TEXT).sum() > (time != numbers.BLANK).sum():
            raw = np.array([text(row, 0) for row in range(rows)], object)
        elif (time == numbers.INTEGER).all():
            raw = integers
        else:
            raw = values[:, 0]
        if (time == numbers.BLANK).all():
            keep = np.zeros(rows, np.bool_)
            stamps = np.empty(0, np.int64)
        else:
            if not self.unit and raw.dtype != object:
                self.unit = times.unit_of(raw, str(self.path))
            stamps, keep = times.stamps(raw, self.unit, str(self.path), self.rows)
        self.time.append(stamps)
        self.timeless += int(rows - keep.sum())
        for place, spool in enumerate(self.columns, 1):
            column = values[:, place]
            odd = np.flatnonzero(kinds[:, place] == numbers.TEXT)
            self.numbers[place] += int((kinds[:, place] != numbers.BLANK).sum()) - len(odd)
            for row in odd.tolist():
                word = text(row, place)
                if word.lower() not in _BLANKS:
                    first = self.texts.get(place, (self.rows + row + 1, word, 0))
                    self.texts[place] = (*first[:2], first[2] + 1)
            spool.append(column if keep.all() else column[keep])
        self.rows += rows

    def column(self, name: str) -> NDArray:
        """The values; texts where there is no number at all."""
        place = self.wanted.index(name)
        if place in self.texts and not self.numbers[place]:
            return np.full(len(self.time), self.texts[place][1], object)
        return self.columns[place - 1].column()

    def losses(self) -> list[str]:
        """What was left out."""
        name, width = self.path.name, len(self.picks)
        if self.bad > self.rows:
            raise LogReadError(f"{self.path}: {self._misfit()}")
        found = [f"{name}: {self.bad} rows without {width} fields left out"] if self.bad else []
        if self.rest.strip():
            found.append(f"{name}: cut off in the last row")
        if self.timeless:
            found.append(f"{name}: {self.timeless} rows without a time left out")
        found += [
            f"{name}: {self.wanted[place]}: {count} values are no numbers (row {row}: '{word}')"
            for place, (row, word, count) in self.texts.items()
            if self.numbers[place]
        ]
        return found

    def nothing(self) -> None:
        """Say why there is no row. Raises LogReadError."""
        if self.bad:
            raise LogReadError(f"{self.path}: {self._misfit()}")
        if self.timeless:
            raise LogReadError(f"{self.path}: the time column holds no number")
        if self.rest.strip():
            raise LogReadError(f"{self.path}: has no complete row: a quote that does not end?")
        raise LogReadError(f"{self.path}: has a header but no rows")

    def _misfit(self) -> str:
        width = len(self.picks)
        why = (
            "; decimal commas between commas? Export with semicolons, or with points"
            if self.layout.delimiter == "," and self.odd > width
            else ""
        )
        return f"{self.bad} rows have not the {width} fields of the header but {self.odd}{why}"


def _encoding(head: bytes) -> str:
    """By the mark at the start, or by where the zeros of ASCII characters are."""
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if head.startswith(codecs.BOM_UTF16_LE):
        return "utf-16-le"
    if head.startswith(codecs.BOM_UTF16_BE):
        return "utf-16-be"
    pairs = np.frombuffer(head[: len(head) // 2 * 2], np.uint8).reshape(-1, 2)
    zeros = (pairs == 0).mean(axis=0) if len(pairs) else np.zeros(2)
    if zeros[1] > 0.5 and not zeros[0]:
        return "utf-16-le"
    if zeros[0] > 0.5 and not zeros[1]:
        return "utf-16-be"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:  # not a character that the end of the head cuts
            return "cp1252"
    return "utf-8"


def _lines(head: bytes, encoding: str) -> list[tuple[str, int]]:
    """The first lines and their sizes in bytes; in single-byte text each decoded as it can be."""
    if not encoding.startswith("utf-16"):
        return [(_decoded(line), len(line)) for line in head.splitlines(keepends=True)]
    text = head[: len(head) // 2 * 2].decode(encoding, "replace")
    lines = [f"{line}\n" for line in text.split("\n")]
    return [(line.removeprefix("\ufeff"), len(line.encode(encoding))) for line in lines]


def _decoded(line: bytes) -> str:
    """UTF-8, or where it is not (a unit written by another program), Windows-1252."""
    try:
        return line.decode("utf-8-sig")
    except UnicodeDecodeError:
        return line.decode("cp1252", "replace")


def _fields(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line.strip("\r\n")], delimiter=delimiter), [])


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _blocks(file: IO[bytes], encoding: str) -> Iterator[bytes]:
    """The rest of the file in blocks of ASCII-compatible bytes; the last ends with a line feed."""
    decoder = (
        codecs.getincrementaldecoder(encoding)("replace") if encoding.startswith("utf-16") else None
    )
    end = b"\n"
    while raw := file.read(BLOCK):
        block = decoder.decode(raw).encode() if decoder else raw
        end = block[-1:] or end
        yield block
    if end != b"\n":
        yield b"\n"


FORMAT = Format(
    name="csv",
    about="text tables",
    recognizes=recognizes,
    read=read,
    names=names,
    is_table=True,
)
