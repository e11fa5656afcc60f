"""Grade from tire forces and motion: the upper layer of tfobe.

Luo 2024, equations (32)-(35), corrected: docs/methods/luo2024.md#grade-from-tire-forces.
State: 0 v_x, 1 v_y, 2 yaw rate, 3 grade. Rows: 0 v_x, 1 a_x, 2 a_y, 3 yaw rate, 4 v_y.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.car.planar_car import PlanarCar, resultants
from roadlog.filters.ukf_loop import Equations, Tuning, register
from roadlog.jit import compiled
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

STATES, ROWS = 4, 5
GRADE = 3


class GradeModel(NamedTuple):
    """forces (n, 8): N, posterior of the lower layer. steer (n, 2):
    cosine and sine of the road wheels' angle."""

    forces: Floats
    steer: Floats
    car: PlanarCar


def tuning(dt: float, grade_noise: float) -> Tuning:
    """Ours. grade_noise: rad/sqrt(s)."""
    return Tuning(
        Q=np.array([0.05**2, 0.3**2, 0.05**2, grade_noise**2]) * dt,
        R=np.array([0.02**2, 0.1**2, 0.1**2, 0.003**2, 0.15**2]),
        P0=np.array([1.0, 0.25, 0.1, 0.05**2]),
    )


def printed_tuning(dt: float, grade_noise: float) -> Tuning:
    """The paper's 1e-4 in every row; it gives no noise of the grade, ours stands in."""
    ours = tuning(dt, grade_noise)
    return Tuning(Q=ours.Q, R=np.full(ROWS, 1e-4), P0=ours.P0)


@compiled
def process(model: GradeModel, x: Floats, k: int, y: Floats) -> None:
    """The state one step on under the tire forces, by Euler's rule.

    The bank's -g sin(bank) is missing in v_y: its noise and row 4 absorb it.
    """
    car = model.car
    force_x, force_y, moment = resultants(
        model.forces[k], 0, model.steer[k, 0], model.steer[k, 1], car
    )
    drag = car.drag * x[0] * abs(x[0])
    y[0] = x[0] + car.dt * ((force_x - drag) / car.mass - G * np.sin(x[3]) + x[1] * x[2])
    y[1] = x[1] + car.dt * (force_y / car.mass - x[0] * x[2])
    y[2] = x[2] + car.dt * moment / car.yaw_inertia
    y[3] = x[3]


@compiled
def measure(model: GradeModel, x: Floats, k: int, z: Floats) -> None:
    """What the state would measure, all rows; a_x and a_y only for the printed variants."""
    car = model.car
    force_x, force_y, _ = resultants(model.forces[k], 0, model.steer[k, 0], model.steer[k, 1], car)
    z[0] = x[0]
    z[1] = (force_x - car.drag * x[0] * abs(x[0])) / car.mass - G * np.sin(x[3])
    z[2] = force_y / car.mass
    z[3] = x[2]
    z[4] = x[1]


@compiled
def slopes(model: GradeModel, k: int, H: Floats) -> None:  # noqa: ARG001
    """Derivatives of `measure`: a_x is curved, a_y does not depend on the state."""
    H[0, 0] = 1.0
    H[1, 0] = np.nan
    H[3, 2] = 1.0
    H[4, 1] = 1.0


@compiled
def spread(model: GradeModel, P: Floats, sd: Floats) -> None:  # noqa: ARG001
    """Of every state."""
    for i in range(STATES):
        sd[i] = np.sqrt(P[i, i])


register(GradeModel, Equations(process, measure, slopes, spread, outputs=STATES, angle=GRADE))
