"""Known points of road, found by place and direction."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.geo import EARTH_RADIUS
from roadlog.roads.way import STEP
from roadlog.types import Floats

REACH = 15.0  # m across the road: its lanes, and the errors of two positions
ABEAM = 1.5 * STEP  # m along the road to the nearest known point; farther off is beyond its end
PARALLEL = np.radians(40.0)  # rad between the ways of passes over one road
LOOK = 8  # nearest known points that are asked


class Places:
    """Every known point of road, found by place and direction; points come in, none goes out."""

    def __init__(self) -> None:
        self.xyz = np.empty((0, 3))
        self.ahead = np.empty((0, 3))
        self.course = np.empty(0)
        self.stretch = np.empty(0, np.int64)
        self.node = np.empty(0, np.int64)
        self.altitude = np.empty(0)
        self.owner = np.empty(0, np.int64)
        self._trees: list[tuple[int, Any]] = []

    def add(
        self, xyz: Floats, course: Floats, altitude: Floats, owner: int, stretch: int, first: int
    ) -> None:
        """Points of one pass on one stretch, the first of which is its node `first`."""
        from scipy.spatial import cKDTree

        begin = len(self.xyz)
        self.xyz = np.concatenate([self.xyz, xyz])
        self.ahead = np.concatenate([self.ahead, _ahead(xyz, course)])
        self.course = np.concatenate([self.course, course])
        self.stretch = np.concatenate([self.stretch, np.full(len(xyz), stretch)])
        self.node = np.concatenate([self.node, first + np.arange(len(xyz))])
        self.altitude = np.concatenate([self.altitude, altitude])
        self.owner = np.concatenate([self.owner, np.full(len(xyz), owner)])
        # trees of growing size, so that each point is put into few of them
        while self._trees and begin - self._trees[-1][0] <= len(self.xyz) - begin:
            begin = self._trees.pop()[0]
        self._trees.append((begin, cKDTree(self.xyz[begin:])))

    def along(self, xyz: Floats, index: NDArray[np.int64]) -> Floats:
        """m, by which places lie ahead of known points in these points' direction."""
        off = xyz - self.xyz[index]
        result: Floats = np.einsum("...k,...k->...", off, self.ahead[index])
        return result

    def across(self, xyz: Floats, index: NDArray[np.int64]) -> Floats:
        """m, by which places lie beside known points, on either side."""
        away = np.linalg.norm(xyz - self.xyz[index], axis=-1)
        return np.sqrt(np.maximum(away**2 - self.along(xyz, index) ** 2, 0.0))

    def climb(self, altitude: Floats, owner: int, index: NDArray[np.int64]) -> float:
        """m, median height of altitudes over those that the same pass had at known points; or 0.

        The altitudes of two receivers cannot be compared.
        """
        own = self.owner[index] == owner
        off = np.abs(altitude - self.altitude[index])[own]
        return float(np.median(off)) if len(off) and np.isfinite(off).all() else 0.0

    def nearest(self, xyz: Floats, course: Floats) -> NDArray[np.int64]:
        """Index of the nearest known point along or against the way; -1 where there is none."""
        best = np.full(len(xyz), -1)
        least = np.full(len(xyz), np.inf)
        for begin, tree in self._trees:
            away, index = tree.query(xyz, LOOK, distance_upper_bound=REACH)
            there = np.isfinite(away)
            index = np.where(there, index + begin, 0)
            turn = course[:, None] - self.course[index]
            there &= np.abs(np.sin(turn)) < np.sin(PARALLEL)
            there &= np.abs(self.along(xyz[:, None], index)) < ABEAM
            away[~there] = np.inf
            column = away.argmin(axis=1)
            rows = np.arange(len(xyz))
            nearer = away[rows, column] < least
            best[nearer] = index[rows, column][nearer]
            least[nearer] = away[rows, column][nearer]
        return best


def on_sphere(latitude: Floats, longitude: Floats) -> Floats:
    """m, on a sphere about the earth's centre: places anywhere can be compared."""
    a, b = np.radians(latitude), np.radians(longitude)
    return EARTH_RADIUS * np.stack(
        [np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)], axis=1
    )


def _ahead(xyz: Floats, course: Floats) -> Floats:
    """Unit vectors along courses (rad from east) at places (n, 3) on the sphere."""
    east = np.stack([-xyz[:, 1], xyz[:, 0], np.zeros(len(xyz))], axis=1)
    east /= np.linalg.norm(east, axis=1, keepdims=True)
    north = np.cross(xyz, east) / EARTH_RADIUS
    return np.cos(course)[:, None] * east + np.sin(course)[:, None] * north
