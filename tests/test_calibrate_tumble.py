"""Zeros and scales of an IMU that is turned over on a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.drives import Run, simulated
from support.tumbled import TURNS, tumbled

from roadlog.calibrate import calibrate
from roadlog.calibrate.tumble import KINDS, is_tumble, tumble
from roadlog.car.correction import corrected
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.log import create
from roadlog.units import STANDARD_GRAVITY as G

HIDDEN = {
    "accel_zero": np.array([0.15, -0.2, 0.08]),
    "accel_scale": np.array([1.01, 0.995, 1.004]),
    "gyro_zero": np.radians([0.5, -0.3, 0.8]),
    "gyro_scale": np.array([0.99, 1.012, 1.0]),
}


@pytest.mark.parametrize("seed", range(1, 6))
def test_zeros_and_scales_within_their_standard_errors(seed: int) -> None:
    drive = Drive.from_tables([tumbled(**HIDDEN, seed=seed)])
    found = {f.name: f for f in tumble(drive)}
    off = []
    for kind in KINDS:
        for axis, true in zip("xyz", HIDDEN[kind], strict=True):
            f = found[f"{kind}_{axis}"]
            assert f.identifiable, f.reason
            off.append((f.value - true) / f.sd)  # type: ignore[operator]
    assert np.abs(off).max() < 4.0
    assert np.sqrt(np.mean(np.square(off))) < 1.5
    assert found["accel_zero_x"].sd < 0.01
    assert found["gyro_scale_x"].sd < 0.002


def test_a_drive_is_no_tumble_and_half_a_tumble_is_said() -> None:
    assert not is_tumble(Drive.from_tables(simulated("ryu2004-slalom", seed=3).tables))
    once_around = Drive.from_tables([tumbled(**HIDDEN, turns=("x", "x", "x", "x"))])
    assert not is_tumble(once_around)
    around_x = Drive.from_tables([tumbled(**HIDDEN, turns=TURNS[:4])])  # x is never up
    few = {f.name: f for f in tumble(around_x)}
    assert not few["accel_zero_x"].identifiable
    assert "up and down" in few["accel_zero_x"].reason


def test_the_file_makes_the_log_true_and_serves_the_drives_after(
    roadlog: Run, tmp_path: Path
) -> None:
    path, file = tmp_path / "tumble.mcap", tmp_path / "imu.toml"
    create(path, [tumbled(**HIDDEN)])
    done = roadlog("calibrate", path, "-o", file)
    assert done.returncode == 0, done.stderr
    assert "accel_zero_x" in done.stdout
    assert "forward in the log's" not in done.stdout
    car = Vehicle.load(file)
    assert car.source("accel_scale").axis_sd is not None
    drive = corrected(Drive.from_tables([tumbled(**HIDDEN, seed=9)]), car)
    force = np.stack([drive[f"imu.accel_{a}"] for a in "xyz"])
    assert np.abs(np.linalg.norm(force[:, :300], axis=0).mean() - G) < 0.01
    assert abs(drive["imu.gyro_z"][:300].mean()) < np.radians(0.01)
    # a car's logger with that IMU: its bias, and no more, is found from the drive
    slalom = simulated("ryu2004-slalom", seed=3)
    imu = next(t for t in slalom.tables if t.topic == "/imu")
    shown = dict(imu.columns)
    for kind in ("accel", "gyro"):
        for k, axis in enumerate("xyz"):
            name = f"{kind}_{axis}"
            shown[name] = shown[name] / HIDDEN[f"{kind}_scale"][k] + HIDDEN[f"{kind}_zero"][k]
    tables = [replace(t, columns=shown) if t is imu else t for t in slalom.tables]
    logs = {"tumble": Drive.from_tables([tumbled(**HIDDEN)]), "slalom": Drive.from_tables(tables)}
    found = calibrate(logs, slalom.vehicle)
    assert found.vehicle.accel_zero == pytest.approx(car.accel_zero)
    for axis in "xyz":
        assert abs(found.constants[f"gyro_bias_{axis}"].value) < np.radians(0.2)
