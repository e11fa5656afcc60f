"""One channel's messages as columns: what the rest of roadlog sees of a log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roadlog.columnar import ByValue


@dataclass(frozen=True, eq=False)
class Table(ByValue):
    """Messages of one channel as columns.

    time: int64 nanoseconds since the epoch, log_time = publish_time = measurement time.
    columns: field path (nested fields joined by dots) -> array as long as `time`; float64, bool
        or integers as the schema says; NaN where a value is unknown.
    metadata: the channel's metadata. texts: text fields, which all messages have alike; a table
        that was read does not say them. unread: a sentence on numbers of the messages that are in
        no column, empty for none.
    """

    topic: str
    schema: str
    time: NDArray[np.int64]
    columns: Mapping[str, NDArray]
    metadata: Mapping[str, str] = field(default_factory=dict)
    texts: Mapping[str, str] = field(default_factory=dict)
    unread: str = ""

    def __post_init__(self) -> None:
        for name, values in self.columns.items():
            if len(values) != len(self.time):
                raise ValueError(
                    f"{self.topic}.{name}: {len(values)} values, {len(self.time)} times"
                )

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Channel:
    """What a log says of one channel before its messages are read."""

    topic: str
    schema: str
    encoding: str  # of the messages: "protobuf", "cdr", "json", ...
    count: int
    metadata: Mapping[str, str] = field(default_factory=dict)
