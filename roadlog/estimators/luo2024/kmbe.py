"""KMBE: grade by a kinematic Kalman filter on speed and longitudinal specific force.

Luo 2024, equation (38), corrected: docs/methods/luo2024.md#kinematic-filter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.car.lever_arm import specific_force_at_cg
from roadlog.car.road_speed import lateral_velocity, road_speed
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.filters import Engine
from roadlog.filters.gaps import age, hold
from roadlog.filters.kalman import LinearModel, kalman_filter, rts_smoother
from roadlog.motion.imu_noise import ImuNoise
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

MAX_SINE = 0.9  # |s/g| beyond this is no road


@dataclass(frozen=True)
class KmbeParameters:
    """docs/methods/luo2024.md#parameters-of-kmbe."""

    variant: Literal["corrected", "paper"] = parameter(
        "corrected",
        "",
        "corrected: v_y r, lever arm, body pitch, speed of the CG; paper: eq. (38) as printed",
    )
    smooth: bool = parameter(True, "", "Rauch-Tung-Striebel smoothing over the whole drive")
    grade_noise: float = parameter(0.010, "rad/sqrt(s)", "random walk of the grade")
    accel_noise: float = parameter(0.03, "m/s2/sqrt(Hz)", "of the accelerometer")
    speed_sd: float = parameter(0.02, "m/s", "of one speed sample of the grid")
    initial_grade_sd: float = parameter(0.05, "rad", "before the first sample")
    hold_time: float = parameter(0.2, "s", "inputs are held this long")
    gap_time: float = parameter(3.0, "s", "the filter predicts this long without speed")
    settle_time: float = parameter(3.0, "s", "flagged as converging after a start")


def kmbe(drive: Drive, vehicle: Vehicle, params: KmbeParameters, engine: Engine) -> Estimate:
    """Grade from dv/dt = a* - g sin(grade): state [v, s = g sin(grade)], input a*, measured v.

    a* is f_x (`paper`), or f_x at the CG + v_y r - g K_theta f_x (`corrected`).
    """
    held = round(params.hold_time * drive.rate)
    force, was_held = hold(_kinematic_acceleration(drive, vehicle, params), held)
    speed = drive.speed if params.variant == "paper" else road_speed(drive, vehicle)
    since_speed = age(np.isfinite(speed)) * drive.dt
    runnable = np.isfinite(force) & (since_speed <= params.gap_time)
    accel_noise = params.accel_noise
    if params.variant == "corrected" and "imu" in drive.native:
        accel_noise = float(np.hypot(accel_noise, ImuNoise.of(drive.native["imu"]).accel[0]))
    n = len(drive)
    sine, sd, started = np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.inf)
    for run in runs(runnable):
        model = _model(force[run], speed[run], drive.dt, params, accel_noise)
        track = kalman_filter(model, engine)
        if params.smooth:
            track = rts_smoother(model, track, engine)
        sine[run] = np.clip(track.x[:, 1] / G, -MAX_SINE, MAX_SINE)
        sd[run] = track.sd(1) / (G * np.sqrt(1 - sine[run] ** 2))
        started[run] = np.arange(run.stop - run.start) * drive.dt
    # a smoother has converged everywhere: the future tells the start of a run as well
    converging = (started < params.settle_time) & ~np.bool_(params.smooth)
    clipped = np.abs(sine) >= MAX_SINE
    flags = (
        flag(~runnable | (since_speed > held * drive.dt), "missing")
        | flag(was_held, "held")
        | flag(converging, "converging")
        | flag(clipped, "saturated")
    )
    valid = runnable & ~converging & ~clipped
    return Estimate(drive.time, {"grade": np.arcsin(sine)}, {"grade": sd}, valid, flags)


def _kinematic_acceleration(drive: Drive, vehicle: Vehicle, params: KmbeParameters) -> Floats:
    """m/s2, what accelerates the car along the road once gravity is taken off."""
    if params.variant == "paper":
        return drive["imu.accel_x"]
    force = specific_force_at_cg(drive, vehicle.imu_position)
    # without a gyro or a lateral accelerometer the drive is taken as straight
    turning = np.nan_to_num(lateral_velocity(drive, vehicle, force.y) * drive.get("imu.gyro_z"))
    return force.x * (1 - G * vehicle.pitch_gain) + turning


def _model(
    force: Floats, speed: Floats, dt: float, params: KmbeParameters, accel_noise: float
) -> LinearModel:
    known = np.flatnonzero(np.isfinite(speed))
    first = speed[known[0]] if len(known) else 0.0
    return LinearModel(
        x0=np.array([first, 0.0]),
        P0=np.diag([1.0, (params.initial_grade_sd * G) ** 2]),
        F=np.array([[[1.0, -dt], [0.0, 1.0]]]),
        Q=np.diag([accel_noise**2 * dt, (G * params.grade_noise) ** 2 * dt])[None],
        H=np.array([[[1.0, 0.0]]]),
        R=np.array([[params.speed_sd**2]]),
        u=np.stack([force * dt, np.zeros(len(force))], axis=1),
        z=speed[:, None],
    )


KMBE = Estimator(
    name="kmbe",
    run=kmbe,
    parameters=KmbeParameters,
    needs=("imu.accel_x", ANY_SPEED),
    gives=("grade",),
    reference="Luo 2024, eq. (38); docs/methods/luo2024.md#kinematic-filter",
    summary="kinematic Kalman filter: grade from speed and longitudinal acceleration",
    vehicle=(
        "pitch_gradient",
        "roll_gradient",
        "mass",
        "rear_cornering_stiffness",
        "cg_height",
        "driven",
    ),
    helped=("imu", "steering"),
    systematic_deg={"grade": 0.35},
    tilted=("grade",),
)
