"""Fixes of a receiver and a barometer for `fusion`, and loop closure.

Source: docs/methods/fusion.md#gnss-rows, docs/methods/fusion.md#loop-closure.
"""

from __future__ import annotations

import numpy as np

from roadlog.drive import Drive, Samples
from roadlog.estimators.fusion.speed import SpeedSource, known_samples
from roadlog.estimators.fusion.steps import STEP_RATE, Fix
from roadlog.geo import TransverseMercator
from roadlog.types import Bools, Floats, Indices

MIN_COURSE_SPEED = 1.0  # m/s, below this the course is noise
ALTITUDE_INTERVAL = 1.0  # s, between altitudes used: their error is correlated over more than that
ACCURACY_FACTOR = 2.0  # receivers' errors are correlated over several samples
VELOCITY_SD, CLIMB_SD, ALTITUDE_SD = 0.06, 0.12, 1.0  # m/s, m/s, m; where nothing is reported
BAROMETER_SD = 0.3  # m, of one value; its slow error is a state
CLOSURE_SD = 0.5  # m, altitude at a second visit of a place
HEADING_SD, ROLL_SD = np.radians(0.3), np.radians(0.6)
REVISIT_STEP = 0.2  # s between places that are compared
REVISIT_GAP = 3.0  # s between fixes; across more the place is not known
REVISIT_RADIUS, REVISIT_HEIGHT = 4.0, 3.0  # m; a lane beside is as high, a floor above is not
REVISIT_TIME, REVISIT_PATH = 20.0, 100.0  # s, m between two visits


def fixes_of(
    drive: Drive, time: Floats, source: SpeedSource, delay: float
) -> tuple[Floats, Floats]:
    """The rows of receiver and barometer at the nearest steps and their sd, (n, 8).

    delay: s, of the receiver behind the IMU.
    """
    n = len(time)
    fixes, sd = np.full((n, len(Fix)), np.nan), np.ones((n, len(Fix)))
    gnss = drive.native.get("gnss", Samples(np.empty(0), {}))
    unknown = np.full(len(gnss.time), np.nan)

    def column(name: str) -> Floats:
        return gnss.columns.get(name, unknown)

    def accuracy(name: str, default: float) -> Floats:
        reported = column(f"{name}_accuracy")
        return ACCURACY_FACTOR * np.where(reported > 0, reported, default)

    speed, course = column("speed"), column("course")
    if source.name == "gnss":
        speed = unknown  # it is the speed row already
    at = gnss.time - delay
    moving = speed > MIN_COURSE_SPEED
    # an error of the course moves the car sideways by speed x error
    across = np.nan_to_num(speed) * np.nan_to_num(column("course_accuracy"))
    horizontal = np.hypot(accuracy("speed", VELOCITY_SD), ACCURACY_FACTOR * across)
    entries = {
        Fix.EAST: (np.where(moving, speed * np.cos(course), np.nan), horizontal),
        Fix.NORTH: (np.where(moving, speed * np.sin(course), np.nan), horizontal),
        Fix.UP: (column("climb"), accuracy("climb", CLIMB_SD)),
        Fix.HEADING: (column("heading"), accuracy("heading", HEADING_SD)),
        Fix.ROLL: (column("roll"), accuracy("roll", ROLL_SD)),
    }
    for index, (values, spread) in entries.items():
        _place(fixes, sd, index, at, values, spread)
    altimeters = [(Fix.ALTITUDE, at, column("altitude"), ALTITUDE_SD)]
    if "barometer" in drive.native:
        barometer = drive.native["barometer"]
        altimeters.append(
            (Fix.BAROMETER, barometer.time, barometer.columns["altitude"], BAROMETER_SD)
        )
    for index, times, values, noise in altimeters:
        own, altitude = known_samples(times, values)
        if len(own):
            chosen = np.unique(np.floor(own / ALTITUDE_INTERVAL), return_index=True)[1]
            own, altitude = own[chosen], altitude[chosen] - altitude[0]
            _place(fixes, sd, index, own, altitude, np.full(len(own), noise))
    return fixes, sd


def revisits(drive: Drive, time: Floats, alive: Bools, fixes: Floats, fixes_sd: Floats) -> Bools:
    """Steps whose altitude is kept; places visited again become rows of `fixes`.

    By the receiver's position, where its altitude agrees: ramps of a car park lie above each other.
    One altitude is kept at a time.
    """
    clone = np.zeros(len(time), np.bool_)
    names = "latitude", "longitude", "altitude"
    gnss = drive.native.get("gnss", Samples(np.empty(0), {}))
    if any(name not in gnss.columns for name in names):
        return clone
    known = np.all([np.isfinite(gnss.columns[name]) for name in names], axis=0)
    own = gnss.time[known]
    latitude, longitude, altitude = (gnss.columns[name][known] for name in names)
    if len(own) < 2 or np.ptp(longitude) > 1.0:  # deg; none so long, or across the date line
        return clone
    east, north = TransverseMercator(latitude[0], longitude[0]).forward(latitude, longitude)
    path = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(east), np.diff(north)))])
    at = np.arange(own[0], own[-1], REVISIT_STEP)
    gap = np.diff(own)[np.clip(np.searchsorted(own, at, side="right") - 1, 0, len(own) - 2)]
    at = at[gap < REVISIT_GAP]
    if not len(at):
        return clone
    place = np.stack([np.interp(at, own, east), np.interp(at, own, north)], axis=1)
    height, driven = np.interp(at, own, altitude), np.interp(at, own, path)
    run = np.cumsum(~alive)  # the same number on both sides of no gap
    places, at_step = _Places(place), np.round(at * STEP_RATE).astype(np.int64)
    earlier = np.searchsorted(at, at - REVISIT_TIME)
    latest, kept = places.latest(earlier), 0
    for j, k in enumerate(at_step):
        if latest[j] < kept or k >= len(time) or not alive[k]:
            continue
        near = places.near(j, kept, earlier[j])
        first = at_step[near]
        is_again = (
            alive[first]
            & (run[first] == run[k])
            & (driven[j] - driven[near] > REVISIT_PATH)
            & (np.abs(height[j] - height[near]) < REVISIT_HEIGHT)
        )
        if is_again.any():
            clone[first[is_again][0] + 1] = True
            fixes[k, Fix.CLOSURE], fixes_sd[k, Fix.CLOSURE] = 0.0, CLOSURE_SD
            kept = j
    return clone


class _Places:
    """Places (m, 2), m, in the order of the drive, by squares as wide as REVISIT_RADIUS.

    Laps pass the same places hundreds of times: only those between two indices are looked at.
    """

    def __init__(self, place: Floats) -> None:
        self.place = place
        squares = np.floor(place / REVISIT_RADIUS).astype(np.int64)
        east, north = (squares - squares.min(axis=0)).T
        width = int(north.max()) + 3  # two squares apart: no neighbour is one of the next column
        self.square = (east + 1) * width + north + 1
        self.around = np.add.outer([-width, 0, width], [-1, 0, 1]).ravel()
        # sorted by square, then by index
        self.keys = np.sort(self.square * len(place) + np.arange(len(place)))

    def latest(self, last: Indices) -> Indices:
        """Of every place, the newest before index last (m,) in the squares around, or -1."""
        m, found = len(self.place), np.full(len(self.place), -1)
        for offset in self.around:
            first = (self.square + offset) * m
            before = self.keys[np.maximum(np.searchsorted(self.keys, first + last) - 1, 0)]
            is_there = (before >= first) & (before < first + last)
            found = np.where(is_there, np.maximum(found, before - first), found)
        return found

    def near(self, j: int, first: int, last: int) -> Indices:
        """Those of first .. last - 1 that are within REVISIT_RADIUS of place j, ascending."""
        squares = (self.square[j] + self.around) * len(self.place)
        begins, ends = (np.searchsorted(self.keys, squares + edge) for edge in (first, last))
        found = [self.keys[b:e] - s for s, b, e in zip(squares, begins, ends, strict=True)]
        near = np.sort(np.concatenate(found))
        east_north = self.place[near] - self.place[j]
        return near[np.hypot(east_north[:, 0], east_north[:, 1]) <= REVISIT_RADIUS]


def _place(
    fixes: Floats, sd: Floats, column: int, own: Floats, values: Floats, spread: Floats
) -> None:
    index = np.round(own * STEP_RATE).astype(np.int64)
    use = np.isfinite(values) & (index >= 0) & (index < len(fixes))
    fixes[index[use], column] = values[use]
    sd[index[use], column] = spread[use]
