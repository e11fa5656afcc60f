"""Recordings of phone apps, from the file to angles, with no profile by hand."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from support.phone_drive import EPOCH, FLAT
from support.phone_formats import APPS, DRIVE, phyphox
from support.phone_variants import VARIANTS

from roadlog import checks, estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.ingest import IngestResult, ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.formats import times
from roadlog.ingest.profile import Profile
from roadlog.log import DriveLog, create
from roadlog.rotation import from_rpy

APPS = {**APPS, **VARIANTS}
WITH_GYRO = {name for name in APPS if name.split("_")[0] in ("phyphox", "sensor", "sensorlog")}
WITH_GYRO |= {"androsensor", "physics_toolbox", "racechrono", "pvs", "gnsslogger"}
WITHOUT_IMU = {"car_scanner", "obd_fusion", "gpslogger"}


def table(result: IngestResult, topic: str):
    return next(t for t in result.tables if t.topic == topic)


def since_start(time: np.ndarray) -> np.ndarray:
    """s of the drive, of stamps that are since the epoch, of the day or since the start."""
    seconds = time * 1e-9
    return seconds - (EPOCH if seconds[0] > 1e8 else 32400 if seconds[0] > 10000 else 0)


@pytest.mark.parametrize("name", APPS)
def test_every_app_gives_what_was_driven(tmp_path, name):
    result = ingest([APPS[name](tmp_path)])
    assert not result.losses
    gnss = table(result, "/gnss")
    t = since_start(gnss.time)
    true = DRIVE.fixes(t)
    for field, near in (("latitude", 2e-6), ("longitude", 2e-6), ("altitude", 0.02)):
        known = np.isfinite(gnss.columns[field])
        assert known.sum() > 100
        assert np.abs(gnss.columns[field] - true[field])[known].max() < near
    speeds = [c for c in (gnss.columns["speed"],) if np.isfinite(c).any()]
    if name == "obd_fusion":
        speeds = [table(result, "/speed").columns["v"]]
    assert speeds
    known = np.isfinite(speeds[0])
    assert np.abs(speeds[0] - DRIVE.speed(t))[known].max() < 0.01
    course = np.isfinite(gnss.columns["course"])
    if course.any():
        apart = gnss.columns["course"] - np.radians(90 - true["course"])
        assert np.abs(np.angle(np.exp(1j * apart)))[course].max() < 0.01
    if name in WITHOUT_IMU:
        return
    imu = table(result, "/imu")
    t = since_start(imu.time)
    force, rate = DRIVE.imu(t)
    for k, axis in enumerate("xyz"):
        assert np.nanmax(np.abs(imu.columns[f"accel_{axis}"] - force[:, k])) < 0.02
        if name in WITH_GYRO:
            assert np.nanmax(np.abs(imu.columns[f"gyro_{axis}"] - rate[:, k])) < 1e-3
    drive = Drive.from_tables(result.tables)
    grade = estimators.run("kmbe", drive, Vehicle()).angles["grade"]
    error = np.degrees(grade - DRIVE.grade(since_start(drive.time_ns)))
    moving = np.isfinite(error) & (drive.time > 25) & (drive.time < 110)
    assert moving.mean() > 0.5
    assert np.sqrt(np.mean(error[moving] ** 2)) < (2.5 if name.startswith("torque") else 1.0)


def test_a_folder_of_one_recording_has_one_clock_and_no_linear_acceleration(tmp_path):
    result = ingest([phyphox(tmp_path)])
    assert not any("clock:" in note for note in result.notes)
    assert any("the phone is taken as flat, its top forward" in note for note in result.notes)
    assert np.nanmean(table(result, "/imu").columns["accel_z"]) == pytest.approx(9.8, abs=0.02)
    only = tmp_path / "other"
    only.mkdir()
    for file in (tmp_path / "phyphox").iterdir():
        if file.name != "Accelerometer.csv":
            file.rename(only / file.name)
    assert "/imu" in {t.topic for t in ingest([only]).tables}
    assert np.isnan(table(ingest([only]), "/imu").columns["accel_z"]).all()


def test_a_gnss_speed_is_one_also_when_it_is_the_only_one(tmp_path):
    result = ingest([APPS["sensor_logger"](tmp_path)])
    assert "/speed" not in {t.topic for t in result.tables}
    assert np.isfinite(table(result, "/gnss").columns["speed_accuracy"]).all()


@pytest.mark.parametrize("name", ["phyphox", "sensorlog", "androsensor"])
def test_profile_new_finds_how_the_phone_lies_and_following_it_ends_the_checks(tmp_path, name):
    source = APPS[name](tmp_path)
    text = starter([source])
    assert 'mount = { forward = "+y", left = "-x" }' in text
    result = ingest([source], Profile.from_toml(text, "p"))
    assert not [f for f in checks.check({t.topic: t for t in result.tables}) if f.level == "fault"]


def test_a_profile_of_the_files_own_names_reads_the_table_as_it_is(tmp_path: Path):
    source = APPS["androsensor"](tmp_path)
    own = '[imu]\naccel_z = { from = "ACCELEROMETER Z (m/s²)", unit = "m/s^2" }\n'
    own += '[time]\ncolumn = "Time since start in ms"\nunit = "ms"\n'
    result = ingest([source], Profile.from_toml(own, "p"))
    assert [m.source for m in result.mapped] == ["ACCELEROMETER Z (m/s²)"]


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("Sun Mar 01 09:00:06 GMT+08:00 2026", 1772326806),
        ("Sun Mar  1 09:00:06 2026", 1772355606),
        ("Sun Mar 01 09:00:06.5 GMT 2026", 1772355606.5),
        ("01-Mar-2026 09:00:06 PM", 1772398806),
    ],
)
def test_dates_with_the_day_of_the_week_and_of_twelve_hours_are_understood(text, seconds):
    stamps, keep = times.from_texts([text], "log.csv")
    assert keep.all()
    assert stamps[0] * 1e-9 == seconds


@pytest.mark.parametrize("turned", [(0, 0, 90), (0, -80, 0), (0, 90, 180)])
def test_advice_on_a_mount_is_for_the_profile_that_has_one(tmp_path, turned):
    lies = FLAT @ from_rpy(*np.radians(turned))
    t = np.arange(0, 120, 0.02)
    force, rate = DRIVE.phone(t, lies)
    rows = np.column_stack([t, DRIVE.speed(t), force, rate])
    path = tmp_path / "drive.csv"
    np.savetxt(path, rows, "%.6f", ",", header="t,v,ax,ay,az,wx,wy,wz", comments="")
    text = '[speed]\nv = { from = "v", unit = "m/s" }\n'
    text += '[imu]\nmount = { forward = "+y", left = "-x" }\n'
    for axis in "xyz":
        text += f'accel_{axis} = {{ from = "a{axis}", unit = "m/s^2" }}\n'
        text += f'gyro_{axis} = {{ from = "w{axis}", unit = "rad/s" }}\n'

    def faults(text: str) -> list[str]:
        result = ingest([path], Profile.from_toml(text, "new"))
        out = tmp_path / "drive.mcap"
        out.unlink(missing_ok=True)
        create(out, result.tables, result.metadata)
        with DriveLog(out) as log:
            return [str(f) for f in log.faults() if f.check == "axes"]

    (said,) = faults(text)
    advised = re.search(r"\[imu\] (mount = \{[^}]*\})", said)
    assert advised is not None, said
    assert not faults(re.sub(r"mount = \{[^}]*\}", advised[1], text))
