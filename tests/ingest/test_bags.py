"""Bags in every state in which recorders leave them, read as rosbags reads the whole ones."""

from __future__ import annotations

import sqlite3
import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
import zstandard
from support.drive_formats import IMU, SPEED, TIME, write_ros1, write_ros2

from roadlog.errors import RoadlogError
from roadlog.ingest import ingest

rosbags = pytest.importorskip("rosbags")


def check(path: Path, count: int = len(TIME)) -> None:
    """The first `count` messages of the drive came through."""
    tables = {table.topic: table for table in ingest([path]).tables}
    np.testing.assert_array_equal(tables["/imu"].time, TIME[:count])
    for name, values in IMU.items():
        np.testing.assert_array_equal(tables["/imu"].columns[name], values[:count])
    np.testing.assert_array_equal(tables["/speed"].columns["v"], SPEED[: -(-count // 5)])


@pytest.mark.parametrize("compression", ["none", "BZ2", "LZ4"])
def test_ros1_bag(tmp_path, compression):
    check(write_ros1(tmp_path / "drive.bag", compression))


def test_ros1_bag_that_is_still_recorded_and_cut(tmp_path):
    whole = write_ros1(tmp_path / "drive.bag", chunk=4096).read_bytes()
    place = whole.index(b"index_pos=") + len(b"index_pos=")
    active = tmp_path / "drive.bag.active"
    active.write_bytes(whole[:place] + bytes(8) + whole[place + 8 :])
    check(active)
    active.write_bytes(active.read_bytes()[: len(whole) // 2])
    result = ingest([active])
    rows = len(next(table for table in result.tables if table.topic == "/imu"))
    assert 0.3 * len(TIME) < rows < 0.6 * len(TIME)
    assert any("it is cut off at byte" in x and "before are kept" in x for x in result.losses)
    check(active, rows)


def test_ros1_bag_whose_index_is_not_that_of_its_chunk(tmp_path):
    """Where an index does not fit, the records themselves are gone through."""
    bag = bytearray(write_ros1(tmp_path / "drive.bag", chunk=4096).read_bytes())
    place = len(b"#ROSBAG V2.0\n")
    while True:  # header and data of each record, after their lengths
        head = int.from_bytes(bag[place : place + 4], "little")
        data = place + 8 + head
        if b"op=\x04" in bag[place : place + 4 + head]:
            break
        place = data + int.from_bytes(bag[data - 4 : data], "little")
    bag[data + 8 : data + 12] = (7).to_bytes(4, "little")  # behind the time of the first entry
    (tmp_path / "false.bag").write_bytes(bytes(bag))
    check(tmp_path / "false.bag")


def test_a_damaged_ros1_bag_is_one_error_or_read(tmp_path):
    whole = write_ros1(tmp_path / "drive.bag", chunk=4096).read_bytes()
    chance = np.random.default_rng(5)
    path = tmp_path / "hurt.bag"
    for _ in range(10):
        hurt = bytearray(whole)
        for place in chance.integers(13, len(whole), 3).tolist():
            hurt[place] = int(chance.integers(256))
        path.write_bytes(bytes(hurt[: int(chance.integers(len(whole) // 2, len(whole)))]))
        with suppress(RoadlogError):
            ingest([path])


def test_ros1_bag_of_version_1_2(tmp_path):
    """As rosbag wrote it until 2010: no chunks, and the topic in each message's header."""

    def record(fields: dict[str, bytes], data: bytes) -> bytes:
        parts = [name.encode() + b"=" + value for name, value in fields.items()]
        head = b"".join(struct.pack("<I", len(part)) + part for part in parts)
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    names = {"topic": b"/speed_report", "md5": b"*", "type": b"my_msgs/Speed"}
    text = b"float64 speed # m/s\nuint32 rolling"
    bag = [b"#ROSBAG V1.2\n", record({"op": b"\x03", "index_pos": bytes(8)}, b"")]
    bag.append(record({"op": b"\x01", **names, "def": text}, b""))
    for k, ns in enumerate(TIME.tolist()):
        stamp = {"sec": struct.pack("<I", ns // 10**9), "nsec": struct.pack("<I", ns % 10**9)}
        payload = struct.pack("<dI", 0.5 * k, k)
        bag.append(record({"op": b"\x02", **names, **stamp, "latching": b"0"}, payload))
    (tmp_path / "old.bag").write_bytes(b"".join(bag))
    (tmp_path / "p.toml").write_text('[speed]\nv = { from = "speed", unit = "m/s" }\n')
    (table,) = ingest([tmp_path / "old.bag"], tmp_path / "p.toml").tables
    np.testing.assert_array_equal(table.time, TIME)
    np.testing.assert_array_equal(table.columns["v"], 0.5 * np.arange(len(TIME)))


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
@pytest.mark.parametrize("mode", ["NONE", "FILE", "MESSAGE"])
def test_ros2_bag(tmp_path, storage, mode):
    if storage == "MCAP" and mode != "NONE":
        pytest.skip("rosbags writes no such bag")
    bag = write_ros2(tmp_path / "drive", storage, mode=mode)
    check(bag)
    (part,) = [p for p in bag.iterdir() if p.name != "metadata.yaml"]
    (bag / "metadata.yaml").unlink()
    check(part)  # alone


def test_mcap_part_that_was_compressed_as_a_file(tmp_path):
    bag = write_ros2(tmp_path / "drive", "MCAP")
    (part,) = bag.glob("*.mcap")
    packed = part.with_name(part.name + ".zstd")
    packed.write_bytes(zstandard.ZstdCompressor().compress(part.read_bytes()))
    part.unlink()
    check(bag)


def test_what_lies_in_the_wal_of_a_recorder_that_was_killed(tmp_path):
    bag = write_ros2(tmp_path / "drive", "SQLITE3")
    (part,) = bag.glob("*.db3")
    with sqlite3.connect(part) as database:
        rows = database.execute("SELECT * FROM messages ORDER BY timestamp").fetchall()
        database.execute("DELETE FROM messages WHERE timestamp >= ?", [int(TIME[200])])
    database.close()
    writer = sqlite3.connect(part, isolation_level=None)
    writer.execute("PRAGMA journal_mode=WAL")
    writer.execute("PRAGMA wal_autocheckpoint=0")
    late = [row for row in rows if row[2] >= int(TIME[200])]
    writer.executemany(f"INSERT INTO messages VALUES ({','.join('?' * len(late[0]))})", late)
    killed = tmp_path / "killed"
    killed.mkdir()
    for file in (part, part.with_name(part.name + "-wal")):
        (killed / file.name).write_bytes(file.read_bytes())
    writer.close()
    before = {p.name: p.read_bytes() for p in killed.iterdir()}
    check(killed / part.name)
    assert {p.name: p.read_bytes() for p in killed.iterdir()} == before


def test_a_split_bag_with_a_part_missing_is_read_and_said(tmp_path):
    bag = write_ros2(tmp_path / "drive", "SQLITE3")
    (part,) = bag.glob("*.db3")
    with sqlite3.connect(part) as database:
        database.execute("PRAGMA journal_mode=DELETE")
    database.close()
    second = part.with_name("drive_1.db3")
    second.write_bytes(part.read_bytes())
    for file, sign in ((part, ">="), (second, "<")):
        with sqlite3.connect(file) as database:
            database.execute(f"DELETE FROM messages WHERE timestamp {sign} ?", [int(TIME[200])])
        database.close()
    text = (bag / "metadata.yaml").read_text()
    lines = [f"  - {name}" for name in (part.name, second.name, "drive_2.db3")]
    (bag / "metadata.yaml").write_text(text + "\n".join(["", *lines, ""]))
    check(bag)
    assert "drive: its part drive_2.db3 is missing" in ingest([bag]).losses
