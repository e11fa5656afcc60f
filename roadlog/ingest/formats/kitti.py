"""KITTI raw data: the `oxts` folder of a drive, one line of 30 figures a file at 10 Hz.

Geiger et al. 2013, "Vision meets Robotics: The KITTI Dataset", IJRR 32(11). An OXTS RT3003; body
axes x forward, y left, z up; roll: left side up +, pitch: front down +.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats import times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.types import Floats

# fmt: off
FIELDS = (
    "lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", "ax", "ay", "az",
    "af", "al", "au", "wx", "wy", "wz", "wf", "wl", "wu", "pos_accuracy", "vel_accuracy",
    "navstat", "numsats", "posmode", "velmode", "orimode",
)
# fmt: on
HEADING_SPEED = 1.0  # m/s; above it the velocity has a direction


def recognizes(path: Path) -> bool:
    """Whether a folder is a drive's `oxts` folder or holds one."""
    return path.is_dir() and _folder(path) is not None


def _folder(path: Path) -> Path | None:
    return next(
        (
            p
            for p in (path, path / "oxts")
            if (p / "timestamps.txt").is_file() and (p / "data").is_dir()
        ),
        None,
    )


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Every figure, and derived: speed [m/s], course [rad, ccw from east], grade [rad].

    Raises LogReadError.
    """
    del profile, dbc
    folder = _folder(path)
    assert folder is not None  # `recognizes` was asked
    files = sorted((folder / "data").glob("*.txt"))
    stamps = (folder / "timestamps.txt").read_text("ascii", errors="replace").split("\n")
    stamps = [line for line in stamps if line.strip()]
    losses = []
    if len(files) != len(stamps):
        losses.append(
            f"{path.name}: {len(files)} data files for {len(stamps)} stamps; "
            f"the first {min(len(files), len(stamps))} taken"
        )
    count = min(len(files), len(stamps))
    if not count:
        raise LogReadError(f"{folder}: holds no data file with a stamp")
    time, keep = times.from_texts(stamps[:count], str(folder / "timestamps.txt"))
    if not keep.all():
        losses.append(f"{path.name}: {count - len(time)} rows without a time left out")
    rows = np.full((count, len(FIELDS)), np.nan)
    bad = 0
    for row, file in zip(rows, files, strict=False):
        try:
            figures = [float(text) for text in file.read_text("ascii").split()]
        except ValueError:  # UnicodeDecodeError is one
            figures = []
        if len(figures) == len(FIELDS):
            row[:] = figures
        else:
            bad += 1
    if bad == count:
        raise LogReadError(
            f"{folder}: no data file holds the {len(FIELDS)} figures of an OXTS line"
        )
    if bad:
        losses.append(f"{path.name}: {bad} data files are not {len(FIELDS)} figures; left out")
    columns = {name: rows[keep, k] for k, name in enumerate(FIELDS)}
    columns |= _derived(columns)
    return Recording((Frame("oxts", path.name, time, columns),), tuple(losses))


def _derived(c: dict[str, Floats]) -> dict[str, Floats]:
    level = np.hypot(c["ve"], c["vn"])
    moving = level > HEADING_SPEED
    grade = np.where(moving, np.arctan2(c["vu"], level), np.nan)
    course = np.where(moving, np.arctan2(c["vn"], c["ve"]), np.nan)
    return {"speed": level, "course": course, "grade": grade}


FORMAT = Format(
    name="kitti",
    about="KITTI folders",
    recognizes=recognizes,
    read=read,
    profile="kitti",
)
