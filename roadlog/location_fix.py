"""`/gnss` once more as `foxglove.LocationFix`, the message that viewers draw on a map."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from roadlog.signals import FIX_TOPIC, SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats, Stamps

SCHEMA = "foxglove.LocationFix"
DIAGONAL_KNOWN = 2  # foxglove.LocationFix.PositionCovarianceType
NS = 10**9
COURSE_SPEED = 1.0  # m/s; below it the course of a receiver turns at random
_DIAGONAL = {0: "horizontal_accuracy", 4: "horizontal_accuracy", 8: "vertical_accuracy"}


def location_fix(gnss: Table) -> Table | None:
    """The fixes whose place is known; None where there is no such fix or this is not /gnss.

    Covariance in m^2 about east, north, up, where all fixes say their accuracy.
    """
    if gnss.topic != SECTIONS["gnss"].topic or not {"latitude", "longitude"} <= set(gnss.columns):
        return None
    columns = {name: np.asarray(values, np.float64) for name, values in gnss.columns.items()}
    known = np.isfinite(columns["latitude"]) & np.isfinite(columns["longitude"])
    if not known.any():
        return None
    time = gnss.time[known]
    fix = stamp(time)
    fix["latitude"] = columns["latitude"][known]
    fix["longitude"] = columns["longitude"][known]
    if "altitude" in columns:
        fix["altitude"] = columns["altitude"][known]
    accuracy = {name: columns[name][known] for name in _DIAGONAL.values() if name in columns}
    if len(accuracy) == 2 and all(np.isfinite(values).all() for values in accuracy.values()):
        zero = np.zeros(len(time))
        for k in range(9):
            variance = accuracy[_DIAGONAL[k]] ** 2 if k in _DIAGONAL else zero
            fix[f"position_covariance.{k}"] = variance
        fix["position_covariance_type"] = np.full(len(time), DIAGONAL_KNOWN, np.int32)
    heading = _heading(columns)
    if heading is not None:
        fix["heading"] = heading[known]
    return Table(FIX_TOPIC, SCHEMA, time, fix)


def stamp(time: Stamps) -> dict[str, NDArray]:
    """The columns of a message's own google.protobuf.Timestamp."""
    return {"timestamp.seconds": time // NS, "timestamp.nanos": (time % NS).astype(np.int32)}


def _heading(columns: Mapping[str, Floats]) -> Floats | None:
    """rad clockwise from north: by two antennas, else the course, the last one while it stands."""
    unknown = np.full(len(columns["latitude"]), np.nan)
    heading, course = columns.get("heading", unknown), columns.get("course", unknown)
    course = np.where(columns.get("speed", unknown) < COURSE_SPEED, np.nan, course)
    east = np.where(np.isfinite(heading), heading, course)
    known = np.flatnonzero(np.isfinite(east))
    if not len(known):
        return None
    last = np.searchsorted(known, np.arange(len(east)), side="right") - 1
    return np.mod(np.pi / 2 - east[known[np.maximum(last, 0)]], 2 * np.pi)
