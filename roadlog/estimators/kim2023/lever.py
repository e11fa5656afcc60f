"""Where the IMU sits along x, from how a body rocks that has just come to a stop.

docs/methods/kim2023.md#lever.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.estimators.kim2023.stops import Stop
from roadlog.types import Floats

LEAST_STOPS = 3
LEAST_RATE = np.radians(0.05)  # rad/s, rms of the pitch rate, without noise, that shows a lever
LARGEST_SD = 0.3  # m; what is known worse is not known


@dataclass(frozen=True)
class Lever:
    """m ahead of the point about which the body pitches, its standard error, and from how many."""

    x: float
    sd: float
    stops: int


def rocking_lever(
    force: Floats, rate: Floats, stops: Sequence[Stop], dt: float, time: float
) -> Lever | None:
    """From (n, 3) m/s2 and rad/s over `time` after each stop; None where the body hardly rocks.

    At the lever x the vertical velocity of a standing car's body is -x w_y. Velocities, not
    accelerations, are compared: the derivative of a gyro is mostly noise. What drifts is taken out.
    """
    products, powers = [], []
    count = round(time / dt)
    for stop in stops:
        window = slice(stop.first, stop.first + count)
        up, turn = force[window, 2], rate[window, 1]
        if not stop.starts or stop.first + count > stop.last:
            continue
        if not (np.isfinite(up).all() and np.isfinite(turn).all()):
            continue
        at_rest, still = force[stop.still, 2], rate[stop.still, 1]
        velocity = np.cumsum(up - at_rest[np.isfinite(at_rest)].mean()) * dt
        swing = _detrended(turn - stop.gyro_bias[1])
        # the gyro's noise is in the power and not in the product
        power = float(swing @ swing) - count * float(np.nanvar(still))
        if power < count * LEAST_RATE**2:
            continue
        products.append(float(-swing @ _detrended(velocity)))
        powers.append(power)
    if len(products) < LEAST_STOPS:
        return None
    product, weight = np.array(products), np.array(powers)
    x = float(product.sum() / weight.sum())
    residual = product - x * weight
    sd = np.sqrt(residual @ residual * len(weight) / (len(weight) - 1)) / weight.sum()
    return Lever(x, float(sd), len(weight)) if sd < LARGEST_SD else None


def _detrended(values: Floats) -> Floats:
    """Without its straight line."""
    t = np.linspace(-1.0, 1.0, len(values))
    return values - values.mean() - t * (t @ values) / (t @ t)
