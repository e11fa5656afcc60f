"""openpilot logs, plain and packed: values, angles, and its own pose as comparison."""

from __future__ import annotations

import numpy as np
import pytest
from support.phone_drive import EPOCH, PhoneDrive

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.ingest import ingest

pytest.importorskip("capnp")
DRIVE = PhoneDrive()


@pytest.mark.parametrize("name", ["rlog", "rlog.bz2", "abc--0--qlog.zst"])
def test_a_log_of_a_comma_device_gives_what_was_driven(tmp_path, name):
    from support.openpilot_log import write

    result = ingest([write(tmp_path / name)])
    tables = {table.topic: table for table in result.tables}
    imu, gnss, truth = (tables[topic] for topic in ("/imu", "/gnss", "/truth/angles"))
    t = imu.time * 1e-9 - EPOCH
    force, rate = DRIVE.imu(t)
    for k, axis in enumerate("xyz"):
        assert np.nanmax(np.abs(imu.columns[f"accel_{axis}"] - force[:, k])) < 1e-3
        assert np.nanmax(np.abs(imu.columns[f"gyro_{axis}"] - rate[:, k])) < 1e-4
    fixes = DRIVE.fixes(gnss.time * 1e-9 - EPOCH)
    assert np.abs(gnss.columns["latitude"] - fixes["latitude"]).max() < 1e-7
    assert np.abs(gnss.columns["climb"] - fixes["climb"]).max() < 1e-3
    steering = tables["/steering"].columns["road_wheel_angle"]
    assert steering == pytest.approx(np.radians(2.0), abs=1e-3)
    at = truth.time * 1e-9 - EPOCH
    assert np.nanmax(np.abs(truth.columns["inclination"] - DRIVE.grade(at))) < 1e-5
    assert truth.columns["bank"] == pytest.approx(0.01)
    drive = Drive.from_tables(result.tables)
    grade = estimators.run("kmbe", drive, Vehicle()).angles["grade"]
    error = np.degrees(grade - DRIVE.grade(drive.time))
    assert np.sqrt(np.nanmean(error[2500:11000] ** 2)) < 0.5
    assert any("openpilot's own estimate" in note for note in result.notes)
