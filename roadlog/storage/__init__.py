"""MCAP as columns: the only part of roadlog that knows MCAP bytes."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from roadlog.errors import LogReadError, LogWriteError, MissingSignalError, near
from roadlog.storage import schemas
from roadlog.storage.table import Channel, Table

__all__ = ["Channel", "LogReader", "Table", "update_log", "write_log"]

_MAGIC = b"\x89MCAP0\r\n"


class LogReader:
    """An MCAP file as columns.

    channels: what the file declares. metadata: records by name, the last one wins.
    losses: sentences on what could not be read. Raises LogReadError.
    """

    def __init__(self, path: Path, *, strict: bool = False) -> None:
        self.path = Path(path)
        self.strict = strict
        self.losses: list[str] = []
        try:
            self._file: IO[bytes] = self.path.open("rb")
        except OSError as error:
            raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error
        head = self._file.read(len(_MAGIC))
        if head != _MAGIC:
            self._file.close()
            found = "is empty" if not head else "is no MCAP file"
            raise LogReadError(f"{path}: {found}; make a log with `roadlog ingest`")
        self._file.seek(0)
        self._reader = make_reader(self._file, validate_crcs=True)
        try:
            summary = self._reader.get_summary()
            if summary is None or summary.statistics is None:
                raise LogReadError(f"{path}: has no summary (cut off?)")
            self._summary = summary
            self.metadata = {r.name: dict(r.metadata) for r in self._reader.iter_metadata()}
        except (McapError, OSError, ValueError, KeyError) as error:
            raise LogReadError(f"{path}: cannot be read: {error}") from error
        counts = summary.statistics.channel_message_counts
        self.channels = tuple(
            Channel(
                c.topic,
                summary.schemas[c.schema_id].name if c.schema_id else "",
                c.message_encoding,
                counts.get(c.id, 0),
                dict(c.metadata),
            )
            for c in summary.channels.values()
        )
        empty = not summary.statistics.message_count
        self.start_ns = None if empty else int(summary.statistics.message_start_time)
        self.end_ns = None if empty else int(summary.statistics.message_end_time)

    def __enter__(self) -> LogReader:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(
        self,
        topics: Iterable[str] | None = None,
        *,
        fields: Mapping[str, Sequence[str]] | None = None,
        start_ns: int | None = None,
        end_ns: int | None = None,
        clock: str = "log",
    ) -> dict[str, Table]:
        """Columns of the channels on the given topics (default: all), in time order.

        fields: topic -> wanted field paths (default: all). Raises MissingSignalError, LogReadError.
        """
        known = {channel.topic: channel for channel in self.channels}
        wanted = list(known if topics is None else topics)
        for topic in wanted:
            if topic not in known:
                raise MissingSignalError(f"{self.path}: no topic '{topic}'. {near(topic, known)}")
        times: dict[str, list[int]] = {topic: [] for topic in wanted}
        rows: dict[str, list[dict[str, Any]]] = {topic: [] for topic in wanted}
        decoders: dict[int, Callable[[bytes], Any]] = {}
        foreign: dict[str, int] = {}
        try:
            for schema, channel, message in self._reader.iter_messages(
                topics=wanted, start_time=start_ns, end_time=end_ns
            ):
                if channel.message_encoding != "protobuf" or schema is None:
                    foreign[channel.topic] = foreign.get(channel.topic, 0) + 1
                    continue
                decode = decoders.setdefault(channel.id, _decoder(schema.name, schema.data))
                stamp = message.publish_time if clock == "publish" else message.log_time
                times[channel.topic].append(stamp)
                rows[channel.topic].append(dict(_flatten(decode(message.data))))
        except (McapError, OSError, ValueError) as error:
            raise LogReadError(f"{self.path}: cannot be read: {error}") from error
        for topic, count in foreign.items():
            loss = f"{topic}: {count} messages are not protobuf and were not read"
            self.losses += [loss] if loss not in self.losses else []
        result = {}
        for topic in wanted:
            names = list(dict.fromkeys(name for row in rows[topic] for name in row))
            if not names and known[topic].schema in schemas.names():
                names = list(schemas.columns(known[topic].schema))
            if fields and topic in fields:
                names = [name for name in names if name in fields[topic]]
            columns = {n: np.array([row.get(n, np.nan) for row in rows[topic]]) for n in names}
            time = np.array(times[topic], np.int64)
            channel = known[topic]
            result[topic] = Table(topic, channel.schema, time, columns, channel.metadata)
        return result


def _decoder(name: str, data: bytes) -> Callable[[bytes], Any]:
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(data).file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(name)).FromString


def _flatten(message: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for field in message.DESCRIPTOR.fields:
        if field.is_repeated:
            continue
        value = getattr(message, field.name)
        if field.message_type is not None:
            yield from _flatten(value, f"{prefix}{field.name}.")
        elif not isinstance(value, (str, bytes)):
            yield prefix + field.name, value


def write_log(
    path: Path,
    tables: Iterable[Table],
    metadata: Mapping[str, Mapping[str, str]],
    *,
    compression: str = "zstd",
) -> None:
    """Write a new log, whole or not at all. Raises LogWriteError."""
    with _replacing(Path(path)) as file:
        writer = Writer(file, compression=CompressionType[compression.upper()])
        writer.start(profile="", library="roadlog")
        for table in tables:
            _write_table(writer, table)
        for name, record in metadata.items():
            writer.add_metadata(name, dict(record))
        writer.finish()


def update_log(
    path: Path,
    tables: Iterable[Table],
    metadata: Mapping[str, Mapping[str, str]],
    *,
    drop: Callable[[str], bool],
    drop_metadata: Callable[[str], bool],
    out: Path | None = None,
    in_place: bool = False,
) -> None:
    """Replace what `drop` names by `tables` in an existing log; the rest stays byte for byte."""
    del in_place
    with LogReader(path) as old, _replacing(Path(out or path)) as file:
        writer = Writer(file)
        writer.start(profile="", library="roadlog")
        ids: dict[int, int] = {}
        for schema, channel, message in old._reader.iter_messages():
            if drop(channel.topic):
                continue
            if channel.id not in ids:
                sid = (
                    writer.register_schema(schema.name, schema.encoding, schema.data)
                    if schema
                    else 0
                )
                ids[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, sid, dict(channel.metadata)
                )
            writer.add_message(
                ids[channel.id],
                message.log_time,
                message.data,
                message.publish_time,
                message.sequence,
            )
        for attachment in old._reader.iter_attachments():
            writer.add_attachment(
                attachment.create_time,
                attachment.log_time,
                attachment.name,
                attachment.media_type,
                attachment.data,
            )
        for table in tables:
            _write_table(writer, table)
        for name, record in {
            **{k: v for k, v in old.metadata.items() if not drop_metadata(k)},
            **metadata,
        }.items():
            writer.add_metadata(name, dict(record))
        writer.finish()


def _write_table(writer: Writer, table: Table) -> None:
    sid = writer.register_schema(table.schema, "protobuf", schemas.descriptor_set(table.schema))
    cid = writer.register_channel(table.topic, "protobuf", sid, dict(table.metadata))
    cls = message_factory.GetMessageClass(schemas.descriptor(table.schema))
    columns = {name: table.columns[name].tolist() for name in table.columns}
    for k, stamp in enumerate(table.time.tolist()):
        message = cls(**{name: values[k] for name, values in columns.items()})
        writer.add_message(cid, stamp, message.SerializeToString(), stamp, k)


@contextmanager
def _replacing(path: Path) -> Iterator[IO[bytes]]:
    """A temporary file beside `path` that takes its place when all went well."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    except OSError as error:
        raise LogWriteError(f"{path}: cannot be written: {error.strerror}") from error
    try:
        with os.fdopen(handle, "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        Path(name).replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        os.fsync(folder)
        os.close(folder)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
