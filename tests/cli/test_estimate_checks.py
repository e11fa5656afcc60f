"""`estimate` says what is wrong with the log, keeps it, and does not sell angles made of it."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from support.drives import hill_tables
from typer.testing import CliRunner

from roadlog.car.vehicle import Vehicle
from roadlog.cli import app
from roadlog.log import DriveLog, create
from roadlog.units import STANDARD_GRAVITY as G


@pytest.fixture
def in_g(tmp_path: Path) -> Path:
    """Hills with the accelerations in g."""
    tables = hill_tables()
    imu = tables[0]
    columns = {n: x / G if n.startswith("accel") else x for n, x in imu.columns.items()}
    path = tmp_path / "in_g.mcap"
    create(path, [dataclasses.replace(imu, columns=columns), *tables[1:]])
    return path


def run(*arguments: object) -> tuple[str, str]:
    done = CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)
    assert done.exit_code == 0
    return done.stdout, done.stderr


def test_a_fault_is_a_warning_and_its_angles_are_not_valid(in_g: Path) -> None:
    out, err = run("estimate", in_g, "-e", "kmbe", "-e", "lowpass_attitude")
    assert "warning: imu.accel_x, imu.accel_y, imu.accel_z: gravity reads 1: the unit is g" in err
    assert "0.0 %" in out
    log = DriveLog(in_g)
    assert not log.stored("kmbe").valid.any()
    assert np.isfinite(log.stored("kmbe").angles["grade"]).any()
    assert "the unit is g" in log.metadata["estimate/kmbe"]["checks"]
    assert "not valid" in log.metadata["estimate/kmbe"]["notes"]


def test_evaluate_repeats_what_was_known(in_g: Path) -> None:
    run("estimate", in_g, "-e", "kmbe")
    out, err = run("evaluate", in_g, "--json")
    assert "the unit is g" in err
    assert "the unit is g" in json.loads(out)["checks"][0]


def test_without_checks_nothing_is_said(in_g: Path) -> None:
    _, err = run("estimate", in_g, "-e", "kmbe", "--no-checks")
    assert "warning" not in err
    assert DriveLog(in_g).stored("kmbe").valid.any()


def test_what_the_vehicle_file_corrects_is_no_fault(tmp_path: Path) -> None:
    tables = hill_tables()
    imu = tables[0]
    flipped = ("accel_y", "accel_z", "gyro_y", "gyro_z")
    columns = {n: -x if n in flipped else x for n, x in imu.columns.items()}
    turned = [dataclasses.replace(imu, columns=columns), *tables[1:]]
    create(tmp_path / "as_it_is.mcap", turned)
    mounted = Vehicle().mounted(np.diag([1.0, -1.0, -1.0]))
    create(tmp_path / "mounted.mcap", turned, vehicle=mounted)
    _, err = run("estimate", tmp_path / "as_it_is.mcap", "-e", "fusion")
    assert "the sensor's axes are not the vehicle's" in err
    _, err = run("estimate", tmp_path / "mounted.mcap", "-e", "fusion")
    assert "warning" not in err
    assert DriveLog(tmp_path / "mounted.mcap").stored("fusion").valid.any()
