"""Action cameras: the telemetry in the video, from the file to angles."""

from __future__ import annotations

import numpy as np
import pytest
from support.camera_formats import (
    DRIVE,
    gopro,
    gopro_json,
    gopro_tables,
    gopro_tables_older,
    gopro_turned,
)
from support.phone_drive import EPOCH

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import LogReadError
from roadlog.ingest import ingest

WRITERS = [gopro, gopro_turned, gopro_json, gopro_tables, gopro_tables_older]


@pytest.mark.parametrize("writer", WRITERS)
def test_a_camera_gives_what_was_driven(tmp_path, writer):
    result = ingest([writer(tmp_path)])
    tables = {table.topic: table for table in result.tables}
    imu, gnss = tables["/imu"], tables["/gnss"]
    t = imu.time * 1e-9 - EPOCH
    force, rate = DRIVE.imu(t)
    for k, axis in enumerate("xyz"):
        assert np.abs(imu.columns[f"accel_{axis}"] - force[:, k]).max() < 0.01
        assert np.abs(imu.columns[f"gyro_{axis}"] - rate[:, k]).max() < 1e-3
    true = DRIVE.fixes(gnss.time * 1e-9 - EPOCH)
    assert np.abs(gnss.columns["latitude"] - true["latitude"]).max() < 1e-6
    assert np.abs(gnss.columns["altitude"] - true["altitude"]).max() < 0.01
    assert np.abs(gnss.columns["speed"] - true["speed"]).max() < 0.01
    drive = Drive.from_tables(result.tables)
    grade = estimators.run("kmbe", drive, Vehicle()).angles["grade"]
    error = np.degrees(grade - DRIVE.grade(drive.time))
    assert np.sqrt(np.nanmean(error[2500:11000] ** 2)) < 0.5


def test_a_video_cut_off_before_its_index_is_refused(tmp_path):
    video = gopro(tmp_path)
    data = video.read_bytes()
    video.write_bytes(data[: len(data) // 2])
    with pytest.raises(LogReadError):
        ingest([video])
