"""ROS 1 bags and ROS 2 bag folders (sqlite3 or MCAP inside), by rosbags."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.types import Stamps

ROS1 = b"#ROSBAG V2.0"
SQLITE = b"SQLite format 3"
METADATA = "metadata.yaml"
STAMPS = ("header.stamp", "stamp")  # where a message has its own clock


def recognizes(path: Path) -> bool:
    """Whether it is a ROS 1 bag, a folder with ROS 2 metadata, or a file out of one."""
    if path.is_dir():
        return (path / METADATA).is_file()
    return begins(path, ROS1, SQLITE)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every numeric field."""
    del dbc
    with _opened(path) as reader:
        return {
            name
            for connection in reader.connections
            for field in _fields(path, reader, connection.msgtype)
            for name in (f"{kind(connection.msgtype)}.{field}", f"{connection.topic}.{field}")
        }


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Numeric fields that the profile reads, one frame a topic; of the others only the names.

    Time is that of recording, or the header's where the profile says so. Raises LogReadError,
    MissingExtraError.
    """
    del dbc
    broken: list[str] = []
    bad: dict[str, int] = {}
    with _opened(path) as reader:
        topics: dict[str, _Topic] = {}
        for connection in reader.connections:
            fields = _fields(path, reader, connection.msgtype)
            topics.setdefault(
                connection.topic,
                _Topic(kind(connection.msgtype), fields, profile, connection.topic),
            )
        wanted = [c for c in reader.connections if topics[c.topic].wanted]
        with guarded(path, "a ROS bag", broken):
            for connection, stamp, raw in reader.messages(wanted) if wanted else ():
                try:
                    topics[connection.topic].add(stamp, reader.deserialize(raw, connection.msgtype))
                except Exception:  # a payload that is not what its definition says
                    bad[connection.topic] = bad.get(connection.topic, 0) + 1
    count = sum(len(topic.time) for topic in topics.values())
    if broken and not count:
        raise LogReadError(broken[0])
    losses = [f"{sentence}; the {count} messages before are kept" for sentence in broken]
    losses += [f"{path.name}: {topic}: {n} messages undecodable" for topic, n in bad.items()]
    frames = [topic.frame(name, path.name) for name, topic in topics.items()]
    return Recording(tuple(frames), tuple(losses))


def kind(name: str) -> str:
    """`sensor_msgs/Imu` of `sensor_msgs/msg/Imu`: ROS 1 and 2 name the same message."""
    return name.replace("/msg/", "/")


class _Topic:
    """Rows of one topic as they come."""

    def __init__(self, kind_: str, fields: list[str], profile: Profile, name: str) -> None:
        self.kind = kind_
        self.fields = fields
        self.wanted = [f for f in fields if profile.reads(f, name, kind_)]
        self.columns = {f: array("d") for f in self.wanted}
        self.time = array("q")
        own = next((s for s in STAMPS if f"{s}.sec" in fields), "")
        self.stamp = own.split(".") if own and profile.clock.clock == "header" else []
        self.paths = [(self.columns[f], f.split(".")) for f in self.wanted]

    def add(self, stamp: int, message: Any) -> None:
        """A row; nothing of it where a value is not there."""
        if self.stamp:
            own = _value(message, self.stamp)
            stamp = own.sec * 1_000_000_000 + own.nanosec
        values = array("d", [_value(message, path) for _, path in self.paths])
        self.time.append(stamp)
        for (column, _), value in zip(self.paths, values, strict=True):
            column.append(value)

    def frame(self, name: str, file: str) -> Frame:
        time: Stamps = np.array(self.time, np.int64)
        columns = {
            f: np.array(self.columns[f]) if f in self.columns else absent(len(time))
            for f in self.fields
        }
        return Frame(name, file, time, columns, kind=self.kind)


def _value(message: Any, path: list[str]) -> Any:
    for part in path:
        message = getattr(message, part)
    return message


def _fields(path: Path, reader: Any, msgtype: str) -> list[str]:
    """Paths of the numeric fields of a message type, nested ones joined by dots."""
    with guarded(path, "a ROS bag"):
        return list(_walk(reader.typestore, msgtype, ""))


def _walk(store: Any, msgtype: str, prefix: str) -> Iterator[str]:
    from rosbags.interfaces import Nodetype

    for name, (node, what) in store.get_msgdef(msgtype).fields:
        if node == Nodetype.BASE and what[0] != "string":
            yield prefix + name
        elif node == Nodetype.NAME:
            yield from _walk(store, what, f"{prefix}{name}.")


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """An open reader. Raises LogReadError in words that say what to do, MissingExtraError."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("a ROS bag", "ros") from None
    try:
        with guarded(path, "a ROS bag"):
            reader = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
            reader.open()
    except LogReadError as error:
        if "index" in str(error).lower() and not path.is_dir():
            raise LogReadError(f"{error}; run `rosbag reindex {path.name}` first") from error
        raise
    with closing(reader):
        yield reader


FORMAT = Format(
    name="ros",
    about="ROS bags",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="ros",
)
