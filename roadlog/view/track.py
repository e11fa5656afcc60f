"""Where the car drove, seen from above, with the grade of the road along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.estimate import Estimate
from roadlog.geo import TransverseMercator
from roadlog.types import Floats
from roadlog.view.colors import ordered
from roadlog.view.runs import MOTION, Run

MAX_POINTS = 4000  # of a track on the screen; more cannot be told apart
FAR = 10.0  # a fix this many times farther off than 90 % of them are is a wrong one


@dataclass(frozen=True)
class MapTrack:
    """A path seen from above.

    time: s. east, north: m from the first point. grade: degrees, NaN where unknown.
    latitude, longitude: degrees, None when there is no GNSS. source: where path and grade are from.
    """

    time: Floats
    east: Floats
    north: Floats
    grade: Floats
    latitude: Floats | None
    longitude: Floats | None
    source: str


@dataclass(frozen=True)
class Poses:
    """Position and yaw at times: m and rad, x east and y north of the start, z up."""

    time: Floats
    x: Floats
    y: Floats
    z: Floats
    yaw: Floats
    source: str


def drive_track(run: Run) -> MapTrack | None:
    """GNSS fixes, else the true path, else dead reckoning; None when there is none of them."""
    grade, grade_source = best_angle(run, "grade")
    found = _fixes(run)
    latitude: Floats | None = None
    longitude: Floats | None = None
    if found is not None:
        time, latitude, longitude = found
        east, north = _local(latitude, longitude)
        source = "GNSS"
    else:
        path = drive_path(run)
        if path is None:
            return None
        time, east, north, source = path.time, path.x, path.y, path.source
    values = np.interp(time, run.drive.time, np.degrees(grade))
    keep = slice(None, None, max(1, -(-len(time) // MAX_POINTS)))
    return MapTrack(
        time[keep],
        east[keep],
        north[keep],
        values[keep],
        None if latitude is None else latitude[keep],
        None if longitude is None else longitude[keep],
        f"{source}; grade by {grade_source}" if grade_source else source,
    )


def drive_path(run: Run) -> Poses | None:
    """The car's path at the drive's times: true, else dead reckoning from speed and yaw rate.

    Heights of dead reckoning come from the best grade that the log has. None without a speed.
    """
    time = run.drive.time
    motion = run.tables.get(MOTION)
    if motion is not None and len(motion):
        own = np.multiply(motion.time - run.drive.start_ns, 1e-9)
        columns = {c: np.asarray(motion.columns[c], np.float64) for c in ("x", "y", "z", "heading")}
        if all(np.isfinite(values).all() for values in columns.values()):
            columns["heading"] = np.unwrap(columns["heading"])
            x, y, z, yaw = (np.interp(time, own, values) for values in columns.values())
            return Poses(time, x, y, z - z[0], yaw, "true path")
    if run.distance is None:
        return None
    drive = run.drive
    rate = np.nan_to_num(drive.get("imu.gyro_z"))
    if drive.standstill.any():
        rate = rate - float(np.mean(rate[drive.standstill]))
    yaw = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * drive.dt)])
    step = np.diff(run.distance, prepend=0.0)
    grade, _ = best_angle(run, "grade")
    slope = np.nan_to_num(grade)
    return Poses(
        time,
        np.cumsum(step * np.cos(yaw) * np.cos(slope)),
        np.cumsum(step * np.sin(yaw) * np.cos(slope)),
        np.cumsum(step * np.sin(slope)),
        yaw,
        "dead reckoning from speed and yaw rate",
    )


def best_angle(run: Run, angle: str) -> tuple[Floats, str]:
    """rad at the drive's times and whose: the truth's, else of the most prominent estimator.

    NaN and an empty name when nobody has it.
    """
    if run.truth is not None and angle in run.truth.angles:
        return at_times(run, run.truth, angle), "truth"
    for label in ordered(list(run.estimates)):
        track = run.estimates[label]
        if angle in track.angles and track.valid.any():
            return at_times(run, track, angle), label
    return np.full(len(run.drive), np.nan), ""


def at_times(run: Run, track: Estimate, angle: str) -> Floats:
    """rad, an angle at the drive's times, valid samples only; held over what is not."""
    known = track.valid & np.isfinite(track.angles[angle])
    if not known.any():
        return np.full(len(run.drive), np.nan)
    return np.interp(run.drive.time, track.time[known], track.angles[angle][known])


def _fixes(run: Run) -> tuple[Floats, Floats, Floats] | None:
    """Times, latitudes and longitudes in degrees of plausible fixes."""
    gnss = run.drive.native.get("gnss")
    if gnss is None or not {"latitude", "longitude"} <= gnss.columns.keys():
        return None
    latitude, longitude = gnss.columns["latitude"], gnss.columns["longitude"]
    known = np.isfinite(latitude) & np.isfinite(longitude) & (np.abs(latitude) <= 90.0)
    known &= (latitude != 0.0) | (longitude != 0.0)
    if known.sum() < 2:
        return None
    east, north = _local(latitude[known], longitude[known])
    away = np.hypot(east - np.median(east), north - np.median(north))
    known[known] = away <= FAR * max(float(np.percentile(away, 90)), 10.0)
    return gnss.time[known], latitude[known], longitude[known]


def _local(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
    """m east and north of the first point; good over the size of a drive."""
    plane = TransverseMercator(float(np.mean(latitude)), longitude[0])
    east, north = plane.forward(latitude, longitude)
    return east, north - north[0]
