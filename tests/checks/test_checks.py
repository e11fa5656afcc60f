"""`roadlog info`'s checks: every usual fault is found, and it only; a right log passes."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np
import pytest
from support.drives import simulated

from roadlog import checks
from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY as G

Tables = dict[str, Table]
ACCEL = [f"accel_{axis}" for axis in "xyz"]
GYRO = [f"gyro_{axis}" for axis in "xyz"]
WHEELS = ["fl", "fr", "rl", "rr"]


@pytest.fixture(scope="module")
def drive() -> Tables:
    """Five minutes over a pass with every sensor, and /speed beside the wheels."""
    tables = {t.topic: t for t in simulated("mountain", seed=3).tables}
    tables = {topic: t for topic, t in tables.items() if not topic.startswith("/truth/")}
    wheels = tables["/wheel_speeds"]
    mean = np.mean([wheels.columns[w] for w in WHEELS], axis=0)
    tables["/speed"] = Table("/speed", "roadlog.v1.Speed", wheels.time, {"v": mean})
    return tables


def with_columns(tables: Tables, topic: str, change: Callable[[str, np.ndarray], np.ndarray]):
    table = tables[topic]
    columns = {name: change(name, np.array(x)) for name, x in table.columns.items()}
    return tables | {topic: dataclasses.replace(table, columns=columns)}


def scaled(topic: str, fields: list[str], factor: float):
    return lambda tables: with_columns(
        tables, topic, lambda name, x: x * factor if name in fields else x
    )


def turned(forward: str, left: str, accel_sign: float = 1.0):
    """As a sensor shows it whose axes `forward` and `left` point there."""
    from roadlog.ingest.mount import rotation

    matrix = rotation({"forward": forward, "left": left}, "test")

    def change(tables: Tables) -> Tables:
        columns = dict(tables["/imu"].columns)
        for names, sign in ((ACCEL, accel_sign), (GYRO, 1.0)):
            rows = sign * matrix.T @ np.stack([columns[name] for name in names])
            columns |= dict(zip(names, rows, strict=True))
        return tables | {"/imu": dataclasses.replace(tables["/imu"], columns=columns)}

    return change


def moved(topic: str, seconds: float, after: float = -np.inf):
    def change(tables: Tables) -> Tables:
        table = tables[topic]
        t = (table.time - table.time[0]) * 1e-9
        time = table.time + np.where(t > after, round(seconds * 1e9), 0)
        order = np.argsort(time, kind="stable")
        columns = {name: x[order] for name, x in table.columns.items()}
        return tables | {topic: dataclasses.replace(table, time=time[order], columns=columns)}

    return change


def rows_set(topic: str, fields: list[str], rows: slice, value: float | None):
    """value: None holds the first one."""

    def change(name: str, x: np.ndarray) -> np.ndarray:
        if name in fields:
            x[rows] = x[rows.start] if value is None else value
        return x

    return lambda tables: with_columns(tables, topic, change)


def clockwise_degrees(tables: Tables) -> Tables:
    return with_columns(
        tables, "/gnss", lambda n, x: (90 - np.degrees(x)) % 360 if n == "course" else x
    )


def repeated(tables: Tables) -> Tables:
    time = tables["/imu"].time.copy()
    time[5000:5010] = time[4999]
    return tables | {"/imu": dataclasses.replace(tables["/imu"], time=time)}


def both(*changes):
    def change(tables: Tables) -> Tables:
        for step in changes:
            tables = step(tables)
        return tables

    return change


IMU = [f"imu.{name}" for name in ACCEL + GYRO]
FAULTS = {
    "g": (scaled("/imu", ACCEL, 1 / G), "unit", ["imu.accel_x"], 'unit = "g"'),
    "deg/s": (scaled("/imu", GYRO, 180 / np.pi), "unit", ["imu.gyro_z"], 'unit = "deg/s"'),
    "km/h": (scaled("/speed", ["v"], 3.6), "unit", ["speed.v"], 'unit = "km/h"'),
    "wheels km/h": (scaled("/wheel_speeds", WHEELS, 3.6), "unit", ["wheel_speeds.fl"], "km/h"),
    "gnss kn": (scaled("/gnss", ["speed"], 1.943844), "unit", ["gnss.speed"], 'unit = "kn"'),
    "mph": (scaled("/speed", ["v"], 2.236936), "unit", ["speed.v"], 'unit = "mph"'),
    "steering deg": (
        scaled("/steering", ["road_wheel_angle"], 180 / np.pi),
        "unit", ["steering.road_wheel_angle"], 'unit = "deg"',
    ),
    "upright": (turned("-y", "-z"), "axes", IMU, 'forward = "-y", left = "-z"'),
    "turned left": (turned("-y", "+x"), "axes", IMU, 'forward = "-y", left = "+x"'),
    "frd": (turned("+x", "-y"), "axes", IMU, 'forward = "+x", left = "-y"'),
    "backward": (turned("-x", "-y"), "axes", IMU, 'forward = "-x", left = "-y"'),
    "ios": (scaled("/imu", ACCEL, -1.0), "sign", ["imu.accel_x"], "scale = -1.0"),
    "accel_x": (scaled("/imu", ["accel_x"], -1.0), "sign", ["imu.accel_x"], "scale = -1.0"),
    "accel_y": (scaled("/imu", ["accel_y"], -1.0), "sign", ["imu.accel_y"], "scale = -1.0"),
    "gyro_x": (scaled("/imu", ["gyro_x"], -1.0), "sign", ["imu.gyro_x"], "scale = -1.0"),
    "gyro_y": (scaled("/imu", ["gyro_y"], -1.0), "sign", ["imu.gyro_y"], "scale = -1.0"),
    "gyro_z": (scaled("/imu", ["gyro_z"], -1.0), "sign", ["imu.gyro_z"], "scale = -1.0"),
    "steering sign": (
        scaled("/steering", ["road_wheel_angle"], -1.0),
        "sign", ["steering.road_wheel_angle"], "scale = -1.0",
    ),
    "course": (clockwise_degrees, "course", ["gnss.course"], "scale = -1.0, offset = 90"),
    "wheel": (scaled("/wheel_speeds", ["rl"], 1.05), "wheel_speeds", ["wheel_speeds.rl"], "0.95"),
    "tires": (scaled("/speed", ["v"], 1.08), "speeds_disagree", ["speed.v"], "scale = 0.92"),
    "late speed": (moved("/speed", 0.5), "latency", ["speed.v"], "add 0."),
    "other clock": (moved("/speed", 1.5), "clocks_differ", ["speed.v"], "ingest A B"),
    "other epoch": (moved("/speed", 1e6), "clocks_differ", ["/speed"], "unit"),
    "clock forward": (moved("/speed", 2.0, 140.0), "clock_step", ["speed.v"], "parts before"),
    "clock back": (moved("/speed", -2.013, 140.0), "clock_step", ["speed.v"], "parts before"),
    "stamps": (repeated, "clock_backward", ["/imu"], "stamp"),
    "frozen": (rows_set("/imu", ["gyro_y"], slice(9000, 10500), None), "frozen",
               ["imu.gyro_y"], "leave that part out"),
    "hung wheels": (rows_set("/wheel_speeds", WHEELS, slice(5000, 6000), None), "frozen",
                    [f"wheel_speeds.{wheel}" for wheel in WHEELS], "leave that part out"),
    "hung speed": (rows_set("/speed", ["v"], slice(5000, 6000), None), "frozen",
                   ["speed.v"], "leave that part out"),
    "leap": (rows_set("/wheel_speeds", ["rl"], slice(5000, 5001), 50.0), "leaps",
             ["wheel_speeds.rl"], "mark these samples invalid"),
    "dropouts": (rows_set("/speed", ["v"], slice(4000, 8000, 500), 0.0), "leaps",
                 ["speed.v"], "mark these samples invalid"),
    "invalid": (rows_set("/imu", ACCEL, slice(8000, 8005), -64.0), "invalid_values",
                ["imu.accel_x", "imu.accel_y", "imu.accel_z"], "valid ="),
    "no fix": (
        both(
            rows_set("/gnss", ["altitude"], slice(0, 300), -5400.0),
            rows_set("/gnss", ["latitude", "longitude"], slice(0, 300), 0.0),
        ),
        "no_fix", ["gnss.latitude"], "valid =",
    ),
    "no gravity": (scaled("/imu", ACCEL, 0.5), "gravity", ["imu.accel_x"], "unit and scale"),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_found_and_it_only(drive, fault):
    change, check, signals, advice = FAULTS[fault]
    found = checks.check(change(drive))
    assert {(f.check, f.level) for f in found} == {(check, "fault")}, list(map(str, found))
    assert len(found) == 1, list(map(str, found))
    assert set(signals) <= set(found[0].signals)
    assert advice in found[0].advice, found[0].advice


def test_faults_at_once_are_told_apart(drive):
    # a phone in an upright holder, its raw accelerations in g of the opposite sign, a late speed
    change = both(moved("/speed", 0.4), turned("-y", "-z", -1.0), scaled("/imu", ACCEL, 1 / G))
    found = checks.check(change(drive))
    assert sorted(f.check for f in found) == ["axes", "latency", "sign", "unit"]
    assert any('forward = "-y", left = "-z"' in f.advice for f in found)


@pytest.mark.parametrize("topic", ["/imu", "/wheel_speeds", "/gnss", "/speed"])
def test_a_single_channel_passes(drive, topic):
    assert checks.check({topic: drive[topic]}) == []


def test_what_a_right_speed_may_do_is_no_fault(drive):
    # whole km/h twice a second, which last in a cruise, and a wheel that locks for a moment
    speed = drive["/speed"]
    slow = slice(None, None, 50)
    coarse = np.round(speed.columns["v"][slow] * 3.6) / 3.6
    table = dataclasses.replace(speed, time=speed.time[slow], columns={"v": coarse})
    assert checks.check({**drive, "/speed": table}) == []
    assert checks.check(rows_set("/wheel_speeds", ["fl"], slice(5000, 5010), 0.0)(drive)) == []


def test_a_right_drive_passes(drive):
    assert checks.check(drive) == []


@pytest.mark.parametrize(
    ("scenario", "options"),
    [
        ("luo2024-helix", {}),
        ("luo2024-s1", {}),
        ("ryu2004-laps-var", {}),
        ("ryu2004-chirp", {}),
        ("wang2025-down12", {"full": True}),
        ("kim2023-testroad", {"full": True}),
        ("massel2004-accel", {"ideal": True}),
        pytest.param("city", {}, marks=pytest.mark.slow),
        pytest.param("kim2023-urban", {"full": True}, marks=pytest.mark.slow),
    ],
)
def test_simulated_drives_give_no_false_alarm(scenario, options):
    tables = {t.topic: t for t in simulated(scenario, seed=5, **options).tables}
    assert [str(f) for f in checks.check(tables) if f.level == "fault"] == []
