"""A sensor's drift and hang are named where they are, and not where noise or codes explain them."""

from __future__ import annotations

import numpy as np
import pytest

from roadlog import checks
from roadlog.storage import Table
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

DRIVE, STOP = 30.0, 6.0  # s, again and again
ROLES = [f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"]


def logged(rate: float, noise: float, drift: float = 0.0, step: float = 0.0) -> dict[str, Table]:
    """Four stops on a level road. noise, drift, step: deg/s of the gyro, a third in m/s2 of the
    accelerometer."""
    t = np.arange(0.0, 4 * (DRIVE + STOP) + DRIVE, 1 / rate)
    stands = t % (DRIVE + STOP) > DRIVE
    rng = np.random.default_rng(7)
    columns = {}
    for role in ROLES:
        size = DEG if role.startswith("gyro") else 1 / 3
        x = size * (noise * rng.standard_normal(len(t)) + drift * t / t[-1])
        x += G if role == "accel_z" else 0.0
        columns[role] = np.round(x / (step * size)) * (step * size) if step else x
    time = np.round(t * 1e9).astype(np.int64)
    speed = {"v": np.where(stands, 0.0, 10.0)}
    return {
        "/imu": Table("/imu", "roadlog.v1.Imu", time, columns),
        "/speed": Table("/speed", "roadlog.v1.Speed", time, speed),
    }


def named(tables: dict[str, Table]) -> set[str]:
    return {finding.check for finding in checks.check(tables) if finding.level == "fault"}


@pytest.mark.parametrize(("rate", "noise", "step"), [(10.0, 0.5, 0.0), (50.0, 0.02, 0.35)])
def test_noise_and_codes_are_no_drift(rate: float, noise: float, step: float) -> None:
    assert "drift" not in named(logged(rate, noise, step=step))


def test_a_quiet_sensor_that_drifts_is_named() -> None:
    assert "drift" in named(logged(50.0, 0.02, drift=0.6))


@pytest.mark.parametrize(("hung", "is_named"), [(1.0, False), (8.0, True)])
def test_a_sensor_that_stays_after_a_stop_for_a_moment_did_not_hang(
    hung: float, is_named: bool
) -> None:
    tables = logged(50.0, 0.02)
    imu = tables["/imu"]
    seconds = imu.time * 1e-9
    rows = (seconds > DRIVE) & (seconds < DRIVE + STOP + hung)
    imu.columns["gyro_y"][rows] = 0.001
    assert ("frozen" in named(tables)) == is_named
