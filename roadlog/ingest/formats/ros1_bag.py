"""ROS 1 bags, versions 1.2 and 2.0: whole, being recorded (`.active`) or cut off.

A bag is a line of records, header and data, which is read from front to back; the index at its
end, which a bag that was cut off does not have, is not needed (wiki.ros.org/Bags/Format).
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats.bags import Bag, Batch, Connection, collected
from roadlog.storage.records import Schema
from roadlog.types import Stamps

BEGINNINGS = (b"#ROSBAG V2.0\n", b"#ROSBAG V1.2\n")
DEFINITION, MESSAGE, INDEX, CHUNK, CONNECTION = 0x01, 0x02, 0x04, 0x05, 0x07
ENTRY = np.dtype([("time", "<u8"), ("at", "<u4")])  # of an index: where in the chunk
PLAIN = 1 << 16  # messages outside chunks that are kept together
NS = 10**9
LATE = NS  # ns by which a message may follow one that is newer
LARGEST = 1 << 30  # bytes of a record; a longer one is a damaged length
DAMAGED = (struct.error, KeyError, ValueError, OSError, EOFError, RuntimeError)


class Cut(Exception):
    """The bytes end within a record."""


class _Listed(NamedTuple):
    """Messages of a connection in a chunk: ns, and where records and payloads begin and end."""

    connection: int
    stamps: Stamps
    starts: Stamps
    bodies: Stamps
    ends: Stamps

    def payloads(self, data: bytes) -> list[bytes]:
        places = zip(self.bodies.tolist(), self.ends.tolist(), strict=True)
        return [data[start:end] for start, end in places]


@dataclass
class Ros1Bag(Bag):
    """A bag, opened: one pass over its records finds the connections and counts the messages."""

    _numbers: dict[str, int] = field(
        default_factory=dict
    )  # of connections of version 1.2, by topic

    def __post_init__(self) -> None:
        for connection, stamps, _ in self._batches(set()):
            if connection in self.connections:
                self.connections[connection].count += len(stamps)
            first = int(stamps.min())
            self.start_ns = first if self.start_ns is None else min(self.start_ns, first)
        if self.start_ns is None:
            what = self.losses[0] if self.losses else "holds no message"
            raise LogReadError(f"{self.path}: cannot be read as a ROS bag: {what}")
        count = sum(c.count for c in self.connections.values())
        self.losses = [f"{loss}; the {count} messages before are kept" for loss in self.losses]

    def batches(self, connections: set[int], end_ns: int | None = None) -> Iterator[Batch]:
        """As they come; a bag is recorded in order of time, but for a little."""
        for batch in self._batches(connections):
            if end_ns is not None and batch.stamps.min() >= end_ns + LATE:
                return
            if batch.connection in connections:
                yield batch

    def _batches(self, wanted: set[int]) -> Iterator[Batch]:
        """All messages, payloads of wanted connections; a loss where the bag is cut or damaged."""
        size = self.path.stat().st_size
        with self.path.open("rb") as file:
            file.seek(len(BEGINNINGS[0]))
            place = file.tell()
            chunk: tuple[bytes, dict[int, bytes]] | None = None  # and its indexes, which follow it
            plain: list[tuple[int, int, bytes]] = []  # messages outside chunks
            try:
                while place < size:
                    place = file.tell()
                    fields, data = _record(file)
                    kind = fields[b"op"][0] if fields else None
                    if kind == INDEX and chunk is not None:
                        chunk[1][_connection(fields)] = data
                        continue
                    if chunk is not None:
                        done, chunk = chunk, None
                        yield from self._in_chunk(*done, wanted)
                    if kind == CHUNK:
                        chunk = _inflated(fields, data), {}
                    elif kind is not None:
                        plain += self._outside(kind, fields, data)
                    if len(plain) >= PLAIN or (plain and place >= size):
                        yield from collected(plain)
                        plain = []
            except (Cut, *DAMAGED) as error:
                if chunk is not None:
                    with suppress(Cut, *DAMAGED):
                        yield from self._in_chunk(*chunk, wanted)
                why = "is cut off" if isinstance(error, Cut) else f"is damaged ({error})"
                loss = f"it {why} at byte {place} of {size}"
                if not any(known.startswith(loss) for known in self.losses):
                    self.losses.append(loss)
            yield from collected(plain)

    def _outside(
        self, kind: int, fields: dict[bytes, bytes], data: bytes
    ) -> list[tuple[int, int, bytes]]:
        """A record that is in no chunk; its message."""
        if kind == CONNECTION:
            self._declare(fields, data)
        elif kind == DEFINITION:
            topic = fields[b"topic"].decode()
            number = self._numbers.setdefault(topic, len(self._numbers))
            self._add(number, topic, fields[b"type"].decode(), fields.get(b"def", data))
        elif kind == MESSAGE and b"topic" in fields:
            stamp = struct.unpack("<I", fields[b"sec"])[0] * NS
            stamp += struct.unpack("<I", fields[b"nsec"])[0]
            return [(self._numbers[fields[b"topic"].decode()], stamp, data)]
        elif kind == MESSAGE:
            return [(_connection(fields), _stamp(fields[b"time"]), data)]
        return []

    def _in_chunk(
        self, data: bytes, indexes: dict[int, bytes], wanted: set[int]
    ) -> Iterator[Batch]:
        """By its indexes where they fit the records, else one record after the other."""
        listed = [_listed(data, *index) for index in indexes.items()]
        found = [places for places in listed if places is not None]
        if len(found) < len(listed) or not self._is_all(data, found):
            yield from collected(self._walk(data))
            return
        for own in found:
            payloads = own.payloads(data) if own.connection in wanted else []
            yield Batch(own.connection, own.stamps, payloads)

    def _is_all(self, data: bytes, found: Sequence[_Listed]) -> bool:
        """Whether nothing but declarations lies between messages; these are noted."""
        firsts = np.sort(np.concatenate([[len(data)], *(own.starts for own in found)]))
        lasts = np.sort(np.concatenate([[0], *(own.ends for own in found)]))
        if (firsts < lasts).any():
            return False
        for k in np.flatnonzero(firsts > lasts).tolist():
            place, end = int(lasts[k]), int(firsts[k])
            while place < end:
                head = _part(data, place)
                body = _part(data, place + 4 + len(head))
                fields = _fields(head)
                if fields[b"op"][0] != CONNECTION:
                    return False
                self._declare(fields, body)
                place += 8 + len(head) + len(body)
        return True

    def _walk(self, data: bytes) -> Iterator[tuple[int, int, bytes]]:
        """The messages of a chunk."""
        place = 0
        while place < len(data):
            head = _part(data, place)
            body = _part(data, place + 4 + len(head))
            place += 8 + len(head) + len(body)
            fields = _fields(head)
            if fields[b"op"][0] == CONNECTION:
                self._declare(fields, body)
            elif fields[b"op"][0] == MESSAGE:
                yield _connection(fields), _stamp(fields[b"time"]), body

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


def _record(file: object) -> tuple[dict[bytes, bytes], bytes]:
    """The header and the data of the next record; none at the end of the file. Raises Cut."""
    head = _block(file)
    if head is None:
        return {}, b""
    data = _block(file)
    if data is None:
        raise Cut
    return _fields(head), data


def _part(data: bytes, place: int) -> bytes:
    """A length and as many bytes, of a chunk. Raises Cut."""
    size = struct.unpack_from("<I", data, place)[0]
    part = data[place + 4 : place + 4 + size]
    if len(part) < size:
        raise Cut
    return part


def _listed(data: bytes, connection: int, index: bytes) -> _Listed | None:
    """The messages of a connection by a chunk's index.

    None where the records are not such messages, all with headers alike but for their time.
    """
    at = np.frombuffer(index, ENTRY)["at"].astype(np.int64)
    if not len(at) or at.max() + 8 > len(data):
        return None
    words = np.ndarray((len(data) - 3,), "<u4", data, 0, (1,))
    size = int(words[at[0]])
    head = data[at[0] + 4 : at[0] + 4 + size]
    try:
        fields = _fields(head)
        is_message = fields[b"op"][0] == MESSAGE and _connection(fields) == connection
    except (KeyError, ValueError):
        return None
    body = at + 4 + size
    if not is_message or (words[at] != size).any() or body.max() + 4 > len(data):
        return None
    ends: Stamps = body + 4 + words[body]
    if ends.max() > len(data):
        return None
    heads = np.ndarray((len(data) - size + 1,), f"V{size}", data, 0, (1,))[at + 4]
    matrix = heads.view(np.uint8).reshape(-1, size).copy()
    time = head.index(b"time=") + 5
    stamps = matrix[:, time : time + 8].copy().view("<u4").astype(np.int64)
    matrix[:, time : time + 8] = 0
    if (matrix != matrix[0]).any():
        return None
    return _Listed(connection, stamps[:, 0] * NS + stamps[:, 1], at, body + 4, ends)


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
    return seconds * NS + rest


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
