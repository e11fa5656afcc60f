"""Bank of the road and roll of the body, told apart: Ryu's disturbance observer.

Ryu 2004, equations (17)-(24), corrected: docs/methods/ryu2004.md#observer.
State: 0 sideslip, 1 yaw rate, 2 roll, 3 roll rate, 4 bank, 5 rate of the road frame's roll,
6 its acceleration, 7 the yaw rate's share in it. Rows: sideslip, yaw rate, total roll, roll rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from roadlog.car.driveline import free_wheel_speed
from roadlog.car.suspension import LINEAR_TIRES
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.ryu2004.split_qs import split
from roadlog.estimators.ryu2004.total_roll import (
    GNSS_GAP,
    INERTIAL_GAP,
    TWO_ANTENNAS,
    TotalRoll,
    total_roll,
)
from roadlog.filters import Engine
from roadlog.filters.discretize import zero_order_hold
from roadlog.filters.gaps import age, hold
from roadlog.filters.kalman import correct_scalar, predict_covariance
from roadlog.jit import compiled
from roadlog.types import Bools, Floats, Indices
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

STATES, ROWS = 8, 4
SPEED_STEP = 0.01  # m/s, between the speeds for which the model is discretized
INITIAL_VARIANCE = np.array([0.05, 0.1, 0.05, 0.3, 0.08, 0.2, 1.0, 0.05]) ** 2
# sd of sideslip, yaw rate, total roll and roll rate. Sideslip is weak on purpose: believed, an
# error of it would go into the bank 17 times. 1 deg, in which the error's correlation
# over 0.5 s counts, leaves out the tires' own error: 2 deg errs less with right and wrong stiffness
MEASUREMENT_SD = np.array([2.0, 0.2, 0.25, 0.3]) * DEG
IMU_ROLL_SD = 1.0 * DEG  # of total roll without two antennas
TYPICAL_DAMPING_RATIO = 0.25  # in roll; wagon 0.18, commonroad_2 0.34
H = np.zeros((ROWS, STATES))
H[0, 0] = H[1, 1] = H[2, 2] = H[2, 4] = H[3, 3] = H[3, 5] = 1.0


@dataclass(frozen=True)
class RollBankParameters:
    """docs/methods/ryu2004.md#parameters-of-roll_bank_obs; the noise is in `system`."""

    min_speed: float = parameter(1.5, "m/s", "below it the steady-state split is given")
    beta_speed: float = parameter(3.0, "m/s", "below it sideslip is not measured")
    settle_time: float = parameter(5.0, "s", "flagged as converging after a start")
    smooth: bool = parameter(
        True, "", "smooth total roll and sideslip over the whole drive; the observer is causal"
    )


class BicycleCar(NamedTuple):
    """Single-track car that rolls; SI, stiffnesses per axle."""

    mass: float
    front: float
    rear: float
    front_stiffness: float
    rear_stiffness: float
    yaw_inertia: float
    roll_inertia: float
    roll_arm: float
    roll_stiffness: float
    roll_damping: float


class Models(NamedTuple):
    """Discrete models of m speeds: transitions (m, 8, 8), input (m, 8), noise (m, 8, 8)."""

    Phi: Floats
    Gamma: Floats
    Qd: Floats


def bicycle_car(vehicle: Vehicle) -> BicycleCar:
    """The model's parameters; stiffness and damping in roll from what the vehicle knows."""
    stiffness = vehicle.roll_stiffness
    if stiffness is None:
        stiffness = vehicle.mass * vehicle.roll_arm / vehicle.roll_gain
    damping = vehicle.roll_damping
    if damping is None:
        arm = vehicle.mass * vehicle.roll_arm
        inertia = vehicle.roll_inertia + arm * vehicle.roll_arm
        damping = 2 * TYPICAL_DAMPING_RATIO * np.sqrt((stiffness - arm * G) * inertia)
    return BicycleCar(
        vehicle.mass,
        vehicle.cg_to_front_axle,
        vehicle.cg_to_rear_axle,
        vehicle.front_cornering_stiffness,
        vehicle.rear_cornering_stiffness,
        vehicle.yaw_inertia,
        vehicle.roll_inertia,
        vehicle.roll_arm,
        stiffness,
        damping,
    )


@compiled
def system(u: float, car: BicycleCar) -> tuple[Floats, Floats, Floats]:
    """F (8, 8), G (8,) and the noise density Qc (8,) at the speed u > 0; eqs. (20)-(24)."""
    m, h = car.mass, car.roll_arm
    c0 = car.front_stiffness + car.rear_stiffness
    c1 = car.front * car.front_stiffness - car.rear * car.rear_stiffness
    c2 = car.front**2 * car.front_stiffness + car.rear**2 * car.rear_stiffness
    inertia = car.roll_inertia + m * h**2  # about the roll axis
    kappa = m * G * h - car.roll_stiffness
    ix = car.roll_inertia
    F = np.zeros((STATES, STATES))
    F[0, 0] = -inertia * c0 / (ix * m * u)
    F[0, 1] = -1.0 - inertia * c1 / (ix * m * u**2)
    F[0, 2] = h * kappa / (ix * u)
    F[0, 3] = -h * car.roll_damping / (ix * u)
    F[0, 4] = -G / u
    F[1, 0] = -c1 / car.yaw_inertia
    F[1, 1] = -c2 / (car.yaw_inertia * u)
    F[2, 3] = 1.0
    F[3, 0] = -c0 * h / ix
    F[3, 1] = -c1 * h / (ix * u)
    F[3, 2] = kappa / ix
    F[3, 3] = -car.roll_damping / ix
    F[3, 6] = -1.0
    F[4, 5] = 1.0
    F[4, 7] = 1.0
    F[5, 6] = 1.0
    B = np.zeros(STATES)
    B[0] = inertia * car.front_stiffness / (ix * m * u)
    B[1] = car.front * car.front_stiffness / car.yaw_inertia
    B[3] = car.front_stiffness * h / ix
    Qc = np.zeros(STATES)
    Qc[0], Qc[1], Qc[2], Qc[3] = 0.04 / u**2, 0.01, 1e-8, 0.05
    Qc[6], Qc[7] = 0.5, 4e-4
    return F, B, Qc


def roll_bank_obs(
    drive: Drive, vehicle: Vehicle, params: RollBankParameters, engine: Engine
) -> Estimate:
    """Bank and roll from steering, speed, yaw rate, roll rate and total roll.

    Total roll and sideslip come from a two-antenna GNSS receiver where the drive has one, else
    total roll from the IMU and no sideslip; a note says which. Detail: `sideslip` at the roll
    axis under the CG.
    """
    total = total_roll(drive, vehicle, params.smooth, engine)
    speed = hold(free_wheel_speed(drive, vehicle), round(INERTIAL_GAP * drive.rate))[0]
    steer = hold(drive["steering.road_wheel_angle"], round(INERTIAL_GAP * drive.rate))[0]
    inertial = age(np.isfinite(drive["imu.gyro_x"]) & np.isfinite(drive["imu.gyro_z"]))
    slow = speed < params.min_speed
    runnable = np.isfinite(speed) & np.isfinite(steer) & np.isfinite(total.angle)
    runnable &= (inertial * drive.dt <= INERTIAL_GAP) & ~slow
    z = _rows(total, speed >= params.beta_speed)
    R = MEASUREMENT_SD**2
    if total.source == "imu_roll":
        R = np.where(np.arange(ROWS) == 2, IMU_ROLL_SD**2, R)
    n, car = len(drive), bicycle_car(vehicle)
    x, sd = np.full((n, STATES), np.nan), np.full((n, STATES), np.nan)
    total_sd, started = np.full(n, np.nan), np.full(n, np.inf)
    steps = _reference if engine == "reference" else _compiled
    at, models = _models(np.where(runnable, speed, params.min_speed), car, drive.dt)
    for run in runs(runnable):
        x[run], sd[run], total_sd[run] = steps(z[run], at[run], models, steer[run], R)
        started[run] = np.arange(run.stop - run.start) * drive.dt
    angles = {"bank": x[:, 4], "roll": x[:, 2], "roll_total": x[:, 2] + x[:, 4]}
    sds = {"bank": sd[:, 4], "roll": sd[:, 2], "roll_total": total_sd}
    steady, steady_sd = split(total, vehicle)
    for name in angles:
        angles[name] = np.where(slow, steady[name], angles[name])
        sds[name] = np.where(slow, steady_sd[name], sds[name])
    converging = started < params.settle_time
    beyond = np.abs(total.force.y) > LINEAR_TIRES
    stale = total.since_update > GNSS_GAP
    missing = ~np.isfinite(angles["bank"]) | stale
    flags = (
        flag(missing, "missing")
        | flag(slow, "standstill")
        | flag(converging, "converging")
        | flag(beyond, "model")
    )
    columns = {
        "beta": x[:, 0],
        "beta_sd": sd[:, 0],
        "v_x": speed,
        "v_y": speed * np.tan(x[:, 0]),
    }
    return Estimate(
        drive.time,
        angles,
        sds,
        ~missing & ~converging & ~beyond,
        flags,
        {"sideslip": Detail("roadlog.v1.Sideslip", drive.time, columns)},
        [total.note],
    )


def _rows(total: TotalRoll, with_beta: Bools) -> Floats:
    """(n, 4): sideslip, yaw rate, total roll, roll rate; total roll only while it is fresh."""
    fresh = total.since_update <= GNSS_GAP
    beta = np.where(with_beta & fresh, total.beta, np.nan)
    angle = np.where(fresh, total.angle, np.nan)
    return np.column_stack([beta, total.yaw_rate, angle, total.roll_rate])


def _models(speed: Floats, car: BicycleCar, dt: float) -> tuple[Indices, Models]:
    """Per sample which model, (n,), and the models: of the rounded speeds that are driven."""
    steps, at = np.unique(np.round(speed / SPEED_STEP), return_inverse=True)
    discrete = [zero_order_hold(*system(u, car), dt) for u in steps * SPEED_STEP]
    return at, Models(*(np.stack(part) for part in zip(*discrete, strict=True)))


@compiled
def _compiled(
    z: Floats, at: Indices, models: Models, steer: Floats, R: Floats
) -> tuple[Floats, Floats, Floats]:
    n = len(z)
    xs, sds, total_sd = np.empty((n, STATES)), np.empty((n, STATES)), np.empty(n)
    P, FP = np.zeros((STATES, STATES)), np.empty((STATES, STATES))
    h, Ph = np.empty(STATES), np.empty(STATES)
    for i in range(STATES):
        P[i, i] = INITIAL_VARIANCE[i]
    for k in range(n):
        x = xs[k]
        if k == 0:
            for i in range(STATES):
                x[i] = 0.0
            for i, row in ((0, 0), (1, 1), (4, 2)):
                if np.isfinite(z[0, row]):
                    x[i] = z[0, row]
        else:
            Phi, Gamma = models.Phi[at[k]], models.Gamma[at[k]]
            for i in range(STATES):
                x[i] = Gamma[i] * steer[k - 1]
                for j in range(STATES):
                    x[i] += Phi[i, j] * xs[k - 1, j]
            predict_covariance(P, Phi, models.Qd[at[k]], FP, P)
        for i in range(ROWS):
            if np.isfinite(z[k, i]):
                residual = z[k, i]
                for j in range(STATES):
                    h[j] = H[i, j]
                    residual -= h[j] * x[j]
                correct_scalar(x, P, residual, h, R[i], Ph)
        for i in range(STATES):
            sds[k, i] = np.sqrt(P[i, i])
        total_sd[k] = np.sqrt(P[2, 2] + P[4, 4] + 2 * P[2, 4])
    return xs, sds, total_sd


def _reference(
    z: Floats, at: Indices, models: Models, steer: Floats, R: Floats
) -> tuple[Floats, Floats, Floats]:
    from filterpy.kalman import KalmanFilter

    n = len(z)
    xs, sds, total_sd = np.empty((n, STATES)), np.empty((n, STATES)), np.empty(n)
    first = np.nan_to_num(z[0])
    kf = KalmanFilter(STATES, ROWS, 1)
    kf.x = np.array([first[0], first[1], 0, 0, first[2], 0, 0, 0]).reshape(-1, 1)
    kf.P = np.diag(INITIAL_VARIANCE)
    for k in range(n):
        if k > 0:
            Phi, Gamma, Qd = (part[at[k]] for part in models)
            kf.predict(u=np.array([[steer[k - 1]]]), B=Gamma.reshape(-1, 1), F=Phi, Q=Qd)
        known = np.isfinite(z[k])
        if known.any():
            kf.dim_z = int(known.sum())
            kf.update(z[k][known].reshape(-1, 1), R=np.diag(R[known]), H=H[known])
        xs[k], sds[k] = kf.x[:, 0], np.sqrt(np.diag(kf.P))
        total_sd[k] = np.sqrt((H[2] @ kf.P @ H[2]).item())
    return xs, sds, total_sd


ROLL_BANK_OBS = Estimator(
    name="roll_bank_obs",
    run=roll_bank_obs,
    parameters=RollBankParameters,
    needs=(
        "imu.accel_x",
        "imu.accel_y",
        "imu.gyro_x",
        "imu.gyro_y",
        "imu.gyro_z",
        "steering.road_wheel_angle",
        ANY_SPEED,
    ),
    helped=TWO_ANTENNAS,
    gives=("bank", "roll", "roll_total"),
    reference="Ryu 2004, eqs. (17)-(24); docs/methods/ryu2004.md#observer",
    summary="disturbance observer: separates bank of the road and roll of the body",
    vehicle=(
        "mass",
        "cg_to_front_axle",
        "cg_to_rear_axle",
        "yaw_inertia",
        "roll_inertia",
        "roll_arm",
        "roll_stiffness",
        "roll_damping",
        "front_cornering_stiffness",
        "rear_cornering_stiffness",
    ),
    systematic_deg={"roll": 0.05},
    spoiled_by=frozenset({"vibration"}),
)
