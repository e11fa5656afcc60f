"""Stamps of messages: of recording, of the message, none, or one that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from support.vehicle_messages import ACCEL, TIME, V, message, stores

from roadlog.errors import ConfigError
from roadlog.ingest import ingest
from roadlog.log import DriveLog
from roadlog.summary import summarize

LATE = 400_000_000  # ns from a message's own stamp to its recording
STORE = stores()[2]
HEADER = """[time]
clock = "header"
[imu]
accel_x = { from = "/imu.linear_acceleration.x", unit = "m/s^2" }
[speed]
v = { from = "/speed.data", unit = "m/s" }
"""


def record(
    path: Path,
    own: np.ndarray = TIME,
    stray: int | None = None,
    recorded: np.ndarray = TIME + LATE,
    second: str = "std_msgs/msg/Float64",
) -> Path:
    """An Imu with a header and a Float64 without; a latched message at `stray`.

    own, recorded: stamps. second: of which type the second topic is, with a header or none.
    """
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channels = {}
        for topic, name in (("/imu", "sensor_msgs/msg/Imu"), ("/speed", second)):
            text, _ = STORE.generate_msgdef(name, ros_version=2)
            number = writer.register_schema(name, "ros2msg", text.encode())
            channels[topic] = name, writer.register_channel(topic, "cdr", number)
        if stray is not None:
            latched = writer.register_channel("/tf_static", "json", 0)
            writer.add_message(latched, stray, b'{"x": 1.0}', stray)
        for k, ns in enumerate(recorded.tolist()):
            for topic, values in (
                ("/imu", {"linear_acceleration": dict(zip("xyz", ACCEL[:, k], strict=True))}),
                ("/speed", {"data": V[k], "twist": {"linear": {"x": V[k], "y": 0.0, "z": 0.0}}}),
            ):
                name, channel = channels[topic]
                made = message(STORE, name, values, int(own[k]))
                payload = bytes(STORE.serialize_cdr(made, name))
                writer.add_message(channel, ns, payload, ns)
        writer.finish()
    return path


def test_a_topic_without_header_keeps_the_recordings_clock_and_that_is_said(tmp_path):
    bag = tmp_path / "bag"
    bag.mkdir()
    record(bag / "bag_0.mcap")
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n  version: 5\n")
    (tmp_path / "p.toml").write_text(HEADER)
    for source in (bag, bag / "bag_0.mcap"):
        result = ingest([source], tmp_path / "p.toml")
        tables = {table.topic: table for table in result.tables}
        np.testing.assert_array_equal(tables["/imu"].time, TIME)
        np.testing.assert_array_equal(tables["/speed"].time, TIME + LATE)
        (loss,) = result.losses
        assert "/speed: its messages have no such stamp" in loss
        assert "on /imu it is +0.400 s later" in loss


def test_stamps_that_nobody_filled_in_are_left_out_and_counted(tmp_path):
    own = TIME.copy()
    own[10:13] = 0
    (tmp_path / "p.toml").write_text(HEADER.partition("[speed]")[0])
    result = ingest([record(tmp_path / "x.mcap", own)], tmp_path / "p.toml")
    assert len(result.tables[0]) == len(TIME) - 3
    assert result.losses == ["x.mcap: /imu: 3 messages without a time left out"]


def test_a_single_wrong_stamp_is_left_out_and_named(tmp_path):
    own = TIME.copy()
    own[100] = 4_000_000_000 * 10**9 // 2
    (tmp_path / "p.toml").write_text(HEADER.partition("[speed]")[0])
    result = ingest([record(tmp_path / "x.mcap", own)], tmp_path / "p.toml")
    np.testing.assert_array_equal(result.tables[0].time, np.delete(TIME, 100))
    (loss,) = result.losses
    assert "/imu: 1 message stamped 2033-05-18 03:33:20, far from the recording" in loss


@pytest.mark.parametrize("stray", [0, 4 * 10**18])
def test_a_latched_message_of_another_time_does_not_stretch_the_drive(tmp_path, stray):
    path = record(tmp_path / "x.mcap", stray=stray)
    summary = summarize(DriveLog(path))
    assert summary.duration == pytest.approx((TIME[-1] - TIME[0]) * 1e-9)
    (found,) = [finding for finding in summary.checks if finding.check == "stray_stamps"]
    assert found.signals == ("/tf_static",)
    assert DriveLog(path).drive().time[-1] == pytest.approx(summary.duration)


S = 10**9
TWIST = "geometry_msgs/msg/TwistStamped"


def changed(rows: slice | int, by: int, stamps: np.ndarray = TIME) -> np.ndarray:
    """Stamps of which some are wrong. by: ns."""
    found = stamps.copy()
    found[rows] += by
    return found


def repeated(rows: slice) -> np.ndarray:
    found = TIME.copy()
    found[rows] = found[rows.start]
    return found


# name -> clock, stamps and times of recording, messages that are left out, what is said of them
FALSE = {
    "single, 5 s ahead": (
        "header", changed(300, 5 * S), TIME, 1,
        "1 message at 2023-11-14 22:13:37 left out, the clock runs backward there by 5.0 s; "
        "--clock log keeps them",
    ),
    "single, 5 s behind": ("header", changed(300, -5 * S), TIME, 1, "runs backward there by 5.0 s"),
    "set back by 3 s": ("header", changed(slice(700, None), -3 * S), TIME, 75, "--clock log"),
    "repeated": ("header", repeated(slice(300, 320)), TIME, 19, "that repeat a stamp"),
    "for a while a year ago": (
        "header", changed(slice(100), -365 * 86400 * S), TIME, 100,
        "100 messages stamped 2022-11-14 22:13:20, far from the recording, left out; --clock log",
    ),
    "recorded 5 s behind": ("log", TIME, changed(300, -5 * S), 1, "--clock header keeps them"),
    "recorded at the epoch": ("log", TIME, changed(300, -int(TIME[300])), 1, "--clock header"),
    "recorder set back": ("log", TIME, changed(slice(700, None), -3 * S), 75, "--clock header"),
    "recorder's burst": ("log", TIME, repeated(slice(300, 320)), 19, "--clock header"),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_false_stamps_are_left_out_counted_and_the_cure_works(tmp_path, name):
    clock, own, recorded, lost, said = FALSE[name]
    path = record(tmp_path / "x.mcap", own, recorded=recorded, second=TWIST)
    cure = {"header": "log", "log": "header"}[clock]
    for used, count in ((clock, lost), (cure, 0)):
        with DriveLog(path, clock=used) as log:
            summary = summarize(log)
            assert summary.duration == pytest.approx(60, abs=4.1)
            table = log.tables(["/imu"])["/imu"]
            assert len(table) == len(TIME) - count
            assert (np.diff(table.time) > 0).all()
            text = " ".join(log.losses)
            assert (said in text) == bool(count), text
            assert log.drive().time[-1] == pytest.approx(60, abs=4.1)


@pytest.mark.parametrize("offset", [-int(TIME[0]) + 100 * S, 7200 * S])
def test_a_clock_of_another_moment_is_put_on_that_of_the_recording(tmp_path, offset):
    """Since the boot of the sensor; a host that is two hours wrong. Headers only on one topic."""
    path = record(tmp_path / "x.mcap", changed(slice(None), offset))
    result = ingest([path], tmp_path / _profile(tmp_path), clock="header")
    tables = {table.topic: table for table in result.tables}
    np.testing.assert_array_equal(tables["/imu"].time, tables["/speed"].time)
    assert any("count from another moment" in note for note in result.notes)
    assert DriveLog(path, tmp_path / "p.toml").drive().time[-1] == pytest.approx(59.96)


def _profile(folder: Path) -> str:
    (folder / "p.toml").write_text(HEADER)
    return "p.toml"


def test_neighbors_that_changed_places_are_put_in_order(tmp_path):
    own = TIME.copy()
    own[[300, 301]] = own[[301, 300]]
    path = record(tmp_path / "x.mcap", own, second=TWIST)
    table = DriveLog(path, clock="header").tables(["/imu"])["/imu"]
    np.testing.assert_array_equal(DriveLog(path, clock="header")._mapped["/imu"].time, TIME)
    assert len(table) == len(TIME)


def test_a_message_that_is_there_twice_is_no_loss(tmp_path):
    from mcap.reader import make_reader

    once = record(tmp_path / "x.mcap", second=TWIST)
    with once.open("rb") as source, (tmp_path / "y.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for k, (schema, channel, message_) in enumerate(make_reader(source).iter_messages()):
            if channel.topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", number)
            for _ in range(1 + (k % 50 == 0)):
                ns = message_.log_time
                writer.add_message(channels[channel.topic], ns, message_.data, ns)
        writer.finish()
    result = ingest([tmp_path / "y.mcap"], clock="header")
    assert not result.losses
    assert len(result.tables[0]) == len(TIME)
    assert any("repeat the one before" in note for note in result.notes)


def test_the_clock_that_was_asked_for_stays_with_the_results(tmp_path):
    path = record(tmp_path / "x.mcap", second=TWIST)
    with DriveLog(path, clock="header") as log:
        log.write([log.estimate("kmbe")])
    with DriveLog(path) as log:
        assert log.drive_start_ns == TIME[0]
        assert log.stored("kmbe").start == TIME[0]


def test_a_clock_that_is_not_there(tmp_path, hill_log):
    with pytest.raises(ConfigError, match="has one clock only"):
        DriveLog(hill_log, clock="header").drive()
    (tmp_path / "x.csv").write_text("t,v\n0,1\n1,2\n")
    with pytest.raises(ConfigError, match="only messages of a bag or MCAP"):
        ingest([tmp_path / "x.csv"], _roadlog_profile(tmp_path), clock="log")


def _roadlog_profile(folder: Path) -> Path:
    path = folder / "t.toml"
    path.write_text('[time]\ncolumn = "t"\nunit = "s"\n[speed]\nv = { from = "v", unit = "m/s" }\n')
    return path
