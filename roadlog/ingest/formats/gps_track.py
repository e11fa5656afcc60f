"""Tracks of watches, bike computers and apps: GPX (gpxpy), FIT (fitdecode), TCX.

GPX 1.0 and 1.1: degrees, meters above the geoid, UTC; speed and course in 1.0 and in extensions.
FIT (Garmin): positions in semicircles (180 deg / 2^31), `enhanced_` values before the coarse ones,
in m and m/s, stamps in whole seconds UTC. TCX: as GPX, speed in its extension. Typically 1 Hz or
one point each few seconds. Where no point has a speed it is made of the positions.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame, nanoseconds, speed_of
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

SEMICIRCLE = 180 / 2**31  # deg
HEAD = 2048  # bytes in which an XML file says what it is
FIELDS = ("latitude", "longitude", "altitude", "speed", "course")

Point = tuple[float, ...]  # time in s and FIELDS, NaN where unknown


def kind_of(path: Path) -> str:
    """gpx, tcx or fit by the content; empty for none."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head[8:12] == b".FIT":
        return "fit"
    text = head.lower()
    return "gpx" if b"<gpx" in text else "tcx" if b"<trainingcenterdatabase" in text else ""


def recognizes(path: Path) -> bool:
    """Whether it is one of the three."""
    return kind_of(path) != ""


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """The points with a time and a place. Raises LogReadError, MissingExtraError."""
    del profile, dbc
    kind = kind_of(path)
    with guarded(path, kind.upper()):
        points = list({"gpx": _gpx, "fit": _fit, "tcx": _tcx}[kind](path))
    rows = np.array(points, np.float64).reshape(-1, 1 + len(FIELDS))
    timeless = int(np.isnan(rows[:, 0]).sum())
    rows = rows[np.isfinite(rows[:, :3]).all(axis=1)]
    if not len(rows):
        raise LogReadError(f"{path}: no point has a time and a place")
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    rows = rows[np.diff(rows[:, 0], prepend=-np.inf) > 0]
    columns = dict(zip(FIELDS, rows[:, 1:].T, strict=True))
    notes = []
    if np.isnan(columns["speed"]).all() and len(rows) > 2:
        columns["speed"] = speed_of(rows[:, 0], columns["latitude"], columns["longitude"])
        notes.append(f"{path.name}: no point has a speed; it is made of the positions")
    time = nanoseconds(rows[:, 0])
    losses = [f"{path.name}: {timeless} points without a time left out"] if timeless else []
    return Recording((frame("location", path.name, time, columns),), tuple(losses), tuple(notes))


def _gpx(path: Path) -> Iterator[Point]:
    try:
        import gpxpy
    except ImportError as error:
        raise MissingExtraError("reading GPX", "gnss") from error
    with path.open(encoding="utf-8", errors="replace") as file:
        track = gpxpy.parse(file)
    for point, *_ in track.walk():
        more = {_tag(e): e.text for x in point.extensions for e in x.iter()}
        yield (
            point.time.timestamp() if point.time else np.nan,
            point.latitude,
            point.longitude,
            _number(point.elevation),
            _number(more.get("speed") if point.speed is None else point.speed),
            _number(
                more.get("course", more.get("bearing")) if point.course is None else point.course
            ),
        )


def _fit(path: Path) -> Iterator[Point]:
    try:
        import fitdecode
    except ImportError as error:
        raise MissingExtraError("reading FIT", "gnss") from error
    with fitdecode.FitReader(str(path), error_handling=fitdecode.ErrorHandling.WARN) as reader:
        for message in reader:
            if not isinstance(message, fitdecode.FitDataMessage) or message.name != "record":
                continue

            def value(*names: str, record: Any = message) -> float:
                found = (record.get_value(n, fallback=None) for n in names)
                return next((_number(v) for v in found if v is not None), np.nan)

            stamp = message.get_value("timestamp", fallback=None)
            yield (
                stamp.timestamp() if hasattr(stamp, "timestamp") else np.nan,
                value("position_lat") * SEMICIRCLE,
                value("position_long") * SEMICIRCLE,
                value("enhanced_altitude", "altitude"),
                value("enhanced_speed", "speed"),
                np.nan,
            )


def _tcx(path: Path) -> Iterator[Point]:
    from datetime import datetime

    for _, element in ElementTree.iterparse(path):
        if _tag(element) != "trackpoint":
            continue
        found = {_tag(e): e.text for e in element.iter()}
        stamp = found.get("time")
        yield (
            datetime.fromisoformat(stamp).timestamp() if stamp else np.nan,
            *(_number(found.get(n)) for n in ("latitudedegrees", "longitudedegrees")),
            _number(found.get("altitudemeters")),
            _number(found.get("speed")),
            np.nan,
        )
        element.clear()


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2].lower()


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return np.nan


FORMAT = Format(
    name="gps_track",
    about="GPX, FIT and TCX tracks",
    recognizes=recognizes,
    read=read,
    extra="gnss",
    profile="receiver",
)
