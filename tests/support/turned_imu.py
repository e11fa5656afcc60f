"""Logs of an IMU that is not mounted straight."""

from __future__ import annotations

import numpy as np

from roadlog.calibrate import Calibration
from roadlog.rotation import to_vector
from roadlog.storage import Table

IMU_DELAY = 0.0075  # s, of the simulated IMU's own low-pass (2nd order, 30 Hz)


def turned(tables: list[Table], rotation: np.ndarray) -> list[Table]:
    """The log of an IMU that is mounted by `rotation` (IMU axes from vehicle axes)."""
    result = []
    for source in tables:
        columns = dict(source.columns)
        if source.topic == "/imu":
            for kind in ("accel", "gyro"):
                names = [f"{kind}_{axis}" for axis in "xyz"]
                rows = rotation @ np.stack([columns[name] for name in names])
                columns |= dict(zip(names, rows, strict=True))
        result.append(Table(source.topic, source.schema, source.time, columns))
    return result


def away(found: Calibration, rotation: np.ndarray) -> np.ndarray:
    """rad about forward, left and up, by which the found mounting is wrong."""
    return to_vector(found.rotation @ rotation)
