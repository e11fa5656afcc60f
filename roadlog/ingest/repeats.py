"""Rows that share a stamp: coarse clocks are spread evenly, all else that is dropped is said.

A row of a signal is its stamp; of several rows with one stamp only the last can count. Copies are
no loss; other values are. Where the clock of a table begins again, what comes after goes on behind.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from roadlog.ingest.formats.clock_steps import continued
from roadlog.ingest.formats.row_clock import spread
from roadlog.ingest.frame import Frame
from roadlog.spool import blocks, release
from roadlog.types import Stamps


def apart(frames: Iterable[Frame]) -> tuple[list[Frame], list[str], list[str]]:
    """Frames with coarse stamps spread, sentences on these, and on rows of which one counts."""
    found, notes, losses = [], [], []
    frames = list(frames)
    tables = Counter(frame.file for frame in frames)
    for frame in frames:
        label = f"{frame.file}: {frame.name}" if frame.name else frame.file
        rows = _repeated(frame.time)
        lost = _differing(frame, *rows)
        if lost:
            time, begun = frame.time, list[str]()
            if tables[frame.file] == 1:  # several would not stay beside each other
                time, _, begun = continued(time, 1, anew=True)
            time, said = spread(time, label)
            notes += said
            losses += [f"{label}: {text}" for text in begun]
            if begun or said:
                frame = replace(frame, time=time)
            else:
                losses.append(
                    f"{label}: {lost} rows have the stamp of another row and other values: the "
                    "last of each stamp counts"
                )
        found.append(frame)
    return found, notes, losses


def _repeated(time: Stamps) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows, and for each the next one with its stamp."""
    found = [np.empty(0, np.int64)]
    for rows in blocks(len(time)):
        start = max(rows.start - 1, 0)
        steps = np.diff(time[start : rows.stop])
        if (steps < 0).any():
            order = np.argsort(time, kind="stable")
            same = np.flatnonzero(np.diff(time[order]) == 0)
            return order[same], order[same + 1]
        found.append(start + np.flatnonzero(steps == 0))
    release([time])
    first = np.concatenate(found)
    return first, first + 1


def _differing(frame: Frame, first: NDArray[np.int64], second: NDArray[np.int64]) -> int:
    """How many of these pairs of rows hold two values of one column."""
    clash = np.zeros(len(first), np.bool_)
    if not len(first):
        return 0
    for values in frame.columns.values():
        if values.dtype.kind in "biuf" and values.ndim == 1 and values.strides != (0,):
            one, other = values[first], values[second]
            clash |= (one != other) & ~(np.isnan(one) | np.isnan(other))
    release(values for values in frame.columns.values() if values.dtype.kind in "biuf")
    return int(clash.sum())
