"""The vocabulary of phones, receivers and cameras: every reader of one gives these frames.

- `accelerometer`: x, y, z in m/s2, specific force in the device's axes (at rest +9.81 upward)
- `gyroscope`: x, y, z in rad/s, right-handed
- `location`: latitude, longitude in deg; altitude in m; speed, climb in m/s; course in deg, clock-
  wise from north; heading of two antennas as course; their `_accuracy` in the same units
- `attitude`: inclination nose up, roll_total right side down, in deg: the device's own estimate
- `obd`: speed in m/s, as the car's bus has it
- `barometer`: altitude in m, relative

The shipped profiles `phone`, `receiver` and `camera` map them; they differ in the mounting.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from roadlog.geo import EARTH_RADIUS
from roadlog.ingest.frame import Frame
from roadlog.types import Floats, Stamps

UNITS = {
    **{f"accelerometer.{axis}": "m/s^2" for axis in "xyz"},
    **{f"gyroscope.{axis}": "rad/s" for axis in "xyz"},
    "location.latitude": "deg",
    "location.longitude": "deg",
    "location.altitude": "m",
    "location.speed": "m/s",
    "location.climb": "m/s",
    "location.course": "deg",
    "location.heading": "deg",
    "location.horizontal_accuracy": "m",
    "location.vertical_accuracy": "m",
    "location.speed_accuracy": "m/s",
    "location.course_accuracy": "deg",
    "attitude.inclination": "deg",
    "attitude.roll_total": "deg",
    "obd.speed": "m/s",
    "barometer.altitude": "m",
}
LONGEST_STEP = 10.0  # s between points, of which a speed is made
SEA_LEVEL = 1013.25  # hPa, of the standard atmosphere (ICAO Doc 7488)


def frame(name: str, file: str, time: Stamps, columns: Mapping[str, ArrayLike]) -> Frame:
    """A frame of the vocabulary; columns without any value are left out."""
    known = {c: np.asarray(v, np.float64) for c, v in columns.items()}
    known = {c: v for c, v in known.items() if np.isfinite(v).any()}
    units = {c: UNITS[f"{name}.{c}"] for c in known}
    return Frame(name, file, np.asarray(time, np.int64), known, units)


def nanoseconds(seconds: ArrayLike) -> Stamps:
    """Stamps of seconds, the whole ones exact."""
    values = np.asarray(seconds, np.float64)
    whole = np.floor(values)
    rest = np.rint((values - whole) * 1e9).astype(np.int64)
    return whole.astype(np.int64) * 1_000_000_000 + rest


def pressure_altitude(pressure: ArrayLike) -> np.ndarray:
    """m of the standard atmosphere, by a pressure in hPa."""
    return 44330.77 * (1 - (np.asarray(pressure, np.float64) / SEA_LEVEL) ** 0.190263)


def speed_of(time: Floats, latitude: Floats, longitude: Floats) -> Floats:
    """m/s by central differences of the positions; NaN across long steps."""
    north = np.radians(latitude) * EARTH_RADIUS
    east = np.radians(longitude) * EARTH_RADIUS * np.cos(np.radians(np.nanmean(latitude)))
    speed = np.hypot(np.gradient(north, time), np.gradient(east, time))
    wide = np.diff(time) > LONGEST_STEP
    speed[np.concatenate([wide, [False]]) | np.concatenate([[False], wide])] = np.nan
    return speed
