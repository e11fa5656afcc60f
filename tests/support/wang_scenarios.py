"""Wang's two drives with the noise of docs/methods/wang2025.md#scenarios."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
from scipy.signal import savgol_filter
from support.drives import simulated

from roadlog.drive import Drive
from roadlog.simulate import Simulation
from roadlog.units import STANDARD_GRAVITY as G

UP, DOWN = "wang2025-up9", "wang2025-down12"


@cache
def ideal(name: str) -> tuple[Drive, dict[str, np.ndarray], Simulation]:
    """The drive with exact sensors, its truth and what it came from."""
    simulation = simulated(name, ideal=True)
    truth = next(t for t in simulation.tables if t.topic == "/truth/angles")
    angles = {a: np.asarray(truth.columns[a]) for a in ("grade", "pitch", "inclination")}
    return Drive.from_tables(simulation.tables), angles, simulation


def wang_drive(name: str, seed: int, mount: str = "body") -> Drive:
    """Noise: v 0.03 m/s, a_x 0.08 m/s2 and 0.15 times smoothed white, F_d 60 N."""
    drive, angles, _ = ideal(name)
    rng, n = np.random.default_rng(seed), len(drive)
    accel = drive["imu.accel_x"]
    if mount == "road":  # an accelerometer that does not pitch with the body; cos(pitch) is 1
        accel = accel - G * (np.sin(angles["inclination"]) - np.sin(angles["grade"]))
    colored = savgol_filter(rng.normal(size=n), 31, 2)
    signals = {
        "imu.accel_x": accel + rng.normal(0, 0.08, n) + 0.15 * colored,
        "imu.accel_z": drive["imu.accel_z"] + rng.normal(0, 0.08, n),
        "speed.v": drive.speed + rng.normal(0, 0.03, n),
        "powertrain.drive_force": drive["powertrain.drive_force"] + rng.normal(0, 60.0, n),
    }
    return Drive(drive.time, drive.start_ns, drive.rate, signals, drive.native)


def without(drive: Drive, *roles: str) -> Drive:
    """The drive with some signals gone."""
    signals = {role: v for role, v in drive.signals.items() if role not in roles}
    return dataclasses.replace(drive, signals=signals)
