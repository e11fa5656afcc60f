"""`profile new`: a profile that loads and ingests, written from names, units and the data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import ROOT

from roadlog.checks import check
from roadlog.errors import ConfigError
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.profile import Profile
from roadlog.units import STANDARD_GRAVITY as G

SAMPLE = ROOT / "sample_logs" / "small_logger.csv"  # x left, y backward
VENDOR = {
    "time_ms": "Time [ms]",
    "ax_g": "IMU_AccelX",
    "ay_g": "IMU_AccelY",
    "az_g": "IMU_AccelZ",
    "wx_dps": "IMU_GyroX",
    "wy_dps": "IMU_GyroY",
    "wz_dps": "IMU_GyroZ",
    "speed_kmh": "VehSpd",
    "true_grade_deg": "PumpState",
}


@pytest.fixture
def vendor(tmp_path: Path) -> Path:
    """The sample as another logger names it, without units; its sensor is the same."""
    header, rest = SAMPLE.read_text().split("\n", 1)
    path = tmp_path / "vendor.csv"
    path.write_text(",".join(VENDOR[name] for name in header.split(",")) + "\n" + rest)
    return path


def entries(text: str) -> dict[str, tuple[str, str]]:
    profile = Profile.from_toml(text, "new")
    return {entry.role: (entry.sources[0], entry.unit) for entry in profile}


def test_the_sample_gets_the_profile_that_it_ships_with():
    text = starter([SAMPLE])
    ours, shipped = Profile.from_toml(text, "new"), Profile.load(SAMPLE.with_suffix(".toml"))
    assert {(e.role, e.sources, e.unit) for e in ours} == {
        (e.role, e.sources, e.unit) for e in shipped
    }
    np.testing.assert_array_equal(ours.mounts["imu"], shipped.mounts["imu"])
    assert ours.clock == shipped.clock


def test_units_and_mounting_come_from_the_data_where_no_name_says_them(vendor):
    text = starter([vendor])
    found = entries(text)
    assert found["imu.accel_x"] == ("IMU_AccelX", "g")
    assert found["imu.gyro_z"] == ("IMU_GyroZ", "deg/s")
    assert found["speed.v"] == ("VehSpd", "km/h")
    assert 'mount = { forward = "-y", left = "+x" }' in text
    assert "#   PumpState" in text
    result = ingest([vendor], Profile.from_toml(text, "new"))
    tables = {table.topic: table for table in result.tables}
    assert np.nanmean(tables["/imu"].columns["accel_z"]) == pytest.approx(G, rel=0.02)
    assert not [f for f in check(tables) if f.level == "fault"]


def test_what_is_uncertain_is_said(tmp_path):
    rows = np.arange(300)
    table = np.column_stack([rows * 0.1, rows % 7 + 1.0, rows % 5 + 1.0, rows % 11 * 10.0])
    path = tmp_path / "drive.csv"
    header = "t,gps_speed,gps_bearing,SteeringAngle"
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    text = starter([path])
    assert "nothing states the unit: m/s is assumed" in text
    assert "clockwise from north" in text
    assert "# road_wheel_angle = { from" in text
    assert set(entries(text)) == {"gnss.speed", "gnss.course"}


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("Vehicle Speed (km/h)", "speed.v", "km/h"),
        ("VehicleSpeed_mph", "speed.v", "mph"),
        ("GPS Speed [m/s]", "gnss.speed", "m/s"),
        ("WheelSpeedFL_kmh", "wheel_speeds.fl", "km/h"),
        ("whl_spd_rear_right", "wheel_speeds.rr", "m/s"),
        ("WSpd_LF_kph", "wheel_speeds.fl", "km/h"),
        ("yaw_rate_dps", "imu.gyro_z", "deg/s"),
        ("LongAccel[g]", "imu.accel_x", "g"),
        ("gFz", "imu.accel_z", "m/s^2"),
        ("Latitude", "gnss.latitude", "deg"),
        ("lng", "gnss.longitude", "deg"),
        ("gps_altitude_m", "gnss.altitude", "m"),
        ("baro_alt_ft", "barometer.altitude", "ft"),
    ],
)
def test_names_that_vendors_use(tmp_path, name, role, unit):
    path = tmp_path / "drive.csv"
    path.write_text(f"t,{name}\n" + "".join(f"{k / 10},{1 + k % 3}\n" for k in range(50)))
    found = entries(starter([path]))
    assert found[role] == (name, unit)


@pytest.mark.parametrize("rows", [1, 3])
def test_a_log_of_a_few_rows_says_its_names_only(tmp_path, rows):
    path = tmp_path / "drive.csv"
    path.write_text("t,ax,v\n" + "".join(f"{k},{k},2\n" for k in range(rows)))
    text = starter([path])
    assert entries(text) == {"imu.accel_x": ("ax", "m/s^2"), "speed.v": ("v", "m/s")}
    assert not check({t.topic: t for t in ingest([path], Profile.from_toml(text, "new")).tables})


def test_a_log_without_signals_is_an_error_that_names_what_is_there(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t,engine_speed,pump\n0,1,2\n0.1,1,2\n")
    with pytest.raises(ConfigError, match=r"no name .* looks like a signal.*engine_speed"):
        starter([path])


def test_public_drives_get_their_mounting(shared):
    iphone = starter([shared / "iphone" / "sample_trip.csv"])
    assert 'mount = { forward = "+y", left = "-x" }' in iphone
    assert 'accel_z = { from = "accelZ(g)", unit = "g", scale = -1 }' in iphone
    canmod = starter(
        [shared / "canmod" / "00000003-60FE43B2.MF4"], [shared / "canmod" / "canmod-gps.dbc"]
    )
    assert 'mount = { forward = "-y", left = "-z" }' in canmod
    assert 'valid = "ImuValid == 1"' in canmod


def test_the_command_writes_a_file_once_and_ingest_takes_it(roadlog, vendor, tmp_path):
    out = tmp_path / "p.toml"
    done = roadlog("profile", "new", vendor, "-o", out)
    assert done.returncode == 0, done.stderr
    assert f"--profile {out}" in done.stdout
    assert ingest([vendor], out).tables
    again = roadlog("profile", "new", vendor, "-o", out)
    assert again.returncode == 1
    assert "is there already" in again.stderr
