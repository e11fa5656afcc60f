"""Tables that are there as arrays (MATLAB, TDMS): groups of columns on a time among them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest.formats import times
from roadlog.ingest.formats.row_clock import RowClock
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile

Group = Mapping[str, NDArray]


def recording(
    groups: Mapping[str, Group],
    units: Mapping[str, Mapping[str, str]],
    file: str,
    profile: Profile,
) -> Recording:
    """A frame for each group that has a time; of columns that nobody reads only the names.

    groups: name -> column -> values. A group without a time is a loss where the profile reads it,
    else a note. Raises ConfigError where none has one, LogReadError where there is none.
    """
    frames: list[Frame] = []
    notes: list[str] = []
    losses: list[str] = []
    refused: ConfigError | None = None
    for name, columns in groups.items():
        wanted = [c for c in columns if profile.reads(c, name)]
        label = f"{file}: {name}" if name else file
        named = profile.clock.column if profile.clock.column in columns else ""
        try:
            clock = times.time_column(list(columns), named, label)
        except ConfigError as error:
            refused = refused or error
            (losses if wanted else notes).append(f"{label}: has no time, left out")
            continue
        own = units.get(name, {})
        stated = (profile.clock.unit, own.get(clock, ""), times.bracketed(clock))
        stamps = RowClock(times.unit_stated(*stated), profile.clock.zone)
        keep = stamps.add(columns[clock], label)
        time, said, set_back = stamps.stamps(label)
        losses += set_back
        notes += said
        if lost := len(keep) - len(time):
            losses.append(f"{label}: {lost} rows without a time left out")
        found = {
            c: values[keep] if c in wanted else absent(len(time))
            for c, values in columns.items()
            if c != clock
        }
        frames.append(Frame(name, file, time, found, dict(own)))
    if not frames:
        raise refused or LogReadError(f"{file}: holds no table of numbers")
    return Recording(tuple(frames), tuple(losses), tuple(notes))


def largest(groups: Mapping[str, Group]) -> dict[str, NDArray]:
    """The first rows of the group with the most columns."""
    columns = max(groups.values(), key=len, default={})
    return {name: values[:SAMPLE] for name, values in columns.items()}


def names(groups: Mapping[str, Group]) -> set[str]:
    """Every name that a profile may refer to."""
    found: set[str] = set()
    for name, columns in groups.items():
        found |= {*columns, *(f"{name}.{c}" for c in columns)}
    return found


SAMPLE = 20000  # rows
NUMBERS = frozenset("buif")


def vector(values: object) -> NDArray | None:
    """A column of numbers or moments; None for anything else."""
    found = np.squeeze(np.asarray(values))
    if found.ndim != 1 or len(found) < 2 or found.dtype.kind not in NUMBERS | {"M"}:
        return None
    return found
