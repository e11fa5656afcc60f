"""DEBE: grade from the driving equation, by an unscented filter on speed alone.

Luo 2024, equation (37), corrected: docs/methods/luo2024.md#driving-equation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numba import njit

from roadlog.car.driveline import NEEDS_TORQUE, Driveline, driveline, free_wheel_speed
from roadlog.car.road_speed import road_speed
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.luo2024.schedule import ScheduleParameters, schedule
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
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

ROLLING_SPEED = 0.1  # m/s, over which rolling resistance changes its sign
RESTART_VARIANCE = 1.0  # (m/s)2, of the speed after a freeze


@dataclass(frozen=True)
class DebeParameters(ScheduleParameters):
    """docs/methods/luo2024.md#parameters-of-debe."""

    variant: Literal["corrected", "eq37_brake", "eq37"] = parameter(
        "corrected",
        "",
        "eq37: no brake torque, no rotating mass; eq37_brake: with brake torque; corrected: both",
    )
    grade_noise: float = parameter(0.010, "rad/sqrt(s)", "random walk of the grade")
    speed_noise: float = parameter(0.05, "m/s2/sqrt(Hz)", "of the driving equation")
    speed_sd: float = parameter(0.02, "m/s", "of one speed sample of the grid")
    initial_grade_sd: float = parameter(0.05, "rad", "before the first sample")


class Resistance(NamedTuple):
    """What brakes the car: drag N s2/m2 and rolling resistance N; mass kg times g in N; dt s."""

    drag: float
    rolling: float
    weight: float
    dt: float


@njit(cache=True)
def process(x: Floats, force: float, mass: float, car: Resistance, y: Floats) -> None:
    """[v, grade] one step on, under `force` N at the wheels and the effective `mass` kg."""
    v, grade = x[0], x[1]
    resistance = car.drag * v * abs(v) + car.rolling * np.cos(grade) * np.tanh(v / ROLLING_SPEED)
    y[0] = v + car.dt * (force - resistance - car.weight * np.sin(grade)) / mass
    y[1] = grade


def debe(drive: Drive, vehicle: Vehicle, params: DebeParameters, engine: Engine) -> Estimate:
    """Grade from m_eff dv/dt = F_drive - F_brake - drag - rolling - m g sin(grade)."""
    line = driveline(drive, vehicle)
    force, was_held = hold(
        _wheel_force(line, vehicle, params), round(params.hold_time * drive.rate)
    )
    mass = _effective_mass(line, vehicle, params)
    corrected = params.variant == "corrected"
    speed = (road_speed if corrected else free_wheel_speed)(drive, vehicle)
    plan = schedule(drive, speed, np.isfinite(force) & ~line.unknown, params)
    car = Resistance(
        0.5 * vehicle.air_density * vehicle.drag_area,
        vehicle.rolling_resistance * vehicle.mass * G,
        vehicle.mass * G,
        drive.dt,
    )
    n = len(drive)
    grade, sd, repaired = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, np.bool_)
    steps = _reference if engine == "reference" else _compiled
    for run in plan.runs:
        grade[run], sd[run], repaired[run] = steps(
            speed[run],
            np.nan_to_num(force[run]),
            mass[run],
            plan.frozen[run],
            np.array([params.speed_noise**2, params.grade_noise**2]) * drive.dt,
            np.array([params.speed_sd**2]),
            np.array([RESTART_VARIANCE, params.initial_grade_sd**2]),
            car,
        )
    valid, flags = plan.outcome(drive, grade, sd, repaired, params)
    flags |= flag(was_held, "held")
    return Estimate(drive.time, {"grade": grade}, {"grade": sd}, valid, flags, notes=line.notes)


def _wheel_force(line: Driveline, vehicle: Vehicle, params: DebeParameters) -> Floats:
    """N, of all wheels; brakes left out in `eq37`."""
    torque = line.drive.sum(axis=1)
    if params.variant != "eq37":
        torque = torque - line.brake.sum(axis=1)
    return torque / vehicle.wheel_radius


def _effective_mass(line: Driveline, vehicle: Vehicle, params: DebeParameters) -> Floats:
    """kg; `corrected` adds what the wheels and the engine turn."""
    if params.variant != "corrected":
        return np.full(len(line.drive), vehicle.mass)
    return vehicle.mass + line.inertia.sum(axis=1) / vehicle.wheel_radius**2


@njit(cache=True)
def _compiled(
    speed: Floats,
    force: Floats,
    mass: Floats,
    frozen: Bools,
    Q: Floats,
    R: Floats,
    P0: Floats,
    car: Resistance,
) -> tuple[Floats, Floats, Bools]:
    n = len(speed)
    grade, sd, repaired = np.empty(n), np.empty(n), np.zeros(n, np.bool_)
    x, P = np.array([speed[0], 0.0]), np.diag(P0)
    X, Y = np.empty((5, 2)), np.empty((5, 2))
    for k in range(n):
        if frozen[k]:
            P[1, 1] += Q[1]
        else:
            if k > 0 and frozen[k - 1]:
                restart_state(x, P, 0, speed[k] if np.isfinite(speed[k]) else x[0], P0[0])
            elif k > 0:
                repaired[k] = sigma_points(x, P, X)
                for p in range(5):
                    process(X[p], force[k], mass[k], car, Y[p])
                mean_and_covariance(Y, Q, x, P)
            repaired[k] |= sigma_points(x, P, X)
            correct(x, P, X, X[:, :1], speed[k : k + 1], R)
            keep_upright(x, P, 1, P0[1])
        grade[k] = x[1]
        sd[k] = np.sqrt(P[1, 1])
    return grade, sd, repaired


def _reference(
    speed: Floats,
    force: Floats,
    mass: Floats,
    frozen: Bools,
    Q: Floats,
    R: Floats,
    P0: Floats,
    car: Resistance,
) -> tuple[Floats, Floats, Bools]:
    n = len(speed)
    grade, sd = np.empty(n), np.empty(n)
    ukf = reference_ukf(np.array([speed[0], 0.0]), np.diag(P0), Q)

    def fx(x: Floats, _dt: float, **step: Any) -> Floats:
        y = np.empty(2)
        process(x, step["force"], step["mass"], car, y)
        return y

    for k in range(n):
        if frozen[k]:
            ukf.P[1, 1] += Q[1]
        else:
            if k > 0 and frozen[k - 1]:
                value = speed[k] if np.isfinite(speed[k]) else ukf.x[0]
                restart_state(ukf.x, ukf.P, 0, value, P0[0])
                ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
            elif k > 0:
                ukf.predict(fx=fx, force=force[k], mass=mass[k])
            if np.isfinite(speed[k]):
                ukf.update(speed[k : k + 1], R=np.diag(R), hx=lambda x: x[:1])
            keep_upright(ukf.x, ukf.P, 1, P0[1])
        grade[k], sd[k] = ukf.x[1], np.sqrt(ukf.P[1, 1])
    return grade, sd, np.zeros(n, np.bool_)


DEBE = Estimator(
    name="debe",
    run=debe,
    parameters=DebeParameters,
    needs=(NEEDS_TORQUE, ANY_SPEED),
    gives=("grade",),
    reference="Luo 2024, eq. (37); docs/methods/luo2024.md#driving-equation",
    summary="driving equation: grade from wheel torque, brake torque and speed",
    causal=True,
    vehicle=("mass", "wheel_radius", "drag_area", "rolling_resistance", "driven", "cg_height"),
)
