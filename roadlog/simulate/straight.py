"""The papers' simple truth model: a car that drives straight and pitches on its springs.

Methods, Massel/Kim/Wang chapter, section 1.8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G
from roadlog.vehicle import Vehicle

STEP = 0.5e-3  # s, at most; section 1.8


@dataclass(frozen=True)
class StraightDrive:
    """Truth of a straight drive on a uniform clock: SI, radians, signs of design section 3."""

    time: Floats
    speed: Floats
    acceleration: Floats
    grade: Floats
    pitch: Floats
    pitch_rate: Floats
    grade_rate: Floats

    @property
    def along_road(self) -> Floats:
        """m/s2, specific force along the road: dv/dt + g sin(grade)."""
        return self.acceleration + G * np.sin(self.grade)

    def specific_force(self) -> tuple[Floats, Floats]:
        """f_x, f_z of an accelerometer at the pitch center, m/s2 (C1)."""
        a, b = self.along_road, G * np.cos(self.grade)
        return (
            a * np.cos(self.pitch) + b * np.sin(self.pitch),
            b * np.cos(self.pitch) - a * np.sin(self.pitch),
        )


def drive_straight(
    acceleration: Floats, grade: Floats, initial_speed: float, rate: float, vehicle: Vehicle
) -> StraightDrive:
    """Integrate speed and suspension pitch under given acceleration and grade.

    acceleration m/s2, grade rad, both at `rate` Hz. The vehicle must have `pitch_stiffness` and
    `pitch_damping`. Pitch: I p'' + C p' + K p = m h (dv/dt + g sin G) + 0.5 rho CdA v^2 h (S1),
    semi-implicit Euler, started at its static value.
    """
    if vehicle.pitch_stiffness is None or vehicle.pitch_damping is None:
        raise ValueError("the straight-line truth model needs pitch_stiffness and pitch_damping")
    time = np.arange(len(acceleration)) / rate
    speed = initial_speed + np.concatenate(
        [[0.0], np.cumsum((acceleration[1:] + acceleration[:-1]) / (2 * rate))]
    )
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * speed * np.abs(speed)
    moment = vehicle.cg_height * (vehicle.mass * (acceleration + G * np.sin(grade)) + drag)
    substeps = max(1, int(np.ceil(1 / (rate * STEP))))
    pitch, pitch_rate = _suspension(
        moment,
        vehicle.pitch_inertia,
        vehicle.pitch_damping,
        vehicle.pitch_stiffness,
        1 / rate,
        substeps,
    )
    return StraightDrive(
        time, speed, acceleration, grade, pitch, pitch_rate, np.gradient(grade, 1 / rate)
    )


@njit(cache=True)
def _suspension(
    moment: Floats, inertia: float, damping: float, stiffness: float, dt: float, substeps: int
) -> tuple[Floats, Floats]:
    n = len(moment)
    angle, rate = np.empty(n), np.empty(n)
    p, w = moment[0] / stiffness, 0.0
    h = dt / substeps
    for k in range(n):
        angle[k], rate[k] = p, w
        after = moment[min(k + 1, n - 1)]
        for j in range(substeps):
            m = moment[k] + (after - moment[k]) * j / substeps
            w += h * (m - damping * w - stiffness * p) / inertia
            p += h * w
    return angle, rate
