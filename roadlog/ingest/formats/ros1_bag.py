"""ROS 1 bags, versions 1.2 and 2.0: whole, being recorded (`.active`) or cut off.

A bag is a line of records, header and data, which is read from front to back; the index at its
end, which a bag that was cut off does not have, is not needed (wiki.ros.org/Bags/Format).
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path

from roadlog.errors import LogReadError
from roadlog.ingest.formats.bags import Bag, Batch, Connection, collected
from roadlog.storage.records import Schema

BEGINNINGS = (b"#ROSBAG V2.0\n", b"#ROSBAG V1.2\n")
DEFINITION, MESSAGE, CHUNK, CONNECTION = 0x01, 0x02, 0x05, 0x07
LATE = 10**9  # ns by which a message may follow one that is newer
LARGEST = 1 << 30  # bytes of a record; a longer one is a damaged length
DAMAGED = (struct.error, KeyError, ValueError, OSError, EOFError, RuntimeError)


class Cut(Exception):
    """The bytes end within a record."""


@dataclass
class Ros1Bag(Bag):
    """A bag, opened: one pass over its records finds the connections and counts the messages."""

    _numbers: dict[str, int] = field(
        default_factory=dict
    )  # of connections of version 1.2, by topic

    def __post_init__(self) -> None:
        last = None
        for connection, stamp, _ in self._rows():
            if connection in self.connections:
                self.connections[connection].count += 1
            last = stamp
            self.start_ns = stamp if self.start_ns is None else min(self.start_ns, stamp)
        if last is None:
            what = self.losses[0] if self.losses else "holds no message"
            raise LogReadError(f"{self.path}: cannot be read as a ROS bag: {what}")
        count = sum(c.count for c in self.connections.values())
        self.losses = [f"{loss}; the {count} messages before are kept" for loss in self.losses]

    def batches(self, connections: set[int], end_ns: int | None = None) -> Iterator[Batch]:
        """As they come; a bag is recorded in order of time, but for a little."""
        rows = self._rows()
        if end_ns is not None:
            rows = takewhile(lambda row: row[1] < end_ns + LATE, rows)
        yield from collected(row for row in rows if row[0] in connections)

    def _rows(self) -> Iterator[tuple[int, int, bytes]]:
        """(connection, ns, payload); ends with a loss where the bag is cut or damaged."""
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            file.seek(len(BEGINNINGS[0]))
            place = file.tell()
            try:
                while place < size:
                    place = file.tell()
                    yield from self._record(file)
            except (Cut, *DAMAGED) as error:
                why = "is cut off" if isinstance(error, Cut) else f"is damaged ({error})"
                loss = f"it {why} at byte {place} of {size}"
                if not any(known.startswith(loss) for known in self.losses):
                    self.losses.append(loss)

    def _record(self, file: object) -> Iterator[tuple[int, int, bytes]]:
        """The messages of the next record of the file."""
        head = _block(file)
        if head is None:
            return
        fields = _fields(head)
        kind = fields[b"op"][0]
        data = _block(file)
        if data is None:
            raise Cut
        if kind == CHUNK:
            yield from self._chunk(_inflated(fields, data))
        elif kind == CONNECTION:
            self._declare(fields, data)
        elif kind == DEFINITION:
            topic = fields[b"topic"].decode()
            number = self._numbers.setdefault(topic, len(self._numbers))
            self._add(number, topic, fields[b"type"].decode(), fields.get(b"def", data))
        elif kind == MESSAGE and b"topic" in fields:
            stamp = struct.unpack("<I", fields[b"sec"])[0] * 10**9
            stamp += struct.unpack("<I", fields[b"nsec"])[0]
            yield self._numbers[fields[b"topic"].decode()], stamp, data
        elif kind == MESSAGE:
            yield _connection(fields), _stamp(fields[b"time"]), data

    def _chunk(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """The messages of a chunk. Their headers look alike but for connection and time."""
        place, end = 0, len(data)
        unpack = struct.Struct("<I").unpack_from
        layouts: dict[tuple[int, bytes], tuple[int, int]] = {}
        while place < end:
            size = unpack(data, place)[0]
            start = place + 4
            body = start + size
            length = unpack(data, body)[0]
            place = body + 4 + length
            if place > end:
                raise Cut
            key = size, data[start : start + 8]
            known = layouts.get(key)
            if known is None:
                head = data[start:body]
                fields = _fields(head)
                if fields[b"op"][0] == CONNECTION:
                    self._declare(fields, data[body + 4 : place])
                    continue
                if fields[b"op"][0] != MESSAGE:
                    continue
                known = layouts[key] = (head.index(b"conn=") + 5, head.index(b"time=") + 5)
            elif data[start + known[1] - 5 : start + known[1]] != b"time=":
                del layouts[key]
                place = start - 4
                continue
            seconds, rest = struct.unpack_from("<II", data, start + known[1])
            yield (
                unpack(data, start + known[0])[0],
                seconds * 10**9 + rest,
                data[body + 4 : place],
            )

    def _declare(self, fields: dict[bytes, bytes], data: bytes) -> None:
        own = _fields(data)
        topic = fields.get(b"topic") or own[b"topic"]
        definition = own[b"message_definition"]
        self._add(_connection(fields), topic.decode(), own[b"type"].decode(), definition)

    def _add(self, number: int, topic: str, type_: str, definition: bytes) -> None:
        schema = Schema(0, type_, "ros1msg", definition)
        self.connections.setdefault(number, Connection(topic, "ros1", schema))


def open_bag(path: Path) -> Ros1Bag:
    """A bag of the disk. Raises LogReadError."""
    return Ros1Bag(path)


def _block(file: object) -> bytes | None:
    """A length and as many bytes; None at the end of the file. Raises Cut."""
    head = file.read(4)  # type: ignore[attr-defined]
    if not head:
        return None
    if len(head) < 4:
        raise Cut
    size = int.from_bytes(head, "little")
    if size > LARGEST:
        raise ValueError(f"a record of {size} bytes")
    data: bytes = file.read(size)  # type: ignore[attr-defined]
    if len(data) < size:
        raise Cut
    return data


def _fields(head: bytes) -> dict[bytes, bytes]:
    """`name=value` fields, each after its length. Raises ValueError."""
    found, place = {}, 0
    while place < len(head):
        size = int.from_bytes(head[place : place + 4], "little")
        name, equals, value = head[place + 4 : place + 4 + size].partition(b"=")
        if not equals:
            raise ValueError("a header that is none")
        found[name] = value
        place += 4 + size
    return found


def _connection(fields: dict[bytes, bytes]) -> int:
    return int.from_bytes(fields[b"conn"], "little")


def _stamp(value: bytes) -> int:
    seconds, rest = struct.unpack("<II", value)
    return seconds * 10**9 + rest


def _inflated(fields: dict[bytes, bytes], data: bytes) -> bytes:
    compression = fields[b"compression"]
    if compression == b"none":
        return data
    if compression == b"bz2":
        return bz2.decompress(data)
    if compression == b"lz4":
        import lz4.frame

        return lz4.frame.decompress(data)
    raise ValueError(f"compression {compression.decode(errors='replace')}")
