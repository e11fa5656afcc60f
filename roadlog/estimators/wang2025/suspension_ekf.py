"""Extended Kalman filter and smoother of a car on its pitch suspension.

Wang 2025, corrected: docs/methods/wang2025.md#suspension-filter. The model is written once; the
compiled engine and filterpy both run it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from roadlog.filters import Engine
from roadlog.filters.kalman import correct_scalar, predict_covariance, smooth_step
from roadlog.jit import compiled
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY

G = STANDARD_GRAVITY
ROLLING_SPEED = 0.05  # m/s, below it there is no rolling resistance
SLOW_SPEED = 0.3  # m/s, below it brakes may hold the car and the force balance says nothing
SLOW_ACCEL_VARIANCE = 3.0**2  # (m/s2)^2, process noise of the acceleration there


class PitchingCar(NamedTuple):
    """A car stepped by dt: SI. drag: rho CdA / 2, kg/m. rolling: coefficient. height: of the CG.
    decay, gain: of the pitch in one step."""

    dt: float
    mass: float
    drag: float
    rolling: float
    height: float
    decay: float
    gain: float  # rad/(N m)


class SuspensionModel(NamedTuple):
    """State x = [v, a = dv/dt + g sin(grade), grade, pitch]; SI and rad.

    body_mount: the accelerometer is on the body, else along the road. Q, R: diagonals. speed,
    accel, force (N,): measured, NaN where unknown.
    """

    car: PitchingCar
    body_mount: bool
    Q: Floats
    R: Floats
    x0: Floats
    P0: Floats
    gate: float  # standard deviations
    speed: Floats
    accel: Floats
    force: Floats


class SuspensionTrack(NamedTuple):
    """x (N, 4), P (N, 4, 4); innovation (N, 3): of speed, of acceleration, and mean normalized
    squared; rejected (N,): beyond the gate."""

    x: Floats
    P: Floats
    innovation: Floats
    rejected: Bools


@compiled
def transition(x: Floats, force: float, car: PitchingCar, y: Floats) -> None:
    """Next state into y (4,); an unknown drive force (NaN) keeps the acceleration."""
    dt, mass, drag, rolling, height, decay, gain = car
    v, a, grade, pitch = x[0], x[1], x[2], x[3]
    y[0] = v + dt * (a - G * np.sin(grade))
    y[1] = a
    if np.isfinite(force):
        y[1] = (force - drag * v * abs(v)) / mass
        if v > ROLLING_SPEED:
            y[1] -= G * rolling * np.cos(grade)
    y[2] = grade
    y[3] = decay * pitch + gain * height * (mass * a + drag * v * v)


@compiled
def jacobian(x: Floats, force: float, car: PitchingCar, F: Floats) -> None:
    """dtransition/dx into F (4, 4)."""
    dt, mass, drag, rolling, height, decay, gain = car
    v, grade = x[0], x[2]
    for i in range(4):
        for j in range(4):
            F[i, j] = 1.0 if i == j else 0.0
    F[0, 1] = dt
    F[0, 2] = -dt * G * np.cos(grade)
    if np.isfinite(force):
        F[1, 0] = -2 * drag * abs(v) / mass
        F[1, 1] = 0.0
        if v > ROLLING_SPEED:
            F[1, 2] = G * rolling * np.sin(grade)
    F[3, 0] = gain * height * 2 * drag * v
    F[3, 1] = gain * height * mass
    F[3, 3] = decay


@compiled
def measured_accel(x: Floats, body: bool) -> float:
    """What the accelerometer reads, m/s2: along the body or along the road."""
    a, grade, pitch = x[1], x[2], x[3]
    if not body:
        return a
    return (a - G * np.sin(grade)) * np.cos(pitch) + G * np.sin(grade + pitch)


@compiled
def accel_row(x: Floats, body: bool, h: Floats) -> None:
    """dmeasured_accel/dx into h (4,)."""
    a, grade, pitch = x[1], x[2], x[3]
    h[0] = h[2] = h[3] = 0.0
    h[1] = 1.0
    if body:
        along = G * np.cos(grade + pitch)
        h[1] = np.cos(pitch)
        h[2] = along - G * np.cos(grade) * np.cos(pitch)
        h[3] = along - (a - G * np.sin(grade)) * np.sin(pitch)


@compiled
def process_noise(x: Floats, Q: Floats, result: Floats) -> None:
    """Q as a matrix into result (4, 4); larger for the acceleration of a car that hardly moves."""
    for i in range(4):
        for j in range(4):
            result[i, j] = Q[i] if i == j else 0.0
    if abs(x[0]) < SLOW_SPEED:
        result[1, 1] = max(Q[1], SLOW_ACCEL_VARIANCE)


@compiled
def ahead(
    x: Floats,
    P: Floats,
    force: float,
    Q: Floats,
    car: PitchingCar,
    y: Floats,
    S: Floats,
    FP: Floats,
    work: Floats,
) -> None:
    """State and covariance one step on into y (4,), S (4, 4), before anything is measured.

    FP (4, 4): Jacobian times P. work (2, 4, 4): the Jacobian, and scratch.
    """
    F, noise = work[0], work[1]
    jacobian(x, force, car, F)
    process_noise(x, Q, noise)
    transition(x, force, car, y)
    predict_covariance(P, F, noise, FP, S)


def filter_suspension(model: SuspensionModel, engine: Engine = "compiled") -> SuspensionTrack:
    """Filtered states: each step from all measurements up to it."""
    run: Any = _filter_reference if engine == "reference" else _filter
    n = len(model.speed)
    track = SuspensionTrack(
        np.empty((n, 4)), np.empty((n, 4, 4)), np.full((n, 3), np.nan), np.zeros(n, np.bool_)
    )
    track.x[:1], track.P[:1] = model.x0, model.P0
    run(model, track)
    return track


def smooth_suspension(
    model: SuspensionModel, track: SuspensionTrack, engine: Engine = "compiled"
) -> SuspensionTrack:
    """Smoothed states: each step from all measurements (Rauch, Tung, Striebel 1965).

    They take the place of `track`, which is used up, and predictions are made anew on the way back:
    hours of them take more memory than time.
    """
    run: Any = _smooth_reference if engine == "reference" else _smooth
    run(model, track)
    return track


@compiled
def _filter(model: SuspensionModel, track: SuspensionTrack) -> None:
    xs, Ps, innovation = track.x, track.P, track.innovation
    FP, work = np.empty((4, 4)), np.empty((2, 4, 4))
    rows, Ph = np.zeros((2, 4)), np.empty(4)
    rows[0, 0] = 1.0
    for k in range(len(model.speed)):
        x, P = xs[k], Ps[k]
        if k > 0:
            ahead(xs[k - 1], Ps[k - 1], model.force[k], model.Q, model.car, x, P, FP, work)
        nis, used = 0.0, 0
        for i in range(2):
            z = model.speed[k] if i == 0 else model.accel[k]
            if not np.isfinite(z):
                continue
            h = rows[i]
            if i == 1:
                accel_row(x, model.body_mount, h)
            residual = z - (x[0] if i == 0 else measured_accel(x, model.body_mount))
            s = model.R[i]
            for a in range(4):
                for b in range(4):
                    s += h[a] * P[a, b] * h[b]
            innovation[k, i] = residual
            nis += residual * residual / s
            used += 1
            if abs(residual) > model.gate * np.sqrt(s):
                track.rejected[k] = True
                continue
            correct_scalar(x, P, residual, h, model.R[i], Ph)
        if used > 0:
            innovation[k, 2] = nis / used


@compiled
def _smooth(model: SuspensionModel, track: SuspensionTrack) -> None:
    xs, Ps = track.x, track.P
    prior, work, of_step = np.empty((2, 4)), np.empty((4, 4, 4)), np.empty((2, 4, 4))
    for k in range(len(xs) - 2, -1, -1):
        force = model.force[k + 1]
        ahead(xs[k], Ps[k], force, model.Q, model.car, prior[0], work[0], work[1], of_step)
        smooth_step(xs[k], Ps[k], xs[k + 1], Ps[k + 1], prior, work)


def _filter_reference(model: SuspensionModel, track: SuspensionTrack) -> None:
    from filterpy.kalman import ExtendedKalmanFilter

    xs, Ps, innovation = track.x, track.P, track.innovation

    class Filter(ExtendedKalmanFilter):  # type: ignore[misc]
        def predict_x(self, u: float = 0.0) -> None:
            state: Floats = np.ravel(vars(self)["x"])
            y = np.empty(4)
            transition(state, u, model.car, y)
            self.x = y.reshape(4, 1)

    def row_of_accel(x: Floats) -> Floats:
        h = np.empty((1, 4))
        accel_row(x[:, 0], model.body_mount, h[0])
        return h

    ekf = Filter(4, 1)
    ekf.x, ekf.P = xs[0].reshape(4, 1).copy(), Ps[0].copy()
    rows = (lambda _: np.array([[1.0, 0.0, 0.0, 0.0]]), row_of_accel)
    readings = (lambda x: x[0:1], lambda x: np.array([[measured_accel(x[:, 0], model.body_mount)]]))
    for k, force in enumerate(model.force):
        if k > 0:
            jacobian(ekf.x[:, 0], force, model.car, ekf.F)
            process_noise(ekf.x[:, 0], model.Q, ekf.Q)
            ekf.predict(force)
        squares = []
        for i, z in enumerate((model.speed[k], model.accel[k])):
            if not np.isfinite(z):
                continue
            h = rows[i](ekf.x)
            residual = z - readings[i](ekf.x)[0, 0]
            s = (h @ ekf.P @ h.T)[0, 0] + model.R[i]
            innovation[k, i] = residual
            squares.append(residual**2 / s)
            if abs(residual) > model.gate * np.sqrt(s):
                track.rejected[k] = True
                continue
            ekf.update(np.array([[z]]), rows[i], readings[i], R=np.array([[model.R[i]]]))
        if squares:
            innovation[k, 2] = np.mean(squares)
        xs[k], Ps[k] = ekf.x[:, 0], ekf.P


def _smooth_reference(model: SuspensionModel, track: SuspensionTrack) -> None:
    xs, Ps, force, car = track.x, track.P, model.force, model.car
    F, noise, x_prior = np.empty((4, 4)), np.empty((4, 4)), np.empty(4)
    for k in range(len(xs) - 2, -1, -1):
        jacobian(xs[k], force[k + 1], car, F)
        process_noise(xs[k], model.Q, noise)
        transition(xs[k], force[k + 1], car, x_prior)
        P_prior = F @ Ps[k] @ F.T + noise
        C = np.linalg.solve(P_prior, F @ Ps[k]).T
        xs[k] += C @ (xs[k + 1] - x_prior)
        Ps[k] += C @ (Ps[k + 1] - P_prior) @ C.T
