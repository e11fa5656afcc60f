"""Which passes went over the same road: stretches, and every pass's runs along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from roadlog.drive import runs
from roadlog.roads.passes import Pass
from roadlog.roads.places import REACH, Places, on_sphere
from roadlog.roads.way import STEP
from roadlog.types import Bools, Floats

REACH_BACK = 10.0  # m, against the direction: the legs of a hairpin are nearer than 2 REACH
STOREY = 8.0  # m of altitude between two roads; a receiver wanders less within a drive
CHUNK = 100  # points of a pass placed at a time, so that a lap meets the lap before
TURNED = np.radians(120.0)  # rad, after which a chunk ends: the way may lead back over itself
SHORTEST = 10  # points; a shorter meeting is a crossing, a shorter detour a parked car
LEAST = 8  # points; fewer are no road
JUMP = 10 * STEP  # m without a known grade, after which a pass begins anew
SLANT = 0.2  # of lateral against longitudinal way, beyond which two roads only cross
HOLE = 6  # points that the way over a hole may be off the known road's
TAIL = 2  # points of a stretch's end that its own next point meets
NEAR_END = int(REACH / STEP) + 3  # points within which a run of a stretch begins at its end


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


def stretches(passes: Sequence[Pass]) -> list[Stretch]:
    """Every stretch of road in some passes; each pass is in it once, but for laps.

    A pass is placed in chunks. Where a known point lies abeam and the way is parallel, it is the
    same road, in either direction; what is not known becomes road. Meetings shorter than SHORTEST
    or at a slant are crossings. Stretches that every drive passes one after the other are joined.
    """
    places = Places()
    found: list[Stretch] = []
    for owner, own in enumerate(passes):
        for leg in _legs(own):
            walk = _Walk(owner, own, int(leg[-1]), places, found)
            for chunk in _chunks(own.course[leg]):
                walk.place(leg[chunk])
    return joined([one for one in found if len(one.latitude) >= LEAST], passes)


class _Walk:
    """One leg of a pass, up to its point `end`, that is placed chunk by chunk.

    open: the stretch that its last point was added to. over: the known stretch that it went over
    there, and whether in its direction.
    """

    def __init__(
        self, owner: int, own: Pass, end: int, places: Places, found: list[Stretch]
    ) -> None:
        self.owner, self.own, self.end, self.places, self.found = owner, own, end, places, found
        self.xyz = on_sphere(own.latitude, own.longitude)
        self.open: int | None = None
        self.over: tuple[int, bool] | None = None

    def place(self, chunk: NDArray[np.int64]) -> None:
        """Enter the points of one chunk: where they are known, and as new road elsewhere."""
        known = self._go_over(chunk)
        before, self.open = self.open, None
        for run in runs(~known):
            goes_on = run.start == 0 and before is not None
            ends = run.stop < len(chunk)  # else it may go on in the next chunk
            if run.stop - run.start < SHORTEST and ends and not goes_on:
                continue
            which = self._add(before if run.start == 0 else None, chunk[run])
            if not ends:
                self.open = which

    def _go_over(self, chunk: NDArray[np.int64]) -> Bools:
        """Enter the runs of a chunk over known stretches; which of its points these are."""
        wide = self._with_following(chunk)
        near = self._near(wide)
        known = np.zeros(len(chunk), np.bool_)
        over: tuple[int, bool] | None = None
        for part in self._meetings(wide, near):
            part = part[part < len(chunk)]
            there = part[near[part] >= 0]  # all but the holes
            if not len(there):
                continue
            first, last = near[there[[0, -1]]]
            which = int(self.places.stretch[first])
            turn = self.own.course[wide[there]] - self.places.course[near[there]]
            forward = bool(np.cos(turn).mean() > 0)
            nodes = int(self.places.node[first]), int(self.places.node[last])
            self.found[which].runs.append(Traverse(self.owner, wide[part], forward, nodes))
            known[part] = True
            if part[-1] == len(chunk) - 1:
                over = which, forward
        self.over = over
        return known

    def _with_following(self, chunk: NDArray[np.int64]) -> NDArray[np.int64]:
        """The chunk and the points behind it that tell whether its end only crosses a road."""
        return np.arange(chunk[0], min(chunk[-1] + SHORTEST, self.end) + 1)

    def _near(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        own = self.own
        near = self.places.nearest(self.xyz[points], own.course[points])
        if self.open is None:
            return near
        # its own last points lie just behind, not abeam
        end = len(self.found[self.open].latitude) - TAIL
        behind = (self.places.stretch[near] == self.open) & (self.places.node[near] >= end)
        return np.where(behind, -1, near)

    def _meetings(
        self, wide: NDArray[np.int64], near: NDArray[np.int64]
    ) -> list[NDArray[np.int64]]:
        """Positions in `wide` of each run over one known stretch, in one direction."""
        hit = near >= 0
        if not hit.any():
            return []
        places, distance = self.places, self.own.distance[wide]
        stretch = np.where(hit, places.stretch[near], -1)
        forward = np.cos(self.own.course[wide] - places.course[near]) > 0
        node = places.node[near]
        step = np.diff(node) * np.where(forward[1:], 1, -1)
        goes_on: Bools = (
            (stretch[1:] == stretch[:-1])
            & hit[1:]
            & (forward[1:] == forward[:-1])
            & (np.abs(step - np.diff(distance) / STEP) < 4)
        )
        result = []
        for part in np.split(np.arange(len(wide)), np.flatnonzero(~goes_on) + 1):
            begin, end = part[[0, -1]]
            if not hit[begin]:
                continue
            whole = len(part) >= SHORTEST or (
                (begin == 0 and self.over == (int(stretch[0]), bool(forward[0])))
                or wide[end] == self.end
            )
            away = places.across(self.xyz[wide[part]], near[part])
            if not whole or (not forward[begin] and np.median(away) > REACH_BACK):
                continue
            if places.climb(self.own.altitude[wide[part]], self.owner, near[part]) > STOREY:
                continue
            slant = np.ptp(away) > max(SLANT * (distance[end] - distance[begin]), 3.0)
            if not (slant and len(part) < 4 * SHORTEST):
                result.append(part)
        return _bridged(result, distance, stretch, forward, node)

    def _add(self, which: int | None, points: NDArray[np.int64]) -> int:
        """Points as new road at the end of a stretch, or as a new one (None); its index."""
        own = self.own
        if which is None:
            which = len(self.found)
            self.found.append(Stretch(np.empty(0), np.empty(0), np.empty(0)))
        stretch = self.found[which]
        first = len(stretch.latitude)
        for name in ("latitude", "longitude", "course"):
            values = np.concatenate([getattr(stretch, name), getattr(own, name)[points]])
            setattr(stretch, name, values)
        self.places.add(
            self.xyz[points], own.course[points], own.altitude[points], self.owner, which, first
        )
        stretch.runs.append(Traverse(self.owner, points, True, (first, first + len(points) - 1)))
        return which


def _legs(own: Pass) -> list[NDArray[np.int64]]:
    """Indices of a pass between its jumps, without the points at which it goes round in a circle.

    A circle of less than SHORTEST points is no road, and its laps cannot be told apart.
    """
    course = np.unwrap(own.course)
    round_about = np.zeros(len(own), np.bool_)
    for k in np.flatnonzero(np.abs(course[SHORTEST:] - course[:-SHORTEST]) > 2 * np.pi):
        round_about[k : k + SHORTEST + 1] = True
    kept = np.flatnonzero(~round_about)
    cuts = (np.diff(own.distance[kept]) > JUMP) | (np.diff(kept) > 1)
    return [leg for leg in np.split(kept, np.flatnonzero(cuts) + 1) if len(leg)]


def _chunks(course: Floats) -> list[NDArray[np.int64]]:
    """Indices of a leg in pieces of at most CHUNK points, cut after half turns."""
    result, begin = [], 0
    turned = np.unwrap(course)
    for k in range(1, len(turned) + 1):
        if k == len(turned) or k - begin >= CHUNK or abs(turned[k] - turned[begin]) > TURNED:
            result.append(np.arange(begin, k))
            begin = k
    return result


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
    if node <= NEAR_END:
        return 0
    return 1 if node >= len(stretch.latitude) - 1 - NEAR_END else None


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
            and (run.nodes[0] - last.nodes[1]) * (1 if run.forward else -1) >= -NEAR_END
        ):
            points = np.arange(last.points[0], run.points[-1] + 1)  # with a hole's between them
            result[-1] = Traverse(run.owner, points, run.forward, (last.nodes[0], run.nodes[1]))
        else:
            result.append(run)
    return result
