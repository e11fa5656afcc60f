"""What an MCAP file holds, before any message is read: `contents`.

It is taken from the file's summary where that provably lists every message, and from a scan of
all records otherwise.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from roadlog.storage import records
from roadlog.storage.container import (
    RAW,
    RUN_SIZE,
    SCAN_WINDOW,
    ByteSource,
    Record,
    crc_of,
    inner_records,
    listed,
    load,
    lost_chunk,
    outer_records,
    walk,
    word,
)
from roadlog.storage.records import (
    MAGIC,
    PREFIX,
    ChannelRecord,
    Chunk,
    Damage,
    Fields,
    Schema,
    Statistics,
    crc32,
)

FOOTER_SIZE = PREFIX.size + 20 + len(MAGIC)  # the Footer record and the magic behind it
DATA_END_SIZE = PREFIX.size + 4
FREE = 1 << 27  # bytes that any file may inflate to
MOST_INFLATED = 200  # times the file; sensors that are still compress to a hundredth at most
MOST_CHANNELS = 5000  # the largest logs of vehicles have some thousand
CHECKED_WHOLE = 1 << 22  # bytes; a file with metadata that has no CRC of its own, up to this size


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

    def read(self, source: ByteSource) -> tuple[str, dict[str, str]]:
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

    counts: messages per channel id. losses: sentences on what is damaged or missing. behind: bytes
    that follow the end of the log.
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
    behind: int = 0


def contents(source: ByteSource) -> Contents:
    """What a file holds, by its summary or else by a scan. Raises Damage for more than is bounded.

    What a log makes us inflate and list is bounded by what lies in the file.
    """
    found = _contents(source)
    found.chunks = _sound(found.chunks, found.losses)
    _check_bounds(source, found.chunks)
    if len(found.channels) > MOST_CHANNELS:
        raise Damage(f"it declares {len(found.channels)} channels, more than {MOST_CHANNELS}")
    return found


def _sound(chunks: Sequence[Chunk], losses: list[str]) -> list[Chunk]:
    """Chunks that declare no more than their length can hold; what is left out goes into `losses`.

    One wrong size is no reason to lose a drive. Raises Damage where no other chunk is left.
    """
    sound, said = [], []
    for chunk in chunks:
        if chunk.size <= max(FREE // 2, MOST_INFLATED * chunk.length):
            sound.append(chunk)
            continue
        said.append(
            f"the chunk at byte {chunk.offset} is damaged and was skipped: it would inflate from "
            f"{chunk.length} to {chunk.size} bytes"
        )
    if said and not sound:
        raise Damage(said[0])
    losses += said
    return sound


def _check_bounds(source: ByteSource, chunks: Sequence[Chunk]) -> None:
    inflated = sum(chunk.size for chunk in chunks)
    if inflated > max(FREE, MOST_INFLATED * source.size):
        raise Damage(
            f"its {len(chunks)} chunks would inflate to {inflated / 1e6:.0f} MB, more than "
            f"{MOST_INFLATED} times the file"
        )


def _contents(source: ByteSource) -> Contents:
    problem = ""
    try:
        found = _from_summary(source)
        if found is not None:
            return found
    except Damage as damage:
        problem = str(damage)
    found = scan(source)
    if found.behind:
        found.losses.append(f"{found.behind} bytes lie behind its end and were not read")
    elif problem and not found.losses:
        found.losses.append(f"its summary is damaged ({problem}); all messages were found anyway")
    return found


def _from_summary(source: ByteSource) -> Contents | None:
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
        if not is_data_end or (crc and crc != crc_of(source, 0, start - DATA_END_SIZE)):
            return None  # the scan says what is wrong
    is_possible = statistics.messages * records.INDEX_ENTRY <= source.size
    return result if is_possible and _is_complete(result, statistics) else None


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


def scan(source: ByteSource) -> Contents:
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
            elif found.opcode == records.FOOTER:
                result.behind = max(0, source.size - found.end - len(MAGIC))
    except Damage as damage:
        if data_end is None:
            result.losses.append(f"it is damaged: {damage}; only what lies before was read")
        else:
            result.losses.append(
                f"its summary is damaged ({damage}); all messages were found anyway"
            )
    else:
        if data_end is None:
            result.losses.append("it is damaged: no record ends its data")
    chunks = _sound(chunks, result.losses)
    _check_bounds(source, chunks)
    for chunk in chunks:
        _take_stock(source, chunk, result)
    _check_declared(result)
    if data_end is not None and not result.losses:
        crc = Fields(data_end.content(source)).take("I")
        if crc and crc != crc_of(source, 0, data_end.offset):
            result.losses.append("its data has a wrong CRC: some bytes were changed")
    return result


def _run(run: Record) -> Chunk:
    size = PREFIX.size + run.length
    return Chunk(0, 0, run.offset, size, {}, 0, RAW, size, size)


def _chunk_at(source: ByteSource, found: Record) -> Chunk:
    """The chunk of a Chunk record, without its indexes."""
    head = Fields(source.read(found.offset + PREFIX.size, min(found.length, SCAN_WINDOW)))
    start, end, size, _ = (head.take(code) for code in "QQQI")
    compression, compressed = head.text(), head.take("Q")
    return Chunk(
        start, end, found.offset, PREFIX.size + found.length, {}, 0, compression, compressed, size
    )


def _add_index(source: ByteSource, chunks: list[Chunk], found: Record) -> None:
    """Note a MessageIndex behind the last chunk."""
    channel = Fields(source.read(found.offset + PREFIX.size, min(found.length, 2))).take("H")
    last = chunks[-1]
    chunks[-1] = last._replace(
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


def _take_stock(source: ByteSource, chunk: Chunk, result: Contents) -> None:
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
        result.chunks.append(chunk._replace(indexes={}, indexes_length=0))
        return
    times = word(data, inside.offsets, 15, "<u8")
    start, end = int(times.min()), int(times.max())
    result.start_ns = start if result.start_ns is None else min(result.start_ns, start)
    result.end_ns = end if result.end_ns is None else max(result.end_ns, end)
    ids, numbers = np.unique(inside.channels, return_counts=True)
    for id_, number in zip(ids.tolist(), numbers.tolist(), strict=True):
        result.counts[id_] = result.counts.get(id_, 0) + number
    places = listed(source, chunk, data) if chunk.indexes_length else None
    if places is None or sum(map(len, places.values())) != len(inside.offsets):
        # the walk found each message: its channels stand in for the missing or damaged indexes
        chunk = chunk._replace(indexes=dict.fromkeys(ids.tolist(), 0), indexes_length=0)
    result.chunks.append(chunk._replace(start_ns=start, end_ns=end))


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
