"""Scenarios: all of them drive, the seed decides everything, a user writes one in TOML."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from roadlog.car.vehicle import Vehicle
from roadlog.errors import ConfigError
from roadlog.log import create
from roadlog.signals import ANGLES, TRUTH_TOPIC
from roadlog.simulate import SCENARIOS, simulate

PAPERS = [
    "massel2004-quasi",
    "massel2004-accel",
    "kim2023-mc",
    "kim2023-urban",
    "kim2023-testroad",
    "luo2024-s1",
    "luo2024-s2",
    "luo2024-s3",
    "luo2024-s3b",
    "luo2024-road1",
    "luo2024-road2",
    "luo2024-helix",
    "luo2024-stopgo",
    "ryu2004-laps",
    "ryu2004-laps-var",
    "ryu2004-slalom",
    "ryu2004-crawl",
    "ryu2004-chirp",
    "wang2025-up9",
    "wang2025-down12",
    "mountain",
    "city",
]
LONG = ("mountain", "city", "kim2023-mc", "kim2023-urban")


def test_every_promised_scenario_is_there() -> None:
    assert set(PAPERS) <= set(SCENARIOS)


@pytest.mark.parametrize(
    ("name", "full"),
    [(name, False) for name in PAPERS if name not in LONG]
    + [("massel2004-accel", True), ("kim2023-testroad", True), ("wang2025-up9", True)],
)
def test_scenario_gives_finite_signals_and_consistent_truth(name: str, full: bool) -> None:
    simulation = simulate(name, full=full)
    truth = simulation.table(TRUTH_TOPIC).columns
    for angle in ANGLES:
        assert np.isfinite(truth[angle]).all()
        assert np.abs(truth[angle]).max() < np.radians(20)
    # grade + pitch = inclination to third order
    np.testing.assert_allclose(truth["grade"] + truth["pitch"], truth["inclination"], atol=1e-3)
    np.testing.assert_allclose(truth["bank"] + truth["roll"], truth["roll_total"], atol=1e-3)
    imu = simulation.table("/imu").columns
    assert all(np.isfinite(values).all() for values in imu.values())
    assert np.mean(imu["accel_z"]) == pytest.approx(9.8, abs=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "full"),
    [(name, False) for name in LONG] + [("kim2023-urban", True)],
)
def test_long_scenario_gives_finite_signals(name: str, full: bool) -> None:
    test_scenario_gives_finite_signals_and_consistent_truth(name, full)


def test_driver_holds_speed_and_lane() -> None:
    """docs/simulator.md#driver: speed within 0.17 m/s, path within 0.31 m."""
    for name in ("luo2024-s3", "ryu2004-laps"):
        motion = simulate(name).motion
        assert np.abs(motion.details["motion"][1]["offset"]).max() < 0.4
    s1 = simulate("luo2024-s1").motion
    assert np.abs(s1.speed - 9.7).max() < 0.2


def test_same_seed_same_bytes_other_seed_other_drive(tmp_path: Path) -> None:
    def log(seed: int) -> bytes:
        simulation = simulate("luo2024-road1", seed=seed)
        path = tmp_path / "drive.mcap"
        create(path, simulation.tables, simulation.metadata, simulation.vehicle)
        return path.read_bytes()

    assert log(3) == log(3)
    assert log(3) != log(4)


def test_another_sensor_leaves_the_others_as_they_were() -> None:
    with_gnss = simulate("luo2024-road1")
    without = simulate("luo2024-road1", overrides={"gnss.rate": 0})
    assert {table.topic for table in with_gnss.tables} - {t.topic for t in without.tables} == {
        "/gnss"
    }
    for field, values in with_gnss.table("/imu").columns.items():
        np.testing.assert_array_equal(values, without.table("/imu").columns[field])


def test_load_reaches_the_drive_but_not_the_data_sheet() -> None:
    empty = simulate("luo2024-road1", ideal=True)
    loaded = simulate("luo2024-road1", ideal=True, load="trunk")
    pitch = [s.table(TRUTH_TOPIC).columns["pitch"].mean() for s in (empty, loaded)]
    assert np.degrees(pitch[1] - pitch[0]) == pytest.approx(1.15, abs=0.1)
    assert loaded.vehicle == empty.vehicle


def test_another_car_drives_and_its_data_sheet_goes_into_the_log() -> None:
    sheet = Vehicle.preset("wagon").with_values(mass=2400.0)
    light, heavy = simulate("luo2024-road1"), simulate("luo2024-road1", vehicle=sheet)
    assert heavy.vehicle.mass == 2400.0
    force = [
        s.table("/powertrain").columns["drive_force"][1000:].mean() / s.vehicle.mass
        for s in (light, heavy)
    ]
    assert force[1] == pytest.approx(force[0], rel=0.05)  # the same hill for each kilogram


def test_scenario_in_toml(tmp_path: Path) -> None:
    path = tmp_path / "pass.toml"
    path.write_text(
        "speed = { points = [[0, 8.0], [20, 12.0]] }\n"
        "[road]\n"
        "grade = { points = [[0, 0.0], [60, 0.05]], smoothing = [10.0] }\n"
        "curvature = { points = [[100, 0.0], [120, 0.02]] }\n"
        "[sensors.gnss]\n"
        "rate = 0.0\n"
    )
    simulation = simulate(str(path))
    assert simulation.metadata["simulation"]["scenario"] == "pass"
    grade = simulation.table(TRUTH_TOPIC).columns["grade"]
    assert np.tan(grade[-1]) == pytest.approx(0.05, abs=1e-3)
    assert "/gnss" not in {table.topic for table in simulation.tables}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sped = 3.0\n", "unknown key 'sped'. Close: speed"),
        ("speed = 9.0\n", "needs a duration"),
        ('base = "montain"\n', "no scenario 'montain'. Close: mountain"),
        ("speed = 9.0\nduration = 5\n[road]\ngrade = { kind = 'hill' }\n", "Close: hills"),
        ("speed = 9.0\nduration = 5\n[road]\ngrade = { points = [] }\n", "need at least one"),
        ("speed = [\n", "not a TOML file"),
    ],
)
def test_wrong_scenario_file_is_explained(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "my.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message.replace(".", r"\.")):
        simulate(str(path))


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"gnss.rat": "1"}, "Close: .*gnss.rate"),
        ({"rate": "1"}, "may be any of"),
        ({"gnss.rate": "fast"}, "must be a number"),
        ({"imu.position": "[1, 2]"}, "must be 3 numbers"),
    ],
)
def test_wrong_override_is_explained(overrides: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        simulate("luo2024-road1", overrides=overrides)
