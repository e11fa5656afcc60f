"""Damaged and unusual files: what is whole is read, what is lost is said, nothing else escapes."""

from __future__ import annotations

import random
import struct
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer
from support.container_view import view
from support.drives import EPOCH_NS, hill_tables, table
from support.memory import peak

from roadlog.errors import LogReadError, MissingSignalError, RoadlogError
from roadlog.storage import LogReader, container, records, schemas, write_log

MAX_SECONDS = 2.0  # CPU of one case; the longest of 120,000 took 0.08 s
MAX_BYTES = 1 << 30  # of memory


def samples(path: Path) -> list[bytes]:
    """Small files by our writer and by the reference library, each part under some CRC."""
    result = []
    for compression in ("zstd", "lz4", "none"):
        write_log(
            path, hill_tables(0.1), {"vehicle": {"toml": "[vehicle]"}}, compression=compression
        )
        result.append(path.read_bytes())
    for options in (
        {"use_chunking": False},
        {"compression": CompressionType.ZSTD, "chunk_size": 900},
        {"index_types": IndexType.NONE},
    ):
        foreign(path, 30, enable_data_crcs=True, **options)
        result.append(path.read_bytes())
    return result


def foreign(path: Path, count: int, **options: object) -> None:
    """Two interleaved channels by the reference library: /imu in order of time, and /raw."""
    with path.open("wb") as file:
        writer = Writer(file, **options)  # type: ignore[arg-type]
        writer.start()
        name = "roadlog.v1.Speed"
        schema = writer.register_schema(name, "protobuf", schemas.descriptor_set(name))
        speed = writer.register_channel("/speed", "protobuf", schema, {"unit.v": "m/s"})
        raw = writer.register_channel("/raw", "bytes", 0)
        for k in range(count):
            payload = b"\x09" + np.float64(k).tobytes()
            writer.add_message(speed, EPOCH_NS + k, payload, EPOCH_NS + k, k)
            writer.add_message(raw, EPOCH_NS + k, bytes([k % 256]), EPOCH_NS + k, k)
        writer.add_metadata("trip", {"driver": "x"})
        writer.finish()


def damaged(data: bytes, chance: random.Random) -> bytes:
    """A copy that is cut, or has one to three bits flipped."""
    if chance.random() < 0.25:
        return data[: chance.randrange(len(data))]
    changed = bytearray(data)
    for _ in range(chance.randint(1, 3)):
        changed[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def fuzz(cases: int, seed: int, files: list[bytes], path: Path) -> list[str]:
    """Descriptions of cases that went wrong."""
    chance = random.Random(seed)
    originals = []
    for data in files:
        path.write_bytes(data)
        originals.append(view(path))
    wrong = []
    for case in range(cases):
        k = chance.randrange(len(files))
        data = damaged(files[k], chance)
        path.write_bytes(data)
        start = time.process_time()
        try:
            found = view(path)
            if not found.losses and found != originals[k]:
                places = [i for i, (a, b) in enumerate(zip(data, files[k], strict=False)) if a != b]
                wrong.append(f"case {case}: file {k}, bytes {places}: wrong, and not said")
        except RoadlogError:
            pass
        except Exception as error:
            wrong.append(f"case {case}: file {k}: {error!r} escaped")
        if time.process_time() - start > MAX_SECONDS:
            wrong.append(f"case {case}: file {k}: took {time.process_time() - start:.1f} s")
    return wrong


def test_4000_cuts_and_flips(tmp_path: Path) -> None:
    files = samples(tmp_path / "x.mcap")
    assert fuzz(4000, 1, files, tmp_path / "x.mcap") == []


@pytest.mark.slow
def test_40000_cuts_and_flips(tmp_path: Path, shared: Path) -> None:
    files = [path.read_bytes() for path in sorted((shared / "mcap_conformance").rglob("*.mcap"))]
    files += 40 * samples(tmp_path / "x.mcap")
    before = peak()  # of the tests before this one
    assert fuzz(40_000, 2, files, tmp_path / "x.mcap") == []
    assert peak() - before < MAX_BYTES


COUNT = 6000


def speeds(path: Path) -> tuple[int, list[str]]:
    """How many messages /speed has, checked by their values, and what was lost."""
    with LogReader(path) as log:
        found = log.read(["/speed"])["/speed"]
        values = found.columns["v"]
        np.testing.assert_array_equal(found.time, EPOCH_NS + values.astype(np.int64))
        return len(found), log.losses


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    path = tmp_path / "x.mcap"
    foreign(path, COUNT, chunk_size=20_000)
    return path


def test_cut_in_the_middle(drive: Path) -> None:
    data = drive.read_bytes()
    drive.write_bytes(data[: len(data) * 6 // 10])
    count, losses = speeds(drive)
    assert COUNT // 2 < count < COUNT
    assert "cut short" in losses[0]


@pytest.mark.parametrize("index_types", [IndexType.ALL, IndexType.NONE])
def test_cut_between_two_records(drive: Path, index_types: IndexType) -> None:
    """Nothing is half there, so only what is missing at the end shows it."""
    whole = 600
    foreign(drive, whole, chunk_size=8_000, index_types=index_types)
    data = drive.read_bytes()
    ends = [at.end for at in container.outer_records(container.ByteSource(drive))]
    assert len(ends) > 10
    for end in ends[:-1]:
        drive.write_bytes(data[:end])
        try:
            count, losses = speeds(drive)
        except (MissingSignalError, LogReadError):
            assert end <= ends[2]  # before the first chunk
            continue
        assert count == whole or "the end of the file is missing" in losses[0]
        assert losses  # exit code 3


def test_cut_in_the_summary(drive: Path) -> None:
    drive.write_bytes(drive.read_bytes()[:-100])
    count, losses = speeds(drive)
    assert (count, len(losses)) == (COUNT, 1)
    assert "summary" in losses[0]


def test_wrong_summary_crc(drive: Path) -> None:
    data = bytearray(drive.read_bytes())
    data[-len(records.MAGIC) - 1] ^= 1
    drive.write_bytes(data)
    count, losses = speeds(drive)
    assert (count, len(losses)) == (COUNT, 1)
    assert "summary is damaged (wrong CRC)" in losses[0]


@pytest.mark.parametrize("hide", [False, True])
def test_changed_metadata_of_others_is_said(drive: Path, hide: bool) -> None:
    """It is under the CRC of the data only, which another flip may hide."""
    foreign(drive, 30, enable_data_crcs=True)
    data = bytearray(drive.read_bytes())
    data[data.index(b"driver")] ^= 0x20
    if hide:
        data[int.from_bytes(data[-28:-20], "little") - 6] ^= 4  # the length of DataEnd
    drive.write_bytes(data)
    with LogReader(drive) as log:
        (loss,) = log.losses
    assert ("it is damaged: the record at byte" if hide else "wrong CRC") in loss


def test_corrupt_chunk_is_skipped_and_its_times_are_said(drive: Path) -> None:
    with LogReader(drive) as log:
        chunk = log.contents.chunks[1]
        data = container.load(log.source, chunk)
        inside = len(container.messages(log.source, chunk, data)[1])
    changed = bytearray(drive.read_bytes())
    changed[chunk.offset + chunk.length - 20] ^= 0x40
    drive.write_bytes(changed)
    count, (loss,) = speeds(drive)
    assert count == COUNT - inside
    first = np.datetime64(chunk.start_ns, "ns")
    assert (
        f"({first} to {np.datetime64(chunk.end_ns, 'ns')} UTC) is damaged and was skipped" in loss
    )
    with (
        pytest.raises(LogReadError, match=r"x\.mcap: the chunk at byte"),
        LogReader(drive, strict=True) as log,
    ):
        log.read()


@pytest.mark.parametrize(
    "options",
    [
        {"use_chunking": False},
        {"index_types": IndexType.NONE},
        {"index_types": IndexType.ALL & ~IndexType.CHUNK},
        {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
        {"repeat_channels": False},
        {"use_statistics": False},
        {"use_summary_offsets": False},
    ],
    ids=str,
)
def test_a_file_without_some_index_is_read_whole(drive: Path, options: dict[str, object]) -> None:
    foreign(drive, COUNT, **options)
    assert speeds(drive) == (COUNT, [])


def test_footer_without_summary(drive: Path) -> None:
    data = drive.read_bytes()
    start = int.from_bytes(data[-28:-20], "little")
    footer = records.record(records.FOOTER, bytes(20)) + records.MAGIC
    drive.write_bytes(data[:start] + footer)
    assert speeds(drive) == (COUNT, [])


def two_channels(path: Path, schema_of_second: str) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for k, name in enumerate(("roadlog.v1.Speed", schema_of_second)):
            schema = writer.register_schema(name, "protobuf", schemas.descriptor_set(name))
            channel = writer.register_channel("/speed", "protobuf", schema, {"k": str(k)})
            for j in range(20 - k):
                payload = b"\x09" + np.float64(2 * j + k).tobytes()
                writer.add_message(channel, EPOCH_NS + 2 * j + k, payload, 0)
        writer.finish()


def test_two_channels_on_a_topic(drive: Path) -> None:
    two_channels(drive, "roadlog.v1.Speed")
    assert speeds(drive) == (39, [])
    two_channels(drive, "roadlog.v1.Barometer")
    with LogReader(drive) as log:
        assert [c.schema for c in log.channels] == ["roadlog.v1.Speed", "roadlog.v1.Barometer"]
    count, (loss,) = speeds(drive)
    assert count == 20
    assert "/speed: 2 channels of different schemas; 19 messages" in loss


def test_channel_without_schema_has_times_and_no_columns(drive: Path) -> None:
    with LogReader(drive) as log:
        raw = log.read()["/raw"]
        assert (len(raw), dict(raw.columns), log.losses) == (COUNT, {}, [])
        log.read(["/raw"])
        assert "times but no columns: 'bytes' with schema '' is not understood" in log.losses[0]


def test_times_that_jump_back_are_put_in_order_and_equal_ones_stay(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    stamps = EPOCH_NS + np.array([5, 5, 1, 9, 1, 5])
    write_log(path, [table("speed", stamps, {"v": np.arange(6.0)})], {})
    with LogReader(path) as log:
        found = log.read()["/speed"]
    assert (found.time - EPOCH_NS).tolist() == [1, 1, 5, 5, 5, 9]
    assert found.columns["v"].tolist() == [2, 4, 0, 1, 5, 3]


def test_one_payload_that_cannot_be_decoded(drive: Path) -> None:
    with drive.open("wb") as file:
        writer = Writer(file)
        writer.start()
        name = "roadlog.v1.Speed"
        schema = writer.register_schema(name, "protobuf", schemas.descriptor_set(name))
        channel = writer.register_channel("/speed", "protobuf", schema)
        for k in range(20):
            payload = b"\x09" + np.float64(k).tobytes()
            writer.add_message(channel, EPOCH_NS + k, payload[:5] if k == 7 else payload, 0)
        writer.finish()
    with LogReader(drive) as log:
        values = log.read()["/speed"].columns["v"]
        assert log.losses == ["/speed: 1 of 20 messages cannot be decoded"]
    np.testing.assert_array_equal(values, [np.nan if k == 7 else k for k in range(20)])


def with_summary(
    data: bytes, chunk: Mapping[str, object], statistics: Mapping[str, object]
) -> bytes:
    """A file with another summary, whole and under its CRC: these fields are changed."""
    start = int.from_bytes(data[-28:-20], "little")
    summary = b""
    for at in container.inner_records(data, start, len(data) - 37):
        content = data[at.offset + 9 : at.end]
        if at.opcode == records.CHUNK_INDEX:
            summary += records.Chunk.parse(content)._replace(**chunk).pack()  # type: ignore[arg-type]
        elif at.opcode == records.STATISTICS:
            found = records.Statistics.parse(content)
            summary += replace(found, **statistics).pack()  # type: ignore[arg-type]
        elif at.opcode != records.SUMMARY_OFFSET:
            summary += data[at.offset : at.end]
    summary += records.PREFIX.pack(records.FOOTER, 20) + struct.pack("<QQ", start, 0)
    return data[:start] + summary + struct.pack("<I", records.crc32(summary)) + records.MAGIC


def test_a_summary_that_lies(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    write_log(path, [table("speed", EPOCH_NS + np.arange(50), {"v": np.arange(50.0)})], {})
    data = path.read_bytes()
    many = 1 << 40
    length = 15 + records.INDEX_ENTRY * many
    path.write_bytes(
        with_summary(
            data,
            {"indexes_length": length, "size": 1 << 60},
            {"messages": many, "counts": {1: many}},
        )
    )
    with LogReader(path) as log:  # all of them are found without it
        assert log.read()["/speed"].columns["v"].tolist() == list(range(50))
        assert log.losses == []
    for chunk in ({"length": 3}, {"offset": 1 << 62}, {"compression": "lz4"}, {"indexes": {1: 0}}):
        path.write_bytes(with_summary(data, chunk, {}))
        with LogReader(path) as log:
            count = len(log.read()["/speed"])
            assert (count, len(log.losses)) in ((50, 0), (0, 1)), chunk


@pytest.mark.parametrize("size", [1 << 62, container.MAX_CHUNK - 1])
@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
def test_declared_sizes_are_not_believed(tmp_path: Path, size: int, compression: str) -> None:
    """A chunk of a few bytes that says it is huge."""
    path = tmp_path / "x.mcap"
    write_log(path, hill_tables(0.1), {}, compression=compression or "none")
    with LogReader(path) as log:
        chunk = log.contents.chunks[0]
    data = bytearray(path.read_bytes())
    data[chunk.offset + 25 : chunk.offset + 33] = size.to_bytes(8, "little")
    path.write_bytes(data[:-50])  # the chunk's own word counts, since the summary is gone
    before = peak()
    with LogReader(path) as log:
        log.read()
        assert any("is damaged and was skipped" in loss for loss in log.losses)
    assert peak() - before < MAX_BYTES // 4
