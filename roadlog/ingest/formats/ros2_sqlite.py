"""ROS 2 bags in SQLite (`.db3`), with what a `-wal` beside them holds."""

from __future__ import annotations

import sqlite3
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from operator import itemgetter
from pathlib import Path
from shutil import copyfile

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.bags import Bag, Batch, Connection
from roadlog.storage.records import Schema

COUNTED = 20_000  # messages at the front that are counted
ROWS = 1 << 10  # fetched at once: what stays in the processor's cache


@dataclass
class SqliteBag(Bag):
    """A database, opened."""

    _folder: tempfile.TemporaryDirectory[str] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        try:
            with closing(self._connected()) as database:
                texts = _definitions(database)
                rows = database.execute(
                    "SELECT id, name, type, serialization_format FROM topics"
                ).fetchall()
                counts = _counts(database, {row[0] for row in rows})
                for number, name, type_, encoding in rows:
                    schema = texts.get(type_) or _known(type_)
                    found = Connection(name, encoding, schema, counts.get(number, 0))
                    self.connections[number] = found
                (self.start_ns,) = database.execute(
                    "SELECT MIN(timestamp) FROM messages"
                ).fetchone()
        except sqlite3.Error as error:
            raise LogReadError(f"{self.path}: cannot be read as a ROS 2 bag: {error}") from error

    def batches(self, connections: set[int], end_ns: int | None = None) -> Iterator[Batch]:
        """Of one topic after another, each in the order of recording."""
        count = 0
        query = "SELECT timestamp, data FROM messages WHERE topic_id = ?"
        if end_ns is not None:  # by the index of the bag; all at once are faster without
            query += " AND timestamp < ?"
        try:
            with closing(self._connected()) as database:
                for number in sorted(connections):
                    asked = [number] if end_ns is None else [number, end_ns]
                    cursor = database.execute(query, asked)
                    while rows := cursor.fetchmany(ROWS):
                        stamps = np.fromiter(map(itemgetter(0), rows), np.int64, len(rows))
                        yield Batch(number, stamps, list(map(itemgetter(1), rows)))
                        count += len(rows)
        except sqlite3.Error as error:
            self._lose(f"it is damaged ({error}); the {count} messages before are kept")

    def _connected(self) -> sqlite3.Connection:
        """Read-only: as it lies, or a copy together with what its -wal holds."""
        path = self.path
        wal = path.with_name(f"{path.name}-wal")
        if wal.is_file() and wal.stat().st_size:
            path = self._copied(wal)
        uri = f"{path.absolute().as_uri()}?mode=ro" + (
            "" if path is not self.path else "&immutable=1"
        )
        return sqlite3.connect(uri, uri=True)

    def _copied(self, wal: Path) -> Path:
        """To read a -wal SQLite writes beside the database: that is not done to a source."""
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="roadlog-")
            for source in (self.path, wal):
                copyfile(source, Path(self._folder.name) / source.name)
        return Path(self._folder.name) / self.path.name


def _counts(database: sqlite3.Connection, topics: set[int]) -> dict[int, int]:
    """Topic -> messages; about, where the first ones are of all topics: a count is a whole pass."""
    found = Counter(
        number for (number,) in database.execute(f"SELECT topic_id FROM messages LIMIT {COUNTED}")
    )
    if found and topics <= found.keys():
        (last,) = database.execute("SELECT MAX(id) FROM messages").fetchone()
        most = max(1.0, last / found.total())
        return {number: round(count * most) for number, count in found.items()}
    return dict(database.execute("SELECT topic_id, COUNT(*) FROM messages GROUP BY topic_id"))


def _definitions(database: sqlite3.Connection) -> dict[str, Schema]:
    """Type -> schema, which bags hold since ROS 2 Iron."""
    found = database.execute("SELECT name FROM sqlite_master WHERE name = 'message_definitions'")
    if found.fetchone() is None:
        return {}
    rows = database.execute(
        "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
    )
    return {
        type_: Schema(0, type_, encoding, text.encode())
        for type_, encoding, text in rows
        if encoding in ("ros2msg", "ros2idl") and text
    }


def _known(type_: str) -> Schema:
    """The definition of a type that the bag does not explain, by rosbags; empty for none."""
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingExtraError("a ROS 2 bag without message definitions", "ros") from None
    for store in (Stores.LATEST, Stores.ROS2_HUMBLE):
        known = get_typestore(store)
        if type_ in known.fielddefs:
            text, _ = known.generate_msgdef(type_, ros_version=2)
            return Schema(0, type_, "ros2msg", text.encode())
    return Schema(0, type_, "", b"")
