"""Positions and heights of a receiver: jumps, and heights that do not belong to the way."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from roadlog.checks.finding import Finding
from roadlog.geo import TransverseMercator
from roadlog.signals import GNSS_TOPIC
from roadlog.storage import Table
from roadlog.types import Floats

JUMP, RUNS = 30.0, 3.0  # m, and times the way that the speed allows
FAR = 200.0  # m driven, over which some height changes
CLIMBS = 2.0  # m, sd of a height that tells its sign
AGAINST = -0.7  # correlation of two heights of which one is turned over


def fixes(tables: Mapping[str, Table]) -> list[Finding]:
    """Findings on the receiver's fixes."""
    table = tables.get(GNSS_TOPIC)
    if table is None or len(table) < 10:
        return []
    columns = {n: np.asarray(v, np.float64) for n, v in table.columns.items()}
    time: Floats = np.multiply(table.time - table.time[0], 1e-9)
    place = _known(time, columns, ("latitude", "longitude"))
    if len(place[0]) < 10:
        return []
    way = _steps(*place[1:])
    found = list(_jumps(time, columns, place[0], way))
    if float(way.sum()) > FAR:
        found += _heights(time, columns, float(way.sum()))
    return found


def _known(time: Floats, columns: Mapping[str, Floats], names: tuple[str, ...]) -> list[Floats]:
    """Times at which all of these are known, and their values there."""
    rows = [columns.get(name, np.full(len(time), np.nan)) for name in names]
    known = np.isfinite(rows).all(axis=0)
    return [time[known], *(row[known] for row in rows)]


def _steps(latitude: Floats, longitude: Floats) -> Floats:
    """m between one fix and the next."""
    if not len(latitude):
        return np.empty(0)
    east, north = TransverseMercator(float(latitude.mean()), longitude[0]).forward(
        latitude, longitude
    )
    return np.hypot(np.diff(east), np.diff(north))


def _jumps(
    time: Floats, columns: Mapping[str, Floats], at: Floats, way: Floats
) -> Iterator[Finding]:
    own, speed = _known(time, columns, ("speed",))
    if len(own) < 2:
        return
    fastest = np.maximum(np.interp(at[1:], own, speed), np.interp(at[:-1], own, speed))
    far = np.flatnonzero(way > JUMP + RUNS * fastest * np.diff(at))
    if len(far):
        yield Finding(
            "fix_jump",
            "fault",
            ("gnss.latitude", "gnss.longitude"),
            f"the position jumps {len(far)} times, by up to {way[far].max():.0f} m",
            "the receiver lost its fix there (tunnel, high houses): mark such fixes invalid",
            float(at[far[0]]),
            float(len(far)),
        )


def _heights(time: Floats, columns: Mapping[str, Floats], way: float) -> Iterator[Finding]:
    at, altitude = _known(time, columns, ("altitude",))
    own, climb = _known(time, columns, ("climb",))
    rigid = {
        "gnss.altitude": len(at) > 1 and np.ptp(altitude) == 0.0,
        "gnss.climb": len(own) > 1 and np.ptp(climb) == 0.0,
    }
    for role in (role for role, is_rigid in rigid.items() if is_rigid):
        yield Finding(
            "dead",
            "fault",
            (role,),
            f"stays exactly the same over {way / 1000:.1f} km",
            "the receiver has no height, or it is not mapped: leave it out",
        )
    if any(rigid.values()) or len(own) < 2 or len(at) < 2:
        return
    risen = np.concatenate([[0.0], np.cumsum(climb[:-1] * np.diff(own))])
    risen = np.interp(at, own, risen)
    if min(np.std(risen), np.std(altitude)) < CLIMBS:
        return
    r = float(np.corrcoef(risen, altitude)[0, 1])
    if r < AGAINST:
        yield Finding(
            "heights",
            "fault",
            ("gnss.altitude", "gnss.climb"),
            f"one falls where the other rises (correlation {r:.2f})",
            "one of the two has its sign reversed: give it scale = -1.0",
            None,
            r,
        )
