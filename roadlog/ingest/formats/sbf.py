"""Septentrio SBF logs by pysbf2: PVTGeodetic (4007), VelCovGeodetic (5908), AttEuler (5938).

Latitude and longitude in rad, height in m above the ellipsoid (undulation is taken off), Vn, Ve, Vu
in m/s, course in deg clockwise from north, none while it stands, accuracies in m (cm in the file),
of the speed the root of the mean variance of Vn and Ve; heading in deg clockwise from north, pitch
nose up, roll right side down, of two antennas a heading and a pitch; do-not-use values are -2e10
(65535 of accuracies). Blocks of one time are one fix, 1 to 100 Hz on GPS time, from which the leap
seconds of 2017 are taken.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.comma2k19 import GPS_EPOCH, LEAP_SECONDS, WEEK
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame, nanoseconds
from roadlog.ingest.frame import Frame, Recording
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
    "speed_accuracy",
    "heading",
)
ANGLES = ("inclination", "roll_total")


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
    epochs: dict[float, dict[str, float]] = {}
    with guarded(path, "SBF"), path.open("rb") as file:
        reader = SBFReader(file, protfilter=SBF_PROTOCOL, quitonerror=ERR_IGNORE)
        for _, message in reader:
            take = _TAKEN.get(getattr(message, "identity", ""))
            if take is not None and np.isfinite(time := _time(message)):
                epochs.setdefault(time, {}).update(take(message))
    fixes = {t: row for t, row in epochs.items() if "latitude" in row}
    if not fixes:
        raise LogReadError(f"{path}: holds no PVTGeodetic block with a time")
    frames = [_frame("location", path, fixes, FIELDS)]
    angles = {t: row for t, row in epochs.items() if not row.keys().isdisjoint(ANGLES)}
    frames += [_frame("attitude", path, angles, ANGLES)] if angles else []
    return Recording(tuple(f for f in frames if f.columns))


def _frame(
    name: str, path: Path, rows: Mapping[float, Mapping[str, float]], fields: Sequence[str]
) -> Frame:
    columns = {f: np.array([row.get(f, np.nan) for row in rows.values()]) for f in fields}
    return frame(name, path.name, nanoseconds(list(rows)), columns)


def _value(m: Any, name: str) -> float:
    """NaN for "do not use"."""
    found = float(getattr(m, name, np.nan))
    return found if found > NOTHING else np.nan


def _accuracy(m: Any, name: str) -> float:
    found = float(getattr(m, name, NO_ACCURACY))
    return found if found < NO_ACCURACY * 0.01 else np.nan


def _time(m: Any) -> float:
    """s since the epoch; NaN for none."""
    week, tow = float(m.WNc), float(m.TOW)
    time = GPS_EPOCH - LEAP_SECONDS + week * WEEK + tow * (1e-3 if tow > WEEK else 1)
    return np.nan if week >= NO_ACCURACY else time


def _fix(m: Any) -> dict[str, float]:
    north, east = _value(m, "Vn"), _value(m, "Ve")
    return {
        "latitude": float(np.degrees(_value(m, "Latitude"))),
        "longitude": float(np.degrees(_value(m, "Longitude"))),
        "altitude": _value(m, "Height") - float(np.nan_to_num(_value(m, "Undulation"))),
        "speed": float(np.hypot(north, east)),
        "climb": _value(m, "Vu"),
        "course": _value(m, "COG"),
        "horizontal_accuracy": _accuracy(m, "HAccuracy"),
        "vertical_accuracy": _accuracy(m, "VAccuracy"),
    }


def _spread(m: Any) -> dict[str, float]:
    variance = (_value(m, "Cov_VnVn") + _value(m, "Cov_VeVe")) / 2
    return {"speed_accuracy": float(np.sqrt(variance)) if variance >= 0 else np.nan}


def _attitude(m: Any) -> dict[str, float]:
    names = {"heading": "Heading", "inclination": "Pitch", "roll_total": "Roll"}
    return {field: _value(m, name) for field, name in names.items()}


_TAKEN: dict[str, Callable[[Any], dict[str, float]]] = {
    "PVTGeodetic": _fix,
    "VelCovGeodetic": _spread,
    "AttEuler": _attitude,
}

FORMAT = Format(
    name="sbf",
    about="Septentrio SBF logs",
    recognizes=recognizes,
    read=read,
    extra="gnss",
    profile="receiver",
)
