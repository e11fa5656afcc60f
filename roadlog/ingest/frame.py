"""What a source gives before a profile says what it means: rows of named columns on a clock."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from roadlog.spool import concatenated
from roadlog.types import Stamps


@dataclass(frozen=True)
class Frame:
    """Rows that share a clock: one message of a bus, one topic, one text file.

    name: of the message or topic, empty where the file holds only one table. file: name of the
    source file. time: ns. columns: source name -> values as the source has them, NaN where there
    is none. units: as the source states them, where it does. kind: the type of the message where
    topics have one (`sensor_msgs/Imu`). also: other names of the message, with or without its bus
    and sender (`CAN1.Motion` and `Motion`). frame_id: the coordinate frame that its messages name.
    """

    name: str
    file: str
    time: Stamps
    columns: Mapping[str, NDArray]
    units: Mapping[str, str] = field(default_factory=dict)
    kind: str = ""
    also: frozenset[str] = frozenset()
    frame_id: str = ""

    @property
    def key(self) -> tuple[frozenset[str], str, tuple[str, ...]]:
        """What frames of one logger have in common, however many files it wrote."""
        return self.also | {self.name}, self.kind, tuple(self.columns)

    def full(self, column: str) -> tuple[str, ...]:
        """A column's names with the frame's."""
        return tuple(f"{name}.{column}" for name in (self.name, self.kind, *sorted(self.also)))

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Recording:
    """What one source file or folder held, and what of it was lost.

    unread: sentences on numbers of its messages that are in no frame.
    """

    frames: tuple[Frame, ...]
    losses: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()


def joined(frames: Iterable[Frame]) -> list[Frame]:
    """Frames with rows; those of the same name and columns that follow each other made one.

    Frames that overlap in time are different sensors of the same layout and stay apart.
    """
    chains: dict[tuple[frozenset[str], str, tuple[str, ...]], list[list[Frame]]] = {}
    ends: dict[int, int] = {}
    for frame in sorted((f for f in frames if len(f)), key=lambda f: int(f.time.min())):
        lines = chains.setdefault(frame.key, [])
        first, last = int(frame.time.min()), int(frame.time.max())
        line = next((line for line in lines if ends[id(line)] <= first), None)
        if line is None:
            line = []
            lines.append(line)
        line.append(frame)
        ends[id(line)] = last
    return [_concatenated(line) for lines in chains.values() for line in lines]


def _concatenated(group: list[Frame]) -> Frame:
    if len(group) == 1:
        return group[0]
    time = concatenated([frame.time for frame in group])

    def column(name: str) -> NDArray:
        parts = [frame.columns[name] for frame in group]
        return concatenated(parts) if any(p.strides != (0,) for p in parts) else absent(len(time))

    files = ", ".join(dict.fromkeys(frame.file for frame in group))
    columns = {name: column(name) for name in group[0].columns}
    return replace(group[0], file=files, time=time, columns=columns)


def unread(name: str, file: str, columns: Iterable[str], kind: str = "") -> Frame:
    """What nobody asked for: the names of its columns over a single row."""
    return Frame(name, file, np.zeros(1, np.int64), {c: absent(1) for c in columns}, kind=kind)


def absent(size: int) -> NDArray:
    """A column that nobody asked for: its name counts, its values take no memory."""
    return np.broadcast_to(np.float64("nan"), size)
