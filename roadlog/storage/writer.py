"""Tables to MCAP: one channel a chunk, all message records of a channel from one array.

A chunk holds one channel's messages of one minute: who wants one channel reads nothing else, and
a result is removed by leaving its chunks out. Layout and reasons: docs/format.md.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import IO

import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from roadlog import field_units
from roadlog.errors import ConfigError, near
from roadlog.files import replacing
from roadlog.storage import journal, records, ros2_messages, schemas
from roadlog.storage.container import COPY_SIZE, ByteSource, Offsets
from roadlog.storage.journal import Before
from roadlog.storage.messages import Wire
from roadlog.storage.records import (
    MAGIC,
    PREFIX,
    ChannelRecord,
    Chunk,
    Schema,
    Statistics,
    crc32,
)
from roadlog.storage.table import Table

WINDOW = 60 * 10**9  # ns of one channel in a chunk, aligned to the epoch
MAX_CHUNK = 1 << 20  # bytes before compression: what players load at once (Foxglove's advice)
AHEAD = 4  # chunks that are compressed while the one before is written
ZSTD_LEVEL = 1  # faster and, on quantized sensor values, smaller than the default 3

Times = NDArray[np.uint64]


@dataclass
class Writer:
    """Appends records to a file and keeps what its summary says.

    offset: where the next byte goes. crc: of all bytes before it, None for unknown. taken,
    taken_schemas: ids that no new channel or schema gets. start_ns, end_ns: first and last log
    time. encoding: of new messages, "protobuf", or "cdr" as ROS 2 has them.
    """

    file: IO[bytes]
    compression: str = "zstd"
    offset: int = 0
    crc: int | None = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, ChannelRecord] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    counts: dict[int, int] = field(default_factory=dict)
    metadata: list[bytes] = field(default_factory=list)  # MetadataIndex records
    attachments: list[bytes] = field(default_factory=list)  # AttachmentIndex records
    taken: set[int] = field(default_factory=set)
    taken_schemas: set[int] = field(default_factory=set)
    start_ns: int | None = None
    end_ns: int | None = None
    encoding: str = "protobuf"
    _compressors: dict[str, Callable[[bytes | memoryview], bytes]] = field(default_factory=dict)

    def put(self, data: bytes | memoryview) -> None:
        self.file.write(data)
        self.offset += len(data)
        if self.crc is not None:
            self.crc = crc32(data, self.crc)

    def start(self) -> None:
        """Magic and Header; no profile, since ours is none of the known ones."""
        self.put(MAGIC + records.record(records.HEADER, records.text(""), records.text("roadlog")))

    def declare(self, table: Table) -> int:
        """Write the schema, unless one of the same content is there, and the channel of a table."""
        if self.encoding == "cdr":
            name, kind = ros2_messages.type_name(table.schema), "ros2msg"
            data = ros2_messages.definition(table).encode()
        else:
            name, kind, data = table.schema, "protobuf", schemas.descriptor_set(table.schema)
        schema = next((s for s in self.schemas.values() if (s.name, s.data) == (name, data)), None)
        if schema is None:
            schema = Schema(_free({*self.schemas, *self.taken_schemas}), name, kind, data)
            self.schemas[schema.id] = schema
            self.put(schema.pack())
        metadata = {f"unit.{n}": u for n, u in field_units.units(table.schema).items()}
        metadata |= table.metadata
        channel = ChannelRecord(
            _free({*self.channels, *self.taken}), schema.id, table.topic, self.encoding, metadata
        )
        self.channels[channel.id] = channel
        self.put(channel.pack())
        return channel.id

    def put_tables(self, tables: Iterable[Table]) -> None:
        """Write the tables, minute by minute, one after another in each minute."""
        parts: list[tuple[int, int, Wire, slice]] = []
        for table in tables:
            id_ = self.declare(table)
            parts += [(window, id_, wire, rows) for window, wire, rows in self._windows(table, id_)]
        parts.sort(key=lambda part: part[0])  # stable: tables stay in order
        compress = self._compress(self.compression)
        waiting: deque[tuple[bytes, dict[int, tuple[Times, Offsets]], Future[bytes]]] = deque()

        def put_first() -> None:
            data, index, compressed = waiting.popleft()
            self._put_compressed(data, index, self.compression, compressed.result())

        with ThreadPoolExecutor(1) as beside:  # zstd holds no lock of Python's
            for _, id_, wire, rows in parts:
                times = wire.time[rows].astype("<u8")
                data = wire.rows(rows).tobytes()  # the wire makes the next rows in its place
                index = {id_: (times, np.arange(0, len(data), wire.size))}
                waiting.append((data, index, beside.submit(compress, data)))
                if len(waiting) > AHEAD:
                    put_first()
            while waiting:
                put_first()

    def _windows(self, table: Table, id_: int) -> Iterator[tuple[int, Wire, slice]]:
        """Rows of a table, cut where a minute ends or a chunk is full."""
        is_ros2 = self.encoding == "cdr"
        wire = ros2_messages.Ros2Wire(table, id_) if is_ros2 else Wire(table, id_)
        window = table.time // WINDOW
        edges = np.flatnonzero(window[1:] != window[:-1]) + 1
        most = max(1, MAX_CHUNK // wire.size)
        starts = [0, *edges.tolist(), len(table)]
        for first, last in pairwise(starts):
            for start in range(first, last, most):
                yield int(window[first]), wire, slice(start, min(start + most, last))

    def put_chunk(
        self, data: bytes | memoryview, index: Mapping[int, tuple[Times, Offsets]], compression: str
    ) -> None:
        """One chunk of records, with a MessageIndex for each channel: its times and offsets."""
        self._put_compressed(data, index, compression, self._compress(compression)(data))

    def _put_compressed(
        self,
        data: bytes | memoryview,
        index: Mapping[int, tuple[Times, Offsets]],
        compression: str,
        compressed: bytes,
    ) -> None:
        entries = {id_: _in_order(*found) for id_, found in index.items()}
        start = min(int(found[0, 0]) for found in entries.values())
        end = max(int(found[-1, 0]) for found in entries.values())
        self.cover(start, end)
        offset = self.offset
        head = struct.pack("<QQQI", start, end, len(data), crc32(data)) + records.text(compression)
        size = len(head) + 8 + len(compressed)
        self.put(PREFIX.pack(records.CHUNK, size) + head + struct.pack("<Q", len(compressed)))
        self.put(compressed)
        behind = self.offset
        places = {}
        for id_, found in entries.items():
            places[id_] = self.offset
            size = found.nbytes
            self.put(struct.pack("<BQHI", records.MESSAGE_INDEX, size + 6, id_, size))
            self.put(found.data.cast("B"))
            self.counts[id_] = self.counts.get(id_, 0) + len(found)
        self.chunks.append(
            Chunk(
                start, end, offset, behind - offset, places, self.offset - behind, compression,
                len(compressed), len(data),
            )
        )  # fmt: skip

    def _compress(self, name: str) -> Callable[[bytes | memoryview], bytes]:
        if name not in self._compressors:
            self._compressors[name] = compressor(name)
        return self._compressors[name]

    def copy(self, source: ByteSource | Before, start: int, end: int) -> None:
        """A range of another file as it is."""
        if self.crc is not None and start:  # the CRC of the first range is known
            for position in range(start, end, COPY_SIZE):
                part = source.read(position, min(COPY_SIZE, end - position))
                self.crc = crc32(part, self.crc)
        source.copy_to(self.file, start, end)
        self.offset += end - start

    def cover(self, start: int, end: int) -> None:
        """Note the times of messages that the file holds."""
        self.start_ns = start if self.start_ns is None else min(self.start_ns, start)
        self.end_ns = end if self.end_ns is None else max(self.end_ns, end)

    def put_metadata(self, name: str, values: Mapping[str, str]) -> None:
        data = records.metadata_record(name, values)
        self.metadata.append(records.metadata_index(self.offset, data, name))
        self.put(data)

    def finish(self, *, with_summary: bool = True) -> None:
        """DataEnd, summary, Footer.

        No summary where it would not list every message (outside chunks, in chunks without
        index): who trusts it would miss some without a word.
        """
        self.put(records.record(records.DATA_END, struct.pack("<I", self.crc or 0)))
        indexed = sum(chunk.indexed for chunk in self.chunks)
        if not with_summary or indexed != sum(self.counts.values()):
            self.put(records.record(records.FOOTER, bytes(20)) + MAGIC)
            return
        statistics = Statistics(
            sum(self.counts.values()), len(self.schemas), len(self.channels),
            len(self.attachments), len(self.metadata), len(self.chunks),
            self.start_ns or 0, self.end_ns or 0, self.counts,
        )  # fmt: skip
        groups = [
            [schema.pack() for schema in self.schemas.values()],
            [channel.pack() for channel in self.channels.values()],
            [statistics.pack()],
            [chunk.pack() for chunk in self.chunks],
            self.attachments,
            self.metadata,
        ]
        start = self.offset
        summary, offsets = b"", b""
        for group in filter(None, groups):
            data = b"".join(group)
            place = struct.pack("<BQQ", data[0], start + len(summary), len(data))
            offsets += records.record(records.SUMMARY_OFFSET, place)
            summary += data
        footer = PREFIX.pack(records.FOOTER, 20)
        footer += struct.pack("<QQ", start, start + len(summary))
        summary += offsets + footer
        self.put(summary + struct.pack("<I", crc32(summary)) + MAGIC)


def _in_order(times: Times, offsets: Offsets) -> NDArray[np.uint64]:
    """Times and offsets of messages as the rows of a MessageIndex."""
    result = np.empty((len(times), 2), "<u8")
    result[:, 0], result[:, 1] = times, offsets
    if (times[1:] < times[:-1]).any():
        result = result[np.argsort(times, kind="stable")]
    return result


def _free(used: set[int]) -> int:
    """The next id; ids are 16 bits and not 0."""
    highest = max(used, default=0)
    return highest + 1 if highest < 0xFFFF else min(set(range(1, 0x10000)) - used)


def compressor(name: str) -> Callable[[bytes | memoryview], bytes]:
    """Function that compresses a chunk. Raises ConfigError for an unknown name."""
    if name == "zstd":
        return zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress
    if name == "lz4":
        return lz4.frame.compress
    if name == "":
        return bytes
    raise ConfigError(f"no compression '{name}'. {near(name, ['zstd', 'lz4', 'none'])}")


def write_log(
    path: Path,
    tables: Iterable[Table],
    metadata: Mapping[str, Mapping[str, str]],
    *,
    compression: str = "zstd",
) -> None:
    """Write a new log, whole or not at all. Raises LogWriteError, ConfigError.

    compression: zstd, lz4 or none.
    """
    name = "" if compression == "none" else compression
    compressor(name)
    with replacing(Path(path)) as file:
        writer = Writer(file, name)
        writer.start()
        writer.put_tables(tables)
        for key, record in metadata.items():
            writer.put_metadata(key, record)
        writer.finish()
    journal.forget(Path(path))
