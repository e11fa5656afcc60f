"""Signals of one section on the union of their stamps, window by window."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from roadlog.ingest.grid import BURST
from roadlog.spool import Spool, blocks, release
from roadlog.types import Floats, Stamps


def rows_of(values: Mapping[str, tuple[Stamps, Floats]]) -> tuple[Stamps, dict[str, NDArray]]:
    """All signals on one set of stamps, without the rows in which none is known."""
    if _is_one_table(values):
        return next(iter(values.values()))[0], {name: v for name, (_, v) in values.items()}
    stamps = Spool(np.int64)
    spools = {name: Spool(np.float64) for name in values}
    for window in windows(values):
        time, columns = united(window)
        known = np.zeros(len(time), np.bool_)
        for column in columns.values():
            known |= np.isfinite(column)
        stamps.append(time[known])
        for name, column in columns.items():
            spools[name].append(column[known])
        release(array for pair in values.values() for array in pair)
    return stamps.column(), {name: spool.column() for name, spool in spools.items()}


def _is_one_table(values: Mapping[str, tuple[Stamps, Floats]]) -> bool:
    """Whether one set of rising stamps has them all already, the first known in every row."""
    (time, first), *others = values.values()
    if not all(stamps is time for stamps, _ in others):
        return False
    whole = all(
        np.isfinite(first[rows]).all()
        and (np.diff(time[max(rows.start - 1, 0) : rows.stop]) > 0).all()
        for rows in blocks(len(time))
    )
    release([time, first])
    return whole


def windows(
    values: Mapping[str, tuple[Stamps, Floats]],
) -> Iterator[Mapping[str, tuple[Stamps, Floats]]]:
    """The signals cut at the same instants, about a block of rows of the longest in each."""
    values = {name: _ordered(*pair) for name, pair in values.items()}
    longest = max((time for time, _ in values.values()), key=len)
    edges = [int(longest[rows.start]) for rows in blocks(len(longest))][1:]
    begin = dict.fromkeys(values, 0)
    for edge in [*edges, None]:
        end = {
            name: len(time) if edge is None else int(np.searchsorted(time, edge))
            for name, (time, _) in values.items()
        }
        yield {
            name: (time[begin[name] : end[name]], column[begin[name] : end[name]])
            for name, (time, column) in values.items()
        }
        begin = end


def _ordered(time: Stamps, values: Floats) -> tuple[Stamps, Floats]:
    """The same in time order."""
    if all((time[rows][1:] >= time[rows][:-1]).all() for rows in blocks(len(time))) and all(
        time[rows.start] >= time[rows.start - 1] for rows in blocks(len(time)) if rows.start
    ):
        release([time])
        return time, values
    order = np.argsort(time, kind="stable")
    return time[order], values[order]


def united(values: Mapping[str, tuple[Stamps, Floats]]) -> tuple[Stamps, dict[str, Floats]]:
    """All signals on the union of their stamps; repeated stamps of one signal keep the last.

    Messages of one burst, BURST apart at most, become one row.
    """
    stamps = [time for time, _ in values.values()]
    first = stamps[0]
    if np.all(np.diff(first) > 0) and all(np.array_equal(time, first) for time in stamps[1:]):
        return first, {name: column for name, (_, column) in values.items()}
    union: Stamps = np.unique(np.concatenate(stamps))
    row = _bursts(union, stamps)
    columns = {}
    for name, (time, column) in values.items():
        column_union = np.full(row[-1] + 1 if len(row) else 0, np.nan)
        known = np.flatnonzero(np.isfinite(column))  # no value does not undo one of its stamp
        order = known[np.argsort(time[known], kind="stable")]
        column_union[row[np.searchsorted(union, time[order])]] = column[order]
        columns[name] = column_union
    starts = np.flatnonzero(np.diff(row, prepend=-1))
    return union[starts], columns


def _bursts(union: Stamps, stamps: Sequence[Stamps]) -> NDArray[np.int64]:
    """Row of each stamp: those of a burst share one, unless it is longer than BURST."""
    steps = [np.median(np.diff(time)) for time in stamps if len(time) > 1]
    near = min(BURST, min(steps, default=0) / 4)
    burst = np.cumsum(np.diff(union, prepend=union[:1]) > near)
    first = np.flatnonzero(np.diff(burst, prepend=-1))
    last = np.append(first[1:], len(union)) - 1
    whole = (union[last] - union[first] <= near)[burst] if len(union) else np.empty(0, np.bool_)
    new = np.diff(burst, prepend=-1) > 0
    row: NDArray[np.int64] = np.cumsum(new | ~whole) - 1
    return row
