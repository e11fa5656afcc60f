"""Racelogic VBO: text with sections; positions in minutes of arc, longitude positive to the west.

Racelogic, "VBO file format" (VBOX Automotive knowledge base). The reader gives `latitude` and
`longitude` in degrees, east positive, speeds in km/h whatever the file has, and `satellites`
without the flags that are added to it; other columns as they stand, with the units of `[header]`.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest.formats import csv
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.csv_layout import TextLayout
from roadlog.ingest.formats.row_clock import RowClock
from roadlog.ingest.formats.text import decoded
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.units import canonical, to_si

HEAD = 1 << 16  # bytes
FLAGS = 64  # added to the satellites for a brake trigger, twice that for corrections
SPEEDS = ("velocity", "vert-vel", "vertvel")
FIXED = ("latitude", "longitude", "velocity", "heading", "height", "vert-vel", "vertvel")
_SECTION = re.compile(rb"^\[([A-Za-z ]+)\]\s*$", re.MULTILINE)
_CREATED = re.compile(r"created on (\d{1,2})[/.-](\d{1,2})[/.-](\d{4})")
_SLIP, _HEADING = re.compile("slip", re.I), re.compile("true_?head|robothead|head_imu", re.I)
_SPELLED = {"kmh": "km/h", "knots": "kn", "m/s": "m/s", "mph": "mph", "g": "g", "kph": "km/h"}


def recognizes(path: Path) -> bool:
    """Whether it is text with the sections of a VBO file."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        found = {match.lower() for match in _SECTION.findall(file.read(HEAD))}
    return {b"column names", b"data"} <= found


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Column names."""
    del dbc
    return {_renamed(name) for name in _layout(path)[0].names}


def _layout(path: Path) -> tuple[TextLayout, int]:
    """How its rows are written, and ns of the midnight before them. Raises LogReadError."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    marks = list(_SECTION.finditer(head))
    sections: dict[str, list[str]] = {}
    start = 0
    for mark, following in zip(marks, [*marks[1:], None], strict=True):
        name = mark[1].decode().lower()
        if name == "data":
            start = head.index(b"\n", mark.start()) + 1
            break
        text = decoded(head[mark.end() : following.start() if following else None])
        sections[name] = [line.strip() for line in text.splitlines() if line.strip()]
    columns = " ".join(sections.get("column names", [])).split()
    if "time" not in [name.lower() for name in columns]:
        raise LogReadError(f"{path}: its [column names] have no time")
    titles = sections.get("header", [])
    units = _units(columns, titles, sections.get("channel units", []))
    created = _CREATED.search(decoded(head[: marks[0].start()]))
    return TextLayout("utf-8", " ", columns, units, start), _midnight(created)


def _midnight(created: re.Match[str] | None) -> int:
    if created is None:
        return 0
    day, month, year = (int(text) for text in created.groups())
    try:
        return round(datetime(year, month, day, tzinfo=UTC).timestamp()) * 10**9
    except ValueError:
        return 0


def _units(
    columns: Sequence[str], titles: Sequence[str], channels: Sequence[str]
) -> dict[str, str]:
    """Units by the titles of the channels, which end with them, and of modules by their list."""
    found = {
        name: "km/h" for name in columns if name.lower() in ("velocity", "vert-vel", "vertvel")
    }
    found |= {"heading": "deg", "height": "m"}
    if len(titles) == len(columns):
        for name, title in zip(columns, titles, strict=True):
            word = title.rpartition(" ")[2].strip("()[]")
            found |= {name: _SPELLED[word]} if word in _SPELLED else {}
    for name, unit in zip(reversed(columns), reversed(channels), strict=False):
        try:
            found[name] = canonical(unit)
        except ConfigError:
            found[name] = unit
    return {name: unit for name, unit in found.items() if name in columns}


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """All columns, what has no fix unknown. Raises LogReadError."""
    del dbc, profile  # the files are small: all is read
    layout, day = _layout(path)
    clock = next(name for name in layout.names if name.lower() == "time")
    wanted = [name for name in layout.names if name != clock]
    recording = csv.rows(path, layout, clock, wanted, RowClock("hhmmss", day=day))
    (frame,) = recording.frames
    columns = _meant(frame.columns)
    units = {_renamed(name): unit for name, unit in frame.units.items()}
    units |= {"latitude": "deg", "longitude": "deg"}
    for name in SPEEDS:
        if name in columns:
            columns[name] = columns[name] * (to_si(units[name], "m/s") / to_si("km/h", "m/s"))
            units[name] = "km/h"
    frame = dataclasses.replace(frame, columns=columns, units=units)
    dated = "the date is that of its creation" if day else "it has no date, the stamps count from 0"
    notes = (*recording.notes, f"{path.name}: {dated}, the time is UTC")
    if any(_SLIP.match(n) for n in columns) and not any(_HEADING.match(n) for n in columns):
        notes += (f"{path.name}: its slip angle is not used: which side is positive nobody states",)
    return Recording((frame,), recording.losses, notes)


def _renamed(name: str) -> str:
    words = {"lat": "latitude", "long": "longitude", "lon": "longitude", "sats": "satellites"}
    return words.get(name.lower(), name)


def _meant(raw: Mapping[str, NDArray]) -> dict[str, NDArray]:
    """Degrees east and north; satellites alone; no position nor speed without any."""
    columns = {_renamed(name): values for name, values in raw.items()}
    if "satellites" in columns:
        columns["satellites"] = columns["satellites"] % FLAGS
    for name, sign in (("latitude", 1.0), ("longitude", -1.0)):
        if name in columns:
            columns[name] = columns[name] * (sign / 60)
    if "satellites" in columns:
        for name in FIXED:
            if name in columns:
                columns[name] = np.where(columns["satellites"] > 0, columns[name], np.nan)
    return columns


FORMAT = Format(
    name="vbo",
    about="Racelogic VBO files",
    recognizes=recognizes,
    read=read,
    names=names,
)
