"""One drive, written by the libraries in every format: each gives the same columns."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.drive_formats import (
    DBC,
    IMU,
    NAMES,
    ROS_NAMES,
    SPEED,
    TIME,
    profile_of,
    write_mdf,
    write_mdf_bus,
    write_parquet,
    write_ros1,
    write_ros2,
    write_text,
    write_trace,
)

from roadlog.ingest import ingest


def check(result, resolution_ns: int = 0) -> None:
    tables = {table.topic: table for table in result.tables}
    assert set(tables) == {"/imu", "/speed"}
    assert np.abs(tables["/imu"].time - TIME).max() <= resolution_ns
    assert np.abs(tables["/speed"].time - TIME[::5]).max() <= resolution_ns
    for name, values in IMU.items():
        np.testing.assert_allclose(tables["/imu"].columns[name], values, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(tables["/speed"].columns["v"], SPEED, atol=1e-9)
    assert not result.losses


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC)
    return path


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".log"])
def test_can_traces(tmp_path, dbc, suffix):
    path = write_trace(tmp_path / f"drive{suffix}")
    renamed = path.rename(tmp_path / "drive.bin")  # told by what is in it
    # TRC keeps 0.1 ms of offsets and rounds the start to its date's resolution
    check(ingest([renamed], profile_of(tmp_path), [dbc]), 2_000_000 if suffix == ".trc" else 2_000)


@pytest.mark.parametrize("version", ["2.14", "3.30", "4.10", "4.20"])
def test_mdf_channel_groups(tmp_path, version):
    suffix = "mf4" if version >= "4" else "mdf"
    path = write_mdf(tmp_path / f"drive.{suffix}", version)
    check(ingest([path], profile_of(tmp_path)), 1_000)


def test_mdf_bus_logging(tmp_path, dbc):
    check(ingest([write_mdf_bus(tmp_path / "drive.mf4")], profile_of(tmp_path), [dbc]), 1_000)


def test_text_and_parquet(tmp_path):
    check(ingest([write_text(tmp_path / "drive.csv")], profile_of(tmp_path)))
    for dates in (False, True):
        path = write_parquet(tmp_path / "drive.parquet", dates)
        check(ingest([path], profile_of(tmp_path)))


def test_ros1_bag(tmp_path):
    bag = write_ros1(tmp_path / "drive.bag")
    check(ingest([bag]))  # the profile is found by the message types
    names = {k: f"/sensors/imu.{v}" for k, v in ROS_NAMES.items()}
    profile = profile_of(tmp_path, "", names)
    profile.write_text(profile.read_text().replace('"v"', '"/car/twist.twist.linear.x"'))
    check(ingest([bag], profile))


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_ros2_bag_folder_and_the_file_in_it(tmp_path, storage):
    bag = write_ros2(tmp_path / "drive", storage)
    check(ingest([bag]))
    inside = next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap"))
    check(ingest([inside]))


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_the_header_is_the_clock_where_the_profile_says_so(tmp_path, storage):
    from importlib.resources import files

    bag = write_ros2(tmp_path / "drive", storage, late=30_000_000)
    text = files("roadlog").joinpath("profiles/ros.toml").read_text("utf-8")
    profile = tmp_path / "header.toml"
    profile.write_text('[time]\nclock = "header"\n' + text[: text.index("[gnss]")])
    check(ingest([bag], profile))
    inside = next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap"))
    check(ingest([inside], profile))


def test_foreign_json_in_an_mcap(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "drive.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("car.Imu", "jsonschema", b'{"type": "object"}')
        imu = writer.register_channel("/car/imu", "json", schema)
        odo = writer.register_channel("/car/odo", "json", schema)
        for k, ns in enumerate(TIME.tolist()):
            row = {NAMES[name]: float(values[k]) for name, values in IMU.items()}
            data = json.dumps({"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, **row})
            writer.add_message(imu, ns, data.encode(), ns)
            if k % 5 == 0:
                writer.add_message(odo, ns, json.dumps({"v": SPEED[k // 5]}).encode(), ns)
        writer.finish()
    names = {k: f"/car/imu.{v}" for k, v in NAMES.items()}
    profile = profile_of(tmp_path, "", names)
    profile.write_text(profile.read_text().replace('"v"', '"/car/odo.v"'))
    check(ingest([path], profile))
