"""The Ryu and Luo estimators on the full simulated car (Ryu/Luo chapter, section 7)."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.simulate import simulate
from roadlog.vehicle import Vehicle

pytestmark = pytest.mark.slow
SKIP = 500  # samples, as the chapter leaves out the first five seconds


@cache
def scenario(name: str, ideal: bool) -> tuple[Drive, Vehicle, dict[str, np.ndarray]]:
    """The drive, its vehicle and the true angles and forces on the drive's grid."""
    simulation = simulate(name, seed=1, ideal=ideal)
    drive = Drive.from_tables(simulation.tables)
    truth = {}
    for table in simulation.tables:
        if table.topic in ("/truth/angles", "/truth/tire_forces", "/truth/sideslip"):
            own = (table.time - drive.start_ns) * 1e-9
            truth |= {k: np.interp(drive.time, own, v) for k, v in table.columns.items()}
    return drive, simulation.vehicle, truth


def grade_error(name: str, ideal: bool, estimator: str = "tfobe", **settings: object) -> np.ndarray:
    drive, vehicle, truth = scenario(name, ideal)
    grade = estimators.run(estimator, drive, vehicle, settings).grade
    return 100 * (np.tan(grade) - np.tan(truth["grade"]))[SKIP:]


def bank(name: str, **settings: object) -> tuple[Estimate, dict[str, np.ndarray], Drive]:
    drive, vehicle, truth = scenario(name, False)
    return estimators.run("roll_bank_obs", drive, vehicle, settings), truth, drive


def rmse_deg(values: np.ndarray, truth: np.ndarray) -> float:
    return float(np.degrees(np.sqrt(np.mean((values - truth)[SKIP:] ** 2))))


@pytest.mark.parametrize("name", ["luo2024-s1", "luo2024-s2", "luo2024-s3", "luo2024-s3b"])
def test_t9_ideal_signals(name: str) -> None:
    tfobe = grade_error(name, True)
    assert np.abs(tfobe).mean() < 0.17
    assert np.sqrt((tfobe**2).mean()) < 0.23


@pytest.mark.parametrize(
    ("name", "limit"),
    [
        ("luo2024-s1", 0.28),
        ("luo2024-s2", 0.28),
        ("luo2024-s3", 0.28),
        ("luo2024-s3b", 0.28),
        ("luo2024-road1", 0.28),
        ("luo2024-road2", 0.22),
        ("luo2024-helix", 0.22),
    ],
)
def test_t10_with_sensors(name: str, limit: float) -> None:
    assert np.abs(grade_error(name, False)).mean() < limit


@pytest.mark.parametrize(("name", "share"), [("luo2024-helix", 1 / 3), ("luo2024-road2", 1 / 2)])
def test_t11_corners(name: str, share: float) -> None:
    tfobe, debe = (np.abs(grade_error(name, False, e)).mean() for e in ("tfobe", "debe"))
    assert tfobe < share * debe


def test_t12_to_t16_the_printed_forms() -> None:
    without = np.abs(grade_error("luo2024-s2", True, "debe", variant="eq37")).mean()
    assert (
        without > 3 * np.abs(grade_error("luo2024-s2", True, "debe", variant="eq37_brake")).mean()
    )
    drive, vehicle, truth = scenario("luo2024-s3", False)
    printed = estimators.run("tfobe", drive, vehicle, {"variant": "printed"}).grade
    assert abs(np.polyfit(truth["grade"][SKIP:], printed[SKIP:], 1)[0]) < 0.1
    assert np.abs(grade_error("luo2024-helix", False, variant="text")).mean() > 5.0
    assert abs(grade_error("luo2024-s1", True, variant="text").mean() - 1.31) < 0.2


def test_t20_forces() -> None:
    drive, vehicle, truth = scenario("luo2024-s3", False)
    wheels = ("fl", "fr", "rl", "rr")

    def total_error(variant: str) -> float:
        run = estimators.run("tfobe", drive, vehicle, {"variant": variant})
        forces = run.details["tires"].columns
        error = sum(forces[f"fx_{w}"] - truth[f"fx_{w}"] for w in wheels)
        return float(np.sqrt(np.mean(error[SKIP:] ** 2)))

    assert total_error("corrected") < 80.0
    columns = estimators.run("tfobe", drive, vehicle).details["tires"].columns
    for axle, pair in (("front", ("fl", "fr")), ("rear", ("rl", "rr"))):
        error = (columns[f"fy_{axle}"] - sum(truth[f"fy_{w}"] for w in pair))[SKIP:]
        assert np.sqrt(np.mean(error**2)) < 60.0


def test_t21_slalom() -> None:
    estimate, truth, drive = bank("ryu2004-slalom")
    assert (np.abs(estimate.bank[SKIP:]) < np.radians(1.0)).all()
    assert np.corrcoef(estimate.roll[SKIP:], drive["imu.accel_y"][SKIP:])[0, 1] > 0.99
    assert rmse_deg(estimate.bank, truth["bank"]) < 0.13


def test_t22_laps() -> None:
    estimate, truth, _ = bank("ryu2004-laps")
    assert rmse_deg(estimate.bank, truth["bank"]) < 0.13
    assert np.corrcoef(estimate.bank[SKIP:], truth["bank"][SKIP:])[0, 1] > 0.99
    level = np.abs(truth["roll_total"]) < np.radians(0.5)
    level[:SKIP] = False
    assert np.abs(np.degrees(truth["bank"][level])).mean() > 1.5
    error = np.degrees(estimate.bank - truth["bank"])[level]
    assert np.sqrt((error**2).mean()) < 0.2


def test_t27_sideslip_and_total_roll() -> None:
    for name in ("ryu2004-slalom", "ryu2004-laps"):
        drive, vehicle, truth = scenario(name, False)
        run = estimators.run("gnss_ins", drive, vehicle, {"smooth": False})
        assert rmse_deg(run.roll_total, truth["roll_total"]) < 0.1
