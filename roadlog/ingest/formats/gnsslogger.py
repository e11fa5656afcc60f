"""GnssLogger (Google): text lines of `Fix`, `UncalAccel`, `UncalGyro`, named in the `#` lines.

Layout of v3.1.0.0. Sensors in m/s2 and rad/s, phone axes, reaction positive; their bias columns are
estimates beside the values, which are raw. `Fix` at 1 Hz: m/s, degrees clockwise from north.
One clock: UTC in ms, of sensors utcTimeMillis and of fixes UnixTimeMillis; where both rows have
elapsedRealtimeNanos, that carries the time between (UTC comes in whole milliseconds).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.pocket import frame
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.types import Floats

HEAD = 1 << 14  # bytes in which the description stands
LOCATION = {
    "LatitudeDegrees": "latitude",
    "LongitudeDegrees": "longitude",
    "AltitudeMeters": "altitude",
    "SpeedMps": "speed",
    "BearingDegrees": "course",
    "AccuracyMeters": "horizontal_accuracy",
    "VerticalAccuracyMeters": "vertical_accuracy",
    "SpeedAccuracyMps": "speed_accuracy",
    "BearingAccuracyDegrees": "course_accuracy",
}
TRIADS = {
    "accelerometer": ("UncalAccel", "UncalAccel{}Mps2"),
    "gyroscope": ("UncalGyro", "UncalGyro{}RadPerSec"),
}
UTC = ("UnixTimeMillis", "utcTimeMillis", "(UTC)TimeInMs")


def recognizes(path: Path) -> bool:
    """Whether its first lines describe rows of GnssLogger."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(HEAD)
    return head.startswith(b"#") and (b"# Fix," in head or b"# UncalAccel," in head)


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Location, accelerometer and gyroscope. Raises LogReadError."""
    del profile, dbc
    names: dict[str, list[str]] = {}
    rows: dict[str, list[list[str]]] = {}
    wanted = {"Fix", *(kind for kind, _ in TRIADS.values())}
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            kind, _, rest = line.lstrip("# ").rstrip("\n").partition(",")
            if kind not in wanted:
                continue
            if line.startswith("#"):
                names[kind] = [name.strip() for name in rest.split(",")]
            else:
                rows.setdefault(kind, []).append(rest.split(","))
    bad = 0
    frames: list[Frame] = []
    for kind, lines in rows.items():
        if kind not in names:
            continue
        whole = [row for row in lines if len(row) >= len(names[kind]) - 1]
        bad += len(lines) - len(whole)
        frames += _frames(path.name, kind, names[kind], whole)
    if not frames:
        raise LogReadError(f"{path}: holds no row of {', '.join(sorted(wanted))} with a time")
    losses = (f"{path.name}: {bad} rows cut short left out",) if bad else ()
    return Recording(tuple(frames), losses)


def _frames(file: str, kind: str, names: list[str], rows: list[list[str]]) -> list[Frame]:
    def column(name: str) -> Floats:
        k = names.index(name)
        return np.array([_number(row[k]) if k < len(row) else np.nan for row in rows])

    utc = next((column(name) for name in UTC if name in names), None)
    if utc is None or not rows:
        return []
    time = utc * 1e6
    if "elapsedRealtimeNanos" in names:
        own = column("elapsedRealtimeNanos")
        finer = own + np.nanmedian(time - own)
        time = np.where(np.abs(finer - time) < 2e6, finer, time)
    known = np.isfinite(time)
    stamps = time[known].astype(np.int64)
    if kind == "Fix":
        columns = {to: column(name)[known] for name, to in LOCATION.items() if name in names}
        return [frame("location", file, stamps, columns)]
    target, form = next((t, form) for t, (k, form) in TRIADS.items() if k == kind)
    return [frame(target, file, stamps, {a: column(form.format(a.upper()))[known] for a in "xyz"})]


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


FORMAT = Format(
    name="gnsslogger",
    about="GnssLogger texts",
    recognizes=recognizes,
    read=read,
    profile="phone",
)
