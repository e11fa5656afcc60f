"""The second reading of a log agrees with ours, and says where it does not."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from mcap.writer import Writer
from support.drives import ROOT
from support.results import put, result
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.verify import verify

pytest.importorskip("mcap_protobuf")
SAMPLES = sorted((ROOT / "sample_logs").glob("*.mcap"))
CONFORMANCE = ROOT.parent / "shared" / "data" / "mcap_conformance"


@pytest.mark.parametrize("log", SAMPLES[:1], ids=lambda log: log.name)
def test_a_sample_log(log: Path) -> None:
    found = verify(log)
    assert not found.differences
    assert sum(topic.values for topic in found.topics) > 100_000


@pytest.mark.slow
@pytest.mark.parametrize("log", SAMPLES[1:], ids=lambda log: log.name)
def test_every_sample_log(log: Path) -> None:
    assert not verify(log).differences


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
