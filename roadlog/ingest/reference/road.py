"""A reference grade and bank from a road model, in the axes of the car that drove there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.errors import LogReadError, RoadlogError
from roadlog.ingest.reference import gnss
from roadlog.roads.model import RoadModel, beside, car_axes
from roadlog.roads.way import way_of
from roadlog.signals import SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats, Stamps

FAR = 20.0  # m; a fix further from the line is on another road
ALONG = 1.0  # m/s; slower, two fixes do not tell the direction of travel
LONGEST_STEP = 3.0  # s between fixes; no course across a longer gap
POSITION_SD = 1.0  # m along the road, of a fix: slopes that change sharply are known less
HELD_SD = 0.55  # m, the same of one that is held to gyro and wheels


@dataclass(frozen=True)
class DriveFixes:
    """Where a drive was. time: ns; latitude, longitude: deg; altitude: m; heading: rad.

    The heading is NaN at rest, the altitude where the receiver gave none.
    """

    time: Stamps
    latitude: Floats
    longitude: Floats
    heading: Floats
    altitude: Floats


def from_road(model: RoadModel, tables: Sequence[Table]) -> Table:
    """`/truth/angles` of a drive over the road, at the fixes: grade, bank and their sds.

    Raises LogReadError without fixes, and where none of them lies on the road.
    """
    if not model.placed:
        raise LogReadError(
            f"{model.name}: the road does not say where on earth it is (geoReference in .xodr, "
            f"reference_line_start_lat and _lon in .crg), so no drive can be laid on it"
        )
    fixes = fixes_of(tables, model.name)
    found = _laid(model, fixes, POSITION_SD)
    held = _held(fixes, tables, found)
    return found if held is None else _laid(model, held, HELD_SD)


def _laid(model: RoadModel, fixes: DriveFixes, position_sd: float) -> Table:
    """The angles at places known to position_sd m. Raises LogReadError with none on the road."""
    x, y = model.plane.forward(fixes.latitude, fixes.longitude)
    station, offset, turn = model.locate(x, y, fixes.heading, FAR)
    known = np.isfinite(station)
    if not known.any():
        raise LogReadError(f"{model.name}: no part of the drive lies on this road")
    station, offset, turn = station[known], offset[known], turn[known]
    grade, bank = car_axes(*beside(model, station, offset), turn)
    there = model.at(station)
    sds = []
    for name in ("grade", "bank"):
        change = np.nan_to_num(np.gradient(getattr(model, name), model.s))
        moved = position_sd * np.interp(station, model.s, change)
        sds.append(np.hypot(getattr(there, f"{name}_sd"), moved))
    return gnss.table(fixes.time[known], grade, sds[0], bank, sds[1])


def _held(fixes: DriveFixes, tables: Sequence[Table], found: Table) -> DriveFixes | None:
    """The fixes on the drive's way (docs/roads.md#way), also at rest; None without speed or gyro.

    found: the angles by the fixes as they are, for the slope that the accelerometer feels.
    """
    known = np.isfinite(found.columns["grade"])
    try:
        drive = Drive.from_tables(tables)
    except RoadlogError:
        return None
    if not (drive.has_speed and "imu.gyro_z" in drive and known.any()):
        return None
    seconds = (found.time[known] - drive.start_ns) * 1e-9
    slope = np.interp(drive.time, seconds, found.columns["grade"][known])
    way = way_of(drive, slope, slope, (0.0, 0.0, 0.0))
    if way is None:
        return None
    at: Floats = np.multiply(fixes.time - drive.start_ns, 1e-9)
    near = way.near(at)
    if not near.any():
        return None
    x, y, heading = (np.interp(at[near], drive.time, v) for v in (way.x, way.y, way.heading))
    latitude, longitude = way.plane.inverse(x, y)
    return DriveFixes(fixes.time[near], latitude, longitude, heading, fixes.altitude[near])


def fixes_of(tables: Sequence[Table], road: str) -> DriveFixes:
    """The drive's fixes with the heading of its way. Raises LogReadError."""
    found = next((t for t in tables if t.topic == SECTIONS["gnss"].topic), None)
    if found is None or not np.isfinite(found.columns["latitude"]).any():
        raise LogReadError(f"{road}: a road needs positions, but the drive has none")
    latitude, longitude = found.columns["latitude"], found.columns["longitude"]
    known = np.isfinite(latitude) & np.isfinite(longitude)
    if known.sum() < 2:
        raise LogReadError(f"{road}: the drive has a single fix, which has no direction")
    time = found.time[known]
    order = np.argsort(time, kind="stable")
    time, latitude, longitude = (
        values[order] for values in (time, latitude[known], longitude[known])
    )
    heading = _heading(found, known, order, time, latitude, longitude)
    altitude = found.columns.get("altitude", np.full(len(known), np.nan))[known][order]
    return DriveFixes(time, latitude, longitude, heading, altitude)


def _heading(
    found: Table, known: np.ndarray, order: np.ndarray, time: Stamps, latitude: Floats,
    longitude: Floats,
) -> Floats:  # fmt: skip
    """rad: two antennas', else the receiver's course, else that of its places."""
    from roadlog.geo import TransverseMercator

    x, y = TransverseMercator(float(latitude[0]), float(longitude[0])).forward(latitude, longitude)
    seconds = (time - time[0]) * 1e-9
    distinct = np.concatenate([[True], np.diff(seconds) > 0])
    vx, vy = (np.interp(seconds, seconds[distinct], np.gradient(p[distinct], seconds[distinct]))
              for p in (x, y))  # fmt: skip
    gap = np.maximum(np.diff(seconds, prepend=seconds[0]), np.diff(seconds, append=seconds[-1]))
    moving = (np.hypot(vx, vy) > ALONG) & (gap < LONGEST_STEP)
    heading = np.where(moving, np.arctan2(vy, vx), np.nan)
    for name in ("course", "heading"):
        if name in found.columns:
            own = np.asarray(found.columns[name], np.float64)[known][order]
            usable = np.isfinite(own) & (moving | (name == "heading"))
            heading = np.where(usable, own, heading)
    return heading
