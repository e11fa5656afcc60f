"""GoPro telemetry as gopro-telemetry exports it to CSV: a file a stream, `cts` in ms, a date.

`Accelerometer (z) [m/s2]` (older cameras: `up/down`), `Gyroscope (x) [rad/s]`, `GPS (Lat.) [deg]`,
`GPS (2D speed) [m/s]`, with `fix` among the columns that repeat.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats import csv, times
from roadlog.ingest.formats.csv_layout import layout
from roadlog.ingest.profile import Clock, Everything
from roadlog.types import Floats

NAMES = {"accelerometer": "ACCL", "gyroscope": "GYRO", "gps": "GPS"}
AXES = {"up/down": "Z", "right/left": "X", "forward/back": "Y", "x": "X", "y": "Y", "z": "Z"}
PLACE = ("lat.", "long.", "alt.", "2d")
FIX = "fix"
_HEADING = re.compile(r"(accelerometer|gyroscope|gps)\w* \(([^)]*)\)(?: \[.*\])?", re.IGNORECASE)


class GoproStream(NamedTuple):
    """One stream: ACCL, GYRO or GPS, time in s of the video, values, and which axis each is.

    epoch: s, UTC less the video's time; None where there is no date.
    """

    key: str
    time: Floats
    values: Floats
    letters: str
    epoch: float | None


def files(path: Path) -> list[Path]:
    """The tables of streams in a folder, or the file itself where it is one."""
    inside = sorted(path.iterdir()) if path.is_dir() else [path]
    return [file for file in inside if file.suffix.lower() == ".csv" and _headings(file)]


def streams(path: Path) -> Iterator[GoproStream]:
    """What the tables hold. Raises LogReadError."""
    for file in files(path):
        headings = _headings(file)
        key = NAMES[next(iter(headings.values()))[0]]
        (frame,) = csv.read(file, Everything("everything", "", Clock("cts", "ms"))).frames
        columns = frame.columns
        time = np.asarray(frame.time, np.float64) * 1e-9
        date = columns.get("date")
        moment = None if date is None or date.dtype.kind != "O" else times.of_text(str(date[0]))
        epoch = None if moment is None else moment * 1e-9 - float(time[0])
        if key == "GPS":
            names = [n for p in PLACE for n, (_, part) in headings.items() if part.startswith(p)]
            fix = next((n for n in columns if n == FIX or headings.get(n, ("", ""))[1] == FIX), "")
            good = columns[fix] >= 2 if fix else np.ones(len(time), np.bool_)
            values = np.column_stack([columns[name] for name in names])
            yield GoproStream(key, time[good], values[good], "", epoch)
        else:
            letters = "".join(AXES.get(part, "") for _, part in headings.values())
            if sorted(letters) != ["X", "Y", "Z"]:
                raise LogReadError(f"{file}: its axes are {', '.join(headings)}, not x, y and z")
            yield GoproStream(
                key, time, np.column_stack([columns[n] for n in headings]), letters, epoch
            )


def _headings(path: Path) -> dict[str, tuple[str, str]]:
    """Column -> stream and part, of a table of one stream; empty for another table."""
    try:
        names = layout(path).names
    except LogReadError:
        return {}
    found = {name: match for name in names if (match := _HEADING.fullmatch(name))}
    if "cts" not in names or len(found) < 3:
        return {}
    return {name: (match[1].lower(), match[2].lower()) for name, match in found.items()}
