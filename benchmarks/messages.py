"""Values that roadlog reads of MCAP and bags, sample by sample beside those of other readers.

    PYTHONPATH=tests python benchmarks/messages.py [FILES [SEED]]

Each file has several topics of random messages: lists of various lengths, numbers of every width,
both byte orders, chunks and messages compressed or not. The other readers are mcap-ros1-support,
mcap-ros2-support, mcap-protobuf-support, and rosbags for bags; 0 values should differ.
"""

from __future__ import annotations

import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from google.protobuf import descriptor_pb2, timestamp_pb2
from mcap.reader import make_reader
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from support.protobuf_values import NUMBERS, message_class, numbers
from support.ros_messages import ROS1, ROS2, START, leaves, random_message

from roadlog.ingest.formats import ros
from roadlog.storage import LogReader, Table

TOPICS, MESSAGES = 8, 40  # of each file
TYPES = [name for name in ROS2.fielddefs if name.split("/")[0] in
         ("sensor_msgs", "geometry_msgs", "nav_msgs", "std_msgs", "diagnostic_msgs",
          "trajectory_msgs") and ROS2.fielddefs[name][1]]  # fmt: skip
BYTES = ("std_msgs/msg/Byte", "std_msgs/msg/ByteMultiArray")  # rosbags reads them signed

Rows = dict[str, list[dict[str, float]]]  # topic -> path -> number, of each message


class Kind(NamedTuple):
    """write: some topics of random messages. theirs: what the other reader finds in them."""

    write: Callable[[Path, np.random.Generator], None]
    theirs: Callable[[Path], Rows]
    ending: str


def _mcap(path: Path, rng: np.random.Generator, version: int) -> None:
    """version: of ROS; 0 for protobuf."""
    compression = list(CompressionType)[int(rng.integers(3))]
    with path.open("wb") as file:
        writer = McapWriter(
            file, compression=compression, chunk_size=int(rng.integers(500, 50_000))
        )
        writer.start()
        for k in range(TOPICS):
            encoding, schema, payloads = _protobuf(rng, k) if version == 0 else _ros(rng, version)
            channel = writer.register_channel(
                f"/topic{k}", encoding, writer.register_schema(*schema)
            )
            for j, payload in enumerate(payloads):
                ns = START + j * 10**7 + k
                writer.add_message(channel, ns, payload, ns)
        writer.finish()


Written = tuple[str, tuple[str, str, bytes], list[bytes]]


def _ros(rng: np.random.Generator, version: int) -> Written:
    store, name = (ROS1, ROS2)[version - 1], _type(rng, version)
    text, _ = store.generate_msgdef(name, ros_version=version)
    messages = [random_message(store, name, rng) for _ in range(MESSAGES)]
    if version == 1:
        payloads = [bytes(store.serialize_ros1(message, name)) for message in messages]
        return "ros1", (name.replace("/msg/", "/"), "ros1msg", text.encode()), payloads
    is_little = bool(rng.integers(2))
    payloads = [bytes(store.serialize_cdr(m, name, little_endian=is_little)) for m in messages]
    return "cdr", (name, "ros2msg", text.encode()), payloads


def _type(rng: np.random.Generator, version: int) -> str:
    known = [t for t in TYPES if t in (ROS1, ROS2)[version - 1].fielddefs and t not in BYTES]
    return known[int(rng.integers(len(known)))]


def _protobuf(rng: np.random.Generator, number: int) -> Written:
    """Messages of a type by chance: nested, repeated, optional, with names and a oneof."""
    kinds = [descriptor_pb2.FieldDescriptorProto.Type.Name(n)[5:].lower() for n in NUMBERS]

    def fields(hows: list[str]) -> str:
        chosen = [(hows[int(rng.integers(len(hows)))], kinds[int(rng.integers(len(kinds)))])
                  for _ in range(int(rng.integers(2, 9)))]  # fmt: skip
        return ", ".join(f"{how} {kind} f{k}" for k, (how, kind) in enumerate(chosen))

    types = {
        "Part": f"string name, {fields(['', 'optional'])}",
        "Whole": f"{fields(['', 'optional', 'repeated'])}, Part one, repeated Part parts, "
        "oneof double a, oneof sint32 b",
    }
    cls = message_class(types, "Whole", f"t{number}")
    messages = [_filled(cls(), rng) for _ in range(MESSAGES)]
    files = descriptor_pb2.FileDescriptorSet()
    for file in (timestamp_pb2.DESCRIPTOR, cls.DESCRIPTOR.file):
        file.CopyToProto(files.file.add())
    schema = (f"t{number}.Whole", "protobuf", files.SerializeToString())
    return "protobuf", schema, [message.SerializeToString() for message in messages]


def _filled(message: Any, rng: np.random.Generator) -> Any:
    for field in message.DESCRIPTOR.fields:
        if rng.random() < 0.2:
            continue
        count = int(rng.integers(0, 4)) if field.is_repeated else 1
        for _ in range(count):
            if field.message_type is not None:
                inner = getattr(message, field.name)
                _filled(inner.add() if field.is_repeated else inner, rng)
                continue
            value = _value(field.type, rng)
            if field.is_repeated:
                getattr(message, field.name).append(value)
            else:
                setattr(message, field.name, value)
    return message


def _value(kind: int, rng: np.random.Generator) -> Any:
    if kind == descriptor_pb2.FieldDescriptorProto.TYPE_STRING:
        return "x" * int(rng.integers(0, 4))
    limits = NUMBERS[kind]
    if limits is None:
        return float(np.float32(rng.normal()))
    low, high = limits
    if rng.random() < 0.5:  # of few bytes
        low, high = 0, min(99, high)
    value = random.Random(int(rng.integers(2**62))).randint(low, high)
    return bool(value) if limits == (0, 1) else value


def _by_mcap(path: Path) -> Rows:
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros1.decoder import DecoderFactory as Ros1
    from mcap_ros2.decoder import DecoderFactory as Ros2

    found: Rows = {}
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[Protobuf(), Ros1(), Ros2()])
        for _, channel, _, message in reader.iter_decoded_messages():
            row = numbers(message) if channel.message_encoding == "protobuf" else leaves(message)
            found.setdefault(channel.topic, []).append(dict(row))
    return found


def _bag1(path: Path, rng: np.random.Generator) -> None:
    from rosbags.rosbag1 import Writer

    writer = Writer(path)
    compression = list(Writer.CompressionFormat)[int(rng.integers(2))]
    if rng.integers(3):
        writer.set_compression(compression)
    with writer as bag:
        _into(bag, rng, 1)


def _bag2(path: Path, rng: np.random.Generator, plugin: str) -> None:
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

    writer = Writer(path, version=9, storage_plugin=StoragePlugin[plugin])
    if plugin == "SQLITE3":
        mode = list(CompressionMode)[int(rng.integers(3))]
        if mode is not CompressionMode.NONE:
            writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer as bag:
        _into(bag, rng, 2)


def _into(bag: Any, rng: np.random.Generator, version: int) -> None:
    store = (ROS1, ROS2)[version - 1]
    serialize = store.serialize_ros1 if version == 1 else store.serialize_cdr
    for k in range(TOPICS):
        name = _type(rng, version)
        connection = bag.add_connection(f"/topic{k}", name, typestore=store)
        for j in range(MESSAGES):
            made = serialize(random_message(store, name, rng), name)
            bag.write(connection, START + j * 10**7 + k, bytes(made))


def _by_rosbags(path: Path) -> Rows:
    from rosbags.highlevel import AnyReader

    found: Rows = {}
    with AnyReader([path]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append(dict(leaves(message)))
    return found


KINDS = {
    "ROS 1 MCAP": Kind(lambda path, rng: _mcap(path, rng, 1), _by_mcap, ".mcap"),
    "ROS 2 MCAP": Kind(lambda path, rng: _mcap(path, rng, 2), _by_mcap, ".mcap"),
    "protobuf MCAP": Kind(lambda path, rng: _mcap(path, rng, 0), _by_mcap, ".mcap"),
    "ROS 1 bag": Kind(_bag1, _by_rosbags, ".bag"),
    "ROS 2 bag, SQLite": Kind(lambda path, rng: _bag2(path, rng, "SQLITE3"), _by_rosbags, ""),
    "ROS 2 bag, MCAP": Kind(lambda path, rng: _bag2(path, rng, "MCAP"), _by_rosbags, ""),
}


def ours(path: Path) -> list[Table]:
    """What roadlog reads of a file or bag."""
    if path.suffix == ".mcap":
        with LogReader(path) as log:
            assert not log.losses
            return list(log.read().values())
    with ros.opened(path) as (readers, losses):
        assert not losses
        topics = [(r, [c.topic for c in r.channels]) for r in readers]
        return [table for reader, names in topics for table in reader.read(names).values()]


def compare(table: Table, rows: list[dict[str, float]], found: Counter[str]) -> None:
    """Count the values of a topic that are the same, and those that are not."""
    own = {name: values for name, values in table.columns.items() if "[" not in name}
    names = {name for row in rows for name in row if "[" not in name}
    for name in names | own.keys():
        expected = np.array([row.get(name, np.nan) for row in rows], np.float64)
        values = np.asarray(own.get(name, np.full(len(rows), np.nan)), np.float64)
        same = (values == expected) | (np.isnan(values) & np.isnan(expected))
        found["same"] += int(np.count_nonzero(same & ~np.isnan(expected)))
        if not same.all():
            found["different"] += int(np.count_nonzero(~same))
            k = int(np.flatnonzero(~same)[0])
            print(f"{table.topic} {table.schema} {name} {k}: {values[k]}, theirs {expected[k]}")


def main() -> None:
    """Print what was compared of each kind of file."""
    files = int(sys.argv[1]) if len(sys.argv) > 1 else 30
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    found: dict[str, Counter[str]] = {}
    for k in range(files):
        name = list(KINDS)[k % len(KINDS)]
        kind, count = KINDS[name], found.setdefault(name, Counter(different=0))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"drive{kind.ending}")
            kind.write(path, rng)
            theirs = kind.theirs(path)
            tables = {table.topic: table for table in ours(path)}
        assert set(tables) == set(theirs)
        count["files"] += 1
        for topic, rows in theirs.items():
            assert len(tables[topic]) == len(rows)
            count["messages"] += len(rows)
            compare(tables[topic], rows, count)
    print("| kind | files | messages | values the same | different |\n|---|---|---|---|---|")
    for name, count in found.items():
        numbers_ = " | ".join(
            f"{count[what]:,}" for what in ("files", "messages", "same", "different")
        )
        print(f"| {name} | {numbers_} |")


if __name__ == "__main__":
    main()
