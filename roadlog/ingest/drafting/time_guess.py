"""Which column of a table is the time: by its name, else the one that rises evenly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError
from roadlog.ingest import Source
from roadlog.ingest.drafting.names import bare, is_time, unit_of
from roadlog.ingest.formats import times
from roadlog.ingest.profile import Clock

EVEN = 0.9  # share of steps that are near the usual one
NEAR = 0.5  # of the usual step
LOOKED = 60  # texts


def clock_of(source: Source) -> tuple[Clock, str]:
    """The clock of a table, and what is not certain about it; a column of "" for none."""
    sample = source.format.sample(source.path)
    try:
        column = times.time_column(list(sample), "", source.path.name)
        clock = Clock()
        doubt = ""
    except ConfigError:
        named = [name for name in sample if is_time(name) and _could_be(sample[name])]
        named = sorted(named, key=lambda name: (not _rises(sample[name]), len(bare(name))))
        rising = [name for name, values in sample.items() if _rises(values)]
        found = named or rising
        if not found:
            return Clock(), "no column rises as a time does: say which is it in [time] column"
        column = found[0]
        clock = Clock(column, unit_of(column, "s"))
        others = [name for name in found[1:] if _rises(sample[name])]
        doubt = "" if named else f"the time is taken to be '{column}', which goes on as one does"
        doubt += f"; or: {', '.join(others)}" if others else ""
    if not clock.unit and sample[column].dtype.kind in "iuf" and not _has_unit(sample[column]):
        clock = Clock(clock.column, "s")
        doubt = "; ".join(filter(None, (doubt, "the unit of the time is not clear: s is assumed")))
    return clock, doubt.removeprefix("; ")


def _has_unit(values: NDArray) -> bool:
    known = values[np.isfinite(values)]
    try:
        return bool(len(known)) and bool(times.guess_unit(known.astype(np.float64)))
    except ConfigError:
        return False


def _could_be(values: NDArray) -> bool:
    """Whether a column of a time's name is one: texts, or numbers that do not fall often."""
    if values.dtype.kind not in "iuf":
        return True
    known = values[np.isfinite(values)]
    return len(known) > 0 and bool((np.diff(known) >= 0).mean() > EVEN if len(known) > 2 else True)


def _rises(values: NDArray) -> bool:
    """Whether numbers rise in even steps, or texts are dates or clocks that go on."""
    if values.dtype.kind == "O":
        moments = [times.of_text(text) for text in values[:LOOKED].tolist() if text]
        known = [moment for moment in moments if moment is not None]
        return len(known) > EVEN * len(moments) and len(set(known)) > 1
    if values.dtype.kind not in "iuf":
        return False
    steps = np.diff(values[np.isfinite(values)])
    if len(steps) < 3 or (steps < 0).any() or not (steps > 0).any():
        return False
    usual = float(np.median(steps[steps > 0]))
    return bool((np.abs(steps[steps > 0] - usual) < NEAR * usual).mean() > EVEN)


def first_rows(sample: Mapping[str, NDArray]) -> int:
    """How many rows a sample has."""
    return max((len(values) for values in sample.values()), default=0)
