"""What a standing car says of its accelerometer: gravity has one size."""

from __future__ import annotations

import numpy as np

from roadlog.drive import Drive, runs
from roadlog.once import once
from roadlog.units import STANDARD_GRAVITY as G

LEAST = 2.0  # s that the car stands


@once
def gravity_error(drive: Drive) -> float:
    """m/s2, root mean square over the stops of by how much the specific force's size misses g.

    It is the bias and the drift of the axis that points up, and what the other axes are likely to
    have as well. 0 where no axis or no stop is there.
    """
    roles = [f"imu.accel_{axis}" for axis in "xyz"]
    if not all(role in drive for role in roles):
        return 0.0
    force = np.stack([drive[role] for role in roles])
    errors = []
    for run in runs(drive.standstill & np.isfinite(force).all(axis=0)):
        if (run.stop - run.start) * drive.dt >= LEAST:
            errors.append(float(np.linalg.norm(force[:, run].mean(axis=1))) - G)
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else 0.0
