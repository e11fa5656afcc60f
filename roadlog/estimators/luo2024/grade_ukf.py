"""Grade from tire forces and motion: the upper layer of tfobe.

Luo 2024, equations (32)-(35), corrected: docs/methods/luo2024.md#grade-from-tire-forces.
State: 0 v_x, 1 v_y, 2 yaw rate, 3 grade. Rows: 0 v_x, 1 a_x, 2 a_y, 3 yaw rate, 4 v_y.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from roadlog.car.planar_car import PlanarCar, resultants
from roadlog.estimators.luo2024.tire_ukf import Tuning
from roadlog.filters import Engine
from roadlog.filters.ukf import (
    correct,
    keep_upright,
    mean_and_covariance,
    reference_ukf,
    restart_state,
    sigma_points,
)
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

STATES, ROWS, POINTS = 4, 5, 9
GRADE = 3


class GradeTrack(NamedTuple):
    """Posterior states x and standard deviations sd (n, 4); repaired (n,)."""

    x: Floats
    sd: Floats
    repaired: Bools


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


@njit(cache=True)
def process(x: Floats, F: Floats, delta: float, car: PlanarCar, y: Floats) -> None:
    """The state one step on under the tire forces F (8,), by Euler's rule.

    The bank's -g sin(bank) is missing in v_y: its noise and row 4 absorb it.
    """
    force_x, force_y, moment = resultants(F, delta, car)
    drag = car.drag * x[0] * abs(x[0])
    y[0] = x[0] + car.dt * ((force_x - drag) / car.mass - G * np.sin(x[3]) + x[1] * x[2])
    y[1] = x[1] + car.dt * (force_y / car.mass - x[0] * x[2])
    y[2] = x[2] + car.dt * moment / car.yaw_inertia
    y[3] = x[3]


@njit(cache=True)
def measure(x: Floats, F: Floats, delta: float, car: PlanarCar, z: Floats) -> None:
    """What the state would measure, all rows; a_x and a_y only for the printed variants."""
    force_x, force_y, _ = resultants(F, delta, car)
    z[0] = x[0]
    z[1] = (force_x - car.drag * x[0] * abs(x[0])) / car.mass - G * np.sin(x[3])
    z[2] = force_y / car.mass
    z[3] = x[2]
    z[4] = x[1]


def grade_ukf(
    z: Floats,
    start: Floats,
    frozen: Bools,
    forces: Floats,
    delta: Floats,
    tune: Tuning,
    car: PlanarCar,
    engine: Engine,
) -> GradeTrack:
    """Filter one run without gaps.

    z (n, 5): measured rows, NaN where not measured or not used. start (n, 3): v_x, v_y and yaw
    rate to start from, at the first sample and after a freeze; NaN keeps the state. forces
    (n, 8): N, posterior of the lower layer. delta (n,): rad.
    """
    steps = _reference if engine == "reference" else _compiled
    return GradeTrack(*steps(z, start, frozen, forces, delta, tune, car))


@njit(cache=True)
def _restart(x: Floats, P: Floats, start: Floats, P0: Floats) -> None:
    for i in range(GRADE):
        restart_state(x, P, i, start[i] if np.isfinite(start[i]) else x[i], P0[i])


@njit(cache=True)
def _compiled(
    z: Floats,
    start: Floats,
    frozen: Bools,
    forces: Floats,
    delta: Floats,
    tune: Tuning,
    car: PlanarCar,
) -> tuple[Floats, Floats, Bools]:
    n = len(z)
    xs, sds, repaired = np.empty((n, STATES)), np.empty((n, STATES)), np.zeros(n, np.bool_)
    x, P = np.zeros(STATES), np.diag(tune.P0)
    X, Y, Z = np.empty((POINTS, STATES)), np.empty((POINTS, STATES)), np.empty((POINTS, ROWS))
    _restart(x, P, start[0], tune.P0)
    for k in range(n):
        if frozen[k]:
            P[GRADE, GRADE] += tune.Q[GRADE]
        else:
            if k > 0 and frozen[k - 1]:
                _restart(x, P, start[k], tune.P0)
            elif k > 0:
                repaired[k] = sigma_points(x, P, X)
                for p in range(POINTS):
                    process(X[p], forces[k], delta[k], car, Y[p])
                mean_and_covariance(Y, tune.Q, x, P)
            repaired[k] |= sigma_points(x, P, X)
            for p in range(POINTS):
                measure(X[p], forces[k], delta[k], car, Z[p])
            correct(x, P, X, Z, z[k], tune.R)
            keep_upright(x, P, GRADE, tune.P0[GRADE])
        xs[k] = x
        for i in range(STATES):
            sds[k, i] = np.sqrt(P[i, i])
    return xs, sds, repaired


def _reference(
    z: Floats,
    start: Floats,
    frozen: Bools,
    forces: Floats,
    delta: Floats,
    tune: Tuning,
    car: PlanarCar,
) -> tuple[Floats, Floats, Bools]:
    n = len(z)
    xs, sds = np.empty((n, STATES)), np.empty((n, STATES))
    x, P = np.zeros(STATES), np.diag(tune.P0)
    _restart(x, P, start[0], tune.P0)
    ukf = reference_ukf(x, P, tune.Q)

    def fx(x: Floats, _dt: float, **step: Any) -> Floats:
        y = np.empty(STATES)
        process(x, forces[step["k"]], delta[step["k"]], car, y)
        return y

    def hx(x: Floats, **step: Any) -> Floats:
        rows = np.empty(ROWS)
        measure(x, forces[step["k"]], delta[step["k"]], car, rows)
        return rows[step["known"]]

    for k in range(n):
        if frozen[k]:
            ukf.P[GRADE, GRADE] += tune.Q[GRADE]
        else:
            if k > 0 and frozen[k - 1]:
                _restart(ukf.x, ukf.P, start[k], tune.P0)
                ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
            elif k > 0:
                ukf.predict(fx=fx, k=k)
            known = np.flatnonzero(np.isfinite(z[k]))
            if len(known):
                ukf.update(z[k][known], R=np.diag(tune.R[known]), hx=hx, k=k, known=known)
            keep_upright(ukf.x, ukf.P, GRADE, tune.P0[GRADE])
        xs[k], sds[k] = ukf.x, np.sqrt(np.diag(ukf.P))
    return xs, sds, np.zeros(n, np.bool_)
