"""Grade of roads from many drives over them: distance-aligned passes, inverse-variance mean."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from roadlog.drive import Drive, runs
from roadlog.estimate import Estimate
from roadlog.files import replacing
from roadlog.geo import LocalPlane
from roadlog.types import Floats

STEP = 10.0  # m between the points of a pass and of a stretch
REACH = 15.0  # m across the road: its lanes, and the error of two positions
MAX_TURN = np.radians(45.0)  # rad between the headings of passes over the same road
COVER = 1.5 * STEP  # m along the road from a known point up to which road is known
JUMP = 5 * STEP  # m without a valid grade, after which a pass begins anew
CHUNK = 100  # points of a pass merged at a time, so that a lap meets the lap before
MIN_NEW = 5  # points; less is no stretch but a detour around a parked car
TILE = 0.005  # deg, of the index of known points: some 500 m, more than MIN_NEW and REACH


@dataclass(frozen=True)
class Pass:
    """One drive's grade along its way, a point every `STEP`.

    latitude, longitude: deg. heading: rad, counterclockwise from east. grade: rad, uphill along
    the heading. sd: rad. distance: m, from the start of the drive. NaN nowhere.
    """

    estimator: str
    latitude: Floats
    longitude: Floats
    heading: Floats
    grade: Floats
    sd: Floats
    distance: Floats

    def to_bytes(self) -> bytes:
        """The pass as a compressed file."""
        buffer = io.BytesIO()
        columns = {
            "latitude": self.latitude,
            "longitude": self.longitude,
            **{k: getattr(self, k).astype(np.float32) for k in ("heading", "grade", "sd")},
            "distance": self.distance,
        }
        np.savez_compressed(buffer, estimator=np.array(self.estimator), **columns)
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> Pass:
        """What `to_bytes` wrote."""
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            names = ("latitude", "longitude", "heading", "grade", "sd", "distance")
            return cls(str(file["estimator"]), *(file[n].astype(np.float64) for n in names))


def pass_of(drive: Drive, estimate: Estimate) -> Pass | None:
    """The pass of one estimate; None without positions, a speed, or a grade with its sd.

    Only points with a valid grade are in it. Positions are the mean over a step, the heading is
    that of the chord over two steps on either side.
    """
    needed = ("gnss.latitude", "gnss.longitude")
    if "grade" not in estimate.known or not all(role in drive for role in needed):
        return None
    if not drive.has_speed or not np.isfinite(estimate.sd["grade"]).any():
        return None
    distance = np.cumsum(np.abs(np.nan_to_num(drive.speed))) * drive.dt
    distance = np.interp(estimate.time, drive.time, distance)
    columns = [np.interp(estimate.time, drive.time, drive[role]) for role in needed]
    columns += [estimate.angles["grade"], estimate.sd["grade"]]
    known = estimate.valid & np.isfinite(columns).all(axis=0) & (columns[3] > 0)
    if not known.any():
        return None
    bins = np.floor(distance[known] / STEP).astype(np.int64)
    which, index, count = np.unique(bins, return_inverse=True, return_counts=True)
    latitude, longitude, grade, sd, distance = (
        np.bincount(index, column[known]) / count for column in (*columns, distance)
    )
    plane = LocalPlane(float(latitude.mean()), float(longitude[0]))
    x, y = plane.forward(latitude, longitude)
    before = np.maximum(np.arange(len(which)) - 2, 0)
    after = np.minimum(np.arange(len(which)) + 2, len(which) - 1)
    heading = np.arctan2(y[after] - y[before], x[after] - x[before])
    return Pass(estimate.name, latitude, longitude, heading, grade, sd, distance)


@dataclass(frozen=True)
class RoadProfile:
    """Grade of every stretch of road that was driven, a point every `STEP`.

    stretch: number of the stretch; it ends where the drives left known road, not at a junction.
    distance: m along it. latitude, longitude: deg. heading: rad, counterclockwise from east; each
    direction of travel is a stretch of its own. grade, sd: rad. passes: how many were merged.
    drives: number of passes' drives in all.
    """

    stretch: NDArray[np.int64]
    distance: Floats
    latitude: Floats
    longitude: Floats
    heading: Floats
    grade: Floats
    sd: Floats
    passes: NDArray[np.int64]
    drives: int

    def __len__(self) -> int:
        return len(self.stretch)

    @property
    def length(self) -> float:
        """m, of all stretches."""
        return STEP * len(self)

    def columns(self) -> dict[str, NDArray]:
        """As a table has them; degrees and percent beside the radians for people."""
        return {
            "stretch": self.stretch,
            "distance_m": self.distance,
            "latitude_deg": self.latitude,
            "longitude_deg": self.longitude,
            "heading_rad": self.heading,
            "grade_rad": self.grade,
            "grade_sd_rad": self.sd,
            "grade_percent": 100 * np.tan(self.grade),
            "passes": self.passes,
        }

    def write(self, path: Path) -> None:
        """Write the table as Parquet."""
        import pyarrow as pa
        from pyarrow import parquet

        with replacing(path) as file:
            parquet.write_table(pa.table(self.columns()), file)


class RoadMerger:
    """Merges passes one by one into a road profile.

    A pass is cut into chunks. Each known point of road within `REACH` of a chunk, and with about
    its heading, is put abeam of the nearest point of the chunk: where it lies along the chunk says
    which grade it gets (distance-aligned). What no known point covers is a new stretch.
    """

    def __init__(self) -> None:
        self._tiles: dict[tuple[int, int], list[int]] = {}
        self._points = _Points()
        self._stretches = 0
        self._drives = 0

    def add(self, drive: Pass) -> None:
        """Merge one drive."""
        self._drives += 1
        open_stretch: int | None = None
        jumps = np.flatnonzero(np.diff(drive.distance) > JUMP) + 1
        for part in np.split(np.arange(len(drive.distance)), jumps):
            open_stretch = None
            for k in range(0, len(part), CHUNK):
                chunk = part[k : k + CHUNK]
                open_stretch = self._merge(drive, chunk, open_stretch)

    def _merge(self, drive: Pass, chunk: NDArray, open_stretch: int | None) -> int | None:
        """Merge a chunk; the stretch that its end is still adding to, if any."""
        latitude, longitude = drive.latitude[chunk], drive.longitude[chunk]
        heading, distance = drive.heading[chunk], drive.distance[chunk]
        plane = LocalPlane(latitude[0], longitude[0])
        x, y = plane.forward(latitude, longitude)
        near = self._near(latitude, longitude)
        covered = np.zeros(len(chunk), np.bool_)
        if len(near):
            points = self._points
            px, py = plane.forward(points["latitude"][near], points["longitude"][near])
            away = np.hypot(px[:, None] - x, py[:, None] - y)
            turn = np.cos(points["heading"][near][:, None] - heading)
            away[turn < np.cos(MAX_TURN)] = np.inf
            nearest = away.argmin(axis=1)
            dx, dy = px - x[nearest], py - y[nearest]
            along = dx * np.cos(heading[nearest]) + dy * np.sin(heading[nearest])
            across = dy * np.cos(heading[nearest]) - dx * np.sin(heading[nearest])
            hit = (
                np.isfinite(away.min(axis=1)) & (np.abs(across) <= REACH) & (np.abs(along) <= STEP)
            )
            if hit.any():
                at = distance[nearest[hit]] + along[hit]
                grade = np.interp(at, distance, drive.grade[chunk])
                sd = np.interp(at, distance, drive.sd[chunk])
                points.merge(near[hit], grade, sd)
                gap = np.abs(distance[:, None] - at).min(axis=1)
                covered = gap <= COVER
        last: int | None = None
        for run in runs(~covered):
            goes_on = run.start == 0 and open_stretch is not None
            if run.stop - run.start < MIN_NEW and not goes_on:
                continue
            stretch = open_stretch if goes_on and open_stretch is not None else self._new_stretch()
            self._append(drive, chunk[run], stretch)
            if run.stop == len(chunk):
                last = stretch
        return last

    def _new_stretch(self) -> int:
        self._stretches += 1
        return self._stretches - 1

    def _append(self, drive: Pass, index: NDArray, stretch: int) -> None:
        first = len(self._points)
        self._points.append(drive, index, stretch)
        for k, tile in enumerate(
            zip(*_tile(drive.latitude[index], drive.longitude[index]), strict=True)
        ):
            self._tiles.setdefault(tile, []).append(first + k)

    def _near(self, latitude: Floats, longitude: Floats) -> NDArray[np.int64]:
        """Known points in the tiles around a chunk."""
        tiles = set(zip(*_tile(latitude, longitude), strict=True))
        around = {(i + a, j + b) for i, j in tiles for a in (-1, 0, 1) for b in (-1, 0, 1)}
        found = [index for tile in around for index in self._tiles.get(tile, ())]
        return np.array(sorted(found), np.int64)

    def profile(self) -> RoadProfile:
        """The profile of everything merged so far.

        A stretch whose passes differ by more than their sd say gets its sd multiplied by the Birge
        ratio, sqrt(chi^2 / degrees of freedom) where that is above 1 (Birge 1932).
        """
        p = self._points
        stretch = p["stretch"].astype(np.int64)
        weight = p["weight"]
        grade = p["weighted"] / weight
        chi2 = np.maximum(p["squared"] - weight * grade**2, 0.0)
        passes = p["passes"].astype(np.int64)
        freedom = np.bincount(stretch, passes - 1, self._stretches)
        ratio = np.bincount(stretch, chi2, self._stretches) / np.maximum(freedom, 1)
        birge = np.sqrt(np.maximum(1.0, ratio))
        distance = np.zeros(len(stretch))
        for k in range(self._stretches):
            of = stretch == k
            distance[of] = STEP * np.arange(of.sum())
        return RoadProfile(
            stretch,
            distance,
            p["latitude"],
            p["longitude"],
            p["heading"],
            grade,
            birge[stretch] / np.sqrt(weight),
            passes,
            self._drives,
        )


class _Points:
    """Columns that grow: positions and weighted sums of the points of all stretches."""

    NAMES = (
        "stretch", "latitude", "longitude", "heading", "weight", "weighted", "squared", "passes",
    )  # fmt: skip

    def __init__(self) -> None:
        self._columns = {name: np.empty(1024) for name in self.NAMES}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, name: str) -> Floats:
        return self._columns[name][: self._count]

    def append(self, drive: Pass, index: NDArray, stretch: int) -> None:
        weight = 1 / drive.sd[index] ** 2
        grade = drive.grade[index]
        new = {
            "stretch": np.full(len(index), float(stretch)),
            "latitude": drive.latitude[index],
            "longitude": drive.longitude[index],
            "heading": drive.heading[index],
            "weight": weight,
            "weighted": weight * grade,
            "squared": weight * grade**2,
            "passes": np.ones(len(index)),
        }
        end = self._count + len(index)
        for name, values in new.items():
            column = self._columns[name]
            if end > len(column):
                column = self._columns[name] = np.resize(column, 2 * end)
            column[self._count : end] = values
        self._count = end

    def merge(self, at: NDArray, grade: Floats, sd: Floats) -> None:
        """Add one pass to each of some points."""
        weight = 1 / sd**2
        self["weight"][at] += weight
        self["weighted"][at] += weight * grade
        self["squared"][at] += weight * grade**2
        self["passes"][at] += 1


def _tile(latitude: Floats, longitude: Floats) -> tuple[list[int], list[int]]:
    cells = (np.floor(latitude / TILE), np.floor(longitude / TILE))
    return cells[0].astype(int).tolist(), cells[1].astype(int).tolist()
