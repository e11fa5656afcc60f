"""`roadlog export`: round trips to the bit, chosen signals, the common grid."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables, table

from roadlog.errors import ConfigError
from roadlog.export import export
from roadlog.ingest import ingest
from roadlog.log import DriveLog, create


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Hills, and a 10 Hz GNSS with odd stamps whose values have all their digits."""
    chance = np.random.default_rng(4)
    time = EPOCH_NS + np.cumsum(chance.integers(90_000_000, 110_000_000, 600))
    gnss = {name: chance.normal(47, 1, 600) for name in ("latitude", "altitude", "speed")}
    gnss["altitude"][chance.random(600) < 0.2] = np.nan
    path = tmp_path_factory.mktemp("export") / "drive.mcap"
    create(path, [*hill_tables(), table("gnss", time, gnss)])
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_log_comes_back_to_the_bit(log, tmp_path, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    out = tmp_path / f"drive{suffix}"
    rows, columns, losses = export(log, out)
    assert losses == []
    assert rows == len({int(t) for x in DriveLog(log).tables().values() for t in x.time})
    assert {"imu.accel_x", "gnss.altitude", "truth.grade"} <= {c.name for c in columns}
    back = {t.topic: t for t in ingest([out]).tables}  # the roadlog profile is found by itself
    for topic, original in DriveLog(log).tables().items():
        np.testing.assert_array_equal(back[topic].time, original.time)
        for name, values in original.columns.items():
            np.testing.assert_array_equal(back[topic].columns[name], values, err_msg=name)


def test_roles_and_topics_choose(log, tmp_path):
    out = tmp_path / "x.csv"
    export(log, out, topics=["/gnss"], roles=["imu.accel_x"])
    with out.open() as file:
        head = next(csv.reader(file))
    assert head[:3] == ["time_ns", "time_s", "gnss.latitude [deg]"]
    assert head[3:] == ["gnss.altitude [m]", "gnss.speed [m/s]", "imu.accel_x [m/s^2]"]
    with pytest.raises(ConfigError, match=r"no topic '/gns'. Close: /gnss"):
        export(log, out, topics=["/gns"])
    with pytest.raises(ConfigError, match=r"does not know fuel\.sender"):
        export(log, out, roles=["fuel.sender"])
    with pytest.raises(ConfigError, match=r"ends in \.csv, \.parquet, "):
        export(log, tmp_path / "x.xls")


def test_a_grid_is_what_estimators_see(log, tmp_path):
    out = tmp_path / "grid.csv"
    rows, _, _ = export(log, out, roles=["imu.accel_x", "gnss.speed"], every="20Hz")
    drive = DriveLog(log).drive(20.0)
    data = np.genfromtxt(out, delimiter=",", names=True)
    assert rows == len(data) == len(drive)
    for name, role in (("imuaccel_x_ms2", "imu.accel_x"), ("gnssspeed_ms", "gnss.speed")):
        np.testing.assert_allclose(data[name], drive[role], atol=1e-9, equal_nan=True)


def test_two_messages_of_one_stamp_stay_two(tmp_path):
    time = EPOCH_NS + np.array([0, 1, 1, 2]) * 10**8
    create(tmp_path / "x.mcap", [table("speed", time, {"v": np.arange(4.0)})])
    rows, _, _ = export(tmp_path / "x.mcap", tmp_path / "x.csv")
    assert rows == 4
    assert (tmp_path / "x.csv").read_text().splitlines()[2:4] == [
        f"{EPOCH_NS + 10**8},0.1,1.0",
        f"{EPOCH_NS + 10**8},0.1,2.0",
    ]


def test_a_failed_export_leaves_the_old_file(roadlog, log, tmp_path):
    out = tmp_path / "x.csv"
    out.write_text("precious")
    failed = roadlog("export", log, "-o", out, "--force", "--topics", "/gone")
    assert failed.returncode == 1
    assert "no topic '/gone'" in failed.stderr
    assert out.read_text() == "precious"
    done = roadlog("export", log, "-o", out, "--force", "--topics", "/gnss,/imu", "--every", "10Hz")
    assert done.returncode == 0
    assert out.read_text().startswith("time_ns,time_s,gnss.latitude")


def test_a_row_each_ten_meters_in_degrees(log, tmp_path):
    drive = DriveLog(log).drive()
    out = tmp_path / "way.csv"
    rows, _, _ = export(log, out, roles=["truth.grade"], every="10m", degrees=True)
    data = np.genfromtxt(out, delimiter=",", names=True)
    way = float(np.nansum(drive.speed[1:] + drive.speed[:-1]) / 2 * drive.dt)
    assert rows == len(data) == pytest.approx(way / 10, abs=1)
    speed = np.interp(data["time_s"], drive.time, drive.speed)
    steps = np.diff(data["time_s"]) * (speed[1:] + speed[:-1]) / 2
    np.testing.assert_allclose(steps, 10.0, rtol=0.02)
    true = DriveLog(log).truth()
    at = np.interp(data["time_s"], true.time, np.degrees(true.grade))
    np.testing.assert_allclose(data["truthgrade_deg"], at, atol=0.02)
    for step in ("10 km", "1e1m", ""):
        with pytest.raises(ConfigError, match=f"--every: '{step}' is no step.* as in 0.1s"):
            export(log, out, every=step)
    assert out.read_text().splitlines()[0] == "time_ns,time_s,distance [m],truth.grade [deg]"
    np.testing.assert_array_equal(data["distance_m"], 10.0 * np.arange(rows))


def test_degrees_are_not_read_back_as_radians(log, tmp_path):
    export(log, tmp_path / "x.csv", roles=["imu.accel_x", "imu.gyro_y"], degrees=True)
    back = {t.topic: t for t in ingest([tmp_path / "x.csv"], "roadlog").tables}
    assert not np.isfinite(back["/imu"].columns["gyro_y"]).any()
    assert np.isfinite(back["/imu"].columns["accel_x"]).all()


def test_excel_and_matlab(log, tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    from scipy.io import loadmat

    export(log, tmp_path / "x.xlsx", roles=["imu.accel_x", "gnss.speed"], every="1s")
    sheet = openpyxl.load_workbook(tmp_path / "x.xlsx").active
    head, first, *_ = sheet.iter_rows(values_only=True)
    assert head == ("UTC", "time_s [s]", "gnss.speed [m/s]", "imu.accel_x [m/s^2]")
    assert first[1] == 0
    export(log, tmp_path / "x.mat", roles=["imu.accel_x", "gnss.speed"])
    found = loadmat(tmp_path / "x.mat", simplify_cells=True)
    table = DriveLog(log).tables()["/imu"]
    np.testing.assert_array_equal(
        found["imu_accel_x"][np.isfinite(found["imu_accel_x"])], table.columns["accel_x"]
    )
    assert found["units"]["imu_accel_x"] == "m/s^2"
