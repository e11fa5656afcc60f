"""`profile new`: a profile that loads and ingests, written from names, units and the data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import ROOT
from typer.testing import CliRunner

from roadlog.car.vehicle import Vehicle
from roadlog.checks import check
from roadlog.cli import app
from roadlog.drive import Drive
from roadlog.errors import ConfigError
from roadlog.estimators import run
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
        ("Velocidad angular X (rad/s)", "imu.gyro_x", "rad/s"),
        ("Vitesse angulaire Z [deg/s]", "imu.gyro_z", "deg/s"),
        ("Winkelgeschwindigkeit Y [°/s]", "imu.gyro_y", "deg/s"),
        ("Velocità di imbardata (°/s)", "imu.gyro_z", "deg/s"),
        ("Velocità veicolo (km/h)", "speed.v", "km/h"),
        ("Vel Cabeceo (°/s)", "imu.gyro_y", "deg/s"),
        ("Vel. de balanceo [°/s]", "imu.gyro_x", "deg/s"),
        ("Taux de lacet (deg/s)", "imu.gyro_z", "deg/s"),
        ("AccX [mm/s^2]", "imu.accel_x", "mm/s^2"),
        ("speed_cms", "speed.v", "cm/s"),
        ("alt_cm", "gnss.altitude", "cm"),
        ("hGPS", "gnss.altitude", "m"),
        ("h_gnss [cm]", "gnss.altitude", "cm"),
        ("course_cdeg", "gnss.course", "cdeg"),
        ("gyro_z_mdps", "imu.gyro_z", "mdeg/s"),
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


def test_a_log_without_known_names_gets_a_profile_of_comments(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t,engine_speed,pump\n" + "".join(f"{k / 10},{1 + k},2\n" for k in range(9)))
    text = starter([path])
    assert "No name in it looks like a signal" in text
    assert "#   engine_speed  (1 to 9)" in text
    with pytest.raises(ConfigError, match=r"maps no signal; write at least one, as \[speed\]"):
        Profile.from_toml(text, "new")
    done = CliRunner().invoke(app, ["profile", "new", str(path), "-o", str(tmp_path / "p.toml")])
    assert done.exit_code == 3
    assert "nothing in it looks like a signal" in done.stderr
    assert "then" not in done.stdout  # no ingest that would fail
    assert "engine_speed" in (tmp_path / "p.toml").read_text("utf-8")


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("Längsbeschleunigung [m/s²]", "imu.accel_x", "m/s^2"),
        ("ESP_Gierrate", "imu.gyro_z", "rad/s"),
        ("Vitesse [km/h]", "speed.v", "km/h"),
        ("Velocidad (km/h)", "speed.v", "km/h"),
        ("Fahrzeuggeschwindigkeit", "speed.v", "m/s"),
        ("velocity kmh", "speed.v", "km/h"),
        ("Ground Speed [km/h]", "speed.v", "km/h"),
        ("InlineAcc [g]", "imu.accel_x", "g"),
        ("G Force Long [G]", "imu.accel_x", "g"),
        ("LateralAcc [g]", "imu.accel_y", "g"),
        ("Gyro Yaw Velocity [deg/s]", "imu.gyro_z", "deg/s"),
        ("Wheel Speed FL [km/h]", "wheel_speeds.fl", "km/h"),
        ("ABS_VL_Radgeschw", "wheel_speeds.fl", "m/s"),
        ("WHL_SPD_RR", "wheel_speeds.rr", "m/s"),
        ("AccX_IMU1", "imu.accel_x", "m/s^2"),
        ("vert-vel", "gnss.climb", "m/s"),
        ("Vitesse de lacet (°/s)", "imu.gyro_z", "deg/s"),
        ("Breitengrad", "gnss.latitude", "deg"),
        ("Höhe [m]", "gnss.altitude", "m"),
        ("Slope_RTK_deg", "truth.grade", "deg"),
        ("vVeh\\ETKC:1", "speed.v", "m/s"),
        ("CAN1::ESP_02::v_Fzg[km/h]", "speed.v", "km/h"),
        ("Model Root/Car/yaw_rate[rad/s]", "imu.gyro_z", "rad/s"),
        ("psi_dot", "imu.gyro_z", "rad/s"),
        ("wNick[°/s]", "imu.gyro_y", "deg/s"),
        ("Angular rate Yv (deg/s)", "imu.gyro_y", "deg/s"),
        ("Gyr_X [mdps]", "imu.gyro_x", "mdeg/s"),
        ("position_lat", "gnss.latitude", "deg"),
        ("Steigung_Ref [%]", "truth.grade", "%"),
        ("Geschwindigkeit über Grund [km/h]", "speed.v", "km/h"),
        ("Geografische Breite [°]", "gnss.latitude", "deg"),
        ("Geographische Länge [°]", "gnss.longitude", "deg"),
        ("Höhe über NN [m]", "gnss.altitude", "m"),
        ("Vitesse roue avant gauche [km/h]", "wheel_speeds.fl", "km/h"),
        ("Velocidad rueda trasera derecha [km/h]", "wheel_speeds.rr", "km/h"),
        ("Velocidad del vehículo [km/h]", "speed.v", "km/h"),
        ("Vitesse verticale [m/s]", "gnss.climb", "m/s"),
        ("Velocidad vertical [m/s]", "gnss.climb", "m/s"),
        ("Lacet °/s", "imu.gyro_z", "deg/s"),
        ("Vitesse km/h", "speed.v", "km/h"),
        ("Beccheggio [deg/s]", "imu.gyro_y", "deg/s"),
        ("Vit. roue AV G (km/h)", "wheel_speeds.fl", "km/h"),
        ("Vit. roue AR D (km/h)", "wheel_speeds.rr", "km/h"),
        ("Velocità ruota ant. sx [km/h]", "wheel_speeds.fl", "km/h"),
        ("Velocidade roda tras. dir. [km/h]", "wheel_speeds.rr", "km/h"),
        ("Snelheid [km/h]", "speed.v", "km/h"),
    ],
)
def test_names_of_vendors_and_languages(tmp_path, name, role, unit):
    path = tmp_path / "drive.csv"
    rows = "".join(f"{k / 10};{1 + k % 3}\n" for k in range(50))
    path.write_text(f"t;{name}\n{rows}", encoding="utf-8")
    assert entries(starter([path]))[role] == (name, unit)


@pytest.mark.parametrize(
    "name",
    [
        "G Force Lat [g]",
        "Wheel Speed FL [rpm]",
        "Engine Speed [rpm]",
        "Ground Speed [bar]",
        "GPS LatAcc [g]",
        "Wind Speed [m/s]",
        "Vel Down [m/s]",
        "Altitude Valid",
        "Lat [g]",
        "Cap pressure",
        "Fahrzeugbreite [mm]",
        "Windgeschwindigkeit [km/h]",
        "Vitesse du vent [km/h]",
        "Velocidad del viento [km/h]",
        "Satellite elevation [deg]",
        "Ride Height FL [mm]",
        "Yaw [deg]",
        "Lacet",
    ],
)
def test_what_a_unit_or_word_contradicts_is_not_mapped(tmp_path, name):
    path = tmp_path / "drive.csv"
    path.write_text(f"t,v,{name}\n" + "".join(f"{k / 10},{k % 7},{1 + k % 3}\n" for k in range(50)))
    found = entries(starter([path]))
    assert {role for role, (source, _) in found.items() if source == name} <= {"imu.accel_y"}


def test_the_time_is_the_column_that_rises(tmp_path):
    path = tmp_path / "drive.csv"
    rows = "".join(f"{k % 5};{3 + k * 0.02:.2f};{10 + k % 3}\n" for k in range(200))
    path.write_text(f"Zähler;Kanal 1;Geschwindigkeit [km/h]\n{rows}", encoding="utf-8")
    text = starter([path])
    assert "the time is taken to be 'Kanal 1', which goes on as one does" in text
    profile = Profile.from_toml(text, "new")
    assert profile.clock.column == "Kanal 1"
    assert np.ptp(ingest([path], profile).tables[0].time) * 1e-9 == pytest.approx(199 * 0.02)


def test_files_that_differ_have_a_clock_each(tmp_path):
    (tmp_path / "a.csv").write_text(
        "Zeit [ms],v [km/h]\n" + "".join(f"{k * 100},{k % 9}\n" for k in range(90))
    )
    (tmp_path / "b.csv").write_text(
        "elapsed_s,yaw_rate [deg/s]\n" + "".join(f"{k / 10},{k % 4}\n" for k in range(90))
    )
    files = [tmp_path / "a.csv", tmp_path / "b.csv"]
    text = starter(files)
    assert text.count("[[time]]") == 2
    tables = {t.topic: t for t in ingest(files, Profile.from_toml(text, "new")).tables}
    for topic in ("/speed", "/imu"):
        assert np.ptp(tables[topic].time) * 1e-9 == pytest.approx(8.9)


def test_of_speeds_the_one_that_the_positions_bear_out(tmp_path):
    path = tmp_path / "drive.csv"
    k = np.arange(600)
    v = 60 + 20 * np.sin(k / 60)
    lat = 50 + np.cumsum(v / 3.6 * 0.1) / 111_195
    noise = np.random.default_rng(1).uniform(40, 80, len(k))
    table = np.column_stack([k / 10, lat, np.full(len(k), 8.0), noise, v])
    np.savetxt(
        path,
        table,
        delimiter=",",
        header="time,lat,lon,v_set_kmh,v_act_kmh",
        comments="",
        fmt="%.9f",
    )
    assert entries(starter([path]))["speed.v"] == ("v_act_kmh", "km/h")


def receiver(path: Path, **columns: np.ndarray) -> str:
    """A profile for a table of a car that goes north-east at 10 m/s and more, by columns."""
    names = ["time", *columns]
    table = np.column_stack([WAY["time"], *columns.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.9f")
    return starter([path])


def way() -> dict[str, np.ndarray]:
    t = np.arange(0, 120, 0.2)
    speed = 12 + 3 * np.sin(t / 9)
    s = np.cumsum(speed) * 0.2
    heading = 0.6 + 0.5 * np.sin(s / 300)
    north, east = np.cumsum(np.sin(heading) * speed) * 0.2, np.cumsum(np.cos(heading) * speed) * 0.2
    latitude = 47.2 + np.degrees(north / 6371009)
    longitude = 11.4 + np.degrees(east / 6371009) / np.cos(np.radians(47.2))
    return {"time": t, "v": speed, "lat": latitude, "lon": longitude, "heading": heading}


WAY = way()


def written(degrees: np.ndarray) -> np.ndarray:
    return np.trunc(degrees) * 100 + degrees % 1 * 60


@pytest.mark.parametrize(
    ("turned", "said"),
    [
        (written, "degrees and minutes in one number"),
        (lambda d: d * 60, "minutes of arc"),
        (lambda d: np.round(d * 1e7), "1e-7 degrees"),
        (np.radians, "in radians"),
    ],
)
@pytest.mark.parametrize(("name", "factor"), [("speed_mps", 1.0), ("speed_kmh", 3.6)])
def test_positions_in_any_form_are_positions(tmp_path, turned, said, name, factor):
    path = tmp_path / "drive.csv"
    speed = {name: WAY["v"] * factor}
    text = receiver(path, lat=turned(WAY["lat"]), lon=turned(WAY["lon"]), **speed)
    assert said in text
    gnss = next(
        t for t in ingest([path], Profile.from_toml(text, "p")).tables if t.topic == "/gnss"
    )
    np.testing.assert_allclose(gnss.columns["latitude"], WAY["lat"], atol=2e-7)
    np.testing.assert_allclose(gnss.columns["longitude"], WAY["lon"], atol=2e-7)


@pytest.mark.parametrize("power", [5, 6, 7])
def test_a_power_of_ten_in_a_name(tmp_path, power):
    path = tmp_path / "drive.csv"
    columns = {f"{n}_e{power}": np.round(WAY[n] * 10**power) for n in ("lat", "lon")}
    text = receiver(path, **columns)
    assert f"by its name in 1e-{power} degrees" in text
    gnss = next(
        t for t in ingest([path], Profile.from_toml(text, "p")).tables if t.topic == "/gnss"
    )
    np.testing.assert_allclose(gnss.columns["latitude"], WAY["lat"], atol=10.0**-power)


def test_what_a_receiver_counts_in_its_own_units(tmp_path):
    path = tmp_path / "drive.csv"
    clockwise = (90 - np.degrees(WAY["heading"])) % 360
    height = np.full(len(WAY["time"]), 612.5)
    positions = {"lat": np.round(WAY["lat"] * 1e7), "lon": np.round(WAY["lon"] * 1e7)}
    text = receiver(
        path, **positions, gSpeed=WAY["v"] * 1e3, headMot=np.round(clockwise * 1e5),
        height=height * 1e3,
    )  # fmt: skip
    tables = {t.topic: t.columns for t in ingest([path], Profile.from_toml(text, "p")).tables}
    np.testing.assert_allclose(tables["/speed"]["v"], WAY["v"], atol=1e-3)
    np.testing.assert_allclose(tables["/gnss"]["altitude"], height)
    np.testing.assert_allclose(tables["/gnss"]["course"], WAY["heading"], atol=1e-6)


def test_the_first_tables_of_an_engineer_need_no_edit(shared):
    folder = shared.parent / "cases" / "first_hour"
    if not folder.is_dir():
        pytest.skip("no cases/first_hour beside the project")
    for path in sorted(folder.glob("*.csv")):
        text = starter([path])
        assert "kmbe" in text.partition("# feeds:")[2]
        profile = Profile.from_toml(text, "new")
        result = ingest([path], profile)
        assert not result.losses
        table = next(t for t in result.tables if t.topic == "/truth/angles")
        assert np.nanmax(np.degrees(table.columns["grade"])) == pytest.approx(9.0, abs=0.3)
        drive = Drive.from_tables([t for t in result.tables if t.topic != "/truth/angles"])
        truth = np.interp(drive.time_ns, table.time, table.columns["grade"])
        off = np.degrees(run("kmbe", drive, Vehicle()).grade - truth)
        assert np.sqrt(np.nanmean(off**2)) < 1.0  # the slope of 4 deg is no lean of the sensor


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


@pytest.mark.parametrize(
    ("name", "each"),
    [
        ("course", 1.0),
        ("course", 100.0),
        ("course_deg", 1.0),
        ("course_cdeg", 100.0),
        ("hdg [mdeg]", 1e3),
        ("course", 1e3),
        ("headMot", 1e5),
        ("course_rad", np.pi / 180),
        ("course", np.pi / 180),
        ("heading [mrad]", np.pi / 0.18),
    ],
)
def test_a_course_in_any_unit_is_counted_from_the_east(tmp_path, name, each):
    """Of each kind the values are clockwise from north."""
    degrees = np.linspace(20, 340, 200)
    values = degrees * each if each < 10 or "mrad" in name else np.rint(degrees * each)
    table = np.column_stack(
        [np.arange(200) * 0.1, values, 48 + degrees * 1e-6, 11 + degrees * 1e-6]
    )
    path = tmp_path / "drive.csv"
    header = f"t,{name},lat,lon"
    np.savetxt(path, table, "%.9f", ",", header=header, comments="")
    text = starter([path])
    (table,) = ingest([path], Profile.from_toml(text, "new")).tables
    expected = np.radians(90 - degrees)
    np.testing.assert_allclose(np.cos(table.columns["course"] - expected), 1, atol=1e-6)
