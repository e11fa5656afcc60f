"""Holes in what was ingested."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from roadlog.spool import blocks, release
from roadlog.storage import Table
from roadlog.types import Stamps


def gaps(tables: Iterable[Table], minimum: float = 1.0) -> list[str]:
    """Sentences on the holes of more than `minimum` seconds and 5 median intervals of a signal."""
    found = []
    for table in tables:
        # messages of one burst lie apart by milliseconds: each signal has its own interval
        holes = {
            hole
            for column in table.columns.values()
            if column.strides != (0,)
            for hole in _holes(table.time, column, minimum)
        }
        if holes:
            longest, at = max(holes)
            after = (at - int(table.time[0])) * 1e-9
            count = "1 gap" if len(holes) == 1 else f"{len(holes)} gaps"
            found.append(f"{table.topic}: {count}, longest {longest:.2f} s at {after:.1f} s")
    return found


def _holes(time: Stamps, column: NDArray, minimum: float) -> Iterator[tuple[float, int]]:
    """Length [s] and start [ns] of each hole."""
    limit, last = 0.0, np.empty(0, np.int64)
    for rows in blocks(len(time)):
        known = np.concatenate([last, time[rows][np.isfinite(column[rows])]])
        steps = np.diff(known) * 1e-9
        if len(steps) < 2:
            last = known
            continue
        limit = limit or max(minimum, 5 * float(np.median(steps)))
        wide = steps > limit
        yield from zip(steps[wide].tolist(), known[:-1][wide].tolist(), strict=True)
        last = known[-1:]
        release([time, column])
