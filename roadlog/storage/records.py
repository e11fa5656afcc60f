"""MCAP records: their bytes, packed and parsed (https://mcap.dev/spec)."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from isal.isal_zlib import crc32 as crc32  # 4 times as fast as zlib's

from roadlog.errors import LogReadError

MAGIC = b"\x89MCAP0\r\n"

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX = range(9, 14)
SUMMARY_OFFSET, DATA_END = 14, 15

PREFIX = struct.Struct("<BQ")  # opcode and length of every record's content
MESSAGE_HEAD = 31  # bytes before a message's payload: prefix, channel, sequence, two times
INDEX_ENTRY = 16  # bytes of one message in a MessageIndex: log time and offset
CRC_MARK = b"crc32"  # announces the CRC behind a MetadataIndex
LOG_TIME, PUBLISH_TIME = 15, 23  # where its times lie
MESSAGE_FIELDS = 22  # of these, the ones that the record's length counts


class Damage(LogReadError):
    """Bytes that are not what they should be; the text says what, not in which file."""


@dataclass(frozen=True)
class Schema:
    """What the messages of a channel mean."""

    id: int
    name: str
    encoding: str
    data: bytes

    @classmethod
    def parse(cls, content: bytes) -> Schema:
        fields = Fields(content)
        return cls(fields.take("H"), fields.text(), fields.text(), fields.blob("I"))

    def pack(self) -> bytes:
        return record(
            SCHEMA, struct.pack("<H", self.id), text(self.name), text(self.encoding),
            blob("I", self.data),
        )  # fmt: skip


@dataclass(frozen=True)
class ChannelRecord:
    """One stream of messages; schema_id 0: none."""

    id: int
    schema_id: int
    topic: str
    encoding: str
    metadata: Mapping[str, str]

    @classmethod
    def parse(cls, content: bytes) -> ChannelRecord:
        fields = Fields(content)
        id_, schema_id = fields.take("H"), fields.take("H")
        return cls(id_, schema_id, fields.text(), fields.text(), fields.texts())

    def pack(self) -> bytes:
        return record(
            CHANNEL, struct.pack("<HH", self.id, self.schema_id), text(self.topic),
            text(self.encoding), texts(self.metadata),
        )  # fmt: skip


# of a ChunkIndex: before its list of message indexes, before a name, and behind that
_PLACE, _MIDDLE, _CHUNK_SIZES = map(struct.Struct, ("<4QI", "<QI", "<2Q"))


class Chunk(NamedTuple):
    """Where a chunk lies and what it holds.

    indexes: channel id -> offset of its MessageIndex; empty when there is none. size: of the
    content. compression: "raw" for a run of messages outside any chunk.
    """

    start_ns: int
    end_ns: int
    offset: int
    length: int
    indexes: Mapping[int, int]
    indexes_length: int
    compression: str
    compressed_size: int
    size: int

    @classmethod
    def parse(cls, content: bytes) -> Chunk:
        """From a ChunkIndex record, of which a long log has thousands."""
        try:
            start, end, offset, length, size = _PLACE.unpack_from(content)
            behind = _PLACE.size + size
            indexes = dict(struct.iter_unpack("<HQ", content[_PLACE.size : behind]))
            indexes_length, size = _MIDDLE.unpack_from(content, behind)
            behind += _MIDDLE.size + size
            compression = content[behind - size : behind].decode()
            sizes = _CHUNK_SIZES.unpack_from(content, behind)
        except (struct.error, UnicodeDecodeError) as error:
            raise Damage("a chunk index is not what it should be") from error
        return cls(start, end, offset, length, indexes, indexes_length, compression, *sizes)

    def pack(self) -> bytes:
        indexes = b"".join(struct.pack("<HQ", *item) for item in self.indexes.items())
        return record(
            CHUNK_INDEX,
            struct.pack("<4Q", self.start_ns, self.end_ns, self.offset, self.length),
            blob("I", indexes), struct.pack("<Q", self.indexes_length), text(self.compression),
            struct.pack("<2Q", self.compressed_size, self.size),
        )  # fmt: skip

    @property
    def indexed(self) -> int:
        """Number of messages that the MessageIndex records list, by their length."""
        return (self.indexes_length - 15 * len(self.indexes)) // INDEX_ENTRY


@dataclass(frozen=True)
class Statistics:
    """What the summary says the file holds."""

    messages: int
    schemas: int
    channels: int
    attachments: int
    metadata: int
    chunks: int
    start_ns: int
    end_ns: int
    counts: Mapping[int, int]

    @classmethod
    def parse(cls, content: bytes) -> Statistics:
        fields = Fields(content)
        numbers = (fields.take(code) for code in "QHIIIIQQ")
        return cls(*numbers, dict(struct.iter_unpack("<HQ", fields.blob("I", 10))))  # type: ignore

    def pack(self) -> bytes:
        counts = b"".join(struct.pack("<HQ", *item) for item in self.counts.items())
        numbers = struct.pack(
            "<QHIIIIQQ", self.messages, self.schemas, self.channels, self.attachments,
            self.metadata, self.chunks, self.start_ns, self.end_ns,
        )  # fmt: skip
        return record(STATISTICS, numbers, blob("I", counts))


_WIDTHS = {"H": 2, "I": 4, "Q": 8}


class Fields:
    """The fields of one record, taken one after another. Raises Damage where they end early."""

    def __init__(self, content: bytes) -> None:
        self.content = content
        self.position = 0

    def take(self, code: str) -> int:
        """One little-endian integer of the given struct code."""
        return int.from_bytes(self._next(_WIDTHS[code]), "little")

    def blob(self, code: str, multiple: int = 1) -> bytes:
        """Bytes behind their length; the length must be a multiple of `multiple`."""
        data = self._next(self.take(code))
        if len(data) % multiple:
            raise Damage(f"a list of {len(data)} bytes has entries of {multiple} bytes")
        return data

    def text(self) -> str:
        try:
            return self.blob("I").decode()
        except UnicodeDecodeError:
            raise Damage("a text is not UTF-8") from None

    def texts(self) -> dict[str, str]:
        inner = Fields(self.blob("I"))
        result = {}
        while inner.position < len(inner.content):
            key = inner.text()
            result[key] = inner.text()
        return result

    def _next(self, size: int) -> bytes:
        start, self.position = self.position, self.position + size
        if self.position > len(self.content):
            raise Damage(f"a field of {size} bytes in a record of {len(self.content)} bytes")
        return self.content[start : self.position]


def record(opcode: int, *parts: bytes) -> bytes:
    """A record of these parts."""
    content = b"".join(parts)
    return PREFIX.pack(opcode, len(content)) + content


def text(value: str) -> bytes:
    return blob("I", value.encode())


def texts(values: Mapping[str, str]) -> bytes:
    return blob("I", b"".join(text(key) + text(value) for key, value in values.items()))


def blob(code: str, data: bytes) -> bytes:
    return struct.pack("<" + code, len(data)) + data


def metadata_record(name: str, values: Mapping[str, str]) -> bytes:
    return record(METADATA, text(name), texts(values))


def metadata_index(offset: int, data: bytes, name: str) -> bytes:
    """Index of a metadata record that lies at `offset`.

    The CRC of the record stands behind the fields of the specification, where readers look no
    further: the summary's own CRC then protects the metadata too.
    """
    numbers = struct.pack("<2Q", offset, len(data))
    return record(METADATA_INDEX, numbers, text(name), CRC_MARK, struct.pack("<I", crc32(data)))


def attachment_index(offset: int, attachment: bytes) -> bytes:
    """Index of an attachment record that lies at `offset`."""
    fields = Fields(attachment)
    fields.position = PREFIX.size
    times = fields.take("Q"), fields.take("Q")
    name, media_type = fields.text(), fields.text()
    numbers = struct.pack("<5Q", offset, len(attachment), *times, fields.take("Q"))
    return record(ATTACHMENT_INDEX, numbers, text(name), text(media_type))
