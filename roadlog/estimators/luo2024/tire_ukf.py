"""Tire forces from wheel speeds, torques and specific force: the lower layer of tfobe.

Luo 2024, equations (26)-(28), corrected: docs/methods/luo2024.md#tire-forces.
State: 0 v_x, 1 v_y, 2 yaw rate, 3-6 wheel speeds, 7-10 longitudinal, 11-14 lateral forces.
Rows: 0 v_x, 1 f_x, 2 f_y, 3 yaw rate, 4-7 wheel speeds, 8 v_y, 9 and 10 load split.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from roadlog.car.planar_car import PlanarCar, resultants
from roadlog.filters import Engine
from roadlog.filters.ukf import (
    correct,
    mean_and_covariance,
    reference_ukf,
    restart_state,
    sigma_points,
)
from roadlog.types import Bools, Floats

STATES, ROWS, POINTS = 15, 11, 31
MEASURED_STATES = 7  # v_x, v_y, yaw rate and wheel speeds start anew after a freeze
ROLLING_WHEEL_SPEED = 0.5  # rad/s, over which brake and rolling moments change sign


class TireInputs(NamedTuple):
    """What drives the process, on the grid; wheels fl, fr, rl, rr.

    delta (n,) rad; drive, brake (n, 4) N m; load (n, 4) N; inertia (n, 4) kg m2.
    """

    delta: Floats
    drive: Floats
    brake: Floats
    load: Floats
    inertia: Floats


class Tuning(NamedTuple):
    """Diagonals: Q (15,) per step, R (11,), P0 (15,)."""

    Q: Floats
    R: Floats
    P0: Floats


class TireTrack(NamedTuple):
    """Posterior forces (n, 8), longitudinal and lateral, and their sd (n, 6), N; repaired (n,).

    sd: of each wheel's longitudinal force, and of the sum of an axle's lateral forces, front and
    rear.
    """

    forces: Floats
    sd: Floats
    repaired: Bools


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


@njit(cache=True)
def process(x: Floats, k: int, inputs: TireInputs, car: PlanarCar, y: Floats) -> None:
    """The state one step on, by Euler's rule.

    The grade is left out on purpose: v_x is tied to its measurement, so the forces do not take
    up what is missing.
    """
    force_x, force_y, moment = resultants(x[7:], inputs.delta[k], car)
    y[0] = x[0] + car.dt * ((force_x - car.drag * x[0] * abs(x[0])) / car.mass + x[1] * x[2])
    y[1] = x[1] + car.dt * (force_y / car.mass - x[0] * x[2])
    y[2] = x[2] + car.dt * moment / car.yaw_inertia
    for i in range(4):
        rolling = car.rolling_resistance * inputs.load[k, i] * car.wheel_radius
        torque = inputs.drive[k, i] - car.wheel_radius * x[7 + i]
        torque -= (inputs.brake[k, i] + rolling) * np.tanh(x[3 + i] / ROLLING_WHEEL_SPEED)
        y[3 + i] = x[3 + i] + car.dt * torque / inputs.inertia[k, i]
    for i in range(7, STATES):
        y[i] = x[i]


@njit(cache=True)
def measure(x: Floats, k: int, inputs: TireInputs, car: PlanarCar, z: Floats) -> None:
    """What the state would measure, all rows."""
    force_x, force_y, _ = resultants(x[7:], inputs.delta[k], car)
    load = inputs.load[k]
    z[0] = x[0]
    z[1] = (force_x - car.drag * x[0] * abs(x[0])) / car.mass
    z[2] = force_y / car.mass
    for i in range(5):
        z[3 + i] = x[2 + i]
    z[8] = x[1]
    z[9] = x[11] - load[0] / load[1] * x[12]
    z[10] = x[13] - load[2] / load[3] * x[14]


def tire_ukf(
    z: Floats,
    start: Floats,
    frozen: Bools,
    inputs: TireInputs,
    tune: Tuning,
    car: PlanarCar,
    engine: Engine,
) -> TireTrack:
    """Filter one run without gaps.

    z (n, 11): measured rows, NaN where not measured or not used. start (n, 7): v_x, v_y, yaw rate
    and wheel speeds to start from, at the first sample and after a freeze; NaN keeps the state.
    """
    steps = _reference if engine == "reference" else _compiled
    return TireTrack(*steps(z, start, frozen, inputs, tune, car))


@njit(cache=True)
def _restart(x: Floats, P: Floats, start: Floats, P0: Floats) -> None:
    for i in range(MEASURED_STATES):
        restart_state(x, P, i, start[i] if np.isfinite(start[i]) else x[i], P0[i])


@njit(cache=True)
def _compiled(
    z: Floats, start: Floats, frozen: Bools, inputs: TireInputs, tune: Tuning, car: PlanarCar
) -> tuple[Floats, Floats, Bools]:
    n = len(z)
    forces, sd = np.empty((n, 8)), np.empty((n, 6))
    repaired = np.zeros(n, np.bool_)
    x, P = np.zeros(STATES), np.diag(tune.P0)
    X, Y, Z = np.empty((POINTS, STATES)), np.empty((POINTS, STATES)), np.empty((POINTS, ROWS))
    _restart(x, P, start[0], tune.P0)
    for k in range(n):
        if frozen[k]:
            for i in range(MEASURED_STATES, STATES):
                P[i, i] += tune.Q[i]
        else:
            if k > 0 and frozen[k - 1]:
                _restart(x, P, start[k], tune.P0)
            elif k > 0:
                repaired[k] = sigma_points(x, P, X)
                for p in range(POINTS):
                    process(X[p], k, inputs, car, Y[p])
                mean_and_covariance(Y, tune.Q, x, P)
            repaired[k] |= sigma_points(x, P, X)
            for p in range(POINTS):
                measure(X[p], k, inputs, car, Z[p])
            correct(x, P, X, Z, z[k], tune.R)
        forces[k] = x[MEASURED_STATES:]
        for i in range(4):
            sd[k, i] = np.sqrt(P[7 + i, 7 + i])
        sd[k, 4] = np.sqrt(P[11, 11] + P[12, 12] + 2 * P[11, 12])
        sd[k, 5] = np.sqrt(P[13, 13] + P[14, 14] + 2 * P[13, 14])
    return forces, sd, repaired


def _reference(
    z: Floats, start: Floats, frozen: Bools, inputs: TireInputs, tune: Tuning, car: PlanarCar
) -> tuple[Floats, Floats, Bools]:
    n = len(z)
    forces, sd = np.empty((n, 8)), np.empty((n, 6))
    x, P = np.zeros(STATES), np.diag(tune.P0)
    _restart(x, P, start[0], tune.P0)
    ukf = reference_ukf(x, P, tune.Q)

    def fx(x: Floats, _dt: float, **step: Any) -> Floats:
        y = np.empty(STATES)
        process(x, step["k"], inputs, car, y)
        return y

    def hx(x: Floats, **step: Any) -> Floats:
        rows = np.empty(ROWS)
        measure(x, step["k"], inputs, car, rows)
        return rows[step["known"]]

    for k in range(n):
        if frozen[k]:
            ukf.P += np.diag(np.where(np.arange(STATES) < MEASURED_STATES, 0.0, tune.Q))
        else:
            if k > 0 and frozen[k - 1]:
                _restart(ukf.x, ukf.P, start[k], tune.P0)
                ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
            elif k > 0:
                ukf.predict(fx=fx, k=k)
            known = np.flatnonzero(np.isfinite(z[k]))
            if len(known):
                ukf.update(z[k][known], R=np.diag(tune.R[known]), hx=hx, k=k, known=known)
        forces[k], sd[k, :4] = ukf.x[MEASURED_STATES:], np.sqrt(np.diag(ukf.P)[7:11])
        sd[k, 4:] = [np.sqrt(ukf.P[i : i + 2, i : i + 2].sum()) for i in (11, 13)]
    return forces, sd, np.zeros(n, np.bool_)
