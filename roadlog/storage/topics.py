"""Channels of one topic as one table, whatever container they come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from roadlog.storage.columns import Columns, merged
from roadlog.storage.encodings import codec_of
from roadlog.storage.records import Damage, Schema
from roadlog.storage.table import Table


class ChannelTable(NamedTuple):
    """One channel of a topic with its columns."""

    encoding: str
    schema: Schema
    columns: Columns
    metadata: Mapping[str, str]

    @property
    def meaning(self) -> object:
        """What channels have in common whose messages make one table: name and fields."""
        try:
            dtypes = codec_of(self.encoding, self.schema).dtypes
        except Damage:
            return self.schema.name, self.encoding, self.schema.data
        if not dtypes:  # nothing but the messages themselves says what is in them
            return self.schema.name, self.encoding
        return self.schema.name, tuple(sorted((name, str(code)) for name, code in dtypes.items()))


def one_table(topic: str, parts: Sequence[ChannelTable], lose: Callable[[str], None]) -> Table:
    """Those that have the fields of most messages, in time order; the rest is a loss."""
    counts: dict[object, int] = {}
    for part in parts:
        counts[part.meaning] = counts.get(part.meaning, 0) + part.columns.count
        if part.columns.lost:
            lose(f"{topic}: {part.columns.lost} of {part.columns.count} messages cannot be decoded")
        if part.columns.beyond:
            lose(f"{topic}: {part.columns.beyond} messages left out, their time is after 2262")
    chosen = max(counts, key=lambda key: counts[key])
    same = [part for part in parts if part.meaning == chosen]
    name = same[0].schema.name
    if left := sum(counts.values()) - counts[chosen]:
        others = sorted({part.schema.name or "no schema" for part in parts} - {name})
        what = ", ".join(others) or f"another definition of {name}"
        lose(
            f"{topic}: {len(counts)} channels of different schemas; {left} messages of {what} were "
            f"not read, {counts[chosen]} of {name or 'no schema'} were"
        )
    time, values = merged([part.columns.finish() for part in same])
    unread = sorted(set().union(*(part.columns.unread for part in same)))
    said = f"{topic}: numbers that were not read: {', '.join(unread)}" if unread else ""
    return Table(topic, name, time, values, same[0].metadata, unread=said)
