"""Databases of CAN messages (DBC, ARXML, KCD, SYM, by cantools), and which message a frame is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roadlog.errors import LogReadError, MissingExtraError, near
from roadlog.ingest.formats import database_xml, dbc_text
from roadlog.ingest.formats.parsers import guarded, readable

EXTENDED = 1 << 31  # marks a 29-bit identifier, as in a DBC file
FURTHEST = 8 * 65536  # bits; a message of a bus, put together of many frames, is shorter
ANY_SOURCE = 0xFE  # SAE J1939-81: the null address, with which databases write "of any sender"
DESTINED = 240  # SAE J1939-21: below this PDU format the next byte is the receiver's address
_BITS = re.compile(rb"(?<=:)\s*(\d{1,30})\s*\|\s*(\d{1,30})\s*(?=@)")  # of a signal: start|length
_PAGES = re.compile(rb"^SG_MUL_VAL_[^\n;]*", re.MULTILINE)
_RANGE = re.compile(rb"(\d{1,30})\s*-\s*(\d{1,30})")
MOST_PAGES = 1 << 20
_PER_BUS = re.compile(r"(\w+)=(.+)")


@dataclass(frozen=True)
class Known:
    """One message of a database.

    message: cantools' own. file: of the database. bus: the one that it is for, empty for all.
    mended: what had to be put right in the file.
    """

    message: Any
    file: str
    bus: str = ""
    mended: str = ""

    @property
    def identifier(self) -> int:
        """With bit 31 where it has 29 bits."""
        return self.message.frame_id | (EXTENDED if self.message.is_extended_frame else 0)

    @property
    def by_pgn(self) -> bool:
        """Whether it means a parameter group of any sender, as in SAE J1939 and NMEA 2000."""
        if not self.message.is_extended_frame:
            return False
        anyone = self.message.frame_id & 0xFF == ANY_SOURCE
        return anyone or self.message.protocol == "j1939"

    def like(self, other: Known) -> bool:
        """Whether another database says the same."""
        mine, others = (
            [
                (s.name, s.start, s.length, s.byte_order, s.is_signed, s.scale, s.offset)
                for s in known.message.signals
            ]
            for known in (self, other)
        )
        return self.message.name == other.message.name and mine == others


def load(paths: Sequence[Path]) -> list[Known]:
    """Messages of DBC (or ARXML, KCD, SYM) files; `BUS=FILE` is for that bus alone.

    Raises LogReadError, MissingExtraError.
    """
    if not paths:
        return []
    try:
        import cantools
    except ImportError:
        raise MissingExtraError("a DBC file", "can") from None
    found = []
    for given in paths:
        bus, path = "", given
        if not given.is_file() and (match := _PER_BUS.fullmatch(str(given))):
            bus, path = match[1], Path(match[2])
        if not path.is_file():
            siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
            raise LogReadError(f"{path}: no such DBC file. {near(path.name, siblings)}")
        with readable(path):
            _bounded(path)
        with guarded(path, "a CAN database"):
            database, mended = _opened(cantools, path)
        found += [Known(message, path.name, bus, mended) for message in database.messages]
    return found


def _opened(cantools: Any, path: Path) -> tuple[Any, str]:
    """The database, and what had to be put right in it."""
    kind = path.suffix.lower().removeprefix(".")
    if kind in database_xml.KINDS:
        text = database_xml.as_labels(path, kind)
        return cantools.database.load_string(text, kind, strict=False), ""
    try:
        return cantools.database.load_file(path, strict=False), ""
    except cantools.database.UnsupportedDatabaseFormatError:
        if kind != "dbc":
            raise
        text, said = dbc_text.mended(path.read_text("cp1252", "replace"))
        try:
            return cantools.database.load_string(text, "dbc", strict=False), "; ".join(said)
        except cantools.database.UnsupportedDatabaseFormatError:
            pass
        raise


def _bounded(path: Path) -> None:
    """Refuse bits far outside of any message, and pages without end: cantools lists them all."""
    text = path.read_bytes()
    for pages in _PAGES.finditer(text):
        for low, high in _RANGE.findall(pages[0]):
            if int(high) - int(low) > MOST_PAGES:
                said = f"{int(low)}-{int(high)}"
                raise LogReadError(f"{path}: cannot be read as a CAN database: pages {said}")
    for match in _BITS.finditer(text):
        if int(match[1]) > FURTHEST or int(match[2]) > FURTHEST:
            said = match[0].decode("ascii")
            raise LogReadError(f"{path}: cannot be read as a CAN database: a signal at bits {said}")


def bus_name(channel: object) -> str:
    """`CAN1` for channel 1; names such as `can0` stay."""
    text = str(channel)
    return f"CAN{text}" if text.isdigit() else text


def group_of(identifier: int) -> int:
    """Parameter group number of a 29-bit identifier (SAE J1939-21)."""
    group = identifier >> 8 & 0x3FFFF
    return group if identifier >> 16 & 0xFF >= DESTINED else group & 0x3FF00


class Messages:
    """Which message a frame is: by identifier, else by parameter group; of its own bus first."""

    def __init__(self, known: Sequence[Known]) -> None:
        self.buses = {one.bus for one in known if one.bus}
        self.rivals: dict[int, tuple[Known, Known]] = {}
        self._exact: dict[tuple[str, int], Known] = {}
        self._groups: dict[tuple[str, int], Known] = {}
        for one in known:
            key = _folded(one.bus), one.identifier
            first = self._exact.setdefault(key, one)
            if first is not one and not first.like(one):
                self.rivals.setdefault(one.identifier, (first, one))
            if one.by_pgn:
                self._groups.setdefault((key[0], group_of(one.identifier)), one)

    def __bool__(self) -> bool:
        return bool(self._exact)

    @property
    def has_groups(self) -> bool:
        """Whether there are messages of parameter groups."""
        return bool(self._groups)

    def find(self, bus: str, identifier: int) -> tuple[Known, int | None] | None:
        """The message and, where it is one of many senders, the source address."""
        source = identifier & 0xFF
        for place in (_folded(bus), ""):
            if known := self._exact.get((place, identifier)):
                return known, (source if known.by_pgn else None)
        if identifier & EXTENDED:
            for place in (_folded(bus), ""):
                if known := self._groups.get((place, group_of(identifier))):
                    return known, source
        return None

    def missing(self, buses: Sequence[str]) -> list[str]:
        """Buses that a database was given for and that are not among these."""
        there = {_folded(bus) for bus in buses}
        return sorted(bus for bus in self.buses if _folded(bus) not in there)


def _folded(bus: str) -> str:
    return bus_name(bus).lower()
