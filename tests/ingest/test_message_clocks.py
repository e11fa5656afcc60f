"""Stamps of messages: of recording, of the message, none, or one that cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from support.vehicle_messages import ACCEL, TIME, V, message, stores

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


def record(path: Path, own: np.ndarray = TIME, stray: int | None = None) -> Path:
    """An Imu with a header and a Float64 without; a latched message at `stray`. own: stamps."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channels = {}
        for topic, name in (("/imu", "sensor_msgs/msg/Imu"), ("/speed", "std_msgs/msg/Float64")):
            text, _ = STORE.generate_msgdef(name, ros_version=2)
            number = writer.register_schema(name, "ros2msg", text.encode())
            channels[topic] = name, writer.register_channel(topic, "cdr", number)
        if stray is not None:
            latched = writer.register_channel("/tf_static", "json", 0)
            writer.add_message(latched, stray, b'{"x": 1.0}', stray)
        for k, ns in enumerate(TIME.tolist()):
            for topic, values in (
                ("/imu", {"linear_acceleration": dict(zip("xyz", ACCEL[:, k], strict=True))}),
                ("/speed", {"data": V[k]}),
            ):
                name, channel = channels[topic]
                made = message(STORE, name, values, int(own[k]))
                payload = bytes(STORE.serialize_cdr(made, name))
                writer.add_message(channel, ns + LATE, payload, ns + LATE)
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
