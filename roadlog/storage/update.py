"""Results into a log that is there: whatever is not replaced stays byte for byte.

Chunks that hold nothing of what is replaced are copied as they are, without being read. Only
their places change, and the summary that tells them.
"""

from __future__ import annotations

import logging
from bisect import bisect_right
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from roadlog.errors import LogWriteError
from roadlog.files import changed, check_unprotected, replacing, temporary, written
from roadlog.storage import container, crc, journal, records
from roadlog.storage.container import RAW, ByteSource, Record, outer_records, walk, word
from roadlog.storage.contents import Contents
from roadlog.storage.journal import Before, changing
from roadlog.storage.reader import LogReader
from roadlog.storage.records import LOG_TIME, PREFIX, Chunk, Damage, Fields
from roadlog.storage.table import Table
from roadlog.storage.writer import Writer

_said = logging.getLogger("roadlog")


def update_log(
    path: Path,
    tables: Iterable[Table],
    metadata: Mapping[str, Mapping[str, str]],
    *,
    drop: Callable[[str], bool],
    drop_metadata: Callable[[str], bool],
    out: Path | None = None,
    in_place: bool = False,
    encoding: str = "protobuf",
    check: Callable[[LogReader], None] = lambda _: None,
) -> None:
    """Replace what `drop` names by `tables` in an existing log; the rest stays byte for byte.

    drop: of topics. drop_metadata: of record names. out: write here and leave `path` as it is.
    The file is replaced at once or not at all. in_place: change the file itself from the first
    byte that differs, with an undo journal beside it, which needs no room for a second file.
    encoding: of new messages ("cdr" for a bag of ROS 2). check: raises where the log is another
    than was meant.
    Raises LogReadError; LogWriteError, also where another program wrote to the log meanwhile: what
    it wrote stays.
    """
    given, path = path, Path(path).resolve()
    with LogReader(path) as old:
        check(old)
        plan = _Plan.of(old, drop, drop_metadata)
        start_crc = plan.start_crc(old.source)

        def put(file: IO[bytes], source: ByteSource | Before, offset: int = 0) -> None:
            writer = Writer(file, offset=offset, crc=start_crc, encoding=encoding)
            _write(writer, plan, source, tables, metadata)

        if out is not None:
            with replacing(Path(out)) as file:
                put(file, old.source)
                if not old.source.is_as_opened():
                    raise changed(given)
            journal.forget(Path(out))
            return
        if old.contents.behind:
            raise LogWriteError(
                f"{given}: {old.contents.behind} bytes lie behind its end and would be lost; write "
                f"elsewhere (-o)"
            )
        _check_writable(given, path, in_place)
        if in_place:
            with changing(path, old.source, plan.first_change) as (before, file):
                put(file, before, plan.first_change)
                file.truncate()
            written.append(given)
            return
        try:
            with temporary(path.parent, 0o600) as part:
                put(part.file, old.source)
                part.sync()
                part.become(path, old.source.state)
            written.append(given)
        except OSError as error:
            raise LogWriteError(f"{given}: cannot be written: {error.strerror}") from error


def _check_writable(given: Path, path: Path, in_place: bool) -> None:
    """Raise LogWriteError for a protected log; say which file is changed where it is not clear."""
    try:
        status = path.stat()
    except OSError as error:  # gone meanwhile
        raise LogWriteError(f"{given}: cannot be written: {error.strerror}") from error
    check_unprotected(given, status)
    if given.is_symlink():
        _said.warning("%s: is a link; the results go into %s", given, path)
    if status.st_nlink > 1 and not in_place:
        _said.warning(
            "%s: has %d names (hard links); only this one gets the results, --in-place gives them "
            "to all",
            given,
            status.st_nlink,
        )


def _write(
    writer: Writer,
    plan: _Plan,
    source: ByteSource | Before,
    tables: Iterable[Table],
    metadata: Mapping[str, Mapping[str, str]],
) -> None:
    plan.execute(writer, source)
    for table in tables:  # one at a time: they may be made only now
        writer.put_tables([table])
    for name, values in metadata.items():
        writer.put_metadata(name, values)
    writer.finish(with_summary=not plan.has_damage)


class _Range(NamedTuple):
    """Bytes of a file that are kept as they are."""

    start: int
    end: int


@dataclass
class _Plan:
    """What becomes of the data section of a log.

    steps: in file order, ranges that are kept and chunks that are kept in part. dropped, unused:
    ids of channels, and of schemas that only these have; inner, inner_unused: of these, the ones
    that are declared inside chunks only. metadata: offset, length and name of
    each kept record. attachments: offset and length. has_damage: a chunk cannot be read; it is
    kept. data_end: where the DataEnd record lies, None when the file is cut off; data_crc: what
    it says.
    """

    contents: Contents
    dropped: set[int]
    unused: set[int]
    inner: set[int]
    inner_unused: set[int]
    steps: list[_Range | Chunk] = field(default_factory=list)
    metadata: list[tuple[int, int, str]] = field(default_factory=list)
    attachments: list[tuple[int, int]] = field(default_factory=list)
    has_damage: bool = False
    data_end: int | None = None
    data_crc: int = 0

    @classmethod
    def of(
        cls, old: LogReader, drop: Callable[[str], bool], drop_metadata: Callable[[str], bool]
    ) -> _Plan:
        """Go through the records outside chunks."""
        channels = old.contents.channels.values()
        dropped = {c.id for c in channels if drop(c.topic)}
        used = {c.schema_id for c in channels if c.id not in dropped}
        unused = {c.schema_id for c in channels} - used
        plan = cls(old.contents, dropped, unused, set(dropped), set(unused))
        plan._keep(0, len(records.MAGIC))
        chunks = {chunk.offset: chunk for chunk in old.contents.chunks}
        is_partial = False
        try:
            for at in outer_records(old.source):
                if at.opcode == records.DATA_END:
                    plan.data_end = at.offset
                    plan.data_crc = Fields(at.content(old.source)).take("I")
                    break
                if at.opcode == records.CHUNK:
                    chunk = chunks.get(at.offset)
                    plan.has_damage |= chunk is None
                    is_partial = chunk is not None and not dropped.isdisjoint(chunk.indexes)
                    if chunk is not None and is_partial:
                        plan.steps.append(chunk)
                        continue
                if at.opcode == records.MESSAGE_INDEX and is_partial:
                    continue  # a new one is written
                if plan._is_kept(at, old.source, drop_metadata):
                    plan._keep(at.offset, at.end)
        except Damage:
            pass  # what is behind was lost before, and the reader said so
        return plan

    def _is_kept(
        self, at: Record, source: ByteSource, drop_metadata: Callable[[str], bool]
    ) -> bool:
        if at.opcode == records.MESSAGE:
            return Fields(source.read(at.offset + PREFIX.size, 2)).take("H") not in self.dropped
        if at.opcode == records.CHANNEL:
            id_ = Fields(at.content(source)).take("H")
            self.inner.discard(id_)
            return id_ not in self.dropped
        if at.opcode == records.SCHEMA:
            id_ = Fields(at.content(source)).take("H")
            self.inner_unused.discard(id_)
            return id_ not in self.unused
        if at.opcode == records.METADATA:
            name = Fields(at.content(source)).text()
            if drop_metadata(name):
                return False
            self.metadata.append((at.offset, at.end - at.offset, name))
        elif at.opcode == records.ATTACHMENT:
            self.attachments.append((at.offset, at.end - at.offset))
        return True

    def _keep(self, start: int, end: int) -> None:
        last = self.steps[-1] if self.steps else None
        if isinstance(last, _Range) and last.end == start:
            self.steps[-1] = _Range(last.start, end)
        else:
            self.steps.append(_Range(start, end))

    def execute(self, writer: Writer, source: ByteSource | Before) -> None:
        """Write what is kept and is not there yet, and tell the writer what there is."""
        found = self.contents
        writer.schemas = {k: s for k, s in found.schemas.items() if k not in self.unused}
        writer.channels = {k: c for k, c in found.channels.items() if k not in self.dropped}
        writer.taken, writer.taken_schemas = self.inner, self.inner_unused
        writer.counts = {k: n for k, n in found.counts.items() if k not in self.dropped}
        moved: list[tuple[int, int]] = []  # where kept ranges began and begin
        for step in self.steps:
            if isinstance(step, Chunk):
                self._rewrite(step, writer, source)
                continue
            is_there = step == _Range(0, writer.offset)
            moved.append((step.start, 0 if is_there else writer.offset))
            if not is_there:
                writer.copy(source, *step)
        starts = [start for start, _ in moved]

        def place(offset: int) -> int:
            start, now = moved[bisect_right(starts, offset) - 1]
            return offset - start + now

        for chunk in found.chunks:
            if not self.dropped.isdisjoint(chunk.indexes):
                continue
            if chunk.indexes:
                writer.cover(chunk.start_ns, chunk.end_ns)
            if chunk.compression != RAW:
                listed = chunk.indexes.items() if chunk.indexes_length else ()
                indexes = {id_: place(offset) for id_, offset in listed}
                writer.chunks.append(chunk._replace(offset=place(chunk.offset), indexes=indexes))
        for offset, length, name in self.metadata:
            data = source.read(offset, length)
            writer.metadata.append(records.metadata_index(place(offset), data, name))
        for offset, length in self.attachments:
            attachment = source.read(offset, length)
            writer.attachments.append(records.attachment_index(place(offset), attachment))

    def start_crc(self, source: ByteSource) -> int | None:
        """CRC of the first kept range; None where the file has none."""
        end = self.first_change
        if self.data_end is None or end < self.data_end - end:
            return None if self.data_end and not self.data_crc else container.crc_of(source, 0, end)
        if not self.data_crc:
            return None
        rest = container.crc_of(source, end, self.data_end)
        return crc.before(self.data_crc, rest, self.data_end - end)

    @property
    def first_change(self) -> int:
        """Where the first kept range ends."""
        first = self.steps[0]
        assert isinstance(first, _Range)
        return first.end

    def _rewrite(self, chunk: Chunk, writer: Writer, source: ByteSource | Before) -> None:
        """What is left of a chunk without the dropped channels; a few bytes of others may be."""
        data = container.load(source, chunk)
        inside = walk(data)
        kept = ~np.isin(inside.channels, list(self.dropped))
        others = [data[at.offset : at.end] for at in inside.others if self._stays(at, data)]
        if not kept.any():
            for other in others:
                writer.put(other)
            return
        sizes = word(data, inside.offsets, 1, "<i8") + PREFIX.size
        parts = others + [
            data[offset : offset + size]
            for offset, size in zip(
                inside.offsets[kept].tolist(), sizes[kept].tolist(), strict=True
            )
        ]
        starts = np.cumsum([0, *map(len, parts)])[len(others) : -1]
        channels, times = inside.channels[kept], word(data, inside.offsets[kept], LOG_TIME, "<u8")
        index = {
            int(id_): (times[channels == id_], starts[channels == id_])
            for id_ in np.unique(channels)
        }
        compression = "" if chunk.compression == RAW else chunk.compression
        writer.put_chunk(b"".join(parts), index, compression)

    def _stays(self, at: Record, data: bytes) -> bool:
        if at.opcode != records.CHANNEL:
            return True
        return Fields(data[at.offset + PREFIX.size : at.end]).take("H") not in self.dropped
