"""Bags as columns: what ROS 1 bags and SQLite bags have in common, through the codecs of logs."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, NamedTuple

import numpy as np

from roadlog.storage import Channel, Table
from roadlog.storage.columns import Columns
from roadlog.storage.encodings import Codec, codec_of
from roadlog.storage.records import Damage, Schema
from roadlog.storage.topics import ChannelTable, one_table
from roadlog.types import Stamps

FIRST = 10**10  # ns from the start of a bag, where a topic's first message is looked for


class Batch(NamedTuple):
    """Messages of one connection: ns of recording, payloads."""

    connection: int
    stamps: Stamps
    payloads: Sequence[bytes]


@dataclass
class Connection:
    """One line of messages in a bag. count: of its messages, about; 0 for none."""

    topic: str
    encoding: str
    schema: Schema
    count: int = 0


@dataclass
class Bag(ABC):
    """A bag as columns, as `storage.LogReader` is an MCAP; losses grow while it is read.

    start_ns: first time of recording.
    """

    path: Path
    connections: dict[int, Connection] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)
    start_ns: int | None = None
    has_publish: ClassVar[bool] = False

    @abstractmethod
    def batches(self, connections: set[int], end_ns: int | None = None) -> Iterator[Batch]:
        """Their messages in the order of the bag; what cannot be read becomes a loss.

        end_ns: those that follow need not come.
        """

    @property
    def channels(self) -> tuple[Channel, ...]:
        """One for each connection."""
        return tuple(
            Channel(c.topic, c.schema.name, c.encoding, c.count) for c in self.connections.values()
        )

    def read(
        self,
        topics: Iterable[str],
        *,
        fields: Mapping[str, Sequence[str]] | None = None,
        end_ns: int | None = None,
        clock: str = "log",
        ordered: bool = True,
    ) -> dict[str, Table]:
        """Columns of some topics; a bag has one clock besides that of the messages."""
        del clock
        wanted = list(dict.fromkeys(topics))
        columns = {
            number: Columns(
                self._codec(found), None if fields is None else fields.get(found.topic),
                end_ns=end_ns, capacity=found.count, ordered=ordered,
            )
            for number, found in self.connections.items()
            if found.topic in wanted
        }  # fmt: skip
        if any(fields is None or fields.get(topic) for topic in wanted):
            for batch in self.batches(set(columns), end_ns):
                columns[batch.connection].add_payloads(batch.stamps, batch.payloads)
        parts: dict[str, list[ChannelTable]] = {topic: [] for topic in wanted}
        for number, found in columns.items():
            own = self.connections[number]
            parts[own.topic].append(ChannelTable(own.encoding, own.schema, found, {}))
        return {topic: one_table(topic, own, self._lose) for topic, own in parts.items()}

    def units(self, topic: str) -> Mapping[str, str]:
        """Field path -> unit, where the definition states it."""
        codecs = [self._codec(c) for c in self.connections.values() if c.topic == topic]
        return {name: unit for codec in codecs if codec for name, unit in codec.units.items()}

    def texts(self, topic: str) -> Mapping[str, str]:
        """Field path -> text, in the first message of a topic that can be read."""
        own = {n for n, c in self.connections.items() if c.topic == topic}
        for batch in self.batches(own, (self.start_ns or 0) + FIRST):
            codec = self._codec(self.connections[batch.connection])
            with suppress(ValueError):
                return codec.texts(batch.payloads[0]) if codec else {}
        return {}

    def _codec(self, connection: Connection) -> Codec | None:
        try:
            return codec_of(connection.encoding, connection.schema)
        except Damage as damage:
            self._lose(f"{connection.topic}: its messages have no columns: {damage}")
            return None

    def _lose(self, loss: str) -> None:
        if loss not in self.losses:
            self.losses.append(loss)


def collected(rows: Iterable[tuple[int, int, bytes]], size: int = 1 << 16) -> Iterator[Batch]:
    """(connection, ns, payload) one after another as batches of about `size` messages."""
    stamps: dict[int, list[int]] = {}
    payloads: dict[int, list[bytes]] = {}
    count = 0
    for connection, stamp, payload in rows:
        if connection not in stamps:
            stamps[connection], payloads[connection] = [], []
        stamps[connection].append(stamp)
        payloads[connection].append(payload)
        count += 1
        if count == size:
            yield from _batches(stamps, payloads)
            stamps, payloads, count = {}, {}, 0
    yield from _batches(stamps, payloads)


def _batches(
    stamps: Mapping[int, list[int]], payloads: Mapping[int, list[bytes]]
) -> Iterator[Batch]:
    for connection, own in stamps.items():
        yield Batch(connection, np.array(own, np.int64), payloads[connection])
