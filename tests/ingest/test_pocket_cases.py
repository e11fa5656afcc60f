"""The recorded cases of phones, dongles and receivers, each as its description expects."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.drives import ROOT, Run

from roadlog import checks
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.profile import Profile

CASES = ROOT.parent / "shared" / "cases" / "pocket"


@pytest.fixture(scope="module")
def cases(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The cases with their inputs written."""
    if not CASES.is_dir():
        pytest.skip("cases: ../shared/cases/pocket is missing")
    folder = tmp_path_factory.mktemp("pocket") / "pocket"
    shutil.copytree(CASES, folder, copy_function=shutil.copyfile)
    for place in (folder, *folder.iterdir()):
        place.chmod(0o755)
    for script in ("make.py", "make2.py", "speed_1hz/make.py"):
        subprocess.run([sys.executable, folder / script], check=True)
    return folder


def tables(result) -> dict:
    return {table.topic: table for table in result.tables}


def drafted(*sources: Path):
    return ingest(sources, Profile.from_toml(starter(sources), "drafted"))


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("phyphox", ""),
        ("sensor_logger", "2026-03-01_09-00-00.zip"),
        ("sensorlog_ios", "2026-03-01_09_00_00_phone.csv"),
        ("androsensor", "Sensor_record_20260301_090000_AndroSensor.csv"),
        ("physics_toolbox", "2026-03-0109.00.00.csv"),
        ("gnsslogger", "gnss_log_2026_03_01_09_00_00.txt"),
    ],
)
def test_a_phone_is_read_with_gravity_its_speed_as_gnss_and_no_check(cases, name, source):
    result = drafted(cases / name / source)
    found = tables(result)
    assert not result.losses
    assert np.nanmean(found["/imu"].columns["accel_z"]) == pytest.approx(9.8, abs=0.05)
    assert np.isfinite(found["/imu"].columns["gyro_y"]).mean() > 0.99
    assert np.nanmax(found["/gnss"].columns["speed"]) == pytest.approx(21.6, abs=0.5)
    assert "/speed" not in found
    if name != "gnsslogger":  # a minute of one pull-away tells neither clock nor clipping
        assert not [f for f in checks.check(found) if f.level == "fault"]


def test_the_speed_of_a_slow_logger_leaves_the_clocks_alone(cases):
    sources = cases / "speed_1hz" / "imu.csv", cases / "speed_1hz" / "speed.csv"
    result = drafted(*sources)
    assert any("clock: agrees with that of" in note for note in result.notes)
    assert tables(result)["/speed"].time[0] == 1_772_355_600_000_000_000


@pytest.mark.parametrize("rate", [10, 100])
def test_a_split_imu_is_whole(cases, rate):
    folder = cases / "split_imu"
    files = [folder / f"accel_{rate}.csv", folder / f"gyro_{rate}.csv", folder / "speed.csv"]
    imu = tables(ingest(files, folder / "p.toml"))["/imu"]
    whole = np.isfinite(imu.columns["accel_x"]) & np.isfinite(imu.columns["gyro_x"])
    assert len(imu) == 200 * rate
    assert whole.mean() > 0.999


def test_a_delay_before_the_start_leaves_no_stamp_outside_the_drive(cases):
    found = tables(drafted(cases / "delay_before_start" / "log.csv"))
    stamps = np.concatenate([table.time for table in found.values()])
    assert stamps.min() == 0
    assert stamps.max() * 1e-9 == pytest.approx(200.0, abs=0.05)


def test_a_long_table_is_pivoted(cases):
    found = tables(ingest([cases / "car_scanner_long" / "2026-03-01 09-00-00.csv"]))
    for topic, field in (("/speed", "v"), ("/gnss", "speed"), ("/gnss", "altitude")):
        assert np.isfinite(found[topic].columns[field]).sum() == 120
    assert np.isfinite(found["/gnss"].columns["longitude"]).sum() > 100


def test_a_slow_noisy_imu_is_said_and_counted(cases, roadlog: Run):
    folder = cases / "slow_noisy_imu"
    subprocess.run([sys.executable, folder / "make.py", "0.02", "0.4", "10"], check=True)
    log, truth = folder / "log.csv", folder / "truth.csv"
    for words in (
        ("profile", "new", log, "-o", "p.toml"),
        ("ingest", log, "-o", "d.mcap", "--profile", "p.toml", "--truth-from", truth),
        ("estimate", "d.mcap", "-e", "fusion"),
    ):
        assert roadlog(*words).returncode == 0
    assert "note: imu: comes at 10 Hz" in roadlog("info", "d.mcap").stdout
    found = json.loads(roadlog("evaluate", "d.mcap", "--json").stdout)
    assert found["estimates"]["fusion"]["grade"]["within_2sd"] > 0.9


def test_torque_takes_the_clock_that_has_times(cases):
    result = ingest([cases / "torque_dash" / "trackLog.csv"])
    assert not result.losses
    assert len(tables(result)["/speed"]) == 120
    assert np.nanmean(tables(result)["/imu"].columns["accel_z"]) == pytest.approx(9.8, abs=0.05)


def test_remarks_of_laps_are_no_loss(cases):
    result = ingest([cases / "trackaddict_laps" / "Log.csv"])
    assert not result.losses
    gnss = tables(result)["/gnss"]
    assert gnss.time[0] == 1_772_355_600_000_000_000
    assert np.isfinite(gnss.columns["course"]).all()


def test_nmea_and_a_folder_without_names_are_read(cases):
    gnss = tables(ingest([cases / "nmea" / "drive.nmea"]))["/gnss"]
    assert len(gnss) == 120
    assert gnss.columns["altitude"][0] == pytest.approx(600.0)
    both = tables(ingest([cases / "uah"]))
    assert np.nanmax(both["/gnss"].columns["speed"]) == pytest.approx(21.6, abs=0.5)
    assert np.nanmean(both["/imu"].columns["accel_z"]) == pytest.approx(9.8, abs=0.05)


def test_a_vbo_file_is_read(cases):
    found = tables(ingest([cases / "vbo" / "drive.vbo"]))
    gnss = found["/gnss"]
    assert gnss.columns["longitude"][0] == pytest.approx(11.0, abs=1e-4)
    speed = found["/speed"].columns["v"] if "/speed" in found else gnss.columns["speed"]
    assert np.nanmax(speed) == pytest.approx(20.0, abs=2.5)
