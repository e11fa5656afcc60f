"""Accelerometer and gyro with clocks of their own, delays and stamps before the start."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import hill_tables
from support.phone_drive import PhoneDrive
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.ingest import ingest
from roadlog.ingest.grid import one_grid
from roadlog.log import create

DRIVE = PhoneDrive()
PROFILE = """
[time]
column = "t"
unit = "s"
[imu]
accel_x = { from = "ax", unit = "m/s^2" }
accel_y = { from = "ay", unit = "m/s^2" }
accel_z = { from = "az", unit = "m/s^2" }
gyro_x = { from = "wx", unit = "rad/s" }
gyro_y = { from = "wy", unit = "rad/s" }
gyro_z = { from = "wz", unit = "rad/s" }
[speed]
v = { from = "v", unit = "m/s" }
"""


def write(path: Path, names: str, t: np.ndarray, values: np.ndarray) -> Path:
    rows = np.column_stack([t, values])
    np.savetxt(path, rows, "%.6f", ",", header=f"t,{names}", comments="")
    return path


def split(folder: Path, accel_rate: float, gyro_rate: float, keep=None) -> list[Path]:
    """Three files: accelerations, rates half a sample later, and the speed at 10 Hz."""
    t = np.arange(0, DRIVE.duration, 1 / accel_rate)
    g = np.arange(0, DRIVE.duration, 1 / gyro_rate) + 0.5 / gyro_rate
    g = g if keep is None else g[keep(g)]
    v = np.arange(0, DRIVE.duration, 0.1)
    return [
        write(folder / "accel.csv", "ax,ay,az", t, DRIVE.imu(t)[0]),
        write(folder / "gyro.csv", "wx,wy,wz", g, DRIVE.imu(g)[1]),
        write(folder / "speed.csv", "v", v, DRIVE.speed(v)[:, None]),
    ]


@pytest.mark.parametrize(("accel", "gyro"), [(10, 10), (100, 100), (25, 50), (50, 10)])
def test_a_split_imu_comes_on_the_stamps_of_the_faster_sensor(tmp_path, accel, gyro):
    profile = tmp_path / "p.toml"
    profile.write_text(PROFILE)
    result = ingest(split(tmp_path, accel, gyro), profile)
    imu = next(table for table in result.tables if table.topic == "/imu")
    assert len(imu) == max(accel, gyro) * DRIVE.duration
    whole = np.all([np.isfinite(imu.columns[f"{k}_z"]) for k in ("accel", "gyro")], axis=0)
    assert whole.mean() > 0.995
    t = imu.time[whole] * 1e-9
    force, rate = DRIVE.imu(t)
    assert np.abs(imu.columns["accel_x"][whole] - force[:, 0]).max() < 0.01
    assert np.abs(imu.columns["gyro_z"][whole] - rate[:, 2]).max() < 1e-3
    assert any("interpolated to the stamps of" in note for note in result.notes)


def test_a_gap_of_one_sensor_stays_a_gap(tmp_path):
    profile = tmp_path / "p.toml"
    profile.write_text(PROFILE)
    files = split(tmp_path, 50, 50, lambda t: (t < 40) | (t > 45))
    imu = next(table for table in ingest(files, profile).tables if table.topic == "/imu")
    t = imu.time * 1e-9
    inside = (t > 40) & (t < 45)
    assert np.isnan(imu.columns["gyro_x"][inside]).all()
    assert np.isfinite(imu.columns["accel_x"][inside]).all()


def test_messages_of_one_burst_are_left_as_they_are():
    time = np.arange(1000) * 10_000_000
    signals = {
        "imu.accel_x": (time, np.ones(1000)),
        "imu.gyro_x": (time + 500_000, np.ones(1000)),
        "speed.v": (time[::7], np.ones(143)),
    }
    same, notes = one_grid(signals)
    assert same is signals
    assert not notes


def test_a_delay_reaches_back_to_the_start_of_the_recording_only(tmp_path):
    t = np.arange(0, 60, 0.02)
    values = np.column_stack([*DRIVE.imu(t)[0].T, *DRIVE.imu(t)[1].T, DRIVE.speed(t - 0.7)])
    log = write(tmp_path / "log.csv", "ax,ay,az,wx,wy,wz,v", t, values)
    profile = tmp_path / "p.toml"
    profile.write_text(PROFILE.replace('from = "v", unit', 'from = "v", delay = "0.7 s", unit'))
    tables = {table.topic: table for table in ingest([log], profile).tables}
    assert tables["/speed"].time.min() == 0
    assert tables["/speed"].columns["v"] == pytest.approx(DRIVE.speed(t[:-35]), abs=1e-5)
    assert tables["/imu"].time.max() == pytest.approx(59.98e9)


def test_one_estimator_that_refuses_is_a_note_and_the_others_are_written(tmp_path):
    log = tmp_path / "slow.mcap"
    create(log, hill_tables(duration=0.8))  # too short for fusion
    command = ["estimate", str(log), "-e", "fusion", "-e", "lowpass_attitude"]
    result = CliRunner().invoke(app, command)
    assert "fusion cannot run: the IMU has no run" in result.stderr
    assert "lowpass_attitude" in result.stdout
    every = CliRunner().invoke(app, ["estimate", str(log), "-e", "fusion"])
    assert every.exit_code != 0
    assert "no estimator can run" in str(every.exception)
