"""Text tables: comma, semicolon or tab separated, decimal points or commas, any time column."""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest.formats import times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.csv_layout import NOTHING, TextLayout, fields_of, is_number, layout
from roadlog.ingest.formats.csv_preamble import Begun, begun
from roadlog.ingest.formats.row_clock import RowClock
from roadlog.ingest.formats.text import decoded
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.spool import Spool

READ_SIZE = 1 << 24  # bytes parsed at a time: bounds the memory of text beside that of numbers
WORD = 64  # bytes of a cell that is no number; no date is longer
SHORTEST_ROW = 2  # bytes
SAMPLE = 1 << 18  # bytes of the first rows
_DATE = re.compile(
    r"(?:(?:gps|utc|local|log)[ _]?)?(?:date|datum|fecha|data|jour)(?:[ _]?\(?utc\)?)?",
    re.IGNORECASE,
)


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


def sample(path: Path) -> dict[str, NDArray]:
    """The first rows: numbers, or texts where a column holds more of these."""
    found = layout(path)
    with path.open("rb") as file:
        file.seek(found.start)
        head = file.read(SAMPLE)
    text = head.decode(
        found.encoding if found.encoding.startswith("utf-16") else "latin-1", "replace"
    )
    lines = text.splitlines()[: -1 if len(head) == SAMPLE else None]
    rows = [fields_of(line, found.delimiter) for line in lines if line.strip()]
    rows = [row[: len(found.names)] for row in rows if len(row) >= len(found.names)]
    columns: dict[str, NDArray] = {}
    for name, cells in zip(found.names, zip(*rows, strict=True), strict=bool(rows)):
        numbers = [float(c.replace(",", ".")) if is_number(c) else np.nan for c in cells]
        few = 2 * np.isfinite(numbers).sum() < sum(bool(cell) for cell in cells)
        columns[name] = np.array(cells, object) if few else np.array(numbers)
    return columns


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """The columns that the profile reads; of the others only the names (as empty columns).

    Raises LogReadError naming the row, ConfigError when there is no time column.
    """
    del dbc
    found = layout(path)
    for name in profile.names.intersection(found.names):
        if f"{name} (2)" in found.names:
            raise LogReadError(f"{path}: column {name} is there twice; rename one")
    if found.headless and profile.clock.column not in found.names:
        raise ConfigError(
            f"{path}: its first line holds numbers; put the columns' names there, or call them "
            f"'{found.names[0]}' to '{found.names[-1]}' in the profile ([time] column first)"
        )
    clock = times.time_column(found.names, profile.clock.column, str(path))
    wanted = [n for n in found.names if n != clock and profile.reads(n)]
    unit = times.unit_stated(profile.clock.unit, found.units.get(clock, ""), times.bracketed(clock))
    zone, european = profile.clock.zone, found.delimiter == ";"
    day = _date_beside(path, found, clock, zone)
    head = Begun() if day else begun(found.above, found.delimiter).in_zone(zone, path.name)
    return rows(path, found, clock, wanted, RowClock(unit, zone, day, european, head))


def _date_beside(path: Path, found: TextLayout, clock: str, zone: str) -> int:
    """ns of the midnight that another column than that of the time states; 0 for none."""
    column = next((n for n in found.names if n != clock and _DATE.fullmatch(n.strip())), None)
    dates = [] if column is None else sample(path)[column].tolist()
    texts = [f"{d:.0f}" if isinstance(d, float) else str(d) for d in dates]
    texts = [f"{t[:4]}-{t[4:6]}-{t[6:]}" if len(t) == 8 and t.isdigit() else t for t in texts]
    moments = [f"{text} 00:00:00" for text in texts if text]
    day_first, _ = times.day_before_month(moments, found.delimiter == ";")
    midnight = next(filter(None, (times.of_text(m, day_first) for m in moments)), 0)
    return midnight - (times.local(midnight, zone, path.name)[0] if midnight else 0)


def rows(
    path: Path, found: TextLayout, clock: str, wanted: Sequence[str], stamps: RowClock
) -> Recording:
    """The rows of a table of a known layout. Raises LogReadError naming the row."""
    reading = _Reading(path, found, [clock, *wanted], stamps)
    with path.open("rb") as file:
        file.seek(found.start)
        for block in _blocks(file, found.encoding):
            reading.take(block)
    if not len(reading.clock):
        reading.nothing()
    time, notes, losses = reading.clock.stamps(path.name)
    columns = {
        n: reading.column(n) if n in wanted else absent(len(time))
        for n in found.names
        if n != clock
    }
    if reading.headers:
        notes.append(f"{path.name}: {reading.headers} rows are the names again, left out")
    frame = Frame("", path.name, time, columns, found.units)
    return Recording((frame,), (*reading.losses(), *losses), tuple(notes))


class _Reading:
    """Columns of one file as its blocks come."""

    def __init__(self, path: Path, found: TextLayout, wanted: list[str], clock: RowClock) -> None:
        self.path = path
        self.layout = found
        self.wanted = wanted
        self.clock = clock
        self.columns = [Spool(np.float64) for _ in wanted[1:]]
        self.picks = np.full(len(found.names), -1)
        for place, name in enumerate(wanted):
            self.picks[found.names.index(name)] = place
        self.rows = self.bad = self.odd = self.timeless = 0
        self.numbers = [0] * len(wanted)
        self.texts: dict[int, tuple[int, str, int]] = {}  # place -> row, text, count
        self.headers = 0  # rows of the names again: the logger began anew
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
                rows = max(1024, int(min(len(data), READ_SIZE) // (SHORTEST_ROW * len(self.picks))))
                self.room = numbers.room(min(rows, READ_SIZE // 64), len(self.wanted))
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
        if len(self.rest) > READ_SIZE:
            raise LogReadError(f"{self.path}: is no text table: a quote or line does not end")

    def _keep(self, data: NDArray, rows: int) -> None:
        from roadlog.ingest.formats import numbers

        kinds, values, integers, spans = (part[:rows] for part in self.room)
        if not rows:
            return

        def text(row: int, place: int) -> str:
            start, end = spans[row, place]
            return decoded(data[start : min(end, start + WORD)].tobytes()).strip().strip('"')

        time = kinds[:, 0]
        if 2 * (time == numbers.TEXT).sum() > (time != numbers.BLANK).sum():
            raw = np.array([text(row, 0) for row in range(rows)], object)
        elif (time == numbers.INTEGER).all():
            raw = integers
        else:
            raw = values[:, 0]
        if (time == numbers.BLANK).all():
            keep = np.zeros(rows, np.bool_)
        else:
            keep = self.clock.add(raw, str(self.path))
        strange = np.flatnonzero(~keep & (time == numbers.TEXT)).tolist()
        again = {row for row in strange if text(row, 0) == self.wanted[0]}
        self.headers += len(again)
        self.timeless += int(rows - keep.sum()) - len(again)
        for place, spool in enumerate(self.columns, 1):
            column = values[:, place]
            odd = np.flatnonzero(kinds[:, place] == numbers.TEXT)
            self.numbers[place] += int((kinds[:, place] != numbers.BLANK).sum()) - len(odd)
            for row in odd.tolist():
                word = text(row, place)
                if word.lower() not in NOTHING and row not in again:
                    first = self.texts.get(place, (self.rows + row + 1, word, 0))
                    self.texts[place] = (*first[:2], first[2] + 1)
            spool.append(column if keep.all() else column[keep])
        self.rows += rows

    def column(self, name: str) -> NDArray:
        """The values; texts where there is no number at all."""
        place = self.wanted.index(name)
        if place in self.texts and not self.numbers[place]:
            return np.full(len(self.clock), self.texts[place][1], object)
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


def _blocks(file: IO[bytes], encoding: str) -> Iterator[bytes]:
    """The rest of the file in blocks of ASCII-compatible bytes; the last ends with a line feed."""
    decoder = (
        codecs.getincrementaldecoder(encoding)("replace") if encoding.startswith("utf-16") else None
    )
    end = b"\n"
    while raw := file.read(READ_SIZE):
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
    sample=sample,
)
