"""Results for a third-party log: beside it by default, as ROS 2 messages where it is a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from support.drives import table
from support.vehicle_messages import GRADE, IMU, TIME, T, V, write
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.log import DriveLog, create

NAMES = ["imu", "twist", "inspva"]


def run(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.output


def messages(path: Path) -> dict[str, list[tuple[int, bytes]]]:
    found: dict[str, list[tuple[int, bytes]]] = {}
    with path.open("rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            found.setdefault(channel.topic, []).append((message.log_time, message.data))
    return found


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """The MCAP part of a ROS 2 bag."""
    (part,) = write(tmp_path / "bag", NAMES, "ros2").glob("*.mcap")
    return part


def test_results_go_beside_and_are_added_to(bag):
    before = bag.read_bytes()
    run("estimate", bag, "-e", "kmbe")
    run("estimate", bag, "-e", "static_slope")
    assert bag.read_bytes() == before
    beside = DriveLog(bag.with_name("bag.roadlog.mcap"))
    assert beside.estimators == ["kmbe", "static_slope"]
    own = messages(bag)
    assert {topic: own[topic] for topic in own} == {t: messages(beside.path)[t] for t in own}


def test_what_is_beside_and_is_no_copy_stays(bag):
    beside = bag.with_name("bag.roadlog.mcap")
    beside.write_bytes(
        write(bag.parent.parent / "x.mcap", ["imu", "odometry"], "mcap").read_bytes()
    )
    kept = beside.read_bytes()
    done = CliRunner().invoke(app, ["estimate", str(bag), "-e", "kmbe"])
    assert done.exit_code == 1
    assert beside.read_bytes() == kept


def test_a_bag_stays_a_bag(bag):
    """rosbags reads all of it, old messages byte for byte; values are those that estimate gave."""
    from rosbags.highlevel import AnyReader

    old = messages(bag)
    run("estimate", bag, "-e", "kmbe", "--as", "ros2", "--in-place-anyway")
    new = messages(bag)
    assert {topic: new[topic] for topic in old} == old
    assert set(new) - set(old) == {
        "/estimates/kmbe/angles",
        "/estimates/kmbe/grade_deg",
        "/estimates/kmbe/road_frame",
        "/truth/angles",
        "/truth/inclination_deg",
        "/truth/roll_total_deg",
        "/truth/body_frame",
    }
    stored = DriveLog(bag).stored("kmbe")
    with AnyReader([bag]) as reader:
        counts = {c.topic: 0 for c in reader.connections}
        grades = []
        for connection, stamp, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            counts[connection.topic] += 1
            if connection.topic == "/estimates/kmbe/angles":
                assert (message.STANDSTILL, message.UNCERTAIN) == (8, 512)
                assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
                grades.append((stamp, message.grade, message.valid))
            elif connection.topic == "/truth/angles":
                k = counts[connection.topic] - 1
                assert message.inclination == pytest.approx(GRADE[k], abs=1e-7)
    assert counts == {topic: len(rows) for topic, rows in new.items()}
    np.testing.assert_allclose([(row[0] - TIME[0]) * 1e-9 for row in grades], stored.time)
    np.testing.assert_array_equal([row[1] for row in grades], stored.angles["grade"])
    np.testing.assert_array_equal([row[2] for row in grades], stored.valid)
    assert in_folder(bag.parent) == counts
    run("estimate", bag, "-e", "static_slope")  # more results are of the same kind
    run("estimate", bag, "-e", "kmbe")
    counts |= {t: len(rows) for t, rows in messages(bag).items()}
    assert "/estimates/static_slope/angles" in counts
    assert in_folder(bag.parent) == counts


def in_folder(folder: Path) -> dict[str, int]:
    """Messages of each topic, as rosbags finds them by the folder's metadata."""
    from rosbags.highlevel import AnyReader

    with AnyReader([folder]) as reader:
        assert reader.message_count == sum(1 for _ in reader.messages())
        found: dict[str, int] = {}
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            found[connection.topic] = found.get(connection.topic, 0) + 1
        assert found == {c.topic: c.msgcount for c in reader.connections if c.msgcount}
    return found


@pytest.mark.parametrize("container", ["mcap", "ros2", "ros1"])
def test_grade_is_that_of_the_native_log(tmp_path, container):
    """Within 0.02 deg, from every container and without a profile."""
    imu = {role.partition(".")[2]: values for role, values in IMU.items()}
    native = create(
        tmp_path / "own.mcap", [table("imu", TIME, imu), table("speed", TIME, {"v": V})]
    )
    path = write(tmp_path / f"drive.{container}", ["imu", "twist"], container)
    log = path if container == "mcap" else tmp_path / "ingested.mcap"
    if log != path:
        run("ingest", path, "-o", log)
    rmse = [_rmse(DriveLog(log)), _rmse(native)]
    assert abs(rmse[0] - rmse[1]) < np.radians(0.02)


def _rmse(log: DriveLog) -> float:
    """rad, of grade by kmbe after 5 s."""
    estimate = log.estimate("kmbe")
    error = estimate.angles["grade"] - np.interp(estimate.time, T, GRADE)
    return float(np.sqrt(np.nanmean(error[500:] ** 2)))
