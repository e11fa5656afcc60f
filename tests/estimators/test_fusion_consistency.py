"""`fusion` takes the size of its errors, and a crooked IMU, from the drive itself."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from support.drives import simulated

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.fusion.innovations import correlated, scales
from roadlog.estimators.fusion.states import ROWS, Row
from roadlog.metrics import AngleMetrics, angle_errors, angle_metrics
from roadlog.signals import FLAGS, TRUTH_TOPIC

STEP = 0.02  # s


def test_white_innovations_change_nothing() -> None:
    innovations = np.random.default_rng(1).standard_normal((5000, ROWS))
    assert correlated(innovations[:, 0], 100) == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(scales(innovations, STEP), 1.0, atol=0.1)


def test_slow_innovations_count_as_few() -> None:
    """A first-order process of correlation a holds (1 - a) / (1 + a) independent samples."""
    rng, a, n = np.random.default_rng(2), 0.9, 50_000
    slow = np.empty(n)
    slow[0] = rng.standard_normal()
    for k in range(1, n):
        slow[k] = a * slow[k - 1] + np.sqrt(1 - a**2) * rng.standard_normal()
    assert correlated(slow, 1000) == pytest.approx((1 + a) / (1 - a), rel=0.15)
    innovations = np.full((n, ROWS), np.nan)
    innovations[:, Row.SLIP] = 2 * slow
    assert scales(innovations, STEP)[Row.SLIP] == pytest.approx(2 * np.sqrt(19), rel=0.1)


def test_the_innovations_come_with_the_estimate(hill_drive: Drive) -> None:
    estimate = estimators.run("fusion", hill_drive, estimators.Vehicle())
    assert {"speed", "slip", "contact"} <= set(estimate.innovations)
    for name, values in estimate.innovations.items():
        assert values.shape == estimate.time.shape
        used = values[np.isfinite(values)]
        assert len(used), name
        assert np.abs(np.median(used)) < 1.0, name
    assert len(np.flatnonzero(np.isfinite(estimate.innovations["contact"]))) == pytest.approx(
        10 * hill_drive.time[-1], rel=0.2
    )


def driven(disturb: Callable[[str, np.ndarray], np.ndarray]) -> tuple[Estimate, AngleMetrics]:
    """A way through town, with stops, by an IMU whose signals are disturbed; no receiver."""
    simulation = simulated("city", seed=1, overrides={"duration": 100.0})
    tables = {table.topic: table for table in simulation.tables}
    imu = tables["/imu"]
    columns = {name: disturb(name, values) for name, values in imu.columns.items()}
    drive = Drive.from_tables([replace(imu, columns=columns), tables["/wheel_speeds"]])
    estimate = estimators.run("fusion", drive, simulation.vehicle)
    errors = angle_errors(estimate, Estimate.from_table(tables[TRUTH_TOPIC]), "grade")
    assert errors is not None
    return estimate, angle_metrics(errors, "grade")


def test_a_vibrating_imu_that_stops_is_no_other_car() -> None:
    """The standstill rows must not take the noise of a standing gyro for its bias."""
    rng = np.random.default_rng(3)

    def vibrating(name: str, values: np.ndarray) -> np.ndarray:
        sd = 3.0 if name.startswith("accel") else np.radians(2.0)
        return values + sd * rng.standard_normal(len(values))

    estimate, grade = driven(vibrating)
    assert (estimate.flags & FLAGS["standstill"] > 0).any()
    assert not any("do not fit one car" in note for note in estimate.notes)
    assert estimate.valid.mean() > 0.95
    assert (grade.within_2sd or 0.0) >= 0.9


def test_an_imu_that_drifts_is_followed() -> None:
    """As fast as the contact with the road says: else nothing is valid (19 times that row's sd)."""
    rng = np.random.default_rng(4)

    def drifting(name: str, values: np.ndarray) -> np.ndarray:
        if name != "accel_z":
            return values
        return values + np.cumsum(0.03 * np.sqrt(0.01) * rng.standard_normal(len(values)))

    estimate, grade = driven(drifting)
    assert estimate.valid.mean() > 0.95
    assert (grade.std_deg or 9.0) < 0.15
    assert (grade.within_2sd or 0.0) >= 0.9


def test_a_crooked_imu_is_turned() -> None:
    """Five degrees of yaw mix bank into grade; they are observable."""
    simulation = simulated("luo2024-s3")
    turn = np.radians(5.0)
    tables = [t for t in simulation.tables if t.topic != TRUTH_TOPIC]
    imu = next(t for t in tables if t.topic == "/imu")
    columns = dict(imu.columns)
    for kind in ("accel", "gyro"):
        x, y = columns[f"{kind}_x"], columns[f"{kind}_y"]
        columns[f"{kind}_x"] = np.cos(turn) * x + np.sin(turn) * y
        columns[f"{kind}_y"] = np.cos(turn) * y - np.sin(turn) * x
    drive = Drive.from_tables([replace(imu, columns=columns) if t is imu else t for t in tables])
    estimate = estimators.run("fusion", drive, simulation.vehicle)
    assert any("mounting of the IMU was not" in note for note in estimate.notes)
    straight = estimators.run("fusion", Drive.from_tables(tables), simulation.vehicle)
    assert not any("mounting of the IMU was not" in note for note in straight.notes)
    yaw, own = (
        np.degrees(found.details["constants"].columns["mounting_yaw"][0])
        for found in (estimate, straight)
    )
    assert yaw == pytest.approx(5.0 + own, abs=0.15)
    truth = simulation.table(TRUTH_TOPIC)
    error = estimate.grade - np.interp(drive.time_ns, truth.time, truth.columns["grade"])
    use = (drive.time > 5) & estimate.valid
    assert np.degrees(np.sqrt(np.mean(error[use] ** 2))) < 0.08
