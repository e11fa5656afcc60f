"""Third-party MCAP files: protobuf, ROS 2 and JSON messages, each topic as columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError
from roadlog.ingest.formats import ros, times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.frame import Frame, Recording, absent, unread
from roadlog.ingest.profile import Clock, Profile
from roadlog.storage import MAGIC, Channel, LogReader, Table
from roadlog.types import Bools, Stamps

FIRST = 2_000_000_000  # ns of each topic that are looked at for its fields
# seconds and nanoseconds of a message's own stamp, as ROS, protobuf and JSON spell them
STAMPS = [
    (f"{stamp}.{second}", f"{stamp}.{rest}")
    for stamp in ("header.stamp", "timestamp", "stamp", "header.timestamp")
    for second, rest in (("sec", "nanosec"), ("sec", "nsec"), ("seconds", "nanos"))
]


def recognizes(path: Path) -> bool:
    """Whether the file begins as an MCAP does."""
    return begins(path, MAGIC)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every numeric field."""
    del dbc
    with LogReader(path) as reader:
        return {
            name
            for channel, fields in _fields(reader).values()
            for field in fields
            for name in (f"{ros.kind(channel.schema)}.{field}", f"{channel.topic}.{field}")
        }


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Fields that the profile reads, one frame a topic; of the others only the names.

    Time is the clock that the profile chooses: log, publish, or header for a message's own stamp.
    Raises LogReadError.
    """
    del dbc
    clock = profile.clock
    frames = []
    losses: list[str] = []
    with LogReader(path) as reader:
        for topic, (channel, fields) in _fields(reader).items():
            kind = ros.kind(channel.schema)
            wanted = [f for f in fields if profile.reads(f, topic, kind)]
            if not wanted:
                frames.append(unread(topic, path.name, fields, kind))
                continue
            stamp = _stamp(clock, fields)
            read_clock = "log" if clock.clock == "header" else clock.clock
            table = reader.read([topic], fields={topic: [*wanted, *stamp]}, clock=read_clock)[topic]
            time, keep = _time(table, clock, stamp, f"{path}: {topic}")
            if lost := len(table) - len(time):
                losses.append(f"{path.name}: {topic}: {lost} messages without a time left out")
            columns = {
                f: _rows(table.columns[f], keep) if f in wanted else absent(len(time))
                for f in fields
            }
            frames.append(Frame(topic, path.name, time, columns, kind=kind))
        losses += [f"{path.name}: {loss}" for loss in reader.losses]
    if not frames:
        raise LogReadError(f"{path}: holds no message with numbers")
    return Recording(tuple(frames), tuple(losses))


def _rows(column: NDArray, keep: Bools) -> NDArray:
    return column if keep.all() else column[keep]


def _fields(reader: LogReader) -> Mapping[str, tuple[Channel, list[str]]]:
    """Topic -> its channel and the paths of its fields, as its first messages have them."""
    topics = {c.topic: c for c in reader.channels if c.count}
    if not topics or reader.start_ns is None:
        return {}
    first = reader.read(topics, end_ns=reader.start_ns + FIRST)
    late = [topic for topic in topics if not len(first[topic])]
    if late:  # a topic that starts later than the log
        first |= reader.read(late)
    return {
        topic: (channel, [f for f, c in first[topic].columns.items() if c.dtype.kind in "bifu"])
        for topic, channel in topics.items()
    }


def _stamp(clock: Clock, fields: list[str]) -> list[str]:
    """The fields that hold a message's own time, where the profile wants it."""
    if clock.column:
        return [clock.column] if clock.column in fields else []
    if clock.clock != "header":
        return []
    return next((list(pair) for pair in STAMPS if set(pair) <= set(fields)), [])


def _time(table: Table, clock: Clock, stamp: list[str], where: str) -> tuple[Stamps, Bools]:
    """ns of each message that has a time, and which these are."""
    if not stamp:
        if clock.column or clock.clock == "header":
            what = clock.column or "header stamp"
            raise LogReadError(
                f"{where}: its messages have no {what}; set [time] clock in the profile"
            )
        return table.time, np.ones(len(table), np.bool_)
    values = [table.columns[name] for name in stamp]
    if len(values) == 1:
        return times.stamps(values[0], clock.unit, where)
    (second, keep), (rest, known) = (
        times.from_numbers(column, unit) for column, unit in zip(values, ("s", "ns"), strict=True)
    )
    return second[known[keep]] + rest[keep[known]], keep & known


FORMAT = Format(
    name="mcap",
    about="MCAP files",
    recognizes=recognizes,
    read=read,
    names=names,
)
