"""The MCAP container: records, chunks and the messages in them, checked.

Every length is checked against the bytes that exist before anything is allocated, every CRC that
is there is checked.
"""

from __future__ import annotations

import os
import stat
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple, Protocol

import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from roadlog import files
from roadlog.errors import LogReadError
from roadlog.files import FileState
from roadlog.storage import records
from roadlog.storage.records import (
    MAGIC,
    MESSAGE_FIELDS,
    MESSAGE_HEAD,
    PREFIX,
    Chunk,
    Damage,
    Fields,
    crc32,
)

Offsets = NDArray[np.int64]
Bytes = NDArray[np.uint8]

MAX_CHUNK = 1 << 29  # bytes; a larger chunk is refused (writers make them of about 1 MiB)
MAX_LZ4_RATIO = 256  # one byte of LZ4 stands for at most 255 (LZ4 block format)
SCAN_WINDOW = 1 << 16  # bytes read at once to find where records begin
CHUNK_HEAD = struct.Struct("<BQQQQII")  # prefix, times, size, CRC, length of a name
RAW = "raw"  # compression of messages outside any chunk, which are handled as if in one
RUN_SIZE = 1 << 20  # bytes; messages outside chunks are handled in pieces of about this size
TOGETHER = 128  # records compared at once
COPY_SIZE = 1 << 26  # bytes handed to the kernel, or read and written, at once
_local = threading.local()


class ByteReader(Protocol):
    """Something whose bytes can be read."""

    def read(self, offset: int, length: int) -> bytes: ...


class ByteSource:
    """Random access to a plain file's bytes. Reading beyond its end raises Damage.

    state: which file it was, and its size and time, when it was opened.
    """

    def __init__(self, path: Path) -> None:
        try:  # without waiting: a pipe has nobody at its other end
            handle = os.open(path, files.READ)
        except OSError as error:
            raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            os.close(handle)
            if stat.S_ISDIR(status.st_mode):
                raise LogReadError(f"{path}: is a folder")
            raise LogReadError(f"{path}: cannot be read: it is no plain file")
        self._file = os.fdopen(handle, "rb")
        self._path, self.state, self.size = path, FileState.of(status), status.st_size
        self._lock = threading.Lock()

    @property
    def handle(self) -> int:
        """The open file."""
        return self._file.fileno()

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
                # the disk begins to write these now, so that less is left for fsync
                os.posix_fadvise(file.fileno(), at, copied, os.POSIX_FADV_DONTNEED)
        except (OSError, AttributeError):
            pass
        file.seek(target + position - start)
        for rest in range(position, end, COPY_SIZE):
            file.write(self.read(rest, min(COPY_SIZE, end - rest)))

    def is_as_opened(self) -> bool:
        """Whether nobody wrote to the file since, whatever its name is by now."""
        return FileState.of(os.fstat(self.handle)) == self.state

    def is_there(self) -> bool:
        """Whether the path still names this file."""
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self.handle))
        except OSError:
            return False

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

    def content(self, source: ByteSource) -> bytes:
        return source.read(self.offset + PREFIX.size, self.length)


def outer_records(source: ByteSource, position: int = len(MAGIC)) -> Iterator[Record]:
    """Records of a file outside chunks, without their content. Raises Damage where one is cut."""
    base, window, size = 0, b"", SCAN_WINDOW
    while position < source.size:
        if position + PREFIX.size > base + len(window):
            base = position
            window = source.read(base, min(size, source.size - base))
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
        size = PREFIX.size if length > SCAN_WINDOW else SCAN_WINDOW  # chunks follow one another
    raise Damage("the end of the file is missing")


def inner_records(data: bytes, position: int, end: int) -> Iterator[Record]:
    """Records in memory. Raises Damage where one is cut short."""
    while position < end:
        if position + PREFIX.size > end:
            raise Damage(f"{end - position} bytes are no record")
        opcode, length = PREFIX.unpack_from(data, position)
        after = position + PREFIX.size + length
        if after > end:
            raise Damage(f"a record of {length} bytes where {end - position} are left")
        yield Record(opcode, position, length)
        position = after


def crc_of(source: ByteSource, start: int, end: int, crc: int = 0) -> int:
    """CRC-32 of a range of the file, continued from `crc`."""
    for position in range(start, end, RUN_SIZE):
        crc = crc32(source.read(position, min(RUN_SIZE, end - position)), crc)
    return crc


def lost_chunk(chunk: Chunk, damage: Damage) -> str:
    """Sentence on a chunk that cannot be read."""
    span = ""
    if chunk.compression != RAW:
        start, end = (
            np.datetime64(min(ns, 2**63 - 1), "ns") for ns in (chunk.start_ns, chunk.end_ns)
        )
        span = f" ({start} to {end} UTC)"
    return f"the chunk at byte {chunk.offset}{span} is damaged and was skipped: {damage}"


def load(source: ByteReader, chunk: Chunk) -> bytes:
    """The records of a chunk, uncompressed and checked. Raises Damage."""
    if chunk.compression == RAW:
        return source.read(chunk.offset, chunk.length)
    whole = source.read(chunk.offset, chunk.length)
    try:
        opcode, length, _, _, size, crc, named = CHUNK_HEAD.unpack_from(whole)
        behind = CHUNK_HEAD.size + named
        compression = whole[CHUNK_HEAD.size : behind].decode()
        (compressed,) = struct.unpack_from("<Q", whole, behind)
    except (struct.error, UnicodeDecodeError) as error:
        raise Damage("there is no chunk") from error
    if opcode != records.CHUNK or PREFIX.size + length != chunk.length:
        raise Damage("there is no chunk")
    if (size, compression) != (chunk.size, chunk.compression):
        raise Damage("it is not what its index says")
    start = behind + 8
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


class ChunkRecords(NamedTuple):
    """Messages of a chunk in file order, and its other records."""

    offsets: Offsets
    channels: NDArray[np.uint16]
    others: list[Record]


def walk(data: bytes) -> ChunkRecords:
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
    return ChunkRecords(found, word(data, found, PREFIX.size, "<u2"), others)


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


def messages(source: ByteSource, chunk: Chunk, data: bytes) -> dict[int, Offsets]:
    """Channel id -> offsets of its messages in a chunk, in file order. Raises Damage.

    By the message indexes where they fit the records, which the chunk's CRC protects and the
    indexes' none, else by going through the records.
    """
    places = listed(source, chunk, data) if chunk.indexes_length else None
    if places is not None:
        return places
    inside = walk(data)
    return {int(id_): inside.offsets[inside.channels == id_] for id_ in np.unique(inside.channels)}


def listed(source: ByteSource, chunk: Chunk, data: bytes) -> dict[int, Offsets] | None:
    """Offsets by the message indexes; None where these are not what they should be."""
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


def varying(matrix: Bytes) -> int:
    """The bits of equally long records that are not the same in all; the first byte is lowest."""
    count, size = matrix.shape
    result = 0
    step = max(1, RUN_SIZE // size)
    for start in range(0, count - 1, step):
        part = matrix[start : start + step + 1]
        changes = part[1:] ^ part[:-1]
        whole = len(changes) // TOGETHER * TOGETHER
        if whole:  # few and long rows are what NumPy is fast at
            once = np.bitwise_or.reduce(changes[:whole].reshape(-1, TOGETHER * size), axis=0)
            changes = np.concatenate([once.reshape(-1, size), changes[whole:]])
        result |= int.from_bytes(np.bitwise_or.reduce(changes, axis=0).tobytes(), "little")
    return result


def equal_records(data: bytes, chunk: Chunk, channel: int) -> tuple[Bytes, int] | None:
    """A chunk that is nothing but equally long messages of one channel, as a matrix.

    With it the bits that vary. None where it is not so, and where the message index says nothing
    of their number.
    """
    count = chunk.indexed if chunk.indexes_length else 0
    size, rest = divmod(len(data), count) if count else (0, 1)
    if rest or size < MESSAGE_HEAD:
        return None
    head = struct.pack("<BQH", records.MESSAGE, size - PREFIX.size, channel)
    if not data.startswith(head):
        return None
    matrix = np.frombuffer(data, np.uint8).reshape(-1, size)
    bits = varying(matrix)
    return None if bits & (1 << 8 * len(head)) - 1 else (matrix, bits)
