"""The MCAP container: where a file keeps its messages, and their bytes, checked.

What a file holds is taken from its summary where that provably lists every message, and from a
scan of all records otherwise. Every length is checked against the bytes that exist before
anything is allocated, every CRC that is there is checked.
"""

from __future__ import annotations

import os
import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, NamedTuple, Protocol

import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from roadlog.errors import LogReadError
from roadlog.storage import records
from roadlog.storage.records import (
    MAGIC,
    MESSAGE_FIELDS,
    MESSAGE_HEAD,
    PREFIX,
    ChannelRecord,
    Chunk,
    Damage,
    Fields,
    Schema,
    Statistics,
    crc32,
)

Offsets = NDArray[np.int64]
Bytes = NDArray[np.uint8]

FOOTER_SIZE = PREFIX.size + 20 + len(MAGIC)  # the Footer record and the magic behind it
DATA_END_SIZE = PREFIX.size + 4
MAX_CHUNK = 1 << 29  # bytes; a larger chunk is refused (writers make them of about 1 MiB)
MAX_LZ4_RATIO = 256  # one byte of LZ4 stands for at most 255 (LZ4 block format)
SCAN_WINDOW = 1 << 16  # bytes read at once to find where records begin
RAW = "raw"  # compression of messages outside any chunk, which are handled as if in one
RUN_SIZE = 1 << 20  # bytes; messages outside chunks are handled in pieces of about this size
CHECKED_WHOLE = 1 << 22  # bytes; a file with metadata that has no CRC of its own, up to this size
COPY_SIZE = 1 << 26  # bytes handed to the kernel, or read and written, at once
_local = threading.local()


class Reader(Protocol):
    """Something whose bytes can be read."""

    def read(self, offset: int, length: int) -> bytes: ...


class Source:
    """Random access to a file's bytes. Reading beyond its end raises Damage."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = path.open("rb")
            self.size = path.stat().st_size
        except OSError as error:
            raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error
        self._lock = threading.Lock()

    def read(self, offset: int, length: int) -> bytes:
        if offset < 0 or length < 0 or offset + length > self.size:
            raise Damage(f"bytes {offset} to {offset + length} of a file of {self.size}")
        with self._lock:
            self._file.seek(offset)
            data = self._file.read(length)
        if len(data) < length:
            raise Damage(f"the file lost its end at byte {offset + len(data)} while it was read")
        return data

    def copy_to(self, file: IO[bytes], start: int, end: int) -> None:
        """Append a range to a file, by the kernel where it can (some file systems share it)."""
        file.flush()
        target = file.tell()
        position = start
        try:
            while position < end:
                size = min(COPY_SIZE, end - position)
                at = target + position - start
                copied = os.copy_file_range(self._file.fileno(), file.fileno(), size, position, at)
                if not copied:
                    break
                position += copied
        except (OSError, AttributeError):
            pass
        file.seek(target + position - start)
        for rest in range(position, end, COPY_SIZE):
            file.write(self.read(rest, min(COPY_SIZE, end - rest)))

    def close(self) -> None:
        self._file.close()


class Record(NamedTuple):
    """Where one record lies; length is that of its content."""

    opcode: int
    offset: int
    length: int

    @property
    def end(self) -> int:
        return self.offset + PREFIX.size + self.length

    def content(self, source: Source) -> bytes:
        return source.read(self.offset + PREFIX.size, self.length)


class MetadataPlace(NamedTuple):
    """Where a metadata record lies, and its CRC where an index of ours says it."""

    offset: int
    length: int
    crc: int | None = None

    @classmethod
    def parse(cls, content: bytes) -> MetadataPlace:
        """From a MetadataIndex record."""
        fields = Fields(content)
        offset, length = fields.take("Q"), fields.take("Q")
        fields.text()
        behind = content[fields.position :]
        has_crc = len(behind) == len(records.CRC_MARK) + 4 and behind.startswith(records.CRC_MARK)
        return cls(offset, length, int.from_bytes(behind[-4:], "little") if has_crc else None)

    def read(self, source: Source) -> tuple[str, dict[str, str]]:
        """Name and texts. Raises Damage."""
        data = source.read(self.offset, self.length)
        if self.crc is not None and crc32(data) != self.crc:
            raise Damage("wrong CRC")
        fields = Fields(data)
        fields.position = PREFIX.size
        return fields.text(), fields.texts()


@dataclass
class Contents:
    """What a file holds.

    counts: messages per channel id. losses: sentences on what is damaged or missing.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    metadata: list[MetadataPlace] = field(default_factory=list)
    attachments: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    losses: list[str] = field(default_factory=list)


def contents(source: Source) -> Contents:
    """What a file holds, by its summary or else by a scan."""
    problem = ""
    try:
        found = _from_summary(source)
        if found is not None:
            return found
    except Damage as damage:
        problem = str(damage)
    found = scan(source)
    if problem and not found.losses:
        found.losses.append(f"its summary is damaged ({problem}); all messages were found anyway")
    return found


def _from_summary(source: Source) -> Contents | None:
    """None where the summary does not provably list every message. Raises Damage."""
    footer = source.read(source.size - FOOTER_SIZE, FOOTER_SIZE)
    opcode, length = PREFIX.unpack_from(footer)
    if footer[-len(MAGIC) :] != MAGIC or opcode != records.FOOTER or length != 20:
        raise Damage("there is no footer")
    start, _, crc = struct.unpack_from("<QQI", footer, PREFIX.size)
    if not start:
        return None
    end = source.size - FOOTER_SIZE
    summary = source.read(start, end - start)
    if crc and crc32(footer[: PREFIX.size + 16], crc32(summary)) != crc:
        raise Damage("wrong CRC")
    result = Contents()
    statistics = None
    for opcode, offset, length in inner_records(summary, 0, len(summary)):
        content = summary[offset + PREFIX.size : offset + PREFIX.size + length]
        if opcode == records.SCHEMA:
            schema = Schema.parse(content)
            result.schemas[schema.id] = schema
        elif opcode == records.CHANNEL:
            channel = ChannelRecord.parse(content)
            result.channels[channel.id] = channel
        elif opcode == records.CHUNK_INDEX:
            result.chunks.append(Chunk.parse(content))
        elif opcode == records.METADATA_INDEX:
            result.metadata.append(MetadataPlace.parse(content))
        elif opcode == records.ATTACHMENT_INDEX:
            result.attachments += 1
        elif opcode == records.STATISTICS:
            statistics = Statistics.parse(content)
    if statistics is None:
        return None
    result.chunks.sort(key=lambda chunk: chunk.offset)
    result.counts = dict(statistics.counts)
    if statistics.messages:
        result.start_ns, result.end_ns = statistics.start_ns, statistics.end_ns
    if start <= CHECKED_WHOLE and any(place.crc is None for place in result.metadata):
        data_end = source.read(start - DATA_END_SIZE, DATA_END_SIZE)
        crc = int.from_bytes(data_end[-4:], "little")
        is_data_end = data_end[: PREFIX.size] == PREFIX.pack(records.DATA_END, 4)
        if is_data_end and crc and crc != crc_of(source, 0, start - DATA_END_SIZE):
            return None  # the scan says what is wrong
    return result if _is_complete(result, statistics) else None


def _is_complete(found: Contents, said: Statistics) -> bool:
    indexed = {id_ for chunk in found.chunks for id_ in chunk.indexes} | set(found.counts)
    return (
        said.messages == sum(found.counts.values())
        and said.messages == sum(chunk.indexed for chunk in found.chunks)
        and said.chunks == len(found.chunks)
        and said.metadata == len(found.metadata)
        and said.attachments == found.attachments
        and said.channels <= len(found.channels)
        and indexed <= found.channels.keys()
        and {c.schema_id for c in found.channels.values()} <= found.schemas.keys() | {0}
    )


def outer_records(source: Source, position: int = len(MAGIC)) -> Iterator[Record]:
    """Records of a file outside chunks, without their content. Raises Damage where one is cut."""
    base, window = 0, b""
    while position < source.size:
        if position + PREFIX.size > base + len(window):
            base = position
            window = source.read(base, min(SCAN_WINDOW, source.size - base))
        if len(window) < PREFIX.size or window == MAGIC:
            break
        opcode, length = PREFIX.unpack_from(window, position - base)
        found = Record(opcode, position, length)
        if not opcode:
            raise Damage(f"there is no record at byte {position}")
        if found.end > source.size:
            raise Damage(f"the record at byte {position} is cut short")
        yield found
        if opcode == records.FOOTER:
            return
        position = found.end
    raise Damage("the end of the file is missing")


def inner_records(data: bytes, position: int, end: int) -> Iterator[Record]:
    """Records in memory. Raises Damage where one is cut short."""
    while position < end:
        if position + PREFIX.size > end:
            raise Damage(f"{end - position} bytes are no record")
        found = Record(*_place(data, position))
        if found.end > end:
            raise Damage(f"a record of {found.length} bytes where {end - position} are left")
        yield found
        position = found.end


def _place(data: bytes, position: int) -> tuple[int, int, int]:
    opcode, length = PREFIX.unpack_from(data, position)
    return opcode, position, length


def scan(source: Source) -> Contents:
    """Go through every record of the file; what is damaged is left out and said in `losses`."""
    result = Contents()
    chunks: list[Chunk] = []
    data_end: Record | None = None
    run: Record | None = None  # messages outside chunks, one after another
    try:
        for found in outer_records(source):
            if found.opcode == records.MESSAGE:
                if run is None or found.end - run.offset > RUN_SIZE:
                    run = found
                    chunks.append(_run(run))
                run = Record(run.opcode, run.offset, found.end - run.offset - PREFIX.size)
                chunks[-1] = _run(run)
                continue
            run = None
            if found.opcode == records.CHUNK:
                chunks.append(_chunk_at(source, found))
            elif found.opcode == records.MESSAGE_INDEX and chunks and data_end is None:
                _add_index(source, chunks, found)
            elif found.opcode in (records.SCHEMA, records.CHANNEL):
                _declare(result, found.opcode, found.content(source))
            elif found.opcode == records.METADATA:
                result.metadata.append(MetadataPlace(found.offset, PREFIX.size + found.length))
            elif found.opcode == records.ATTACHMENT:
                result.attachments += 1
            elif found.opcode == records.DATA_END:
                data_end = found
    except Damage as damage:
        if data_end is None:
            result.losses.append(f"it is damaged: {damage}; what was read lies before")
        else:
            result.losses.append(
                f"its summary is damaged ({damage}); all messages were found anyway"
            )
    else:
        if data_end is None:
            result.losses.append("it is damaged: no record ends its data")
    for chunk in chunks:
        _take_stock(source, chunk, result)
    _check_declared(result)
    if data_end is not None and not result.losses:
        crc = Fields(data_end.content(source)).take("I")
        if crc and crc != crc_of(source, 0, data_end.offset):
            result.losses.append("its data has a wrong CRC: some bytes were changed")
    return result


def crc_of(source: Source, start: int, end: int, crc: int = 0) -> int:
    """CRC-32 of a range of the file, continued from `crc`."""
    for position in range(start, end, RUN_SIZE):
        crc = crc32(source.read(position, min(RUN_SIZE, end - position)), crc)
    return crc


def _run(run: Record) -> Chunk:
    size = PREFIX.size + run.length
    return Chunk(0, 0, run.offset, size, {}, 0, RAW, size, size)


def _chunk_at(source: Source, found: Record) -> Chunk:
    """The chunk of a Chunk record, without its indexes."""
    head = Fields(source.read(found.offset + PREFIX.size, min(found.length, SCAN_WINDOW)))
    start, end, size, _ = (head.take(code) for code in "QQQI")
    compression, compressed = head.text(), head.take("Q")
    return Chunk(
        start, end, found.offset, PREFIX.size + found.length, {}, 0, compression, compressed, size
    )


def _add_index(source: Source, chunks: list[Chunk], found: Record) -> None:
    """Note a MessageIndex behind the last chunk."""
    channel = Fields(source.read(found.offset + PREFIX.size, min(found.length, 2))).take("H")
    last = chunks[-1]
    chunks[-1] = replace(
        last,
        indexes={**last.indexes, channel: found.offset},
        indexes_length=last.indexes_length + PREFIX.size + found.length,
    )


def _declare(result: Contents, opcode: int, content: bytes) -> None:
    if opcode == records.SCHEMA:
        schema = Schema.parse(content)
        result.schemas.setdefault(schema.id, schema)
    else:
        channel = ChannelRecord.parse(content)
        result.channels.setdefault(channel.id, channel)


def _take_stock(source: Source, chunk: Chunk, result: Contents) -> None:
    """Count a chunk's messages and take its declarations; a damaged one becomes a loss."""
    try:
        data = load(source, chunk)
        inside = walk(data)
        for found in inside.others:
            if found.opcode in (records.SCHEMA, records.CHANNEL):
                _declare(result, found.opcode, data[found.offset + PREFIX.size : found.end])
    except Damage as damage:
        result.losses.append(lost_chunk(chunk, damage))
        return
    if not len(inside.offsets):
        result.chunks.append(replace(chunk, indexes={}, indexes_length=0))
        return
    times = word(data, inside.offsets, 15, "<u8")
    start, end = int(times.min()), int(times.max())
    result.start_ns = start if result.start_ns is None else min(result.start_ns, start)
    result.end_ns = end if result.end_ns is None else max(result.end_ns, end)
    ids, numbers = np.unique(inside.channels, return_counts=True)
    for id_, number in zip(ids.tolist(), numbers.tolist(), strict=True):
        result.counts[id_] = result.counts.get(id_, 0) + number
    listed = _listed(source, chunk, data) if chunk.indexes_length else None
    if listed is None or sum(map(len, listed.values())) != len(inside.offsets):
        # the walk found each message: its channels stand in for the missing or damaged indexes
        chunk = replace(chunk, indexes=dict.fromkeys(ids.tolist(), 0), indexes_length=0)
    result.chunks.append(replace(chunk, start_ns=start, end_ns=end))


def _check_declared(result: Contents) -> None:
    """Leave out, and say so, messages of channels that no record declares."""
    for id_ in sorted(result.counts.keys() - result.channels.keys()):
        count = result.counts.pop(id_)
        result.losses.append(f"{count} messages belong to channel {id_}, which is not declared")
    for channel in result.channels.values():
        if channel.schema_id and channel.schema_id not in result.schemas:
            result.losses.append(
                f"{channel.topic}: schema {channel.schema_id} of its "
                f"{result.counts.get(channel.id, 0)} messages is missing"
            )


def lost_chunk(chunk: Chunk, damage: Damage) -> str:
    """Sentence on a chunk that cannot be read."""
    span = ""
    if chunk.compression != RAW:
        start, end = (
            np.datetime64(min(ns, 2**63 - 1), "ns") for ns in (chunk.start_ns, chunk.end_ns)
        )
        span = f" ({start} to {end} UTC)"
    return f"the chunk at byte {chunk.offset}{span} is damaged and was skipped: {damage}"


def load(source: Reader, chunk: Chunk) -> bytes:
    """The records of a chunk, uncompressed and checked. Raises Damage."""
    if chunk.compression == RAW:
        return source.read(chunk.offset, chunk.length)
    whole = source.read(chunk.offset, chunk.length)
    opcode, length = PREFIX.unpack_from(whole)
    if opcode != records.CHUNK or PREFIX.size + length != chunk.length:
        raise Damage("there is no chunk")
    fields = Fields(whole)
    fields.position = PREFIX.size + 16
    size, crc, compression = fields.take("Q"), fields.take("I"), fields.text()
    if (size, compression) != (chunk.size, chunk.compression):
        raise Damage("it is not what its index says")
    start = fields.position + 8
    compressed = fields.take("Q")
    if start + compressed > len(whole):
        raise Damage(f"{compressed} bytes in a chunk of {len(whole)}")
    data = _inflate(memoryview(whole)[start : start + compressed], compression, size)
    if len(data) != size:
        raise Damage(f"{len(data)} bytes instead of {size}")
    if crc and crc32(data) != crc:
        raise Damage("wrong CRC")
    return data


def _inflate(data: memoryview, compression: str, size: int) -> bytes:
    if size > MAX_CHUNK:
        raise Damage(f"{size} bytes are more than {MAX_CHUNK}, the most for one chunk")
    if compression == "":
        return bytes(data)
    if not size:
        return b""
    try:
        if compression == "zstd":
            if zstandard.frame_content_size(data) not in (-1, size):
                raise Damage("its compressed size is wrong")
            if not hasattr(_local, "zstd"):
                _local.zstd = zstandard.ZstdDecompressor()
            return _local.zstd.decompress(data, max_output_size=size)
        if compression == "lz4":
            if size > MAX_LZ4_RATIO * len(data):
                raise Damage("its compressed size is wrong")
            stream = lz4.frame.LZ4FrameDecompressor()
            return stream.decompress(data, max_length=size)
    except (zstandard.ZstdError, RuntimeError, EOFError, ValueError) as error:
        raise Damage(f"{compression}: {error}") from error
    raise Damage(f"its compression '{compression}' is unknown")


class Walk(NamedTuple):
    """Messages of a chunk in file order, and its other records."""

    offsets: Offsets
    channels: NDArray[np.uint16]
    others: list[Record]


def walk(data: bytes) -> Walk:
    """Go through all records of a chunk. Raises Damage."""
    offsets: list[Offsets] = []
    others: list[Record] = []
    position, last, end = 0, 0, len(data)
    single: list[int] = []
    while position < end:
        if position + PREFIX.size > end:
            raise Damage(f"{end - position} bytes are no record")
        opcode, length = PREFIX.unpack_from(data, position)
        after = position + PREFIX.size + length
        if after > end:
            raise Damage(f"a record of {length} bytes where {end - position} are left")
        if opcode != records.MESSAGE:
            others.append(Record(opcode, position, length))
        elif length < MESSAGE_FIELDS:
            raise Damage(f"a message of {length} bytes")
        else:
            single.append(position)
            if length == last:  # two of one size: perhaps many
                count = _equal_records(data, position)
                offsets += [np.array(single, np.int64)]
                offsets += [position + (after - position) * np.arange(1, count, dtype=np.int64)]
                single = []
                after = position + (after - position) * count
            last = length
        position = after
    found = np.concatenate([*offsets, np.array(single, np.int64)])
    return Walk(found, word(data, found, PREFIX.size, "<u2"), others)


def _equal_records(data: bytes, position: int) -> int:
    """How many records from `position` on have the opcode and length of the first."""
    _, length = PREFIX.unpack_from(data, position)
    size = PREFIX.size + length
    count = (len(data) - position) // size
    heads = np.ndarray((count,), "V9", data, position, (size,))
    step = 64  # look at few first: in an interleaved chunk the second is different already
    while True:
        part = heads[:step]
        same = part == heads[0]
        if not same.all():
            return int(same.argmin())
        if step >= count:
            return count
        step *= 16


def word(data: bytes, offsets: Offsets, shift: int, dtype: str) -> NDArray:
    """Numbers that lie `shift` bytes behind each offset; the caller has checked the bounds."""
    size = np.dtype(dtype).itemsize
    count = len(data) - shift - size + 1
    if not len(offsets) or count <= 0:
        return np.zeros(0, dtype)
    return np.ndarray((count,), dtype, data, shift, (1,))[offsets]


def messages(source: Source, chunk: Chunk, data: bytes) -> dict[int, Offsets]:
    """Channel id -> offsets of its messages in a chunk, in file order. Raises Damage.

    By the message indexes where they fit the records, which the chunk's CRC protects and the
    indexes' none, else by going through the records.
    """
    listed = _listed(source, chunk, data) if chunk.indexes_length else None
    if listed is not None:
        return listed
    inside = walk(data)
    return {int(id_): inside.offsets[inside.channels == id_] for id_ in np.unique(inside.channels)}


def _listed(source: Source, chunk: Chunk, data: bytes) -> dict[int, Offsets] | None:
    """None where the indexes are not what they should be."""
    result: dict[int, Offsets] = {}
    total = 0
    try:
        first = min(chunk.indexes.values())
        block = source.read(first, chunk.indexes_length)
        for id_, offset in chunk.indexes.items():
            opcode, length = PREFIX.unpack_from(block, offset - first)
            fields = Fields(block[offset - first + PREFIX.size :][:length])
            if opcode != records.MESSAGE_INDEX or fields.take("H") != id_:
                return None
            found = np.frombuffer(fields.blob("I", 16), "<i8")[1::2]
            if len(found) > 1 and (found[1:] <= found[:-1]).any():
                found = np.unique(found)
            total += len(found)
            if len(found) and not _are_messages(data, found, id_):
                return None
            result[id_] = found
    except (Damage, struct.error):
        return None
    return result if total == chunk.indexed else None


def _are_messages(data: bytes, offsets: Offsets, channel: int) -> bool:
    if offsets[0] < 0 or offsets[-1] + MESSAGE_HEAD > len(data):
        return False
    lengths = word(data, offsets, 1, "<u8")
    room = (len(data) - PREFIX.size - offsets).astype(np.uint64)
    return bool(
        (word(data, offsets, 0, "u1") == records.MESSAGE).all()
        and (word(data, offsets, PREFIX.size, "<u2") == channel).all()
        and ((lengths >= MESSAGE_FIELDS) & (lengths <= room)).all()
    )


def equal_size(data: bytes, chunk: Chunk, channel: int) -> int:
    """Size of each record where a chunk is nothing but equally long messages of one channel.

    0 where it is not, and where the message index says nothing of their number.
    """
    count = chunk.indexed if chunk.indexes_length else 0
    size, rest = divmod(len(data), count) if count else (0, 1)
    if rest or size < MESSAGE_HEAD:
        return 0
    head = data[: PREFIX.size + 2]
    if head != struct.pack("<BQH", records.MESSAGE, size - PREFIX.size, channel):
        return 0
    for shift, dtype in ((0, "<u8"), (8, "u1"), (9, "<u2")):
        heads = np.ndarray((count,), dtype, data, shift, (size,))
        if (heads != heads[0]).any():
            return 0
    return size
