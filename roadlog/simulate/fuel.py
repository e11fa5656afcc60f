"""The simulated fuel sender."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.simulate.motion import Motion
from roadlog.simulate.sampling import Columns, at, clock, stream, without_errors
from roadlog.types import Floats


@dataclass(frozen=True)
class FuelSender:
    """Float in a box tank whose surface sloshes; docs/simulator.md#fuel-sender."""

    rate: float = 0.0  # Hz, 0 = none
    volume: float = 0.020  # m3, true
    slosh_frequency: float = 0.7  # Hz
    slosh_damping: float = 0.05  # -, of critical
    noise: float = 0.0005  # m

    def ideal(self) -> FuelSender:
        """A float without noise; the fuel sloshes as it does."""
        return without_errors(self, "noise")

    def measure(self, motion: Motion, vehicle: Vehicle, seed: int) -> Columns:
        """Section fuel."""
        if not self.rate:
            return {}
        from scipy.signal import lfilter

        tilt = motion.force[:, 0] / motion.force[:, 2]
        w = 2 * np.pi * self.slosh_frequency * motion.dt
        z = self.slosh_damping
        # the surface follows the specific force like an oscillator (backward difference)
        a = np.array([1 + 2 * z * w + w * w, -2 - 2 * z * w, 1.0])
        start = tilt[0]
        surface = start + lfilter([w * w], a, tilt - start)
        time = clock(motion, self.rate)
        height = sender_height(self.volume, at(motion, surface, time), vehicle)
        noise = self.noise * stream(seed, "fuel").standard_normal(len(time))
        return {"fuel": (time, {"sender": np.clip(height + noise, 0.0, vehicle.tank_height)})}


def sender_height(volume: float, slope: Floats, vehicle: Vehicle) -> Floats:
    """m, fuel level at the sender by bisection of the volume under a plane in a box.

    volume: m3. slope: fall of the surface towards +x, -.
    """
    cells = (np.arange(400) + 0.5) / 400 - 0.5
    x = cells * vehicle.tank_length
    base = vehicle.tank_length * vehicle.tank_width
    span = vehicle.tank_height + np.abs(slope) * vehicle.tank_length
    low, high = -span, span + vehicle.tank_height
    for _ in range(40):
        middle = (low + high) / 2
        level = middle[:, None] - slope[:, None] * (x - vehicle.tank_sender[0])
        filled = base * np.clip(level, 0.0, vehicle.tank_height).mean(axis=1)
        low, high = np.where(filled < volume, middle, low), np.where(filled < volume, high, middle)
    return (low + high) / 2
