"""Logs on which roadlog once failed, made by their own scripts beside the project."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.drives import SHARED
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.ingest import IngestResult, ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.log import DriveLog
from roadlog.summary import summarize

CASES = SHARED.parent / "cases" / "ros"


@pytest.fixture
def case(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    name = request.node.name.removeprefix("test_")
    if not (CASES / name).is_dir():
        pytest.skip(f"cases: ../shared/cases/ros/{name} is missing")
    shutil.copy(CASES / "drive.py", tmp_path)
    folder = Path(shutil.copytree(CASES / name, tmp_path / name))
    subprocess.run([sys.executable, "make.py"], cwd=folder, check=True)
    return folder


def columns(result: IngestResult, topic: str) -> dict[str, np.ndarray]:
    return next(dict(t.columns) for t in result.tables if t.topic == topic)


def test_imu_speed_mixup(case):
    text = starter([case / "drive.mcap"])
    assert 'v = { from = "/vehicle/twist.twist.linear.x", unit = "m/s" }' in text
    assert 'gyro_x = { from = "/imu/data.angular_velocity.x", unit = "rad/s" }' in text


def test_integer_gnss(case):
    (case / "p.toml").write_text(starter([case / "drive.mcap"]))
    gnss = columns(ingest([case / "drive.mcap"], case / "p.toml"), "/gnss")
    assert np.abs(gnss["latitude"] - 10).max() < 0.1
    assert np.abs(gnss["altitude"] - 300).max() < 100
    assert gnss["speed"].max() < 20
    assert "mount" not in (case / "p.toml").read_text()


def test_wheel_rad_per_s(case):
    for name in ("pacmod", "dbw"):
        text = starter([case / f"{name}.mcap"])
        scales = [float(scale) for scale in re.findall(r'"m/s", scale = ([\d.]+)', text)]
        assert scales == pytest.approx([0.31] * 4, rel=0.01)  # its positions are of a sphere
        wheels = columns(ingest([case / f"{name}.mcap"]), "/wheel_speeds")
        assert np.abs(wheels["rr"]).max() == pytest.approx(17, abs=0.2)


def test_two_odometries(case):
    assert "# or: /wheel/odom.twist.linear.x" in starter([case / "drive.mcap"])


def test_joint_states(case):
    for source in (case / "bag", case / "bag" / "bag_0.mcap"):
        speeds = columns(ingest([source], case / "wheels.toml"), "/wheel_speeds")["fl"]
        assert speeds.min() == pytest.approx(7, abs=0.01)


def test_ros1_in_mcap(case):
    result = ingest([case / "drive.mcap"])
    assert len(columns(result, "/speed")["v"]) == 1500
    assert "speed.v" in {m.role for m in result.mapped}


def test_schema_text_differs(case):
    result = ingest([case / "drive.mcap"])
    assert not result.losses
    assert len(columns(result, "/speed")["v"]) == 3000


def test_time_zero(case):
    summary = summarize(DriveLog(case / "drive.mcap", "ros"))
    assert summary.duration == pytest.approx(59.98)


def test_bag_active(case):
    for name in ("drive.bag.active", "drive.bag"):
        result = ingest([case / name])
        assert 300 < len(columns(result, "/speed")["v"]) < 335
        assert any("cut off" in loss for loss in result.losses)


def test_header_clock_partly(case):
    made = [ingest([case / place], case / "p.toml") for place in ("bag", "bag/bag_0.mcap")]
    for one, other in zip(made[0].tables, made[1].tables, strict=True):
        np.testing.assert_array_equal(one.time, other.time)
    assert all(any("two clocks are mixed" in loss for loss in one.losses) for one in made)


def test_inplace_breaks_bag(case):
    """The bag stays as it was; results go beside it, and as ROS 2 messages into it."""
    from rosbags.highlevel import AnyReader

    def run(*words: object) -> None:
        done = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert done.exit_code == 0, done.output

    def read_whole() -> tuple[int, list[np.ndarray]]:
        with AnyReader([case / "bag"]) as reader:
            count = sum(1 for c, _, raw in reader.messages() if reader.deserialize(raw, c.msgtype))
        return count, [t.time for t in ingest([case / "bag"]).tables]

    before, part = read_whole(), case / "bag" / "bag_0.mcap"
    content = part.read_bytes()
    run("estimate", part, "-e", "kmbe")
    assert part.read_bytes() == content
    assert read_whole()[0] == before[0]
    run("estimate", part, "-e", "kmbe", "--as", "ros2", "--in-place-anyway")
    after = read_whole()
    assert after[0] > before[0]
    for one, other in zip(before[1], after[1], strict=True):
        np.testing.assert_array_equal(one, other)
