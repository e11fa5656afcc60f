"""Grade and pitch by an extended Kalman filter on specific force and the speed's derivative.

Stands for Nilsson (2016), which Kim 2023 compares with and of which only a summary is public;
reconstructed: docs/methods/kim2023.md#grade-pitch-ekf.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.filters import Engine
from roadlog.filters.kalman import correct_scalar
from roadlog.filters.kernels import odd_window, parabolic_mean, slope
from roadlog.jit import compiled
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

CORRELATION = 1.2  # samples of the smoothed signals per window count as n / 1.2 copies


@dataclass(frozen=True)
class GradePitchEkfParameters:
    """docs/methods/kim2023.md#parameters-of-grade_pitch_ekf."""

    slope_time: float = parameter(0.6, "s", "window of the speed's derivative")
    grade_noise: float = parameter(1e-2, "rad/sqrt(s)", "random walk of the grade")
    pitch_noise: float = parameter(math.sqrt(1e-9), "rad/sqrt(s)", "random walk of the pitch")
    accel_x_sd: float = parameter(0.15, "m/s2", "of a smoothed f_x")
    accel_z_sd: float = parameter(0.3, "m/s2", "of a smoothed f_z")
    initial_grade_sd: float = parameter(0.05, "rad", "before the first sample")
    initial_pitch_sd: float = parameter(0.02, "rad", "before the first sample")
    min_speed: float = parameter(1.0, "m/s", "slower samples do not correct")


def grade_pitch_ekf(
    drive: Drive, vehicle: Vehicle, params: GradePitchEkfParameters, engine: Engine
) -> Estimate:
    """State [grade, pitch], random walks, corrected by f_x and f_z given dv/dt.

    Forces: docs/methods/common.md#straight-line-specific-force.
    """
    del vehicle  # a kinematic method
    n = odd_window(params.slope_time, drive.dt)
    rate = slope(drive.speed, n, drive.dt)
    f_x = parabolic_mean(drive["imu.accel_x"], n)
    f_z = parabolic_mean(drive["imu.accel_z"], n)
    known = np.isfinite(rate) & np.isfinite(f_x) & np.isfinite(f_z)
    with np.errstate(invalid="ignore"):
        used = known & (drive.speed > params.min_speed)
    # smoothed samples are correlated over the window
    inflation = params.slope_time / (CORRELATION * drive.dt)
    r = inflation * np.array([params.accel_x_sd**2, params.accel_z_sd**2])
    q = np.array([params.grade_noise**2, params.pitch_noise**2]) * drive.dt
    p0 = np.array([params.initial_grade_sd**2, params.initial_pitch_sd**2])
    run_filter = _reference if engine == "reference" else _filter
    x, P = run_filter(rate, f_x, f_z, used, q, r, p0)
    started = np.maximum.accumulate(used) if len(used) else used
    for track in (x, P):
        track[~started] = np.nan
    flags = (
        flag(~known, "missing")
        | flag(drive.standstill | ~used & known, "standstill")
        | flag(~drive.straight, "model")
        | flag(~started, "converging")
    )
    angles = {"grade": x[:, 0], "pitch": x[:, 1], "inclination": x[:, 0] + x[:, 1]}
    sd = {
        "grade": np.sqrt(P[:, 0]),
        "pitch": np.sqrt(P[:, 1]),
        "inclination": np.sqrt(np.maximum(P[:, 0] + P[:, 1] + 2 * P[:, 2], 0.0)),
    }
    return Estimate(drive.time, angles, sd, used & started, flags)


@compiled
def force_x(grade: float, pitch: float, rate: float) -> tuple[float, float, float]:
    """f_x on a straight road and its derivatives by grade and pitch."""
    value = rate * np.cos(pitch) + G * np.sin(grade + pitch)
    by_grade = G * np.cos(grade + pitch)
    return value, by_grade, by_grade - rate * np.sin(pitch)


@compiled
def force_z(grade: float, pitch: float, rate: float) -> tuple[float, float, float]:
    """f_z on a straight road and its derivatives by grade and pitch."""
    value = -rate * np.sin(pitch) + G * np.cos(grade + pitch)
    by_grade = -G * np.sin(grade + pitch)
    return value, by_grade, by_grade - rate * np.cos(pitch)


@compiled
def _filter(
    rate: Floats, f_x: Floats, f_z: Floats, used: Bools, q: Floats, r: Floats, p0: Floats
) -> tuple[Floats, Floats]:
    """States (n, 2) and p11, p22, p12 (n, 3)."""
    n = len(rate)
    xs, Ps = np.empty((n, 2)), np.empty((n, 3))
    x, P = np.zeros(2), np.zeros((2, 2))
    h, Ph = np.empty(2), np.empty(2)
    P[0, 0], P[1, 1] = p0[0], p0[1]
    for k in range(n):
        for i in range(2):
            P[i, i] += q[i]
        if used[k]:
            value, h[0], h[1] = force_x(x[0], x[1], rate[k])
            correct_scalar(x, P, f_x[k] - value, h, r[0], Ph)
            value, h[0], h[1] = force_z(x[0], x[1], rate[k])
            correct_scalar(x, P, f_z[k] - value, h, r[1], Ph)
        xs[k, 0], xs[k, 1] = x[0], x[1]
        Ps[k, 0], Ps[k, 1], Ps[k, 2] = P[0, 0], P[1, 1], P[0, 1]
    return xs, Ps


def _reference(
    rate: Floats, f_x: Floats, f_z: Floats, used: Bools, q: Floats, r: Floats, p0: Floats
) -> tuple[Floats, Floats]:
    from filterpy.kalman import ExtendedKalmanFilter

    ekf = ExtendedKalmanFilter(2, 1)
    ekf.x, ekf.P, ekf.Q = np.zeros((2, 1)), np.diag(p0), np.diag(q)
    xs, Ps = np.empty((len(rate), 2)), np.empty((len(rate), 3))
    for k in range(len(rate)):
        ekf.predict()
        if used[k]:
            for model, z, variance in ((force_x, f_x[k], r[0]), (force_z, f_z[k], r[1])):

                def row(x: Floats, model=model, k=k) -> Floats:  # type: ignore[no-untyped-def]
                    return np.array([model(x[0, 0], x[1, 0], rate[k])[1:]])

                def value(x: Floats, model=model, k=k) -> Floats:  # type: ignore[no-untyped-def]
                    return np.array([[model(x[0, 0], x[1, 0], rate[k])[0]]])

                ekf.update(np.array([[z]]), row, value, R=np.array([[variance]]))
        xs[k] = ekf.x[:, 0]
        Ps[k] = ekf.P[0, 0], ekf.P[1, 1], ekf.P[0, 1]
    return xs, Ps


GRADE_PITCH_EKF = Estimator(
    name="grade_pitch_ekf",
    run=grade_pitch_ekf,
    parameters=GradePitchEkfParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Nilsson 2016, by Kim 2023 (reconstructed); docs/methods/kim2023.md#grade-pitch-ekf",
    summary="grade and load pitch from specific force and dv/dt by an EKF; straight driving",
    tilted=("inclination",),
    spoiled_by=frozenset({"vibration", "frozen", "leaps"}),
)
