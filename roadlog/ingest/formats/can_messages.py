"""CAN frames that come as messages: can_msgs/Frame, ros2_socketcan_msgs/FdFrame and their like."""

from __future__ import annotations

from collections.abc import Mapping
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from roadlog.ingest.formats.can import EXTENDED, CanFrames
from roadlog.types import Stamps

KINDS = ("can_msgs/Frame", "ros2_socketcan_msgs/FdFrame", "*/CanFrame")
MAX_DATA = 64  # bytes of a frame
FIELDS = (
    "id", "is_extended", "is_rtr", "is_error", "dlc", "len",
    *(f"data.{k}" for k in range(MAX_DATA)),
)  # fmt: skip


def is_can(kind: str) -> bool:
    """Whether messages of a type are frames of a bus."""
    return any(fnmatchcase(kind, pattern) for pattern in KINDS)


def frames(time: Stamps, columns: Mapping[str, NDArray], topic: str) -> CanFrames:
    """The data frames of a topic, which stands for their bus; remote and error frames left out."""
    nothing = np.zeros(len(time))

    def column(*names: str) -> NDArray:
        found = [np.asarray(columns[name], np.float64) for name in names if name in columns]
        known = [values for values in found if np.isfinite(values).any()]
        return np.nan_to_num(known[0]) if known else nothing

    keep = (column("is_rtr") == 0) & (column("is_error") == 0)
    data = np.stack([column(f"data.{k}") for k in range(MAX_DATA)], axis=1).astype(np.uint8)
    widest = max(8, int(column("dlc", "len").max(initial=0)))
    identifier = column("id").astype(np.uint32) | np.where(
        column("is_extended") != 0, np.uint32(EXTENDED), np.uint32(0)
    )
    return CanFrames(
        time[keep],
        identifier[keep],
        np.ascontiguousarray(data[keep, : min(widest, MAX_DATA)]),
        column("dlc", "len").astype(np.uint8)[keep],
        np.zeros(int(keep.sum()), np.uint8),
        (topic,),
    )
