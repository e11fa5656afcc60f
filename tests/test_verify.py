"""The second reading of a log agrees with ours, and says where it does not."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, timestamp_pb2
from mcap.writer import Writer
from support.drives import ROOT
from support.protobuf_values import message_class
from support.results import put, result
from support.ros_messages import ROS2, leaves, random_message, write_mcap
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.verify import verify

pytest.importorskip("mcap_protobuf")
SAMPLES = sorted((ROOT / "sample_logs").glob("*.mcap"))


@pytest.mark.parametrize("log", SAMPLES[:1], ids=lambda log: log.name)
def test_a_sample_log(log: Path) -> None:
    found = verify(log)
    assert not found.differences
    assert sum(topic.values for topic in found.topics) > 100_000


@pytest.mark.slow
@pytest.mark.parametrize("log", SAMPLES[1:], ids=lambda log: log.name)
def test_every_sample_log(log: Path) -> None:
    assert not verify(log).differences


def test_the_conformance_set_of_the_mcap_project(shared: Path) -> None:
    logs = sorted((shared / "mcap_conformance").rglob("*.mcap"))
    assert len(logs) == 416
    assert [log.name for log in logs if verify(log).differences] == []


def test_a_log_with_results(hill_log: Path) -> None:
    put(hill_log, result(500))
    before = hill_log.read_bytes()
    done = CliRunner().invoke(app, ["verify", str(hill_log)])
    assert (done.exit_code, hill_log.read_bytes()) == (0, before)
    assert "both readings are the same" in done.output


def test_a_damaged_log_differs(hill_log: Path) -> None:
    content = bytearray(hill_log.read_bytes())
    content[len(content) // 2] ^= 1
    hill_log.write_bytes(content)
    assert CliRunner().invoke(app, ["verify", str(hill_log)]).exit_code == 3


@pytest.mark.parametrize("name", ["JointState", "MultiDOFJointState", "BatteryState", "Joy"])
def test_elements_of_lists_are_compared_too(tmp_path: Path, name: str) -> None:
    """Of various lengths, by number and by name."""
    pytest.importorskip("mcap_ros2")
    type_, chance = f"sensor_msgs/msg/{name}", np.random.default_rng(3)
    text, _ = ROS2.generate_msgdef(type_, ros_version=2)
    messages = [random_message(ROS2, type_, chance) for _ in range(20)]
    payloads = [ROS2.serialize_cdr(message, type_) for message in messages]
    log = write_mcap(tmp_path / "x.mcap", "cdr", (type_, "ros2msg", text.encode()), payloads)
    found = verify(log)
    assert not found.differences
    (topic,) = found.topics
    assert not topic.left_out
    assert topic.values > 20 * len(list(leaves(messages[0])))


def test_elements_of_lists_in_protobuf(tmp_path: Path) -> None:
    types = {"Wheel": "string name, double speed, repeated sint32 ticks", "Car": "repeated Wheel w"}
    car = message_class(types, "Car")
    messages = [car(w=[{"name": f"n{j}", "speed": j, "ticks": [-j] * j} for j in range(k)])
                for k in range(5)]  # fmt: skip
    files = descriptor_pb2.FileDescriptorSet()
    for file in (timestamp_pb2.DESCRIPTOR, car.DESCRIPTOR.file):
        file.CopyToProto(files.file.add())
    schema = ("t.Car", "protobuf", files.SerializeToString())
    payloads = [message.SerializeToString() for message in messages]
    found = verify(write_mcap(tmp_path / "x.mcap", "protobuf", schema, payloads))
    assert not found.differences
    assert not found.topics[0].left_out
    assert found.topics[0].values == 5 * 2 * (4 + 1 + 2 + 3)


def test_what_the_witness_cannot_decode_is_not_called_different(tmp_path: Path) -> None:
    """mcap-ros2-support 0.6.0 decodes XCDR 2 by the rules of XCDR 1: its values are no witness."""
    pytest.importorskip("mcap_ros2")
    log = tmp_path / "xcdr2.mcap"
    writer = Writer(str(log))
    writer.start()
    text = b"float32 speed\nfloat32 yaw_rate\n"
    schema = writer.register_schema("car/msg/Motion", "ros2msg", text)
    channels = [writer.register_channel(topic, "cdr", schema) for topic in ("/first", "/second")]
    motion = struct.pack("<ff", 20.0, 0.5)
    bodies = [b"\0\1\0\0" + motion, b"\0\x09\0\0" + struct.pack("<I", len(motion)) + motion]
    for channel, body in zip(channels, bodies, strict=True):
        writer.add_message(channel, 10**9, body, 10**9)
    writer.finish()
    found = verify(log)
    assert not found.differences
    compared = {t.topic: (t.values, t.left_out) for t in found.topics}
    assert compared == {"/first": (2, ()), "/second": (0, ("speed", "yaw_rate"))}
