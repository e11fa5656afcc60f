"""Which passes went over the same road: stretches, and every pass's runs along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.drive import runs
from roadlog.geo import EARTH_RADIUS
from roadlog.roads.passes import Pass
from roadlog.roads.way import STEP
from roadlog.types import Bools, Floats

REACH = 15.0  # m across the road: its lanes, and the errors of two positions
REACH_BACK = 10.0  # m, against the direction: the legs of a hairpin are nearer than 2 REACH
PARALLEL = np.radians(40.0)  # rad between the ways of passes over one road
CHUNK = 100  # points of a pass placed at a time, so that a lap meets the lap before
TURNED = np.radians(120.0)  # rad, after which a chunk ends: the way may lead back over itself
SHORTEST = 10  # points; a shorter meeting is a crossing, a shorter detour a parked car
JUMP = 10 * STEP  # m without a known grade, after which a pass begins anew
SLANT = 0.2  # of lateral against longitudinal way, beyond which two roads only cross
STOREY = 8.0  # m of altitude between two roads; a receiver wanders less within a drive
HOLE = 6  # points that the way over a hole may be off the known road's
BEHIND = int(REACH / STEP) + 3  # points of a stretch's end that its own next points meet
LOOK = 8  # nearest known points that are asked


@dataclass(frozen=True)
class Traverse:
    """A part of a pass along one stretch. points: (m,) indices into the pass, in travel order.

    forward: in the stretch's direction. nodes: of the stretch, abeam of the first and last point.
    """

    owner: int
    points: NDArray[np.int64]
    forward: bool
    nodes: tuple[int, int]


@dataclass
class Stretch:
    """A road without junctions that has been driven. nodes: its line as it was first driven."""

    latitude: Floats
    longitude: Floats
    course: Floats
    runs: list[Traverse] = field(default_factory=list)


class Places:
    """Every known point of road, found by place and direction; points come in, none goes out."""

    def __init__(self) -> None:
        self.xyz = np.empty((0, 3))
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
        self.course = np.concatenate([self.course, course])
        self.stretch = np.concatenate([self.stretch, np.full(len(xyz), stretch)])
        self.node = np.concatenate([self.node, first + np.arange(len(xyz))])
        self.altitude = np.concatenate([self.altitude, altitude])
        self.owner = np.concatenate([self.owner, np.full(len(xyz), owner)])
        # trees of growing size, so that each point is put into few of them
        while self._trees and begin - self._trees[-1][0] <= len(self.xyz) - begin:
            begin = self._trees.pop()[0]
        self._trees.append((begin, cKDTree(self.xyz[begin:])))

    def nearest(
        self, xyz: Floats, course: Floats, altitude: Floats, owner: int
    ) -> NDArray[np.int64]:
        """Index of the nearest known point along or against the way; -1 where there is none.

        A pass that is higher up by more than STOREY than where it was before is on another road;
        the altitudes of two receivers cannot be compared.
        """
        best = np.full(len(xyz), -1)
        least = np.full(len(xyz), np.inf)
        for begin, tree in self._trees:
            away, index = tree.query(xyz, LOOK, distance_upper_bound=REACH)
            there = np.isfinite(away)
            index = np.where(there, index + begin, 0)
            turn = course[:, None] - self.course[index]
            there &= np.abs(np.sin(turn)) < np.sin(PARALLEL)
            there &= (np.cos(turn) > 0) | (away < REACH_BACK)
            climb = np.abs(altitude[:, None] - self.altitude[index])
            there &= ~((self.owner[index] == owner) & (climb > STOREY))
            away[~there] = np.inf
            column = away.argmin(axis=1)
            rows = np.arange(len(xyz))
            nearer = away[rows, column] < least
            best[nearer] = index[rows, column][nearer]
            least[nearer] = away[rows, column][nearer]
        return best


def stretches(passes: Sequence[Pass]) -> list[Stretch]:
    """Every stretch of road in some passes; each pass is in it once, but for laps.

    A pass is placed in chunks. Where a known point lies abeam and the way is parallel, it is the
    same road, in either direction; what is not known becomes road. Meetings shorter than SHORTEST
    or at a slant are crossings. Stretches that every drive passes one after the other are joined.
    """
    places, found = Places(), _Book([])
    for owner, own in enumerate(passes):
        xyz = _xyz(own.latitude, own.longitude)
        open_stretch: int | None = None
        last_chunk: NDArray | None = None
        for chunk in _chunks(own):
            if last_chunk is None or own.distance[chunk[0]] - own.distance[last_chunk[-1]] > JUMP:
                open_stretch = None
            near = places.nearest(xyz[chunk], own.course[chunk], own.altitude[chunk], owner)
            open_stretch = found.place(owner, own, xyz, chunk, near, places, open_stretch)
            last_chunk = chunk
    return joined(found.stretches, passes)


@dataclass
class _Book:
    stretches: list[Stretch]

    def place(
        self,
        owner: int,
        own: Pass,
        xyz: Floats,
        chunk: NDArray[np.int64],
        near: NDArray[np.int64],
        places: Places,
        open_stretch: int | None,
    ) -> int | None:
        """Enter one chunk; the stretch that its end is still adding to, if any."""
        if open_stretch is not None:  # its own last points lie just behind, not abeam
            end = len(self.stretches[open_stretch].latitude) - BEHIND
            behind = (places.stretch[near] == open_stretch) & (places.node[near] >= end)
            near = np.where(behind, -1, near)
        met = _meetings(own, xyz, chunk, near, places)
        known = np.zeros(len(chunk), np.bool_)
        for part in met:
            there = part[near[part] >= 0]  # all but the holes
            which = int(places.stretch[near[there[0]]])
            points = chunk[part]
            forward = bool(np.cos(own.course[chunk[there]] - places.course[near[there]]).mean() > 0)
            nodes = int(places.node[near[there[0]]]), int(places.node[near[there[-1]]])
            self.stretches[which].runs.append(Traverse(owner, points, forward, nodes))
            known[part] = True
        last: int | None = None
        for run in runs(~known):
            goes_on = run.start == 0 and open_stretch is not None
            if run.stop - run.start < SHORTEST and not goes_on:
                continue
            points = chunk[run]
            if goes_on and open_stretch is not None:
                which = open_stretch
                self._extend(which, own, points)
            else:
                which = len(self.stretches)
                self.stretches.append(Stretch(np.empty(0), np.empty(0), np.empty(0)))
                self._extend(which, own, points)
            stretch = self.stretches[which]
            first = len(stretch.latitude) - len(points)
            places.add(xyz[points], own.course[points], own.altitude[points], owner, which, first)
            last_node = len(stretch.latitude) - 1
            nodes = last_node - len(points) + 1, last_node
            stretch.runs.append(Traverse(owner, points, True, nodes))
            if run.stop == len(chunk):
                last = which
        return last

    def _extend(self, which: int, own: Pass, points: NDArray[np.int64]) -> None:
        stretch = self.stretches[which]
        for name in ("latitude", "longitude", "course"):
            values = np.concatenate([getattr(stretch, name), getattr(own, name)[points]])
            setattr(stretch, name, values)


def _chunks(own: Pass) -> list[NDArray[np.int64]]:
    """Indices of a pass in pieces of at most CHUNK points, cut at jumps and after half turns."""
    result, begin = [], 0
    course = np.unwrap(own.course)
    for k in range(1, len(own) + 1):
        if (
            k == len(own)
            or k - begin >= CHUNK
            or own.distance[k] - own.distance[k - 1] > JUMP
            or abs(course[k] - course[begin]) > TURNED
        ):
            result.append(np.arange(begin, k))
            begin = k
    return result


def _meetings(
    own: Pass, xyz: Floats, chunk: NDArray[np.int64], near: NDArray[np.int64], places: Places
) -> list[NDArray[np.int64]]:
    """Positions in the chunk of each run over one known stretch, in one direction."""
    hit = near >= 0
    if not hit.any():
        return []
    stretch = np.where(hit, places.stretch[near], -1)
    forward = np.cos(own.course[chunk] - places.course[near]) > 0
    node = places.node[near]
    step = np.diff(node) * np.where(forward[1:], 1, -1)
    goes_on: Bools = (
        (stretch[1:] == stretch[:-1])
        & hit[1:]
        & (forward[1:] == forward[:-1])
        & (np.abs(step - np.diff(own.distance[chunk]) / STEP) < 4)
    )
    cuts = np.flatnonzero(~goes_on) + 1
    result = []
    for part in np.split(np.arange(len(chunk)), cuts):
        # at a chunk's edge the rest of a run may lie in the next; a turn there is no way back
        at_edge = (part[0] == 0 or part[-1] == len(chunk) - 1) and forward[part[0]]
        if not hit[part[0]] or (len(part) < SHORTEST and not at_edge) or len(part) < 2:
            continue
        away = np.linalg.norm(xyz[chunk[part]] - places.xyz[near[part]], axis=1)
        way = own.distance[chunk[part[-1]]] - own.distance[chunk[part[0]]]
        if np.ptp(away) > max(SLANT * way, 3.0) and len(part) < 4 * SHORTEST:
            continue
        result.append(part)
    return _bridged(result, own.distance[chunk], stretch, forward, node)


def _bridged(
    parts: list[NDArray[np.int64]],
    distance: Floats,
    stretch: NDArray[np.int64],
    forward: Bools,
    node: NDArray[np.int64],
) -> list[NDArray[np.int64]]:
    """Parts of one stretch with a hole between them, in which only the fixes were off, as one."""
    result: list[NDArray[np.int64]] = []
    for part in parts:
        if result:
            a, b = result[-1][-1], part[0]
            along = (node[b] - node[a]) * (1 if forward[a] else -1)
            off = abs(along - (distance[b] - distance[a]) / STEP)
            if stretch[a] == stretch[b] and forward[a] == forward[b] and off < HOLE:
                result[-1] = np.arange(result[-1][0], part[-1] + 1)
                continue
        result.append(part)
    return result


def _xyz(latitude: Floats, longitude: Floats) -> Floats:
    """m, on a sphere about the earth's centre: places anywhere can be compared."""
    a, b = np.radians(latitude), np.radians(longitude)
    return EARTH_RADIUS * np.stack(
        [np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a)], axis=1
    )


def joined(found: list[Stretch], passes: Sequence[Pass]) -> list[Stretch]:
    """Stretches with one neighbor at an end are one road."""
    links: dict[tuple[int, int], set[tuple[int, int]]] = {}
    ways: dict[int, list[tuple[int, Traverse]]] = {}
    for index, stretch in enumerate(found):
        for run in stretch.runs:
            ways.setdefault(run.owner, []).append((index, run))
    for owner, parts in ways.items():
        parts.sort(key=lambda part: int(part[1].points[0]))
        for (a, before), (b, after) in pairwise(parts):
            gap = np.diff(passes[owner].distance[[before.points[-1], after.points[0]]])[0]
            here = _end(found[a], before.nodes[1])
            there = _end(found[b], after.nodes[0])
            if a == b or gap > JUMP or here is None or there is None:
                continue
            links.setdefault((a, here), set()).add((b, there))
            links.setdefault((b, there), set()).add((a, here))
    single = {
        end: next(iter(others))
        for end, others in links.items()
        if len(others) == 1 and len(links[next(iter(others))]) == 1
    }
    return _chained(found, single)


def _end(stretch: Stretch, node: int) -> int | None:
    """0 at the stretch's beginning, 1 at its end, None between them."""
    if node <= BEHIND:
        return 0
    return 1 if node >= len(stretch.latitude) - 1 - BEHIND else None


def _chained(found: list[Stretch], single: dict[tuple[int, int], tuple[int, int]]) -> list[Stretch]:
    """One stretch for every chain of linked ends; end 0 is a stretch's beginning, 1 its end."""
    left, result = set(range(len(found))), []
    while left:
        start = min(left)
        index, entry = start, 0
        seen = {start}
        while (index, entry) in single:  # back to where the chain begins
            other, end = single[index, entry]
            if other in seen:
                break
            seen.add(other)
            index, entry = other, 1 - end
        chain = []
        while index in left:
            left.discard(index)
            chain.append((index, entry == 0))
            following = single.get((index, 1 - entry))
            if following is None:
                break
            index, entry = following
        result.append(_connected([(found[i], forward) for i, forward in chain]))
    return result


def _connected(chain: list[tuple[Stretch, bool]]) -> Stretch:
    columns: dict[str, list[Floats]] = {"latitude": [], "longitude": [], "course": []}
    members: list[Traverse] = []
    begin = 0
    for stretch, forward in chain:
        way = slice(None, None, 1 if forward else -1)
        columns["latitude"].append(stretch.latitude[way])
        columns["longitude"].append(stretch.longitude[way])
        columns["course"].append(stretch.course[way] + (0.0 if forward else np.pi))
        last = len(stretch.latitude) - 1
        for run in stretch.runs:
            first, end = (begin + (n if forward else last - n) for n in run.nodes)
            members.append(Traverse(run.owner, run.points, run.forward == forward, (first, end)))
        begin += last + 1
    latitude, longitude, course = (np.concatenate(c) for c in columns.values())
    return Stretch(latitude, longitude, course, _merged(members))


def _merged(members: list[Traverse]) -> list[Traverse]:
    """Runs of one drive that follow each other are one; a lap that begins anew is its own."""
    result: list[Traverse] = []
    for run in sorted(members, key=lambda r: (r.owner, int(r.points[0]))):
        last = result[-1] if result else None
        if (
            last is not None
            and last.owner == run.owner
            and last.forward == run.forward
            and 0 < run.points[0] - last.points[-1] <= JUMP / STEP
            and (run.nodes[0] - last.nodes[1]) * (1 if run.forward else -1) >= -BEHIND
        ):
            points = np.concatenate([last.points, run.points])
            result[-1] = Traverse(run.owner, points, run.forward, (last.nodes[0], run.nodes[1]))
        else:
            result.append(run)
    return result
