"""A third-party MCAP, estimated in place through a profile."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from mcap.reader import make_reader
from mcap.writer import Writer
from support.drives import hill_tables, table

from roadlog.log import DriveLog, create

PROFILE = """
[time]
clock = "publish"
[imu]
mount = { forward = "+y", left = "-x" }
accel_x = { from = "/car/body.accel.x", unit = "g" }
accel_y = { from = "/car/body.accel.y", unit = "g" }
accel_z = { from = "/car/body.accel.z", unit = "g" }
gyro_x = { from = "/car/body.rate", unit = "deg/s" }
[speed]
v = { from = "/car/odo.kmh", unit = "km/h" }
[truth]
grade = { from = "/car/odo.slope", unit = "rad" }
"""
G = 9.80665


def schema() -> bytes:
    """car.Body {Vector {x, y, z} accel; rate} and car.Odo {kmh, slope}, proto3."""
    file = descriptor_pb2.FileDescriptorProto(name="car.proto", package="car", syntax="proto3")
    messages = {
        "Vector": ("x", "y", "z"),
        "Body": ("accel", "rate"),
        "Odo": ("kmh", "slope"),
    }
    for name, fields in messages.items():
        message = file.message_type.add(name=name)
        for number, field in enumerate(fields, 1):
            kind = 11 if field == "accel" else 1
            added = message.field.add(name=field, number=number, label=1, type=kind)
            if kind == 11:
                added.type_name = ".car.Vector"
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


@pytest.fixture
def foreign(tmp_path: Path) -> Path:
    """`hill_tables` as someone else would log them: other axes, units and topics."""
    from google.protobuf import descriptor_pool, message_factory

    imu, wheels, truth = hill_tables()
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(schema()).file:
        pool.Add(file)
    body = message_factory.GetMessageClass(pool.FindMessageTypeByName("car.Body"))
    odo = message_factory.GetMessageClass(pool.FindMessageTypeByName("car.Odo"))
    path = tmp_path / "foreign.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        ids = {}
        for topic, name in (("/car/body", "car.Body"), ("/car/odo", "car.Odo")):
            number = writer.register_schema(name, "protobuf", schema())
            ids[topic] = writer.register_channel(topic, "protobuf", number)
        for k, ns in enumerate(imu.time.tolist()):
            x, y, z = (float(imu.columns[f"accel_{a}"][k]) / G for a in "xyz")
            message = body(rate=-np.degrees(imu.columns["gyro_y"][k]))
            message.accel.x, message.accel.y, message.accel.z = -y, x, z
            late = ns + 50_000_000
            writer.add_message(ids["/car/body"], late, message.SerializeToString(), ns)
            message = odo(kmh=3.6 * wheels.columns["fl"][k], slope=truth.columns["grade"][k])
            writer.add_message(ids["/car/odo"], late, message.SerializeToString(), ns)
        writer.finish()
    (tmp_path / "p.toml").write_text(PROFILE)
    return path


def own_messages(path: Path) -> list[tuple[str, int, bytes]]:
    with path.open("rb") as stream:
        return [
            (channel.topic, message.log_time, message.data)
            for _, channel, message in make_reader(stream).iter_messages()
            if channel.topic.startswith("/car/")
        ]


def test_estimate_writes_in_place_and_later_commands_know_the_profile(foreign, roadlog):
    imu, wheels, truth = hill_tables()
    hill_log = foreign.with_name("hill.mcap")
    create(hill_log, [imu, table("speed", wheels.time, {"v": wheels.columns["fl"]}), truth])
    before = own_messages(foreign)
    arguments = ("--profile", "p.toml", "-e", "kmbe", "--in-place-anyway")
    done = roadlog("estimate", "foreign.mcap", *arguments)
    assert done.returncode == 0, done.stderr
    assert own_messages(foreign) == before
    done = roadlog("evaluate", "foreign.mcap", "--json")
    assert done.returncode == 0, done.stderr
    grade = json.loads(done.stdout)["estimates"]["kmbe"]["grade"]
    roadlog("estimate", hill_log, "-e", "kmbe")
    own = json.loads(roadlog("evaluate", hill_log, "--json").stdout)["estimates"]["kmbe"]["grade"]
    assert grade["rmse_deg"] == pytest.approx(own["rmse_deg"], abs=1e-6)
    assert grade["matched_share"] > 0.9
    done = roadlog("info", "foreign.mcap", "--json")
    assert done.returncode == 0, done.stderr
    able = [e["name"] for e in json.loads(done.stdout)["estimators"] if e["can_run"]]
    assert "kmbe" in able


def test_units_axes_and_the_clock_are_the_profiles(foreign):
    imu, wheels, _ = hill_tables()
    log = DriveLog(foreign, foreign.parent / "p.toml")
    tables = log.tables(["/imu", "/speed"])
    np.testing.assert_array_equal(tables["/imu"].time, imu.time)
    for axis in "xyz":
        expected = imu.columns[f"accel_{axis}"]
        np.testing.assert_allclose(tables["/imu"].columns[f"accel_{axis}"], expected, atol=1e-9)
    np.testing.assert_allclose(tables["/speed"].columns["v"], wheels.columns["fl"], atol=1e-9)


def test_without_a_profile_that_fits_it_says_what_to_do(foreign, roadlog):
    before = foreign.read_bytes()
    failed = roadlog("estimate", "foreign.mcap")
    assert failed.returncode == 1
    assert "--profile" in failed.stderr
    assert len(failed.stderr.strip().splitlines()) == 1
    assert foreign.read_bytes() == before
    shown = roadlog("info", "foreign.mcap")
    assert shown.returncode == 0, shown.stderr
    assert "/car/odo" in shown.stdout


def test_a_signal_that_the_log_lacks_is_named(foreign, roadlog):
    (foreign.parent / "p.toml").write_text(PROFILE.replace("odo.kmh", "odo.kmph"))
    failed = roadlog("estimate", "foreign.mcap", "--profile", "p.toml")
    assert failed.returncode == 1
    assert "no '/car/odo.kmph'. Close: /car/odo.kmh" in failed.stderr


def test_ingest_of_an_mcap_gives_a_log_of_its_own(foreign, roadlog):
    done = roadlog("ingest", "foreign.mcap", "-o", "own.mcap", "--profile", "p.toml")
    assert done.returncode == 0, done.stderr
    own = DriveLog(foreign.parent / "own.mcap")
    assert own.profile is None
    assert {"/imu", "/speed", "/truth/angles"} <= set(own.tables())
