"""A reference grade from a surveyed table: grade over distance or over positions of a road."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.geo import TransverseMercator
from roadlog.ingest.formats.csv_layout import layout
from roadlog.ingest.reference import gnss as truth
from roadlog.signals import SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats, Stamps
from roadlog.units import to_si

FAR = 20.0  # m; a fix further from the surveyed line is on another road
STEP = 1.0  # m, at which the surveyed line is compared with the fixes
CHORD = 10.0  # m to either side, over which the line has its direction: it may be fixes, with noise
APART = 1.0  # s to either side, between fixes that tell the direction of travel
ALONG = 1.0  # m/s; slower, they do not
BESIDE = 5.0  # m further off than the nearest point, where by its error a fix may belong too
UNLIKE = np.radians(0.3)  # grades of two parts of a road that both may be meant: nothing is said
ACROSS = np.cos(np.radians(45.0))  # less of the travel along the line: a road that crosses it
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
    """Each fix at the nearest point of the surveyed line, where that is the road it travels on."""
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

    seconds = (time - time[0]) * 1e-9
    if len(time) < 2:
        raise LogReadError(f"{path}: the drive has a single fix; survey over distance")
    reach = APART / max(float(np.median(np.diff(seconds))), 1e-3)
    velocity = _chords(fixes, reach) / _chords(seconds, reach)[:, None]
    tangent = _chords(line, CHORD / STEP)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    slope, sd = (np.interp(along, corner, c) for c in (columns["grade"], _sd(columns)))
    tree = cKDTree(line)
    away, place = tree.query(fixes)
    around = tree.query_ball_point(fixes, away + BESIDE)
    grade = np.full(len(time), np.nan)
    for k in np.flatnonzero(away <= FAR):
        nearby = np.array(around[k])
        ahead = tangent[nearby] @ velocity[k]
        is_along = np.abs(ahead) > max(ALONG, ACROSS * np.hypot(*velocity[k]))
        nearby, signed = nearby[is_along], (slope[nearby] * np.sign(ahead))[is_along]
        if not len(nearby):
            continue
        best = int(np.argmin(np.hypot(*(line[nearby] - fixes[k]).T)))
        is_other = np.abs(along[nearby] - along[nearby[best]]) > 4 * (away[k] + BESIDE)
        if not (np.abs(signed[is_other] - signed[best]) > UNLIKE).any():
            grade[k], place[k] = signed[best], nearby[best]
    return time, grade, sd[place]


def _chords(points: Floats, reach: float) -> Floats:
    """From `reach` samples before each of (n,) or (n, 2) to as many behind it."""
    k, n = np.arange(len(points)), max(1, round(reach))
    return points[np.minimum(k + n, len(points) - 1)] - points[np.maximum(k - n, 0)]


def _sd(columns: dict[str, Floats]) -> Floats:
    return columns.get("grade_sd", np.full(len(columns["grade"]), np.nan))


def _plane(latitude: Floats, longitude: Floats, origin: tuple[float, float]) -> Floats:
    """East and north in m of an origin in deg."""
    return np.stack(TransverseMercator(*origin).forward(latitude, longitude), axis=1)
