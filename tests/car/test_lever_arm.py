"""Specific force of the CG from an IMU elsewhere, on motions whose answer is known."""

import numpy as np

from roadlog.car.lever_arm import specific_force_at_cg
from roadlog.drive import Drive
from roadlog.units import STANDARD_GRAVITY as G


def drive(w: tuple[np.ndarray, np.ndarray, np.ndarray], f: np.ndarray) -> Drive:
    time = np.arange(len(f[0])) / 100
    signals = {f"imu.accel_{a}": f[k] for k, a in enumerate("xyz")}
    signals |= {f"imu.gyro_{a}": w[k] for k, a in enumerate("xyz")}
    return Drive(time, 0, 100.0, signals, {})


def test_a_steady_turn_pulls_an_imu_ahead_of_the_cg_backward() -> None:
    n, yaw_rate, ahead = 200, 0.5, 2.0
    zero = np.zeros(n)
    felt = np.stack([np.full(n, -(yaw_rate**2) * ahead), zero, np.full(n, G)])
    at_cg = specific_force_at_cg(drive((zero, zero, np.full(n, yaw_rate)), felt), (ahead, 0, 0))
    np.testing.assert_allclose(at_cg.x, 0, atol=1e-12)
    np.testing.assert_allclose(at_cg.y, 0, atol=1e-12)
    np.testing.assert_allclose(at_cg.z, G, atol=1e-12)


def test_a_growing_yaw_rate_pushes_an_imu_ahead_of_the_cg_to_the_left() -> None:
    n, growth, ahead = 200, 0.1, 2.0  # rad/s2, m
    zero = np.zeros(n)
    yaw_rate = growth * np.arange(n) / 100
    felt = np.stack([-(yaw_rate**2) * ahead, np.full(n, growth * ahead), np.full(n, G)])
    at_cg = specific_force_at_cg(drive((zero, zero, yaw_rate), felt), (ahead, 0, 0))
    np.testing.assert_allclose(at_cg.y[50:-50], 0, atol=1e-9)  # the slope needs its window
    np.testing.assert_allclose(at_cg.x, 0, atol=1e-9)


def test_without_a_position_the_imu_stands_for_the_cg() -> None:
    felt = np.random.default_rng(1).normal(size=(3, 50))
    same = specific_force_at_cg(drive((felt[0], felt[1], felt[2]), felt), None)
    np.testing.assert_array_equal([same.x, same.y, same.z], felt)
