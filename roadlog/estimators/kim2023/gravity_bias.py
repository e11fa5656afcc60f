"""The accelerometer's bias along x, from the size of gravity at stops on different slopes.

docs/methods/kim2023.md#bias-by-gravity.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.estimators.kim2023.stops import Stop
from roadlog.types import Floats

LEAST_STOPS = 5
PRIOR_SD = 0.1  # m/s2, of a bias before the data
WORTH = 0.5  # share of the prior; what is known worse is left alone


@dataclass(frozen=True)
class GravityBias:
    """m/s2 along x, its standard error, and from how many stops."""

    value: float
    sd: float
    stops: int


def gravity_bias(force: Floats, stops: Sequence[Stop]) -> GravityBias | None:
    """From (n, 3) m/s2; None where the stops hardly differ in slope.

    At rest |f| = g + d sin i + ...: a bias d along x shows by how the size follows the slope. The
    other axes' biases and a wrong scale move all stops alike.
    """
    sizes, slopes, times = [], [], []
    for stop in stops:
        still = force[stop.still]
        still = still[np.isfinite(still).all(axis=1)]
        if len(still):
            mean = still.mean(axis=0)
            sizes.append(float(np.linalg.norm(mean)))
            slopes.append(float(mean[0]) / sizes[-1])
            times.append(len(still))
    if len(sizes) < LEAST_STOPS:
        return None
    weight = np.array(times) / sum(times)
    size, slope = (np.array(part) - weight @ np.array(part) for part in (sizes, slopes))
    power = float(weight @ slope**2)
    if power == 0.0:
        return None
    found = float(weight @ (slope * size)) / power
    left = size - found * slope
    sd = float(np.sqrt(weight @ left**2 / power / (len(sizes) - 2)))
    if sd > WORTH * PRIOR_SD:
        return None
    share = PRIOR_SD**2 / (PRIOR_SD**2 + sd**2)
    return GravityBias(share * found, float(np.sqrt(share)) * sd, len(sizes))
