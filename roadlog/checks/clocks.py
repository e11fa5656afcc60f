"""Clocks that jump while a log is written, and stamps that are times of day taken as seconds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from roadlog.checks.finding import Finding
from roadlog.geo import EARTH_RADIUS
from roadlog.signals import GNSS_TOPIC, INPUTS, SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats, Stamps

JUMP = 1.0  # s; no jitter of stamps is that large
FORWARD = 5.0  # s; a shorter gap is one of messages
DRIVES = 3.0  # m/s
GOES_ON = 0.5  # m/s; a speed that goes on changes by less over a moment
BESIDE = 1.0  # s about a gap in which the speed is looked at
DAY = 240_000  # of hhmmss
SPEEDS = (("speed", "v"), ("wheel_speeds", "fl"), ("gnss", "speed"))  # section and field


def of_day(tables: Mapping[str, Table]) -> list[Finding]:
    """Times of day written hhmmss and taken as seconds: no second beyond 59, and gaps of 40 s."""
    there = [tables[s.topic] for s in INPUTS if s.topic in tables and len(tables[s.topic]) > 1]
    if not there or any(table.time[0] < 0 or table.time[-1] >= DAY * 10**9 for table in there):
        return []
    whole = [np.asarray(table.time) // 10**9 for table in there]
    minutes = np.unique(np.concatenate([np.unique(seconds // 100) for seconds in whole]))
    if len(minutes) < 2 or (minutes % 100 > 59).any():
        return []
    if any((seconds % 100 > 59).any() for seconds in whole):
        return []
    found = "no stamp has a second beyond 59: times of day (hhmmss) taken as seconds"
    topics = tuple(table.topic for table in there)
    return [Finding("clock_jump", "fault", topics, found, 'say unit = "hhmmss" in [time]')]


def forward(tables: Mapping[str, Table]) -> list[Finding]:
    """Gaps of all channels at once over which the car drives on as if there were none."""
    there = [tables[s.topic] for s in INPUTS if s.topic in tables and len(tables[s.topic]) > 1]
    if not there:
        return []
    longest = max(there, key=len)
    steps = np.diff(longest.time)
    found = []
    for row in np.flatnonzero(steps > FORWARD * 1e9).tolist():
        start, end = int(longest.time[row]), int(longest.time[row + 1])
        if any(_inside(table.time, start, end) for table in there):
            continue
        said = next(_drives_on(tables, start, end), None)
        if said is not None:
            at = (start - int(longest.time[0])) * 1e-9
            size = (end - start) * 1e-9
            found.append(
                Finding(
                    "clock_forward",
                    "note",
                    tuple(table.topic for table in there),
                    f"nothing for {size:.1f} s, but {said}: was the clock set?",
                    "then the stamps after it are as much too late: cut the log there",
                    at,
                    size,
                )
            )
    return found


def _inside(time: Stamps, start: int, end: int) -> bool:
    """Whether there is a stamp well within a gap."""
    middle = (end - start) // 4
    first, last = np.searchsorted(time, (start + middle, end - middle))
    return bool(last > first)


def _drives_on(tables: Mapping[str, Table], start: int, end: int) -> Iterator[str]:
    """How the car goes on over a gap: by where it is, else by its speed."""
    speeds = [_beside(tables, SECTIONS[s].topic, field, start, end) for s, field in SPEEDS]
    speed = next((pair for pair in speeds if pair is not None), None)
    if speed is None or min(speed) < DRIVES or abs(speed[1] - speed[0]) > GOES_ON:
        return
    places = [_beside(tables, GNSS_TOPIC, f, start, end) for f in ("latitude", "longitude")]
    north, east = places
    if north is None or east is None:
        yield f"the speed goes on ({speed[0]:.1f} and {speed[1]:.1f} m/s)"
        return
    way = np.radians([north[1] - north[0], (east[1] - east[0]) * np.cos(np.radians(north[0]))])
    moved = EARTH_RADIUS * float(np.hypot(*way))
    if moved < 0.25 * speed[0] * (end - start) * 1e-9:
        yield f"the car moves {moved:.0f} m at {speed[0]:.1f} m/s"


def _beside(
    tables: Mapping[str, Table], topic: str, field: str, start: int, end: int
) -> tuple[float, float] | None:
    """The known values nearest to a gap, before and after it; None where they are not near."""
    table = tables.get(topic)
    if table is None or table.columns.get(field) is None:
        return None
    values: Floats = np.asarray(table.columns[field], np.float64)
    known = np.flatnonzero(np.isfinite(values))
    row = int(np.searchsorted(table.time[known], start, side="right"))
    if not 0 < row < len(known):
        return None
    before, after = known[row - 1], known[row]
    near = start - table.time[before] <= BESIDE * 1e9 and table.time[after] - end <= BESIDE * 1e9
    return (float(values[before]), float(values[after])) if near else None


def jumps(tables: Mapping[str, Table]) -> list[Finding]:
    """Clocks that were set back while driving, one finding for all channels that jump at once.

    What lies on both sides of such a jump is mixed in time, and no check of the motion can be
    believed.
    """
    there = [tables[s.topic] for s in INPUTS if s.topic in tables and len(tables[s.topic]) > 1]
    start = min((int(table.time[0]) for table in there), default=0)
    found: dict[tuple[int, int], list[str]] = {}
    for table in there:
        steps = np.diff(table.time)
        back = int(np.argmin(steps))
        if steps[back] < -JUMP * 1e9:
            size, at = -steps[back] * 1e-9, (table.time[back] - start) * 1e-9
            found.setdefault((round(size), round(at)), []).append(table.topic)
    return [
        Finding(
            "clock_jump",
            "fault",
            tuple(topics),
            f"the clock jumps back by {size} s",
            "cut the log there, or use another stamp (--clock header or publish of a bag or MCAP)",
            float(at),
            float(size),
        )
        for (size, at), topics in found.items()
    ]
