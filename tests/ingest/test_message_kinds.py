"""Every message kind that cars log is the signal that its type says, in every container."""

from __future__ import annotations

import json

import numpy as np
import pytest
from support.drives import table as table_of
from support.vehicle_messages import (
    ACCEL,
    CLIMB,
    EAST,
    FIX,
    GRADE,
    GYRO,
    IMU,
    KINDS,
    NORTH,
    RADIUS,
    TIME,
    VELOCITY,
    WHEELS,
    T,
    V,
    write,
    xyz,
)

from roadlog.ingest import ingest
from roadlog.ingest.kinds import table
from roadlog.log import DriveLog, create
from roadlog.signals import SIGNALS
from roadlog.summary import summarize
from roadlog.units import UNITS, canonical

CONTAINERS = ("mcap", "ros2", "ros1")
ANGLES = ("gnss.course",)
ROUNDED = {"gnss.speed": 5.1e-3, "gnss.climb": 5.1e-3}  # m/s, of a receiver that counts cm/s


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
        least = ROUNDED.get(role, 1.1e-3)
        assert np.abs(error).max() < max(scale * np.abs(expected).max(), least), role


SCHEMAS = {
    "imu": ".Imu", "speed": ".Speed", "wheel_speeds": ".WheelSpeeds", "gnss": ".Gnss",
    "steering": ".Steering", "truth": ".RoadAngles", "wheel_torques": ".WheelTorques",
    "powertrain": ".Powertrain", "barometer": ".Barometer", "fuel": ".FuelLevel",
}  # fmt: skip


WHAT_A_DRIVE_NEEDS = {
    "imu.accel_x": "imu",
    "imu.gyro_x": "xsens_rates",
    "speed.v": "twist",
    "gnss.latitude": "fix",
    "gnss.speed": "fix_velocity",
}


@pytest.fixture(scope="module")
def native(tmp_path_factory):
    """rad, RMSE of the grade by kmbe from a log of roadlog's own."""
    imu = {role.partition(".")[2]: values for role, values in IMU.items()}
    tables = [table_of("imu", TIME, imu), table_of("speed", TIME, {"v": V})]
    return rmse(create(tmp_path_factory.mktemp("native") / "own.mcap", tables))


def rmse(log):
    """rad, of the grade by kmbe after 5 s."""
    estimate = log.estimate("kmbe")
    error = estimate.angles["grade"] - np.interp(estimate.time, T, GRADE)
    return float(np.sqrt(np.nanmean(error[estimate.time > 5] ** 2)))


@pytest.mark.slow
@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("name", KINDS)
def test_kind_goes_from_info_to_estimate_without_a_profile(tmp_path, native, name, container):
    """Beside what else a drive needs: IMU, speed, position; a bag is ingested first."""
    roles = set(KINDS[name][3])
    names = [name]
    for role, kind in WHAT_A_DRIVE_NEEDS.items():
        is_there = any(role in KINDS[other][3] for other in names)
        is_by_wheels = role == "speed.v" and any("wheel" in own for own in roles)
        if not is_there and not is_by_wheels:
            names.append(kind)
    path = write(tmp_path / f"drive.{container}", names, container)
    log = DriveLog(path) if container == "mcap" else taken_in(path, tmp_path / "log.mcap")
    found = {signal.role: signal for signal in summarize(log).signals}
    assert not log.losses
    tables = {topic: table_.columns for topic, table_ in log.inputs().items()}
    for role in {*roles, "imu.accel_x", "imu.gyro_z", "gnss.latitude", "gnss.speed"}:
        if role.startswith("truth"):
            continue
        section, _, field = role.partition(".")
        expected = {**IMU, **WHEELS, **FIX, **VELOCITY, **KINDS[name][3]}[role]
        error = tables[f"/{section}"][field] - expected
        if role in ANGLES:
            error = np.angle(np.exp(1j * error))
        scale = 1e-3 if role.startswith("wheel") else 2e-6
        assert np.abs(error).max() < max(scale * np.abs(expected).max(), ROUNDED.get(role, 1.1e-3))
        assert role in found
    assert abs(rmse(log) - native) < np.radians(0.02)


def taken_in(path, out):
    result = ingest([path])
    assert not result.losses
    return create(out, result.tables, result.metadata)


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


def test_messages_that_name_no_type_are_what_they_look_like(tmp_path):
    """JSON without a schema, as bridges to the web write it."""
    from mcap.writer import Writer

    covariance = {"position_covariance": [4.0, 0, 0, 0, 4.0, 0, 0, 0, 9.0]}
    turned = {"angular": xyz(0.0, 0.0, 0.0)}
    more = {
        "imu": {},
        "fix": covariance,
        "odometry": {"pose": {"pose": {"position": xyz(0, 0, 0)}}},
    }
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        for name in more:
            topic, _, of, _ = KINDS[name]
            channel = writer.register_channel(topic, "json", 0)
            for k, ns in enumerate(TIME.tolist()):
                values = {**of(k), **more[name]}
                if name == "odometry":
                    values["twist"] = {"twist": {**values["twist"]["twist"], **turned}}
                writer.add_message(channel, ns, json.dumps(values, default=list).encode(), ns)
        writer.finish()
    tables = {t.topic: t.columns for t in ingest([tmp_path / "x.mcap"]).tables}
    for role, expected in {**IMU, **FIX, "speed.v": V}.items():
        section, _, field = role.partition(".")
        np.testing.assert_allclose(tables[f"/{section}"][field], expected, atol=1e-9)


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
