"""The public drives, each by one command with a shipped profile."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from roadlog.ingest import ingest
from roadlog.log import DriveLog
from roadlog.units import STANDARD_GRAVITY as G


def errors_deg(process) -> dict[str, dict[str, dict[str, float]]]:
    assert process.returncode == 0, process.stderr
    return json.loads(process.stdout)["estimates"]


def test_comma2k19_meets_its_goals(shared, roadlog, tmp_path):
    log = tmp_path / "comma.mcap"
    assert roadlog("ingest", shared / "comma2k19", "-o", log).returncode == 0
    causal = tmp_path / "causal.mcap"
    assert roadlog("estimate", log, "-e", "kmbe").returncode == 0
    made = roadlog("estimate", log, "-e", "kmbe", "--set", "kmbe.smooth=false", "-o", causal)
    assert made.returncode == 0
    rmse = {
        path.stem: errors_deg(roadlog("evaluate", path, "--json", "--remove-offset"))["kmbe"][
            "grade"
        ]["rmse_deg"]
        for path in (log, causal)
    }
    assert rmse["comma"] <= 0.20  # MAIN LINE issue
    assert rmse["causal"] <= 0.46


def test_comma2k19_axes_and_clocks_give_the_documented_baseline(shared, roadlog, tmp_path):
    # data README: asin((f_x - dv/dt) / g), zero-phase 0.5 Hz Butterworth, offset
    # removed: 0.375 deg over the whole minute, its unsettled ends included
    path = tmp_path / "comma.mcap"
    assert roadlog("ingest", shared / "comma2k19", "-o", path).returncode == 0
    log = DriveLog(path)
    drive, truth = log.drive(), log.truth()
    known = np.isfinite(drive["imu.accel_x"]) & np.isfinite(drive.speed)
    low = butter(2, 0.5, fs=drive.rate, output="sos")
    acceleration = np.gradient(drive.speed[known], drive.dt)
    raw = (drive["imu.accel_x"][known] - acceleration) / G
    grade = np.arcsin(np.clip(sosfiltfilt(low, raw), -1, 1))
    at = (truth.time_ns - drive.start_ns) * 1e-9
    inside = (at >= 0.0) & (at < drive.time[known][-1])
    error = np.interp(at[inside], drive.time[known], grade) - truth.angles["grade"][inside]
    assert np.degrees(error.std()) == pytest.approx(0.375, abs=0.03)


def test_canmod_axes_validity_and_files(shared):
    pytest.importorskip("asammdf")
    folder = shared / "canmod"
    result = ingest(
        sorted(folder.glob("*.MF4")), "canmod", [folder / "canmod-gps.dbc"], truth_from="gnss"
    )
    tables = {table.topic: table for table in result.tables}
    imu = tables["/imu"].columns
    assert np.nanmean(imu["accel_z"]) == pytest.approx(G, abs=0.3)
    assert abs(np.nanmean(imu["accel_x"])) < 0.5
    assert np.nanmin(imu["accel_x"]) > -30  # -64 m/s2 is a frame without data
    duration = np.ptp(tables["/imu"].time) * 1e-9
    assert duration == pytest.approx(29 * 60, abs=90)
    assert sum("identifiers, 10 decoded" in note for note in result.notes) == 3
    assert any("unknown identifiers (frames): 0x17F00010" in note for note in result.notes)
    assert np.abs(np.degrees(tables["/truth/angles"].columns["grade"])).max() < 12


@pytest.mark.parametrize("trip", ["sample_trip", "trip2_with_obd"])
def test_iphone_sign_and_axes(shared, trip):
    result = ingest([shared / "iphone" / f"{trip}.csv"], "iphone")
    tables = {table.topic: table for table in result.tables}
    assert np.nanmean(tables["/imu"].columns["accel_z"]) == pytest.approx(G, abs=0.3)
    v, gnss = tables["/speed"].columns["v"], tables["/gnss"].columns["altitude"]
    assert 5 < np.nanmax(v) < 40
    assert 100 < np.nanmean(gnss) < 300
