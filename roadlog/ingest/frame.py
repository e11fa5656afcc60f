"""What a source gives before a profile says what it means: rows of named columns on a clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roadlog.types import Stamps


@dataclass(frozen=True)
class Frame:
    """Rows that share a clock: one message of a bus, one topic, one text file.

    name: of the message or topic, empty where the file holds only one table. file: name of the
    source file. time: ns. columns: source name -> values as the source has them, NaN where there
    is none. units: as the source states them, where it does.
    """

    name: str
    file: str
    time: Stamps
    columns: Mapping[str, NDArray]
    units: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Recording:
    """What one source file or folder held, and what of it was lost."""

    frames: tuple[Frame, ...]
    losses: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def joined(frames: Iterable[Frame]) -> list[Frame]:
    """Frames with rows; those of the same name and columns put end to end, in time order."""
    groups: dict[tuple[str, tuple[str, ...]], list[Frame]] = {}
    for frame in frames:
        if len(frame):
            groups.setdefault((frame.name, tuple(frame.columns)), []).append(frame)
    return [_concatenated(group) for group in groups.values()]


def _concatenated(group: list[Frame]) -> Frame:
    if len(group) == 1:
        return group[0]
    group = sorted(group, key=lambda frame: int(frame.time[0]))
    return Frame(
        group[0].name,
        ", ".join(frame.file for frame in group),
        np.concatenate([frame.time for frame in group]),
        {name: np.concatenate([f.columns[name] for f in group]) for name in group[0].columns},
        group[0].units,
    )
