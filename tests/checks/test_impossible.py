"""What cannot be is said with its likely cause, tried on the data; nothing is inferred of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from roadlog.checks import check
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile
from roadlog.storage import Table
from roadlog.storage.schemas import columns as fields_of

COUNT = 3000
T = np.arange(COUNT) / 10
SPEED = 15 + 4 * np.sin(T / 15)
NORTH = 50 + np.cumsum(SPEED) * 0.1 / 111_195
EAST = np.full(COUNT, -8.0)


def table(topic: str, schema: str, **values: np.ndarray) -> Table:
    schema = f"roadlog.v1.{schema}"
    blank = {
        name: np.full(COUNT, np.nan if d.kind == "f" else 0, d)
        for name, d in fields_of(schema).items()
    }
    time = 1_700_000_000_000_000_000 + np.round(T * 1e9).astype(np.int64)
    return Table(topic, schema, time, {**blank, **values})


def drive(scale: float = 1.0, altitude: float = 1.0, v: np.ndarray = SPEED) -> dict[str, Table]:
    height = (100 + 5 * np.sin(T / 40)) * altitude
    gnss = table("/gnss", "Gnss", latitude=NORTH * scale, longitude=EAST * scale, altitude=height)
    return {"/gnss": gnss, "/speed": table("/speed", "Speed", v=v)}


def faults(tables: dict[str, Table]) -> dict[str, str]:
    return {f.signals[0]: str(f) for f in check(tables) if f.level == "fault"}


def test_a_drive_that_can_be_has_no_such_finding():
    assert faults(drive()) == {}


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (60.0, "minutes of arc? Then say scale = 0.01666667"),
        (1e7, "1e-7 degrees? Then say scale = 1e-07"),
        (np.pi / 180, 'in radians; say unit = "rad"'),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 3.6])
def test_positions_in_another_unit(scale, words, unit):
    if unit != 1.0 and scale < 1:
        pytest.skip("a speed in km/h hides radians")
    found = faults(drive(scale, v=SPEED * unit))
    assert words in found["gnss.latitude"]
    assert "speed.v" not in found  # nothing is inferred of positions that cannot be


def test_a_factor_that_the_speed_denies_is_not_advised():
    found = faults(drive(60.0, v=SPEED * 20))
    assert "scale" not in found["gnss.latitude"]


@pytest.mark.parametrize(
    ("factor", "words"), [(1e3, 'unit = "mm"'), (1e6, "nothing that is tried")]
)
def test_heights_in_another_unit(factor, words):
    assert words in faults(drive(altitude=factor))["gnss.altitude"]


def test_a_height_that_lost_its_sign():
    tables = drive()
    tables["/gnss"].columns["altitude"][:] = 2.0**64 - 5 * (1 + np.sin(T))
    assert "2^64" in faults(tables)["gnss.altitude"]


@pytest.mark.parametrize(
    ("factor", "words"),
    [(1e3, "scale = 0.001"), (1e3 / 9.80665, 'unit = "mg"'), (100.0, "scale = 0.01")],
)
def test_accelerations_in_another_unit(factor, words):
    rng = np.random.default_rng(1)
    level = {name: rng.normal(0, 0.2, COUNT) * factor for name in ("accel_x", "accel_y")}
    up = (9.81 + rng.normal(0, 0.2, COUNT)) * factor
    found = faults({"/imu": table("/imu", "Imu", **level, accel_z=up)})
    assert words in found["imu.accel_x"]


def test_a_speed_in_millimeters():
    assert "mm/s? Then say scale = 0.001" in faults(drive(v=SPEED * 1e3))["speed.v"]


def test_a_slope_beyond_roads_is_said_though_no_estimator_reads_it():
    truth = table("/truth/angles", "RoadAngles", grade=2 + np.sin(T / 30))
    found = faults({**drive(), "/truth/angles": truth})
    assert 'unit = "deg"' in found["truth.grade"]


def test_ingest_says_it_too(tmp_path):
    path = tmp_path / "drive.csv"
    rows = zip(T, NORTH * 60, EAST * 60, SPEED * 3.6, strict=True)
    path.write_text("t,lat,lon,v\n" + "".join(",".join(f"{x:.7f}" for x in r) + "\n" for r in rows))
    profile = '[gnss]\nlatitude = { from = "lat", unit = "deg" }\n'
    profile += (
        'longitude = { from = "lon", unit = "deg" }\n[speed]\nv = { from = "v", unit = "km/h" }\n'
    )
    notes = ingest([path], Profile.from_toml(profile, "p")).notes
    assert any(n.startswith("check: gnss.latitude") and "minutes of arc" in n for n in notes)


def at(stamps: np.ndarray, **more: np.ndarray) -> dict[str, Table]:
    """Positions and speed at other stamps [s]."""
    time = np.round(stamps * 1e9).astype(np.int64)
    found = {**drive(), **more}
    return {topic: replace(table, time=time) for topic, table in found.items()}


def test_times_of_day_taken_as_seconds_are_named_and_nothing_is_inferred():
    second = 36_035 + T
    of_day = second // 3600 * 10_000 + second // 60 % 60 * 100 + second % 60
    (finding,) = [f for f in check(at(of_day)) if f.level == "fault"]
    assert "no stamp has a second beyond 59" in finding.found
    assert finding.advice == 'say unit = "hhmmss" in [time]'
    assert not any("second beyond" in f.found for f in check(at(second)))


@pytest.mark.parametrize("places", [True, False])
def test_a_clock_that_was_set_forward_is_told_from_a_pause(places):
    def said(tables: dict[str, Table]) -> list[str]:
        tables = tables if places else {"/speed": tables["/speed"]}
        return [f.found for f in check(tables) if f.check == "clock_forward"]

    half = COUNT // 2
    moved = np.where(np.arange(COUNT) < half, 0.0, 600.0)
    (found,) = said(at(T + moved))
    assert "nothing for 600.1 s" in found
    assert ("the car moves" if places else "the speed goes on") in found
    assert not said(at(T))
    paused = at(T + moved)
    speed = np.where(np.arange(COUNT) < half, SPEED, SPEED + 3)
    paused["/speed"] = replace(paused["/speed"], columns={**paused["/speed"].columns, "v": speed})
    assert not said(paused)


@pytest.mark.parametrize(("delay", "doubt", "left"), [("5 s", True, True), ("90 s", True, False)])
def test_a_delay_that_no_sensor_has_and_what_it_leaves_is_said(tmp_path, delay, doubt, left):
    path = tmp_path / "drive.csv"
    rows = "".join(f"{t:.2f},{v:.2f},9.8\n" for t, v in zip(T[:600], SPEED, strict=False))
    path.write_text("time_s,v,az\n" + rows)
    text = f'[speed]\nv = {{ from = "v", unit = "m/s", delay = "{delay}" }}\n'
    text += '[imu]\naccel_z = { from = "az", unit = "m/s^2" }\n'
    result = ingest([path], Profile.from_toml(text, "new"))
    said = f"check: speed.v: is moved by a delay of {delay}"
    assert any(note.startswith(said) for note in result.notes) is doubt
    assert (result.losses == ["speed.v: no sample of v is usable"]) is not left


def test_one_position_alone_that_cannot_be_is_said():
    tables = drive(scale=100.0)
    gnss = tables["/gnss"]
    blank = {**gnss.columns, "longitude": np.full(COUNT, np.nan)}
    found = faults({**tables, "/gnss": replace(gnss, columns=blank)})
    assert "nothing is beyond -90 to 90" in found["gnss.latitude"]


def test_a_speed_that_counts_backward():
    assert "counted backward? Then say scale = -1" in faults(drive(v=-SPEED))["speed.v"]


def test_a_code_throughout_is_not_taken_for_another_unit():
    tables = drive()
    gnss = tables["/gnss"]
    code = {**gnss.columns, "altitude": np.full(COUNT, -32768.0)}
    found = faults({**tables, "/gnss": replace(gnss, columns=code)})
    assert "a code for none" in found["gnss.altitude"]


HEADING = 0.6 + 0.8 * np.sin(np.cumsum(SPEED) / 4000)  # from east, left positive


def turning(**gnss: np.ndarray) -> dict[str, Table]:
    """A drive with turns, and more of its receiver."""
    east, north = (np.cumsum(SPEED * f(HEADING)) * 0.1 for f in (np.cos, np.sin))
    place = {
        "latitude": 48 + np.degrees(north / 6_371_008.8),
        "longitude": 11 + np.degrees(east / 6_371_008.8 / np.cos(np.radians(48))),
    }
    return {**drive(), "/gnss": table("/gnss", "Gnss", **place, **gnss)}


@pytest.mark.parametrize(
    ("course", "words"),
    [
        (HEADING, ""),
        (np.degrees(HEADING) + 3, "is in degrees"),
        (90 - np.degrees(HEADING), "is in degrees and counts clockwise from north"),
        (np.pi / 2 - (90 - np.degrees(HEADING)), "is in degrees"),
        (9000 - 100 * np.degrees(HEADING), 'cdeg? Then say unit = "cdeg"'),
    ],
)
def test_a_course_in_another_unit(course, words):
    found = faults(turning(course=course))
    assert words in found.get("gnss.course", "")
    assert ("gnss.course" in found) is bool(words)


def test_a_yaw_rate_alone_in_degrees():
    rate = np.gradient(HEADING, T)
    imu = table("/imu", "Imu", gyro_z=np.degrees(rate), accel_y=SPEED * rate)
    found = faults({**turning(), "/imu": imu})
    assert 'say unit = "deg/s"' in found["imu.gyro_z"]
    assert "imu.gyro_z" not in faults(
        {**turning(), "/imu": table("/imu", "Imu", gyro_z=rate, accel_y=SPEED * rate)}
    )
