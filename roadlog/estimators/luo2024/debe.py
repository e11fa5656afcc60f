"""DEBE: grade from the driving equation, by an unscented filter on speed alone.

Luo 2024, equation (37), corrected: docs/methods/luo2024.md#driving-equation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from roadlog.car.driveline import NEEDS_TORQUE, Driveline, driveline, free_wheel_speed
from roadlog.car.road_speed import road_speed
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.luo2024.schedule import ScheduleParameters, schedule
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.ukf_loop import Equations, Tuning, register, track
from roadlog.jit import compiled
from roadlog.types import Floats
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


class Car(NamedTuple):
    """What moves the car, force (n,) N at the wheels and mass (n,) kg with what turns, and what
    brakes it: drag N s2/m2, rolling resistance N, weight N; dt s."""

    force: Floats
    mass: Floats
    drag: float
    rolling: float
    weight: float
    dt: float


@compiled
def process(car: Car, x: Floats, k: int, y: Floats) -> None:
    """[v, grade] one step on."""
    v, grade = x[0], x[1]
    resistance = car.drag * v * abs(v) + car.rolling * np.cos(grade) * np.tanh(v / ROLLING_SPEED)
    y[0] = v + car.dt * (car.force[k] - resistance - car.weight * np.sin(grade)) / car.mass[k]
    y[1] = grade


@compiled
def measure(car: Car, x: Floats, k: int, z: Floats) -> None:  # noqa: ARG001
    """The speed."""
    z[0] = x[0]


@compiled
def slopes(car: Car, k: int, H: Floats) -> None:  # noqa: ARG001
    """Derivative of `measure`."""
    H[0, 0] = 1.0


@compiled
def spread(car: Car, P: Floats, sd: Floats) -> None:  # noqa: ARG001
    """Of the grade."""
    sd[0] = np.sqrt(P[1, 1])


register(Car, Equations(process, measure, slopes, spread, outputs=1, angle=1))


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
    tune = Tuning(
        Q=np.array([params.speed_noise**2, params.grade_noise**2]) * drive.dt,
        R=np.array([params.speed_sd**2]),
        P0=np.array([RESTART_VARIANCE, params.initial_grade_sd**2]),
    )
    n = len(drive)
    grade, sd, repaired = np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, np.bool_)
    for run in plan.runs:
        car = Car(
            np.nan_to_num(force[run]),
            mass[run],
            0.5 * vehicle.air_density * vehicle.drag_area,
            vehicle.rolling_resistance * vehicle.mass * G,
            vehicle.mass * G,
            drive.dt,
        )
        shown = speed[run, None]
        found = track(car, shown, shown, plan.frozen[run], tune, engine)
        grade[run], sd[run], repaired[run] = found.x[:, 1], found.sd[:, 0], found.repaired
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


DEBE = Estimator(
    name="debe",
    run=debe,
    parameters=DebeParameters,
    needs=(NEEDS_TORQUE, ANY_SPEED),
    helped=("imu", "steering"),
    gives=("grade",),
    reference="Luo 2024, eq. (37); docs/methods/luo2024.md#driving-equation",
    summary="driving equation: grade from wheel torque, brake torque and speed",
    causal=True,
    vehicle=("mass", "wheel_radius", "drag_area", "rolling_resistance", "driven", "cg_height"),
)
