"""Every message kind that cars log is the signal that its type says, in every container."""

from __future__ import annotations

import numpy as np
import pytest
from support.vehicle_messages import (
    ACCEL,
    CLIMB,
    EAST,
    GYRO,
    KINDS,
    NORTH,
    RADIUS,
    TIME,
    V,
    write,
    xyz,
)

from roadlog.ingest import ingest
from roadlog.ingest.kinds import table
from roadlog.signals import SIGNALS
from roadlog.units import UNITS, canonical

CONTAINERS = ("mcap", "ros2", "ros1")
ANGLES = ("gnss.course",)


@pytest.mark.parametrize("name", KINDS)
def test_kind_is_its_signals(tmp_path, name):
    """Each in a container of another kind; with something to measure wheels against."""
    container = CONTAINERS[list(KINDS).index(name) % 3]
    names = [name] if "wheels" not in name and name != "joints" else [name, "gpsfix"]
    path = write(tmp_path / f"drive.{container}", names, container)
    result = ingest([path])
    assert not result.losses
    columns = {
        f"{section}.{field}": values
        for table_ in result.tables
        for section in [next(s.role.partition(".")[0] for s in SIGNALS.values()
                             if table_.schema.endswith(SCHEMAS[s.role.partition(".")[0]]))]
        for field, values in table_.columns.items()
    }  # fmt: skip
    for role, expected in KINDS[name][3].items():
        error = columns[role] - expected
        if role in ANGLES:
            error = np.angle(np.exp(1j * error))
        scale = 1e-3 if role.startswith("wheel") else 2e-6  # a radius that was measured
        assert np.abs(error).max() < max(scale * np.abs(expected).max(), 1.1e-3), role


SCHEMAS = {
    "imu": ".Imu", "speed": ".Speed", "wheel_speeds": ".WheelSpeeds", "gnss": ".Gnss",
    "steering": ".Steering", "truth": ".RoadAngles", "wheel_torques": ".WheelTorques",
    "powertrain": ".Powertrain", "barometer": ".Barometer", "fuel": ".FuelLevel",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("name", KINDS)
def test_kind_in_every_container(tmp_path, name, container):
    names = [name, "imu"] if name != "imu" else ["imu", "twist"]
    names += ["gpsfix"] if "wheels" in name or name == "joints" else []
    result = ingest([write(tmp_path / f"drive.{container}", names, container)])
    assert {m.role for m in result.mapped} >= set(KINDS[name][3])
    assert not result.losses


def test_a_table_whose_every_line_can_be_read():
    for kind in table():
        for role, line in kind.lines.items():
            unit = UNITS[canonical(line.unit)][0]
            wheel = role.startswith("wheel_speeds.") and unit == "angular rate"
            assert wheel or unit == UNITS[canonical(SIGNALS[role].unit)][0], (kind.types, role)


def test_an_angular_rate_is_never_a_speed(tmp_path):
    """Of an unknown type, where only names say what there is."""
    from mcap.writer import Writer

    from roadlog.ingest.drafting.starter import starter

    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/body", "json", 0)
        for k, ns in enumerate(TIME.tolist()):
            text = f'{{"angular_velocity": {{"x": 0.1, "z": 0.2}}, "velocity": {{"x": {V[k]}}}}}'
            writer.add_message(channel, ns, text.encode(), ns)
        writer.finish()
    text = starter([tmp_path / "x.mcap"])
    assert 'v = { from = "/body.velocity.x"' in text
    assert 'gyro_x = { from = "/body.angular_velocity.x"' in text


def test_two_speeds_are_offered_with_topic_and_type(tmp_path):
    from roadlog.ingest.drafting.starter import starter

    path = write(tmp_path / "x.mcap", ["odometry", "twist", "velocity_report"], "mcap")
    text = starter([path])
    assert 'v = { from = "/vehicle/status/velocity_status.longitudinal_velocity"' in text
    other = "/vehicle/twist.twist.linear.x (geometry_msgs/TwistStamped), "
    assert f"# or: {other}/odom.twist.twist.linear.x (nav_msgs/Odometry)" in text


def test_wheels_without_another_speed_take_a_usual_radius_and_say_so(tmp_path):
    from roadlog.ingest.drafting.starter import starter

    path = write(tmp_path / "x.mcap", ["dbw_wheels", "imu"], "mcap")
    assert "a usual rolling radius of 0.31 m is assumed" in starter([path])
    path = write(tmp_path / "y.mcap", ["dbw_wheels", "imu", "navpvt"], "mcap")
    assert f"rolling radius {RADIUS} m by gnss.speed" in starter([path])


def test_a_command_is_not_what_the_car_does(tmp_path):
    """Of whatever type: `/cmd_vel` beside an odometry, and alone."""
    type_ = KINDS["twist"][1]
    faster = lambda k: {"twist": {"linear": xyz(1 + 1.2 * V[k], 0.0, 0.0)}}  # noqa: E731
    for name in ("/cmd_vel", "/control/command/twist", "/twist_cmd"):
        KINDS["wanted"] = (name, type_, faster, {})
        try:
            path = write(tmp_path / "x.mcap", ["wanted", "odometry", "imu"], "mcap")
            alone = write(tmp_path / "y.mcap", ["wanted", "imu"], "mcap")
        finally:
            del KINDS["wanted"]
        speed = next(t for t in ingest([path]).tables if t.topic == "/speed")
        np.testing.assert_allclose(speed.columns["v"], V)
        assert "speed.v" not in {m.role for m in ingest([alone]).mapped}


def test_a_frame_that_says_ned_is_north_east_down(tmp_path):
    topics = {
        "imu": lambda k: {
            "header": {"frame_id": "imu_ned"},
            "angular_velocity": xyz(GYRO[0, k], -GYRO[1, k], -GYRO[2, k]),
            "linear_acceleration": xyz(ACCEL[0, k], -ACCEL[1, k], -ACCEL[2, k]),
        },
        "map_twist": lambda k: {
            "header": {"frame_id": "ned"},
            "twist": {"linear": xyz(NORTH[k], EAST[k], -CLIMB[k])},
        },
    }
    before = {name: KINDS[name] for name in topics}
    try:
        for name, of in topics.items():
            KINDS[name] = (before[name][0], before[name][1], of, before[name][3])
        path = write(tmp_path / "x.mcap", list(topics), "mcap")
    finally:
        KINDS.update(before)
    tables = {t.topic: t.columns for t in ingest([path]).tables}
    for role, expected in {**before["imu"][3], **before["map_twist"][3]}.items():
        section, _, field = role.partition(".")
        np.testing.assert_allclose(tables[f"/{section}"][field], expected, atol=1e-9)
