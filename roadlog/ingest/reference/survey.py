"""A reference grade from a surveyed table: grade over distance or over positions of a road."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.geo import LocalPlane
from roadlog.ingest.formats.csv_layout import layout
from roadlog.ingest.reference import gnss as truth
from roadlog.signals import SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats, Stamps
from roadlog.units import to_si

FAR = 20.0  # m; a fix further from the surveyed line is on another road
STEP = 1.0  # m, at which the surveyed line is compared with the fixes
ALONG = 1.0  # m/s; slower, two fixes do not tell the direction of travel
_HEADER = re.compile(
    r"^(distance|chainage|latitude|lat|longitude|lon|grade_sd|sd|grade|slope)"
    r"[ _]*[\[(]?([^\])]*)[\])]?$"
)
_NAMES = {"chainage": "distance", "lat": "latitude", "lon": "longitude", "slope": "grade"}
_PERCENT = ("", "%", "percent", "pct")


def from_table(path: Path, tables: Sequence[Table]) -> Table:
    """`/truth/angles` of a drive over a surveyed road.

    The file is a text table of `grade` (percent, or the unit in the header: `grade_deg`,
    `grade [rad]`), of `distance` (m; from the start of the drive) or `latitude` and `longitude`
    (deg, in order along the road; travel against that order turns the sign), and of `grade_sd`
    where it is known. Raises ConfigError for missing columns, LogReadError when nothing fits.
    """
    columns = _columns(path)
    if "latitude" in columns:
        time, grade, sd = _by_position(path, columns, tables)
    else:
        time, grade, sd = _by_distance(columns, tables)
    known = np.isfinite(grade)
    if not known.any():
        raise LogReadError(f"{path}: no part of the drive lies on the surveyed road")
    return truth.table(time[known], grade[known], sd[known])


def _columns(path: Path) -> dict[str, Floats]:
    """Name -> SI values (grade and sd in rad, positions in deg), without incomplete rows."""
    if not path.is_file():
        raise LogReadError(f"{path}: no such file; --truth-from is gnss or a surveyed table")
    found = layout(path)
    units: dict[str, tuple[int, str]] = {}
    for place, name in enumerate(found.names):
        if match := _HEADER.match(name.strip().lower()):
            key = "grade_sd" if match[1] == "sd" else _NAMES.get(match[1], match[1])
            units[key] = place, match[2].strip() or found.units.get(name, "")
    there = set(units)
    if "grade" not in there or not ({"distance"} <= there or {"latitude", "longitude"} <= there):
        raise ConfigError(
            f"{path}: a surveyed table has grade, and distance or latitude and longitude. "
            + near("grade", found.names)
        )
    with path.open("rb") as file:
        file.seek(found.start)
        lines = file.read().decode(found.encoding, "replace").splitlines()
    rows = []
    for number, fields in enumerate(csv.reader(lines, delimiter=found.delimiter), 1):
        try:
            row = [fields[place] for place, _ in units.values()]
            texts = row if found.delimiter == "," else [f.replace(",", ".") for f in row]
            rows.append([float(text) for text in texts])
        except (ValueError, IndexError):
            if any(field.strip() for field in fields):
                raise LogReadError(f"{path}: row {number} is not all numbers: {fields}") from None
    values = np.array(rows, np.float64).reshape(-1, len(units))
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < 2:
        raise LogReadError(f"{path}: has fewer than two complete rows")
    columns = dict(zip(units, values.T, strict=True))
    slope, sd = columns["grade"], columns.get("grade_sd")
    unit = units["grade"][1]
    percent = unit in _PERCENT
    columns["grade"] = np.arctan(slope / 100) if percent else slope * to_si(unit, "rad")
    if sd is not None:
        own = units["grade_sd"][1] or unit
        cosine = np.cos(columns["grade"]) ** 2
        columns["grade_sd"] = sd / 100 * cosine if own in _PERCENT else sd * to_si(own, "rad")
    if "distance" in columns:
        columns["distance"] = columns["distance"] * to_si(units["distance"][1] or "m", "m")
    return columns


def _by_distance(
    columns: dict[str, Floats], tables: Sequence[Table]
) -> tuple[Stamps, Floats, Floats]:
    speed = truth.speed(tables)
    if speed is None:
        raise LogReadError("--truth-from with distances needs a speed; the profile maps none")
    time, v = speed
    distance = truth.travelled(time, v)
    order = np.argsort(columns["distance"], kind="stable")
    along = columns["distance"][order]
    return (
        time,
        np.interp(distance, along, columns["grade"][order], np.nan, np.nan),
        np.interp(distance, along, _sd(columns)[order], np.nan, np.nan),
    )


def _by_position(
    path: Path, columns: dict[str, Floats], tables: Sequence[Table]
) -> tuple[Stamps, Floats, Floats]:
    """Each fix at the nearest point of the surveyed line."""
    gnss = next((t for t in tables if t.topic == SECTIONS["gnss"].topic), None)
    if gnss is None or not np.isfinite(gnss.columns["latitude"]).any():
        raise LogReadError(f"{path} has positions, but the drive has none; survey over distance")
    latitude, longitude = gnss.columns["latitude"], gnss.columns["longitude"]
    known = np.isfinite(latitude) & np.isfinite(longitude)
    time = gnss.time[known]
    origin = columns["latitude"][0], columns["longitude"][0]
    fixes = _plane(latitude[known], longitude[known], origin)
    corners = _plane(columns["latitude"], columns["longitude"], origin)
    steps = np.hypot(*np.diff(corners, axis=0).T)
    corner = np.concatenate([[0.0], np.cumsum(steps)])
    along: Floats = np.arange(0.0, corner[-1] + STEP, STEP)
    line = np.stack([np.interp(along, corner, axis) for axis in corners.T], axis=1)
    from scipy.spatial import cKDTree

    away, place = cKDTree(line).query(fixes)
    seconds = (time - time[0]) * 1e-9
    if len(time) < 2:
        raise LogReadError(f"{path}: the drive has a single fix; survey over distance")
    velocity = np.gradient(fixes, seconds, axis=0)
    ahead = np.sum(velocity * np.gradient(line, axis=0)[place], axis=1) / STEP
    grade = np.interp(along[place], corner, columns["grade"]) * np.sign(ahead)
    grade[(away > FAR) | (np.abs(ahead) < ALONG)] = np.nan
    return time, grade, np.interp(along[place], corner, _sd(columns))


def _sd(columns: dict[str, Floats]) -> Floats:
    return columns.get("grade_sd", np.full(len(columns["grade"]), np.nan))


def _plane(latitude: Floats, longitude: Floats, origin: tuple[float, float]) -> Floats:
    """East and north in m of an origin in deg."""
    return np.stack(LocalPlane(*origin).forward(latitude, longitude), axis=1)
