"""TFOBE: grade from observed tire forces, right in corners too.

Luo 2024, two unscented filters in a row: docs/methods/luo2024.md#tire-forces. What can be observed
at all: docs/methods/luo2024.md#observability.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.car.driveline import NEEDS_TORQUE, Driveline, driveline, free_wheel_speed
from roadlog.car.lever_arm import specific_force_at_cg
from roadlog.car.planar_car import MIN_LOAD, planar_car, steer, wheel_loads
from roadlog.car.road_speed import lateral_velocity, road_speed
from roadlog.car.suspension import LINEAR_TIRES
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import Estimator, flag, parameter
from roadlog.estimators.luo2024 import grade_ukf, tire_ukf
from roadlog.estimators.luo2024.schedule import Schedule, ScheduleParameters, schedule
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.ukf_loop import track
from roadlog.signals import WHEELS
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

# rows of either layer that a variant measures; docs/methods/luo2024.md#observability
TIRE_ROWS: dict[str, tuple[int, ...]] = {
    "corrected": (0, 2, 3, 4, 5, 6, 7, 8, 9, 10),
    "fx": (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10),
    "text": (0, 2, 3, 4, 5, 6, 7),
    "printed": (1, 2, 3, 4, 5, 6, 7),
}
GRADE_ROWS: dict[str, tuple[int, ...]] = {
    "corrected": (0, 3, 4),
    "fx": (0, 3, 4),
    "text": (0, 2, 3),
    "printed": (1, 2, 3),
}
MAX_GRADE = 0.35  # rad; beyond this it is no road


@dataclass(frozen=True)
class TfobeParameters(ScheduleParameters):
    """docs/methods/luo2024.md#parameters-of-tfobe; the filters' tuning is in their modules."""

    variant: Literal["corrected", "fx", "text", "printed"] = parameter(
        "corrected",
        "",
        "corrected; fx: also the accelerometer along x; text and printed: the paper's two readings",
    )
    grade_noise: float = parameter(0.010, "rad/sqrt(s)", "random walk of the grade")


@dataclass(frozen=True)
class _Signals:
    """What both layers need, on the grid: speed m/s, yaw rate rad/s, wheels rad/s (n, 4), specific
    forces in the road's plane m/s2, v_y m/s, and the process inputs; missing inputs are NaN."""

    speed: Floats
    yaw_rate: Floats
    wheels: Floats
    f_x: Floats
    f_y: Floats
    v_y: Floats
    inputs: tire_ukf.TireInputs


@dataclass(frozen=True)
class _Layers:
    """What the two filters run on: process inputs, where to start, and each layer's rows."""

    plan: Schedule
    inputs: tire_ukf.TireInputs
    start: Floats
    tire_z: Floats
    grade_z: Floats
    load: Floats
    was_held: Bools
    is_nonlinear: Bools
    notes: list[str]


def tfobe(drive: Drive, vehicle: Vehicle, params: TfobeParameters, engine: Engine) -> Estimate:
    """Tire forces, then grade = what accelerates the car less what its tires do.

    Details: `tires` (roadlog.v1.TireForces) and `sideslip` (roadlog.v1.Sideslip) at the CG. A
    single wheel's lateral force is its axle's, split by load: no equation here tells them apart.
    """
    printed = params.variant in ("printed", "text")
    car = planar_car(vehicle, drive.dt, printed)
    layers = _layers(drive, vehicle, params)
    inputs, plan = layers.inputs, layers.plan
    lower = tire_ukf.printed_tuning() if printed else tire_ukf.tuning(drive.dt)
    tune = (grade_ukf.printed_tuning if printed else grade_ukf.tuning)(drive.dt, params.grade_noise)
    n = len(drive)
    forces, force_sd = np.full((n, 8), np.nan), np.full((n, 6), np.nan)
    repaired = np.zeros(n, np.bool_)
    y, y_sd = np.full((n, grade_ukf.STATES), np.nan), np.full((n, grade_ukf.STATES), np.nan)
    turned = steer(inputs.delta)
    for run in plan.runs:
        own = tire_ukf.TireInputs(*(part[run] for part in inputs))
        tires = track(
            tire_ukf.TireModel(own, turned[run], car),
            layers.tire_z[run],
            layers.start[run],
            plan.frozen[run],
            lower,
            engine,
        )
        forces[run], force_sd[run] = tires.x[:, tire_ukf.FORCES], tires.sd
        grades = track(
            grade_ukf.GradeModel(forces[run], turned[run], car),
            layers.grade_z[run],
            layers.start[run, :3],
            plan.frozen[run],
            tune,
            engine,
        )
        y[run], y_sd[run] = grades.x, grades.sd
        repaired[run] = tires.repaired | grades.repaired
    grade, grade_sd = y[:, grade_ukf.GRADE], y_sd[:, grade_ukf.GRADE]
    valid, flags = plan.outcome(drive, grade, grade_sd, repaired, params)
    beyond = np.abs(grade) > MAX_GRADE
    flags |= (
        flag(layers.was_held, "held")
        | flag(beyond, "uncertain")
        | flag(layers.is_nonlinear, "model")
    )
    columns = _force_columns(forces, force_sd, layers.load)
    details = {
        "tires": Detail("roadlog.v1.TireForces", drive.time, columns),
        "sideslip": Detail("roadlog.v1.Sideslip", drive.time, _sideslip_columns(y, y_sd)),
    }
    return Estimate(
        drive.time,
        {"grade": grade},
        {"grade": grade_sd},
        valid & ~beyond,
        flags,
        details,
        layers.notes,
    )


def _layers(drive: Drive, vehicle: Vehicle, params: TfobeParameters) -> _Layers:
    line = driveline(drive, vehicle)
    signals = _signals(drive, vehicle, line, params.variant in ("printed", "text"))
    inputs, known, was_held = _hold(signals.inputs, round(params.hold_time * drive.rate))
    tire_z, grade_z = _rows(signals, params.variant)
    return _Layers(
        plan=schedule(drive, signals.speed, known & ~line.unknown, params),
        inputs=inputs,
        start=np.column_stack([signals.speed, signals.v_y, signals.yaw_rate, signals.wheels]),
        tire_z=tire_z,
        grade_z=grade_z,
        load=signals.inputs.load,
        was_held=was_held,
        is_nonlinear=np.abs(signals.f_y) > LINEAR_TIRES,
        notes=line.notes,
    )


def _signals(drive: Drive, vehicle: Vehicle, line: Driveline, printed: bool) -> _Signals:
    force = specific_force_at_cg(drive, vehicle.imu_position)
    # in the road's plane: the body's own pitch and roll, in proportion to the force, taken off
    in_plane_x = force.x * (1 - G * vehicle.pitch_gain)
    in_plane_y = force.y * (1 - G * vehicle.roll_gain)
    load = np.maximum(wheel_loads(in_plane_x, in_plane_y, vehicle), MIN_LOAD)
    speed = (free_wheel_speed if printed else road_speed)(drive, vehicle)
    wheels = np.stack([drive.get(f"wheel_speeds.{w}") for w in WHEELS], axis=1)
    return _Signals(
        speed=speed,
        yaw_rate=drive["imu.gyro_z"],
        wheels=wheels / vehicle.wheel_radius,
        f_x=force.x if printed else in_plane_x,
        f_y=force.y if printed else in_plane_y,
        v_y=lateral_velocity(drive, vehicle, force.y),
        inputs=tire_ukf.TireInputs(
            drive["steering.road_wheel_angle"], line.drive, line.brake, load, line.inertia
        ),
    )


def _hold(inputs: tire_ukf.TireInputs, limit: int) -> tuple[tire_ukf.TireInputs, Bools, Bools]:
    """Inputs held over short gaps and 0 in longer ones; where all are known; where any is held."""
    n = len(inputs.delta)
    known, was_held = np.ones(n, np.bool_), np.zeros(n, np.bool_)
    parts = []
    for part in inputs:
        columns = part.reshape(n, -1).copy()
        for i in range(columns.shape[1]):
            columns[:, i], filled = hold(columns[:, i], limit)
            was_held |= filled
        known &= np.isfinite(columns).all(axis=1)
        parts.append(columns.reshape(part.shape))
    # where an input is unknown the filter is frozen, but its arithmetic must stay finite
    load = np.where(np.isfinite(parts[3]), parts[3], MIN_LOAD)
    delta, torque, brake, inertia = (np.nan_to_num(parts[i]) for i in (0, 1, 2, 4))
    return tire_ukf.TireInputs(delta, torque, brake, load, inertia), known, was_held


def _rows(signals: _Signals, variant: str) -> tuple[Floats, Floats]:
    """Measurements of the lower (n, 11) and the upper layer (n, 5), NaN where not used."""
    n = len(signals.speed)
    common = [signals.speed, signals.f_x, signals.f_y, signals.yaw_rate]
    tires = np.column_stack([*common, signals.wheels, signals.v_y, np.zeros((n, 2))])
    grades = np.column_stack([*common, signals.v_y])
    for z, rows in ((tires, TIRE_ROWS[variant]), (grades, GRADE_ROWS[variant])):
        unused = np.setdiff1d(np.arange(z.shape[1]), rows)
        z[:, unused] = np.nan
    return tires, grades


def _force_columns(forces: Floats, sd: Floats, load: Floats) -> dict[str, Floats]:
    """The fields of roadlog.v1.TireForces; loads and a wheel's lateral share have no sd."""
    unknown = np.full(len(forces), np.nan)
    columns = {}
    for i, wheel in enumerate(WHEELS):
        columns[f"fx_{wheel}"], columns[f"fx_{wheel}_sd"] = forces[:, i], sd[:, i]
        columns[f"fy_{wheel}"], columns[f"fy_{wheel}_sd"] = forces[:, 4 + i], unknown
        columns[f"fz_{wheel}"], columns[f"fz_{wheel}_sd"] = load[:, i], unknown
    for i, axle in enumerate(("front", "rear")):
        columns[f"fy_{axle}"] = forces[:, 4 + 2 * i] + forces[:, 5 + 2 * i]
        columns[f"fy_{axle}_sd"] = sd[:, 4 + i]
    return columns


def _sideslip_columns(y: Floats, y_sd: Floats) -> dict[str, Floats]:
    """The fields of roadlog.v1.Sideslip; of the angle only where the car rolls forward."""
    forward = np.where(y[:, 0] > 1.0, y[:, 0], np.nan)
    return {
        "beta": np.arctan2(y[:, 1], forward),
        "beta_sd": y_sd[:, 1] / forward,
        "v_x": y[:, 0],
        "v_y": y[:, 1],
    }


TFOBE = Estimator(
    name="tfobe",
    run=tfobe,
    parameters=TfobeParameters,
    needs=(
        NEEDS_TORQUE,
        "wheel_speeds.fl|wheel_speeds.rl",
        "steering.road_wheel_angle",
        "imu.accel_x",
        "imu.accel_y",
        "imu.gyro_z",
    ),
    gives=("grade",),
    reference="Luo 2024, eqs. (26)-(35); docs/methods/luo2024.md#tire-forces",
    summary="tire-force observer: forces of each wheel, and grade in corners too",
    causal=True,
    vehicle=(
        "mass",
        "cg_to_front_axle",
        "cg_to_rear_axle",
        "cg_height",
        "track",
        "yaw_inertia",
        "wheel_radius",
        "wheel_inertia",
        "drag_area",
        "rolling_resistance",
        "rear_cornering_stiffness",
        "pitch_gradient",
        "roll_gradient",
        "driven",
    ),
)
