"""Septentrio SBF logs by pysbf2: PVTGeodetic (block 4007).

Latitude and longitude in rad, height in m above the ellipsoid (undulation is taken off), Vn, Ve, Vu
in m/s, course in deg clockwise from north, accuracies in m (cm in the file); do-not-use values are
-2e10 (65535 of accuracies). 1 to 100 Hz on GPS time, from which the leap seconds of 2017 are taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.comma2k19 import GPS_EPOCH, LEAP_SECONDS, WEEK
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame, nanoseconds
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

MAGIC = b"$@"
NOTHING = -1e10  # what is below it is "do not use"
NO_ACCURACY = 65535
FIELDS = (
    "latitude",
    "longitude",
    "altitude",
    "speed",
    "climb",
    "course",
    "horizontal_accuracy",
    "vertical_accuracy",
)


def recognizes(path: Path) -> bool:
    """Whether it begins with an SBF block."""
    return begins(path, MAGIC)


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """The fixes. Raises LogReadError, MissingExtraError."""
    del profile, dbc
    try:
        from pysbf2 import ERR_IGNORE, SBF_PROTOCOL, SBFReader
    except ImportError as error:
        raise MissingExtraError("reading SBF", "gnss") from error
    rows: list[tuple[float, ...]] = []
    with guarded(path, "SBF"), path.open("rb") as file:
        reader = SBFReader(file, protfilter=SBF_PROTOCOL, quitonerror=ERR_IGNORE)
        for _, message in reader:
            if getattr(message, "identity", "") == "PVTGeodetic":
                rows.append(_fix(message))
    values = np.array(rows, np.float64).reshape(-1, 1 + len(FIELDS))
    values = values[np.isfinite(values[:, 0])]
    if not len(values):
        raise LogReadError(f"{path}: holds no PVTGeodetic block with a time")
    columns = dict(zip(FIELDS, values[:, 1:].T, strict=True))
    return Recording((frame("location", path.name, nanoseconds(values[:, 0]), columns),))


def _fix(m: Any) -> tuple[float, ...]:
    def value(name: str) -> float:
        found = float(getattr(m, name, np.nan))
        return found if found > NOTHING else np.nan

    def accuracy(name: str) -> float:
        found = float(getattr(m, name, NO_ACCURACY))
        return found if found < NO_ACCURACY * 0.01 else np.nan

    week, tow = float(m.WNc), float(m.TOW)
    time = GPS_EPOCH - LEAP_SECONDS + week * WEEK + tow * (1e-3 if tow > WEEK else 1)
    if week >= NO_ACCURACY:
        time = np.nan
    north, east = value("Vn"), value("Ve")
    height = value("Height") - np.nan_to_num(value("Undulation"))
    place = (np.degrees(value("Latitude")), np.degrees(value("Longitude")), height)
    course = np.degrees(np.arctan2(east, north)) % 360
    motion = (float(np.hypot(north, east)), value("Vu"), float(course))
    return (time, *place, *motion, accuracy("HAccuracy"), accuracy("VAccuracy"))


FORMAT = Format(
    name="sbf",
    about="Septentrio SBF logs",
    recognizes=recognizes,
    read=read,
    extra="gnss",
    profile="receiver",
)
