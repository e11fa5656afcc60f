"""NMEA 0183 logs by pynmeagps: RMC, GGA, GNS, VTG, GST, ZDA, HDT of any talker.

Knots, degrees clockwise from north, meters above the geoid, UTC; the date is in RMC and ZDA only,
so that sentences before the first of these take its day, and without any the stamps count from a
midnight. Sums are checked where they are there. Without RMC and VTG the speed is made of the
positions. HDT: heading of two antennas. GST: sd of the position in meters, which is the accuracy
kept (HDOP is none). 1 to 25 Hz; all sentences of one time are one fix.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame, speed_of
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.units import UNITS

HEAD = 4096
SENTENCE = re.compile(
    rb"\$[A-Z]{2}(?:RMC|GGA|GNS|GLL|VTG|GSA|GSV|ZDA|GST|TXT),"
    rb"(?:[^\r\n]*\*[0-9A-Fa-f]{2}|[\dA-Z.,-]*\r?\n)"
)
KNOT = UNITS["kn"][1]
FIELDS = (
    "latitude",
    "longitude",
    "altitude",
    "speed",
    "course",
    "horizontal_accuracy",
    "vertical_accuracy",
    "heading",
)
HALF_DAY = 43_200.0  # s


def recognizes(path: Path) -> bool:
    """Whether its first bytes hold NMEA sentences and no binary."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(HEAD)
    return b"\0" not in head and b"\xb5b" not in head and len(SENTENCE.findall(head)) > 0


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """One row a fix. Raises LogReadError, MissingExtraError."""
    del profile, dbc
    try:
        from pynmeagps import NMEAReader
    except ImportError as error:
        raise MissingExtraError("reading NMEA", "gnss") from error
    fixes = SentenceFixes()
    bad = 0
    with guarded(path, "NMEA 0183"):
        for line in path.read_bytes().splitlines():
            found = line[line.find(b"$") :].strip()
            if not found.startswith(b"$"):
                continue
            try:
                fixes.add(NMEAReader.parse(_summed(found)))
            except Exception:  # a line cut or garbled on its way
                bad += 1
    made = fixes.frame(path.name)
    if made is None:
        raise LogReadError(f"{path}: holds no fix")
    losses = (f"{path.name}: {bad} sentences that are damaged left out",) if bad else ()
    return Recording((made,), losses, tuple(f"{path.name}: {note}" for note in fixes.notes))


def _summed(sentence: bytes) -> bytes:
    """The sentence with its sum, where a logger left that out."""
    if b"*" in sentence:
        return sentence
    return sentence + f"*{reduce(xor, sentence[1:], 0):02X}".encode()


class SentenceFixes:
    """Fixes put together of the sentences of one time."""

    def __init__(self) -> None:
        self.rows: dict[float, dict[str, float]] = {}  # s since the first midnight -> values
        self.midnight: datetime | None = None
        self.day = 0.0
        self.last: float | None = None
        self.now: float | None = None
        self.notes: list[str] = []

    def add(self, message: Any) -> None:
        """Take one parsed sentence."""
        kind = message.msgID
        clock = getattr(message, "time", None)
        if kind in ("RMC", "GGA", "GNS", "GST", "ZDA") and hasattr(clock, "hour"):
            self._at(clock)
        if kind in ("RMC", "ZDA") and self.midnight is None and self.now is not None:
            self._date(message)
        if self.now is None:
            return
        row = self.rows.setdefault(self.now, {})
        if kind == "RMC" and message.status == "A":
            row |= {"speed": _number(message.spd) * KNOT, "course": _number(message.cog)}
            row.setdefault("latitude", _number(message.lat))
            row.setdefault("longitude", _number(message.lon))
        elif kind in ("GGA", "GNS") and (kind == "GNS" or message.quality):
            row |= {"latitude": _number(message.lat), "longitude": _number(message.lon)}
            row["altitude"] = _number(message.alt)
        elif kind == "HDT":
            row["heading"] = _number(message.heading)
        elif kind == "VTG":
            row.setdefault("course", _number(message.cogt))
            row.setdefault("speed", _number(message.sogn) * KNOT)
        elif kind == "GST":
            sds = [_number(message.stdLat), _number(message.stdLong)]
            row["horizontal_accuracy"] = math.hypot(*sds)
            row["vertical_accuracy"] = _number(message.stdAlt)

    def _at(self, clock: Any) -> None:
        second = clock.hour * 3600 + clock.minute * 60 + clock.second + clock.microsecond * 1e-6
        if self.last is not None and second < self.last - HALF_DAY:
            self.day += 86_400
        self.last = second
        self.now = self.day + second

    def _date(self, message: Any) -> None:
        date: Any = getattr(message, "date", None)
        if message.msgID == "ZDA":
            date = datetime(int(message.year), int(message.month), int(message.day), tzinfo=UTC)
        if hasattr(date, "year"):
            first = datetime(date.year, date.month, date.day, tzinfo=UTC)
            self.midnight = first - timedelta(seconds=self.day)

    def frame(self, file: str) -> Any:
        """The vocabulary's `location`; None without a fix."""
        rows = [(t, row) for t, row in self.rows.items() if row]
        if not rows:
            return None
        start = 0
        if self.midnight is None:
            self.notes.append("no sentence has a date (RMC, ZDA); the stamps are times of day")
        else:
            start = round(self.midnight.timestamp()) * 1_000_000_000
        seconds = np.array([t for t, _ in rows])
        time = start + np.rint(seconds * 1e9).astype(np.int64)
        columns = {f: np.array([row.get(f, np.nan) for _, row in rows]) for f in FIELDS}
        if np.isnan(columns["speed"]).all() and len(rows) > 2:
            columns["speed"] = speed_of(seconds, columns["latitude"], columns["longitude"])
            self.notes.append("no sentence has a speed; it is made of the positions")
        return frame("location", file, time, columns)


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return np.nan


FORMAT = Format(
    name="nmea",
    about="NMEA 0183 logs",
    recognizes=recognizes,
    read=read,
    extra="gnss",
    profile="receiver",
)
