"""The clock of a table: its time column, block by block, to stamps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roadlog.ingest.formats import times
from roadlog.ingest.formats.clock_steps import continued
from roadlog.ingest.formats.csv_preamble import Begun
from roadlog.spool import Spool, blocks, release
from roadlog.types import Bools, Stamps

HALF_DAY = times.DAY // 2
NEAR_START = 60 * 10**9  # ns; seconds of the day begin as close to the moment of the start
REPEATED = 0.5  # share of stamps that repeat the one before from which they are coarse
GAP = 1.5  # median steps; after more than that the rows were not spread over the step


class RowClock:
    """Stamps of a time column as its blocks come.

    unit: of numbers; where nothing states it, by their size. zone: of dates without one. day: ns
    of the midnight from which a clock without a date counts. day_first: whether 01/03 is likely
    to be the first of March, until a date tells. head: the start that the file states above its
    rows, for a clock without a date.
    """

    def __init__(
        self,
        unit: str = "",
        zone: str = "",
        day: int = 0,
        day_first: bool = False,
        head: Begun | None = None,
    ) -> None:
        self.head = head or Begun()
        self.day = day or self.head.midnight
        self.day_first = day_first
        self.guessed = ""  # a date that may be read in two ways
        self.unit = unit
        self.zone = zone
        self.rows = 0
        self.days = 0  # midnights passed by a clock without a date
        self._last: int | None = None
        self._stamps = Spool(np.int64)

    def add(self, raw: NDArray, where: str) -> Bools:
        """Which of some rows have a time. Raises LogReadError, ConfigError as `times.stamps`."""
        numbers = raw.dtype.kind in "iufb"
        if numbers and not self.unit and np.isfinite(raw).any():
            self.unit = times.unit_of(raw, where)
        if raw.dtype.kind == "O" and not self.rows:
            texts = [str(text) for text in raw]
            self.day_first, guessed = times.day_before_month(texts, self.day_first)
            self.guessed = next((t for t in texts if "/" in t), "") if guessed else ""
        stamps, keep = times.stamps(raw, self.unit, where, self.rows, self.zone, self.day_first)
        self.rows += len(raw)
        of_day = self.unit == "hhmmss" if numbers else raw.dtype.kind not in "Mm"
        if of_day and len(stamps) and stamps.min() >= 0 and stamps.max() < times.DAY:
            stamps = self._over_midnight(stamps)
        self._stamps.append(stamps)
        return keep

    def _over_midnight(self, stamps: Stamps) -> Stamps:
        before = stamps[0] if self._last is None else self._last
        falls = np.diff(stamps, prepend=before) < -HALF_DAY
        days = self.days + np.cumsum(falls)
        self._last, self.days = int(stamps[-1]), int(days[-1])
        return np.asarray(stamps + days * times.DAY + self.day)

    def stamps(self, name: str) -> tuple[Stamps, list[str], list[str]]:
        """All stamps, coarse ones spread evenly, and notes and losses to say of them."""
        notes = []
        if self.unit == "hhmmss" and not self.day:
            notes.append(f"{name}: its time is a time of day (hhmmss)")
        if self.guessed:
            order = "day before month" if self.day_first else "month before day"
            notes.append(f"{name}: '{self.guessed}' is read with the {order}: nothing tells")
        if self.days:
            notes.append(f"{name}: its clock passes midnight")
        tick = times.tick(self.unit)
        time, counted, lost = continued(self._stamps.column(), tick)
        time, said = spread(time, name)
        notes += [f"{name}: {text}" for text in counted] + said
        start = self._start(time)
        if start or (self.head.wrong and self._is_undated(time)):
            notes.append(self.head.said)
        if start:
            time = _moved(time, start) if self._last is None else time
        return time, notes, [f"{name}: {text}" for text in lost]

    def _start(self, time: Stamps) -> int:
        """ns that the head of the file adds, or has added to a time of day; 0 for nothing."""
        if self._last is not None:
            return self.head.midnight
        head = self.head
        if not head.moment or not self._is_undated(time):
            return 0
        of_day = head.moment - head.midnight
        return head.midnight if abs(time[0] - of_day) < NEAR_START else head.moment

    @staticmethod
    def _is_undated(time: Stamps) -> bool:
        return len(time) > 0 and 0 <= time[0] < times.DAY

    def __len__(self) -> int:
        return len(self._stamps)


def _moved(time: Stamps, start: int) -> Stamps:
    """Stamps from another zero, block by block."""
    late = Spool(np.int64)
    for rows in blocks(len(time)):
        late.append(time[rows] + start)
    release([time])
    return late.column()


def spread(time: Stamps, name: str) -> tuple[Stamps, list[str]]:
    """Rows of coarse stamps put evenly between them, and a sentence where that was needed.

    A logger that writes whole seconds gives ten rows of 10 Hz one stamp; taken as they are, nine
    would be lost. Rows after the last change of stamp, and before a gap, lie as close as others.
    """
    repeats = sum(
        int((np.diff(time[max(0, rows.start - 1) : rows.stop]) == 0).sum())
        for rows in blocks(len(time))
    )
    release([time])
    if len(time) < 3 or repeats < REPEATED * len(time):
        return time, []
    first = np.flatnonzero(np.diff(time, prepend=time[0] - 1))
    counts = np.diff(first, append=len(time))
    steps = np.diff(time[first])
    if not len(steps) or (steps < 0).any():
        return time, []
    step, count = float(np.median(steps)), float(np.median(counts))
    length = np.append(steps, step).astype(np.float64)
    wide = length > GAP * step
    length[wide] = step
    pace = length / counts
    short = counts < count / GAP  # a first, last or broken run is not spread over a whole step
    pace[short] = step / count
    within = np.arange(len(time)) - np.repeat(first, counts)
    late = np.zeros(len(first))
    if short[0]:
        late[0] = step - pace[0] * counts[0]  # the log began within the step
    offset = np.repeat(late, counts) + within * np.repeat(pace, counts)
    even = time + np.rint(offset).astype(np.int64)
    share = f"{count:.0f} rows each"
    return even, [f"{name}: stamps of {step * 1e-9:g} s stand on {share}: spread evenly over it"]
