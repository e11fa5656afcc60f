"""Grade and pitch by an extended Kalman filter with a first-order suspension.

Wang 2025, corrected: docs/methods/wang2025.md#suspension-filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.straight import selected_speed, straight_flags
from roadlog.estimators.wang2025.printed import filter_printed
from roadlog.estimators.wang2025.suspension_ekf import (
    PitchingCar,
    SuspensionModel,
    filter_suspension,
    smooth_suspension,
)
from roadlog.filters import Engine
from roadlog.filters.gaps import age
from roadlog.jit import argument
from roadlog.types import Bools, Floats

DAMPING = 0.3  # -, of critical, where the vehicle file gives none
TUNING_RATE = 100.0  # Hz, at which noises per step are given


@dataclass(frozen=True)
class EkfSuspensionParameters:
    """docs/methods/wang2025.md#parameters-of-ekf_suspension; noises per step at 100 Hz."""

    smooth: bool = parameter(True, "", "Rauch-Tung-Striebel smoothing over the whole drive")
    form: Literal["mended", "printed"] = parameter(
        "mended", "", "printed: the paper's transition and noises; causal, whatever `smooth` says"
    )
    mount: Literal["body", "road"] = parameter(
        "body", "", "the accelerometer pitches with the body, or stays parallel to the road"
    )
    use_drive_force: bool = parameter(True, "", "use the drive force where the log has one")
    wheels: Literal["undriven", "all", "front", "rear", "median"] = parameter(
        "undriven", "", "wheels that give the speed"
    )
    speed_noise: float = parameter(1e-3, "m/s", "process noise of the speed")
    accel_noise: float = parameter(3.0, "m/s2", "of the force balance; 0.3 only with brakes in it")
    grade_noise: float = parameter(1e-3, "rad", "random walk of the grade")
    pitch_noise: float = parameter(2e-4, "rad", "process noise of the pitch")
    speed_sd: float = parameter(0.05, "m/s", "of one measured speed")
    accel_sd: float = parameter(0.15, "m/s2", "of one measured acceleration")
    gate: float = parameter(math.inf, "-", "innovations beyond this many sd are skipped")
    gap_time: float = parameter(2.0, "s", "predicts this long without one of the inputs; ours")
    settle_time: float = parameter(1.0, "s", "flagged as converging after a start")


def ekf_suspension(
    drive: Drive, vehicle: Vehicle, params: EkfSuspensionParameters, engine: Engine
) -> Estimate:
    """State [v, a = dv/dt + g sin(grade), grade, pitch], measured v and a (or f_x).

    With mount `road` the pitch is the suspension model's answer to a, never corrected.
    """
    speed, accel = selected_speed(drive, params.wheels, vehicle), drive.get("imu.accel_x")
    smooth = params.smooth and params.form == "mended"
    force = drive_force(drive, vehicle) if params.use_drive_force else np.full(len(drive), np.nan)
    since = np.maximum(age(np.isfinite(speed)), age(np.isfinite(accel))) * drive.dt
    runnable = since <= params.gap_time
    n = len(drive)
    x, P, innovation = np.full((n, 4), np.nan), np.full((n, 4, 4), np.nan), np.full((n, 3), np.nan)
    rejected, since_start = np.zeros(n, np.bool_), np.full(n, np.inf)
    for run in runs(runnable):
        model = suspension_model(vehicle, params, drive.dt, speed[run], accel[run], force[run])
        printed = params.form == "printed"
        track = filter_printed(model) if printed else filter_suspension(model, engine)
        innovation[run], rejected[run] = track.innovation, track.rejected
        if smooth:
            track = smooth_suspension(model, track, engine)
        x[run], P[run] = track.x, track.P
        since_start[run] = np.arange(run.stop - run.start) * drive.dt
    converging = (since_start < params.settle_time) & ~np.bool_(smooth)
    measured = np.isfinite(speed) & np.isfinite(accel)
    flags = (
        straight_flags(drive, measured)
        | flag(converging, "converging")
        | flag(rejected, "rejected")
        | flag(np.isnan(force) & params.use_drive_force, "powertrain")
    )
    columns = {
        "speed": x[:, 0],
        "along_road": x[:, 1],
        "speed_innovation": innovation[:, 0],
        "accel_innovation": innovation[:, 1],
        "nis": innovation[:, 2],
    }
    angles = {"grade": x[:, 2], "pitch": x[:, 3], "inclination": x[:, 2] + x[:, 3]}
    sd = {
        "grade": np.sqrt(P[:, 2, 2]),
        "pitch": np.sqrt(P[:, 3, 3]),
        "inclination": np.sqrt(np.maximum(P[:, 2, 2] + P[:, 3, 3] + 2 * P[:, 2, 3], 0.0)),
    }
    details = {"filter": Detail("roadlog.v1.SuspensionFilter", drive.time, columns)}
    valid: Bools = runnable & ~converging
    return Estimate(drive.time, angles, sd, valid, flags, details)


def drive_force(drive: Drive, vehicle: Vehicle) -> Floats:
    """N, on the wheels together, brakes included; NaN where the log does not tell.

    /powertrain drive_force, else the sum of the wheel torques over the wheel radius.
    """
    if "powertrain.drive_force" in drive:
        return drive["powertrain.drive_force"]
    wheels = ("fl", "fr", "rl", "rr")
    torques = {kind: [f"wheel_torques.{kind}_{w}" for w in wheels] for kind in ("drive", "brake")}
    if not any(role in drive for role in torques["drive"]):
        return np.full(len(drive), np.nan)

    def total(kind: str) -> Floats:
        return sum((drive[r] for r in torques[kind] if r in drive), np.zeros(len(drive)))

    return (total("drive") - total("brake")) / vehicle.wheel_radius


def suspension_model(
    vehicle: Vehicle,
    params: EkfSuspensionParameters,
    dt: float,
    speed: Floats,
    accel: Floats,
    force: Floats,
) -> SuspensionModel:
    """The filter's model of this car; stiffness from the pitch gradient, K = m h / k."""
    stiffness = vehicle.mass * vehicle.cg_height / vehicle.pitch_gain
    damping = vehicle.pitch_damping
    if damping is None:
        damping = 2 * DAMPING * math.sqrt(stiffness * vehicle.pitch_inertia)
    rate = stiffness / damping
    decay = 1 - dt * rate if params.form == "printed" else math.exp(-dt * rate)
    known = np.flatnonzero(np.isfinite(speed))
    per_step = TUNING_RATE * dt
    return SuspensionModel(
        PitchingCar(
            dt=dt,
            mass=vehicle.mass,
            drag=0.5 * vehicle.air_density * vehicle.drag_area,
            rolling=vehicle.rolling_resistance,
            height=vehicle.cg_height,
            decay=decay,
            gain=(1 - decay) / stiffness,
        ),
        body_mount=params.mount == "body",
        Q=np.array(
            [
                params.speed_noise**2 * per_step,
                params.accel_noise**2,  # an algebraic balance, no walk: does not scale
                params.grade_noise**2 * per_step,
                params.pitch_noise**2 * per_step,
            ]
        ),
        R=np.array([params.speed_sd**2, params.accel_sd**2]),
        x0=np.array([speed[known[0]] if len(known) else 0.0, 0.0, 0.0, 0.0]),
        P0=np.diag([0.1**2, 1.0**2, 0.1**2, 0.02**2]),
        gate=params.gate,
        speed=argument(speed),
        accel=argument(accel),
        force=argument(force),
    )


EKF_SUSPENSION = Estimator(
    name="ekf_suspension",
    run=ekf_suspension,
    parameters=EkfSuspensionParameters,
    needs=("imu.accel_x", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Wang 2025; docs/methods/wang2025.md#suspension-filter",
    summary="grade and pitch by a Kalman smoother with the suspension's pitch; straight driving",
    vehicle=("mass", "cg_height", "pitch_gradient", "pitch_inertia", "drag_area"),
    systematic_deg={"grade": 0.4, "pitch": 0.08, "inclination": 0.4},
    tilted=("grade", "inclination"),
    spoiled_by=frozenset({"vibration"}),
)
