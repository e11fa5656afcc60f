"""Tire forces from wheel speeds, torques and specific force: the lower layer of tfobe.

Luo 2024, equations (26)-(28), corrected: docs/methods/luo2024.md#tire-forces.
State: 0 v_x, 1 v_y, 2 yaw rate, 3-6 wheel speeds, 7-10 longitudinal, 11-14 lateral forces.
Rows: 0 v_x, 1 f_x, 2 f_y, 3 yaw rate, 4-7 wheel speeds, 8 v_y, 9 and 10 load split.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.car.planar_car import PlanarCar, resultants
from roadlog.filters.ukf_loop import Equations, Tuning, register
from roadlog.jit import compiled
from roadlog.types import Floats

STATES, ROWS = 15, 11
FORCES = slice(7, STATES)  # all before: v_x, v_y, yaw rate, wheel speeds start anew after a freeze
ROLLING_WHEEL_SPEED = 0.5  # rad/s, over which brake and rolling moments change sign
SATURATED = 20.0  # whose tanh differs from 1 by less than the last digit


class TireInputs(NamedTuple):
    """What drives the process, on the grid; wheels fl, fr, rl, rr.

    delta (n,) rad; drive, brake (n, 4) N m; load (n, 4) N; inertia (n, 4) kg m2.
    """

    delta: Floats
    drive: Floats
    brake: Floats
    load: Floats
    inertia: Floats


class TireModel(NamedTuple):
    """The process's inputs, `steer` of their angle, and the car."""

    inputs: TireInputs
    steer: Floats
    car: PlanarCar


def tuning(dt: float) -> Tuning:
    """Ours; docs/methods/luo2024.md#tire-forces."""
    velocity = [(1.0 * dt) ** 2, (0.5 * dt) ** 2, (0.2 * dt) ** 2, *4 * [(4.0 * dt) ** 2]]
    force = [*4 * [400.0**2 * dt], *4 * [1500.0**2 * dt]]
    split = 300.0**2
    return Tuning(
        Q=np.array(velocity + force),
        R=np.array([0.05**2, 0.1**2, 0.1**2, 0.003**2, *4 * [0.06**2], 0.15**2, split, split]),
        P0=np.array([1.0, 0.25, 0.1, 1.0, 1.0, 1.0, 1.0, *8 * [300.0**2]]),
    )


def printed_tuning() -> Tuning:
    """The paper's, its force entries read in kN^2; docs/methods/luo2024.md#errata."""
    force = [*4 * [1e-6 * 1e6], *4 * [1e-5 * 1e6]]
    ours = tuning(1.0)
    return Tuning(Q=np.array(7 * [1e-4] + force), R=np.full(ROWS, 1e-4), P0=ours.P0)


@compiled
def forward(turns: float) -> float:
    """tanh, which is 1 to the last digit at all but a walking pace."""
    if abs(turns) > SATURATED:
        return 1.0 if turns > 0.0 else -1.0
    return np.tanh(turns)


@compiled
def process(model: TireModel, x: Floats, k: int, y: Floats) -> None:
    """The state one step on, by Euler's rule.

    The grade is left out on purpose: v_x is tied to its measurement, so the forces do not take
    up what is missing.
    """
    inputs, car = model.inputs, model.car
    force_x, force_y, moment = resultants(x, 7, model.steer[k, 0], model.steer[k, 1], car)
    y[0] = x[0] + car.dt * ((force_x - car.drag * x[0] * abs(x[0])) / car.mass + x[1] * x[2])
    y[1] = x[1] + car.dt * (force_y / car.mass - x[0] * x[2])
    y[2] = x[2] + car.dt * moment / car.yaw_inertia
    for i in range(4):
        rolling = car.rolling_resistance * inputs.load[k, i] * car.wheel_radius
        torque = inputs.drive[k, i] - car.wheel_radius * x[7 + i]
        torque -= (inputs.brake[k, i] + rolling) * forward(x[3 + i] / ROLLING_WHEEL_SPEED)
        y[3 + i] = x[3 + i] + car.dt * torque / inputs.inertia[k, i]
    for i in range(7, STATES):
        y[i] = x[i]


@compiled
def measure(model: TireModel, x: Floats, k: int, z: Floats) -> None:
    """What the state would measure, all rows."""
    inputs, car = model.inputs, model.car
    force_x, force_y, _ = resultants(x, 7, model.steer[k, 0], model.steer[k, 1], car)
    load = inputs.load[k]
    z[0] = x[0]
    z[1] = (force_x - car.drag * x[0] * abs(x[0])) / car.mass
    z[2] = force_y / car.mass
    for i in range(5):
        z[3 + i] = x[2 + i]
    z[8] = x[1]
    z[9] = x[11] - load[0] / load[1] * x[12]
    z[10] = x[13] - load[2] / load[3] * x[14]


@compiled
def slopes(model: TireModel, k: int, H: Floats) -> None:
    """Derivatives of `measure`; f_x is curved by the drag."""
    car, load = model.car, model.inputs.load[k]
    c, s = model.steer[k, 0], model.steer[k, 1]
    H[0, 0] = 1.0
    H[1, 0] = np.nan
    for i in range(2):
        H[2, 7 + i], H[2, 11 + i], H[2, 13 + i] = s / car.mass, c / car.mass, 1.0 / car.mass
    for i in range(5):
        H[3 + i, 2 + i] = 1.0
    H[8, 1] = 1.0
    H[9, 11], H[9, 12] = 1.0, -load[0] / load[1]
    H[10, 13], H[10, 14] = 1.0, -load[2] / load[3]


@compiled
def spread(model: TireModel, P: Floats, sd: Floats) -> None:  # noqa: ARG001
    """N: of each wheel's longitudinal force, then of the sum of an axle's lateral forces."""
    for i in range(4):
        sd[i] = np.sqrt(P[7 + i, 7 + i])
    sd[4] = np.sqrt(P[11, 11] + P[12, 12] + 2 * P[11, 12])
    sd[5] = np.sqrt(P[13, 13] + P[14, 14] + 2 * P[13, 14])


register(TireModel, Equations(process, measure, slopes, spread, outputs=6, angle=-1))
