"""Moving an accelerometer's reading to another point of the rigid body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.filters.kernels import odd_window, slope
from roadlog.once import once
from roadlog.types import Floats

RATE_WINDOW = 0.5  # s, least-squares slope of the gyro


@dataclass(frozen=True)
class SpecificForce:
    """Specific force of one point in vehicle axes, m/s2."""

    x: Floats
    y: Floats
    z: Floats


@once
def specific_force_at_cg(
    drive: Drive, imu_position: tuple[float, float, float] | None
) -> SpecificForce:
    """f_cg = f_imu - dw/dt x rho - w x (w x rho), rho = IMU position from the CG.

    Without a known position, or where the gyro is missing, the IMU's own reading is returned.
    Source: docs/methods/common.md#lever-arm.
    """
    f = [drive.get(f"imu.accel_{a}") for a in "xyz"]
    if imu_position is None or not any(imu_position):
        return SpecificForce(*f)
    w = np.stack([drive.get(f"imu.gyro_{a}") for a in "xyz"])
    n = odd_window(RATE_WINDOW, drive.dt)
    angular = np.stack([slope(rate, n, drive.dt) for rate in w])
    rho = np.asarray(imu_position)[:, None]
    w, angular = np.nan_to_num(w), np.nan_to_num(angular)
    lever = np.cross(angular, rho, axis=0) + np.cross(w, np.cross(w, rho, axis=0), axis=0)
    return SpecificForce(*(axis - part for axis, part in zip(f, lever, strict=True)))
