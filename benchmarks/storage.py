"""Writing and reading logs against what one would do by hand, each beside its alternative.

Run: python benchmarks/storage.py [--json] [--minutes M] [--rounds N] [--large BYTES]
[--only W2 R2]. CPU time of one warm process, median over the rounds of the ratio within each; A1
and A2 are wall time.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import zstandard
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.timestamp_pb2 import Timestamp
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.writer import Writer as ProtobufWriter
from rerun.chunk import Chunk, McapReader

from roadlog.signals import SECTIONS
from roadlog.storage import LogReader, Table, container, schemas, update_log, write_log
from roadlog.storage.protobuf_fields import add_files
from roadlog.storage.writer import ZSTD_LEVEL

EPOCH_NS = 1_700_000_000_000_000_000
RATES = {"imu": 100, "wheel_speeds": 100, "steering": 100, "wheel_torques": 52, "gnss": 10}  # Hz
TRIES = 3  # the least of so many counts where other processes disturb most
RESULTS = 300_000  # messages that A1 and A2 add
GOALS = {
    "W1": "write, x faster than mcap + protobuf objects (goal >= 24)",
    "W2": "write, x the time of compressing alone (goal <= 1.2)",
    "R1": "read a channel, x faster than mcap + mcap_protobuf (goal >= 60)",
    "R2": "read a channel, x the time of inflating alone (goal <= 1.4)",
    "R3": "R1 on a foreign, interleaved file (goal >= 45)",
    "R4": "R1 on a foreign file with varints and omitted zeros (goal >= 18)",
    "R5": "read a channel, x faster than Rerun's loader (goal >= 9)",
    "A1": "add results in place, s without writing them (goal <= 0.5)",
    "A2": "add results by copying, x cp + fsync of the file (goal <= 1.5)",
}


def drive(minutes: float) -> list[Table]:
    """Noisy, quantized sensors: 362 messages a second on 5 channels."""
    rng = np.random.default_rng(1)
    result = []
    for name, rate in RATES.items():
        section, n = SECTIONS[name], round(minutes * 60 * rate)
        stamps = EPOCH_NS + np.arange(n) * (10**9 // rate) + rng.integers(0, 10**5, n)
        fields = section.fields[:6] if name == "gnss" else section.fields
        noise = {f: np.cumsum(rng.normal(0, 0.02, n)) + rng.normal(0, 0.1, n) for f in fields}
        columns = {f: np.round(values / 0.002) * 0.002 for f, values in noise.items()}
        result.append(Table(section.topic, section.schema, stamps, columns))
    return result


def write_by_hand(path: Path, tables: list[Table]) -> None:
    """One protobuf object a message, in time order."""
    rows = []
    for table in tables:
        cls = message_factory.GetMessageClass(schemas.descriptor(table.schema))
        values = zip(*(column.tolist() for column in table.columns.values()), strict=True)
        names = tuple(table.columns)
        rows += [
            (stamp, table.topic, cls, names, row)
            for stamp, row in zip(table.time.tolist(), values, strict=True)
        ]
    rows.sort(key=lambda row: row[0])
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for stamp, topic, cls, names, row in rows:
            message = cls(**dict(zip(names, row, strict=True)))
            writer.write_message(topic, message, log_time=stamp, publish_time=stamp)


def write_stamped(path: Path, count: int) -> None:
    """A foreign schema: a Timestamp, a text, numbers of which some are zero and left out."""
    file = descriptor_pb2.FileDescriptorProto(name="s.proto", package="s", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    kind = file.message_type.add(name="Sample")
    field = kind.field.add(name="stamp", number=1, type=11, label=1)
    field.type_name = ".google.protobuf.Timestamp"
    kind.field.add(name="frame", number=2, type=9, label=1)
    for k, name in enumerate("abcdef"):
        kind.field.add(name=name, number=3 + k, type=1, label=1)
    stamp_file = descriptor_pb2.FileDescriptorProto()
    Timestamp.DESCRIPTOR.file.CopyToProto(stamp_file)
    files = [stamp_file, file]
    pool = descriptor_pool.DescriptorPool()
    add_files(pool, {one.name: one for one in files})
    cls = message_factory.GetMessageClass(pool.FindMessageTypeByName("s.Sample"))
    data = descriptor_pb2.FileDescriptorSet(file=files).SerializeToString()
    rng = np.random.default_rng(2)
    values = rng.normal(size=(count, 6)) * (rng.random((count, 6)) > 0.02)
    with path.open("wb") as out:
        writer = Writer(out, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("s.Sample", "protobuf", data)
        channel = writer.register_channel("/imu", "protobuf", schema)
        for k, row in enumerate(values.tolist()):
            stamp = EPOCH_NS + k * 10**7
            message = cls(frame="imu", **dict(zip("abcdef", row, strict=True)))
            message.stamp.seconds, message.stamp.nanos = divmod(stamp, 10**9)
            writer.add_message(channel, stamp, message.SerializeToString(), stamp)
        writer.finish()


def read_by_hand(path: Path) -> list[tuple]:
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        found = reader.iter_decoded_messages(topics=["/imu"])
        rows = []
        for _, _, message, imu in found:
            numbers = [getattr(imu, f.name) for f in imu.DESCRIPTOR.fields if f.type == 1]
            rows.append((message.log_time, *numbers))
    return rows


def read(path: Path) -> Table:
    with LogReader(path) as log:
        return log.read(["/imu"])["/imu"]


def read_with_rerun(path: Path) -> list[Chunk]:
    reader = McapReader(path, include_topic_regex=[f"^{re.escape('/imu')}$"])
    return [chunk for chunk in reader.stream() if not chunk.is_static]


def check_rerun(path: Path) -> None:
    """It is given the same work: every message with the values that we read."""
    own = read(path)
    batches = [chunk.to_record_batch() for chunk in read_with_rerun(path)]
    found = [batch.column(f"{own.schema}:message").flatten() for batch in batches]
    for name, values in own.columns.items():
        theirs = np.concatenate([np.asarray(part.field(name)) for part in found])
        np.testing.assert_array_equal(theirs, values)


def cost(function: Callable[..., object], *arguments: object) -> float:
    """s of CPU."""
    start = time.process_time()
    function(*arguments)
    return time.process_time() - start


def least(function: Callable[..., object], *arguments: object) -> float:
    """s of CPU, of the run that others disturbed least."""
    return min(cost(function, *arguments) for _ in range(TRIES))


def wall(function: Callable[..., object], *arguments: object) -> float:
    start = time.perf_counter()
    function(*arguments)
    return time.perf_counter() - start


def copy(source: Path, target: Path) -> None:
    shutil.copyfile(source, target)
    with target.open("r+b") as file:
        os.fsync(file.fileno())


def measure(
    folder: Path, minutes: float, rounds: int, large: int, only: list[str]
) -> dict[str, float]:
    """Key of GOALS -> what was found; only: the keys that are asked for."""
    tables = drive(minutes)
    ours, hand, stamped = (folder / f"{name}.mcap" for name in ("ours", "hand", "stamped"))
    write_log(ours, tables, {})
    if {"W1", "R3"} & set(only):
        write_by_hand(hand, tables)
    if "R4" in only:
        write_stamped(stamped, len(tables[0]))
    if "R5" in only:
        check_rerun(ours)
    with LogReader(ours) as log:
        parts = [(container.load(log.source, c), c) for c in log.contents.chunks]
    compress = zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress
    imu = [compress(data) for data, chunk in parts if 1 in chunk.indexes]
    inflate = zstandard.ZstdDecompressor().decompress

    def against_hand(path: Path) -> float:
        return cost(read_by_hand, path) / least(read, path)

    ways: dict[str, Callable[[], float]] = {
        "W1": lambda: cost(write_by_hand, hand, tables) / cost(write_log, ours, tables, {}),
        "W2": lambda: (
            cost(write_log, ours, tables, {}) / cost(lambda: [compress(data) for data, _ in parts])
        ),
        "R1": lambda: against_hand(ours),
        "R2": lambda: least(read, ours) / least(lambda: [inflate(data) for data in imu]),
        "R3": lambda: against_hand(hand),
        "R4": lambda: against_hand(stamped),
        "R5": lambda: cost(read_with_rerun, ours) / least(read, ours),
    }
    found: dict[str, list[float]] = {key: [] for key in only}
    for _ in range(rounds):
        for key in only:
            if key in ways:
                found[key].append(ways[key]())
        if {"A1", "A2"} & set(only):
            _append(folder, tables[0], large, found)
    return {key: round(statistics.median(values), 3) for key, values in found.items()}


def _append(folder: Path, imu: Table, large: int, ratios: dict[str, list[float]]) -> None:
    path, other = folder / "large.mcap", folder / "copy.mcap"
    copies = max(1, large // (85 * len(imu)))
    span = int(imu.time[-1] - imu.time[0]) + 10**7
    time_ns = np.concatenate([imu.time + k * span for k in range(copies)])
    columns = {name: np.tile(values, copies) for name, values in imu.columns.items()}
    write_log(path, [Table(imu.topic, imu.schema, time_ns, columns)], {}, compression="none")
    stamps = EPOCH_NS + np.arange(RESULTS) * 10**7
    angles = {"grade": np.sin(np.arange(RESULTS) / 100), "valid": np.ones(RESULTS, np.bool_)}
    results = [Table("/estimates/a/angles", "roadlog.v1.RoadAngles", stamps, angles)]
    alone = wall(write_log, folder / "alone.mcap", results, {})

    def put(tables: list[Table], in_place: bool) -> None:
        update_log(path, tables, {}, drop=lambda topic: topic == results[0].topic,
                   drop_metadata=lambda _: False, in_place=in_place)  # fmt: skip

    copied, added = [], []
    for _ in range(TRIES):  # each makes a new file out of pages that the one before gave back
        copied.append(wall(copy, path, other))
        other.unlink()
        added.append(wall(put, results, False))
        put([], True)  # without results again
    ratios.setdefault("A2", []).append(min(added) / min(copied))
    ratios.setdefault("A1", []).append(max(0.0, wall(put, results, True) - alone))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--minutes", type=float, default=46.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--large", type=int, default=1 << 30)
    parser.add_argument("--only", choices=GOALS, nargs="+", default=list(GOALS))
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = measure(Path(folder), options.minutes, options.rounds, options.large, options.only)
    for key, value in found.items():
        print(f"{key}  {value:8.2f}  {GOALS[key]}")
    if options.json:
        print(json.dumps(found))


if __name__ == "__main__":
    main()
