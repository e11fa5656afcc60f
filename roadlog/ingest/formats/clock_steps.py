"""Clocks that step back in the rows of a table: counters that begin anew, and clocks that were set.

Rows stand in the order in which they were written. Where a counter of 16 to 32 bits, a time of day
or a time of week begins anew, what it counts to is added; where a clock was set back over what it
had said, the rows after go on behind those before. All else is only put in order of time.
"""

from __future__ import annotations

import numpy as np

from roadlog.spool import blocks, release
from roadlog.types import Floats, Stamps

COUNTERS = (16, 24, 31, 32)  # bits
PERIODS = (86_400 * 10**9, 604_800 * 10**9)  # ns; of a time of day, of a time of week
NEAR = 0.01  # share of what is counted to, and
STEPS = 50  # usual steps, by which a row may miss the turn
SET = 1_000_000_000  # ns; messages that overtake each other are closer
FEW = 0.01  # share of rows; where more step back there is no order to go on with
LOOKED = 100_000  # rows that tell the usual step
STRAYS = 3  # rows after which a stamp that strays is back


def continued(time: Stamps, tick: int, anew: bool = False) -> tuple[Stamps, list[str], list[str]]:
    """Stamps that go on over steps back, a sentence on counters, and one on clocks that were set.

    tick: ns of one count. anew: no counter, but a logger that began again, maybe from zero.
    """
    back = _steps_back(time)
    steps = np.diff(time[:LOOKED])
    usual = int(np.median(steps[steps > 0])) if (steps > 0).any() else 0
    if not len(back) or len(back) > FEW * len(time) + 1 or not usual:
        return time, [], []
    sizes = time[back] - time[back - 1]
    for period in () if anew else (*(tick << bits for bits in COUNTERS), *PERIODS):
        off = np.abs(sizes + period - usual)
        if (off <= np.maximum(STEPS * usual, NEAR * period)).all() and _within(time, period):
            said = f"its time counts to {period * 1e-9:.6g} s and begins anew: put in one line"
            return _moved(time, back, np.full(len(back), period)), [said], []
    was_set = [k for k, row in enumerate(back) if _was_set(time, int(row), int(sizes[k]), anew)]
    if not was_set:
        return time, [], []
    rows = back[was_set]
    moved = usual - sizes[was_set]
    said = ", ".join(
        f"by {amount * 1e-9:.3f} s at row {row + 1}"
        for row, amount in zip(rows[:STRAYS].tolist(), moved.tolist(), strict=False)
    )
    more = " and more" if len(rows) > STRAYS else ""
    loss = f"its clock was set back {said}{more}: the rows after go on behind those before"
    return _moved(time, rows, moved), [], [loss]


def _steps_back(time: Stamps) -> Stamps:
    """The rows whose stamp is before that of the row above."""
    found = [np.empty(0, np.int64)]
    for rows in blocks(len(time)):
        start = max(rows.start - 1, 0)
        part = time[start : rows.stop]
        found.append(np.flatnonzero(part[1:] < part[:-1]) + start + 1)
    release([time])
    return np.concatenate(found)


def _within(time: Stamps, period: int) -> bool:
    """Whether no stamp is beyond what is counted to."""
    return all(
        bool((time[rows] >= 0).all() and (time[rows] <= period).all()) for rows in blocks(len(time))
    )


def _was_set(time: Stamps, row: int, size: int, anew: bool) -> bool:
    """Whether a clock goes on from within what was written, and not a single stamp strays."""
    if -size < SET:
        return False
    before, after = time[max(0, row - STRAYS) : row], time[row : row + STRAYS]
    if len(after) < STRAYS or (after >= before[-1]).any() or (before <= after[0]).any():
        return False  # a stamp that strays, or the row before it did
    return anew or bool(time[row] > time[0])


def _moved(time: Stamps, rows: Stamps, amounts: Floats | Stamps) -> Stamps:
    """Stamps with an amount added from each of some rows on."""
    added = np.zeros(len(time), np.int64)
    added[rows] = amounts
    return np.asarray(time + np.cumsum(added))
