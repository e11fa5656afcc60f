"""A log of an IMU that somebody turns over on a table."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation
from support.drives import EPOCH_NS, table

from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY as G

RATE = 100.0
REST, TURN = 4.0, 1.5  # s
NONE, ALIKE = np.zeros(3), np.ones(3)
# quarter turns of the IMU about its own axes, one after the other: every axis up and down
TURNS = ("x", "x", "x", "x", "y", "z", "z", "z", "z", "y", "y", "y")


def tumbled(
    accel_zero: np.ndarray = NONE,
    accel_scale: np.ndarray = ALIKE,
    gyro_zero: np.ndarray = NONE,
    gyro_scale: np.ndarray = ALIKE,
    turns: tuple[str, ...] = TURNS,
    tilt: float = 0.06,
    seed: int = 1,
) -> Table:
    """`/imu` as such an IMU shows it: shown = true / scale + zero, with noise.

    tilt: rad, of the table, and about which the turns miss a quarter.
    """
    rng = np.random.default_rng(seed)
    attitude = Rotation.from_rotvec([tilt, -tilt, 0.3])  # from IMU axes to the room's
    forces, rates = [], []

    def show(rate: np.ndarray, count: int) -> None:
        nonlocal attitude
        for _ in range(count):
            forces.append(attitude.inv().apply([0.0, 0.0, G]))
            rates.append(rate)
            attitude = attitude * Rotation.from_rotvec(rate / RATE)

    show(np.zeros(3), round(REST * RATE))
    for axis in turns:
        about = np.array([a == axis for a in "xyz"], np.float64) + rng.uniform(-0.1, 0.1, 3)
        angle = np.pi / 2 + rng.uniform(-tilt, tilt)
        show(about / np.linalg.norm(about) * angle / TURN, round(TURN * RATE))
        show(np.zeros(3), round(REST * RATE))
    force = np.array(forces) / accel_scale + accel_zero + rng.normal(0, 0.03, (len(forces), 3))
    rate = np.array(rates) / gyro_scale + gyro_zero + rng.normal(0, 0.0015, (len(rates), 3))
    time = EPOCH_NS + np.round(np.arange(len(force)) / RATE * 1e9).astype(np.int64)
    columns = {f"accel_{a}": force[:, k] for k, a in enumerate("xyz")}
    columns |= {f"gyro_{a}": rate[:, k] for k, a in enumerate("xyz")}
    return table("imu", time, columns)
