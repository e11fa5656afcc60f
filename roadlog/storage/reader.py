"""A log's channels as columns, whatever wrote it: `LogReader`."""

from __future__ import annotations

import glob
import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from itertools import accumulate, chain, groupby
from pathlib import Path
from typing import TypeVar

from roadlog.errors import LogReadError, MissingSignalError, near
from roadlog.storage import container, journal
from roadlog.storage.columns import Columns
from roadlog.storage.container import CHUNK_HEAD, RAW
from roadlog.storage.contents import contents
from roadlog.storage.encodings import Codec, codec_of
from roadlog.storage.records import (
    MAGIC,
    MESSAGE_HEAD,
    PREFIX,
    ChannelRecord,
    Chunk,
    Damage,
    Schema,
)
from roadlog.storage.table import Channel, Table
from roadlog.storage.topics import ChannelTable, one_table

AHEAD = 2  # batches of chunks that are inflated while another is taken apart
BATCH = 1 << 22  # bytes; to hand over every chunk on its own takes a tenth of the time
WORTH_A_THREAD = 1 << 26  # bytes of chunks; below, it all takes a tenth of a second

SAMPLED = 16  # chunks whose first bytes, with the CRC of their content, tell a log from others
SAMPLE = 1 << 16  # bytes of messages outside chunks

NO_SCHEMA = Schema(0, "", "", b"")

T = TypeVar("T")
R = TypeVar("R")


class LogReader:
    """An MCAP file as columns.

    channels: what the file declares. metadata: records by name, the last one wins. start_ns,
    end_ns: first and last log time, None without messages. losses: sentences on what could not be
    read. strict: raise instead of noting a loss. recover: put the file back first where a change
    of it was interrupted; else it is only read as it was before. Raises LogReadError.
    """

    has_publish = True  # a time of publishing beside that of recording

    def __init__(self, path: Path, *, strict: bool = False, recover: bool = True) -> None:
        self.path = Path(path)
        self.strict = strict
        self.losses: list[str] = []
        _check(self.path)
        self.source = journal.recover(self.path.resolve(), only_look=not recover)
        try:
            head = self.source.read(0, min(len(MAGIC), self.source.size))
            if head != MAGIC:
                raise LogReadError(f"{path}: {_no_mcap(self.path, head)}")
            try:
                self.contents = contents(self.source)
            except Damage as damage:
                raise LogReadError(f"{path}: cannot be read: {damage}") from damage
            if self.contents.losses and not self.contents.channels:
                raise LogReadError(f"{path}: {self.contents.losses[0]}, and that is nothing")
            for loss in self.contents.losses:
                self._lose(loss)
            self.metadata = self._read_metadata()
        except BaseException:
            self.source.close()
            raise
        self.start_ns = self.contents.start_ns
        self.end_ns = self.contents.end_ns
        self.channels = tuple(self._described(c) for c in self.contents.channels.values())

    def __enter__(self) -> LogReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.source.close()

    def read(
        self,
        topics: Iterable[str] | None = None,
        *,
        fields: Mapping[str, Sequence[str]] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        clock: str = "log",
        ordered: bool = True,
    ) -> dict[str, Table]:
        """Columns of the channels on the given topics (default: all), in time order.

        fields: topic -> wanted field paths (default: all). start_ns, end_ns: log times from, and
        up to but without. clock: which of a message's times the tables hold, "log" or "publish".
        ordered: else the messages of a channel are in the order of the file.
        Raises MissingSignalError, LogReadError.
        """
        known = {channel.topic: channel for channel in self.channels}
        wanted = list(known if topics is None else dict.fromkeys(topics))
        for topic in wanted:
            if topic not in known:
                raise MissingSignalError(f"{self.path}: no topic '{topic}'. {near(topic, known)}")
        columns = {
            id_: Columns(
                self._codec(channel, is_asked_for=topics is not None),
                None if fields is None else fields.get(channel.topic),
                start_ns,
                end_ns,
                clock,
                min(self.contents.counts.get(id_, 0), self._room(id_)),
                ordered,
            )
            for id_, channel in self.contents.channels.items()
            if channel.topic in wanted
        }
        chunks = [
            chunk
            for chunk in self.contents.chunks
            if not columns.keys().isdisjoint(chunk.indexes)
            and (start_ns is None or chunk.end_ns >= start_ns)
            and (end_ns is None or chunk.start_ns < end_ns)
        ]
        for chunk, data in self._loaded(chunks):
            self._take(chunk, data, columns)
        parts: dict[str, list[ChannelTable]] = {topic: [] for topic in wanted}
        for id_, found in columns.items():
            channel = self.contents.channels[id_]
            parts[channel.topic].append(
                ChannelTable(channel.encoding, self._schema(channel), found, channel.metadata)
            )
        return {topic: one_table(topic, own, self._lose) for topic, own in parts.items()}

    def units(self, topic: str) -> Mapping[str, str]:
        """Field path -> unit, where the schema of a topic states it."""
        codecs = (self._codec(channel, is_asked_for=False) for channel in self._channels(topic))
        return {name: unit for codec in codecs if codec for name, unit in codec.units.items()}

    def texts(self, topic: str) -> Mapping[str, str]:
        """Field path -> text, in the first message of a topic that can be read."""
        for channel in self._channels(topic):
            codec = self._codec(channel, is_asked_for=False)
            chunks = [chunk for chunk in self.contents.chunks if channel.id in chunk.indexes]
            for chunk, data in self._loaded(chunks[:1] if codec else []):
                with suppress(Damage, ValueError):
                    at = int(container.messages(self.source, chunk, data)[channel.id][0])
                    size = PREFIX.size + PREFIX.unpack_from(data, at)[1]
                    return codec.texts(data[at + MESSAGE_HEAD : at + size]) if codec else {}
        return {}

    def _channels(self, topic: str) -> list[ChannelRecord]:
        return [c for c in self.contents.channels.values() if c.topic == topic]

    def fingerprint(self, leave_out: Callable[[str], bool]) -> str:
        """What tells this log from any other, whatever lies on topics that are left out."""
        out = {c.id for c in self.contents.channels.values() if leave_out(c.topic)}
        chunks = [c for c in self.contents.chunks if not c.indexes or c.indexes.keys() - out]
        seen = hashlib.sha256()
        for k, chunk in enumerate(chunks):
            topics = sorted(self.contents.channels[id_].topic for id_ in chunk.indexes)
            what = (chunk.start_ns, chunk.end_ns, chunk.size, chunk.compression, topics)
            seen.update(repr(what).encode())
            if k % -(-len(chunks) // SAMPLED) == 0:
                head = min(chunk.length, SAMPLE) if chunk.compression == RAW else CHUNK_HEAD.size
                seen.update(self.source.read(chunk.offset, head))
        return seen.hexdigest()

    def _loaded(self, chunks: Sequence[Chunk]) -> Iterator[tuple[Chunk, bytes]]:
        """Chunks with their records; a damaged one is skipped and said in `losses`."""

        def load(chunk: Chunk) -> tuple[Chunk, bytes | Damage]:
            try:
                return chunk, container.load(self.source, chunk)
            except Damage as damage:
                return chunk, damage

        is_large = sum(chunk.size for chunk in chunks) > WORTH_A_THREAD
        batches = ahead(lambda batch: list(map(load, batch)), _batches(chunks))
        for chunk, data in chain.from_iterable(batches) if is_large else map(load, chunks):
            if isinstance(data, Damage):
                self._lose(container.lost_chunk(chunk, data))
            else:
                yield chunk, data

    def _take(self, chunk: Chunk, data: bytes, columns: Mapping[int, Columns]) -> None:
        try:
            if len(chunk.indexes) == 1:
                (id_,) = chunk.indexes
                equal = container.equal_records(data, chunk, id_)
                if equal is not None:
                    columns[id_].add_equal(*equal)
                    return
            for id_, offsets in container.messages(self.source, chunk, data).items():
                if id_ in columns:
                    columns[id_].add(data, offsets)
        except Damage as damage:
            self._lose(container.lost_chunk(chunk, damage))

    def _room(self, id_: int) -> int:
        """How many messages of a channel there can be at most, by the size of its chunks."""
        chunks = [chunk for chunk in self.contents.chunks if id_ in chunk.indexes]
        return sum(chunk.size for chunk in chunks) // MESSAGE_HEAD

    def _codec(self, channel: ChannelRecord, *, is_asked_for: bool) -> Codec | None:
        """None where payloads cannot become columns; that is a loss when they were asked for."""
        try:
            return codec_of(channel.encoding, self._schema(channel))
        except Damage as damage:
            if is_asked_for:
                count = self.contents.counts.get(channel.id, 0)
                self._lose(f"{channel.topic}: {count} messages have times but no columns: {damage}")
            return None

    def _schema(self, channel: ChannelRecord) -> Schema:
        return self.contents.schemas.get(channel.schema_id, NO_SCHEMA)

    def _described(self, channel: ChannelRecord) -> Channel:
        count = self.contents.counts.get(channel.id, 0)
        name = self._schema(channel).name
        return Channel(channel.topic, name, channel.encoding, count, dict(channel.metadata))

    def _read_metadata(self) -> dict[str, dict[str, str]]:
        result = {}
        for place in self.contents.metadata:
            try:
                name, values = place.read(self.source)
                result[name] = values
            except Damage as damage:
                self._lose(f"the metadata record at byte {place.offset} cannot be read: {damage}")
        return result

    def _lose(self, loss: str) -> None:
        if self.strict:
            raise LogReadError(f"{self.path}: {loss}")
        if loss not in self.losses:
            self.losses.append(loss)


def _batches(chunks: Sequence[Chunk]) -> Iterator[list[Chunk]]:
    """Chunks one after another, about `BATCH` bytes together."""
    sizes = accumulate(chunk.size for chunk in chunks)
    for _, group in groupby(zip(chunks, sizes, strict=True), lambda item: item[1] // BATCH):
        yield [chunk for chunk, _ in group]


def ahead(function: Callable[[T], R], items: Iterable[T]) -> Iterator[R]:
    """`map` with a second thread that works up to `AHEAD` items ahead of the caller."""
    with ThreadPoolExecutor(1) as pool:
        waiting: list[Future[R]] = []
        for item in items:
            waiting.append(pool.submit(function, item))
            if len(waiting) > AHEAD:
                yield waiting.pop(0).result()
        for future in waiting:
            yield future.result()


def _check(path: Path) -> None:
    """Raise LogReadError for what is no file, with what to do instead."""
    if path.is_dir():
        if any(path.glob("*.mcap")) and not (path / "metadata.yaml").exists():
            what = f"give its logs one by one, as {path}/*.mcap, or all of it to `roadlog report`"
        else:
            what = "make a log of a bag, or of what lies in it, with `roadlog ingest`"
        raise LogReadError(f"{path}: is a folder; {what}")
    if path.exists() or path.is_symlink():
        return
    if glob.has_magic(str(path)):
        hint = "The shell resolves a pattern outside quotes; `roadlog report` takes one in quotes."
    else:
        there = path.parent.iterdir() if path.parent.is_dir() else ()
        hint = near(path.name, [sibling.name for sibling in there])
    raise LogReadError(f"{path}: no such file. {hint}")


def _no_mcap(path: Path, head: bytes) -> str:
    """What a file is instead, and what to do."""
    if not head:
        return "is empty; copy it anew"
    if path.suffix.lower() == ".mcap":
        begin = repr(head.decode("latin-1"))
        return f"is no MCAP file, whatever its name says: it begins with {begin}; copy it anew"
    return f"is no MCAP file; make one with `roadlog ingest {path} -o {path.stem}.mcap`"
