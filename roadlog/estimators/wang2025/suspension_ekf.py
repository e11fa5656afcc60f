"""Extended Kalman filter and smoother of a car on its pitch suspension.

Wang 2025, corrected: docs/methods/wang2025.md#suspension-filter. The model is written once; the
compiled engine and filterpy both run it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from roadlog.filters import Engine
from roadlog.filters.kalman import correct_scalar, predict, smooth_step
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY

G = STANDARD_GRAVITY
ROLLING_SPEED = 0.05  # m/s, below it there is no rolling resistance
SLOW_SPEED = 0.3  # m/s, below it brakes may hold the car and the force balance says nothing
SLOW_ACCEL_VARIANCE = 3.0**2  # (m/s2)^2, process noise of the acceleration there


@dataclass(frozen=True)
class SuspensionModel:
    """State x = [v, a = dv/dt + g sin(grade), grade, pitch]; SI and rad.

    drag: rho CdA / 2, kg/m. rolling: coefficient. height: of the CG. decay, gain: of the pitch in
    one step. Q, R: diagonals. speed, accel, force (N,): measured, NaN where unknown.
    """

    dt: float
    mass: float
    drag: float
    rolling: float
    height: float
    decay: float
    gain: float  # rad/(N m)
    body_mount: bool
    Q: Floats
    R: Floats
    x0: Floats
    P0: Floats
    gate: float  # standard deviations
    speed: Floats
    accel: Floats
    force: Floats

    @property
    def car(self) -> Floats:
        """The constants in the order in which the model's functions unpack them."""
        parts = (self.dt, self.mass, self.drag, self.rolling, self.height, self.decay, self.gain)
        return np.array(parts)


@dataclass(frozen=True)
class SuspensionTrack:
    """x (N, 4), P (N, 4, 4); innovation (N, 3): of speed, of acceleration, and mean normalized
    squared; rejected (N,): beyond the gate."""

    x: Floats
    P: Floats
    innovation: Floats
    rejected: Bools


@njit(cache=True)
def transition(x: Floats, force: float, car: Floats) -> Floats:
    """Next state; an unknown drive force (NaN) keeps the acceleration."""
    dt, mass, drag, rolling, height, decay, gain = car
    v, a, grade, pitch = x
    y = x.copy()
    y[0] = v + dt * (a - G * np.sin(grade))
    if np.isfinite(force):
        y[1] = (force - drag * v * abs(v)) / mass
        if v > ROLLING_SPEED:
            y[1] -= G * rolling * np.cos(grade)
    y[3] = decay * pitch + gain * height * (mass * a + drag * v * v)
    return y


@njit(cache=True)
def jacobian(x: Floats, force: float, car: Floats) -> Floats:
    """dtransition/dx."""
    dt, mass, drag, rolling, height, decay, gain = car
    v, _, grade, _ = x
    F = np.eye(4)
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
    return F


@njit(cache=True)
def measured_accel(x: Floats, body: bool) -> float:
    """What the accelerometer reads, m/s2: along the body or along the road."""
    _, a, grade, pitch = x
    if not body:
        return a
    return (a - G * np.sin(grade)) * np.cos(pitch) + G * np.sin(grade + pitch)


@njit(cache=True)
def accel_row(x: Floats, body: bool) -> Floats:
    """dmeasured_accel/dx."""
    _, a, grade, pitch = x
    h = np.zeros(4)
    if not body:
        h[1] = 1.0
        return h
    along = G * np.cos(grade + pitch)
    h[1] = np.cos(pitch)
    h[2] = along - G * np.cos(grade) * np.cos(pitch)
    h[3] = along - (a - G * np.sin(grade)) * np.sin(pitch)
    return h


@njit(cache=True)
def process_noise(x: Floats, Q: Floats) -> Floats:
    """Q as a matrix; larger for the acceleration of a car that hardly moves."""
    result = np.diag(Q)
    if abs(x[0]) < SLOW_SPEED:
        result[1, 1] = max(Q[1], SLOW_ACCEL_VARIANCE)
    return result


@njit(cache=True)
def ahead(x: Floats, P: Floats, force: float, Q: Floats, car: Floats) -> tuple[Floats, Floats]:
    """State and covariance one step on, before anything is measured."""
    F = jacobian(x, force, car)
    return transition(x, force, car), predict(x, P, F, np.zeros(4), process_noise(x, Q))[1]


def filter_suspension(model: SuspensionModel, engine: Engine = "compiled") -> SuspensionTrack:
    """Filtered states: each step from all measurements up to it."""
    run: Any = _filter_reference if engine == "reference" else _filter
    data = (model.speed, model.accel, model.force, model.x0, model.P0, model.Q, model.R)
    arrays = (np.ascontiguousarray(part, np.float64) for part in data)
    return SuspensionTrack(*run(*arrays, model.car, model.body_mount, model.gate))


def smooth_suspension(
    model: SuspensionModel, track: SuspensionTrack, engine: Engine = "compiled"
) -> SuspensionTrack:
    """Smoothed states: each step from all measurements (Rauch, Tung, Striebel 1965).

    They take the place of `track`, which is used up, and predictions are made anew on the way back:
    hours of them take more memory than time.
    """
    run: Any = _smooth_reference if engine == "reference" else _smooth
    force = np.ascontiguousarray(model.force, np.float64)
    run(track.x, track.P, force, np.asarray(model.Q, np.float64), model.car)
    return track


@njit(cache=True)
def _filter(
    speed: Floats,
    accel: Floats,
    force: Floats,
    x0: Floats,
    P0: Floats,
    Q: Floats,
    R: Floats,
    car: Floats,
    body: bool,
    gate: float,
) -> tuple[Floats, Floats, Floats, Bools]:
    n = len(speed)
    xs, Ps = np.empty((n, 4)), np.empty((n, 4, 4))
    innovation, rejected = np.full((n, 3), np.nan), np.zeros(n, np.bool_)
    speed_row = np.array([1.0, 0.0, 0.0, 0.0])
    x, P = x0.copy(), P0.copy()
    for k in range(n):
        if k > 0:
            x, P = ahead(x, P, force[k], Q, car)
        nis, used = 0.0, 0
        for i in range(2):
            z = speed[k] if i == 0 else accel[k]
            if not np.isfinite(z):
                continue
            h = speed_row if i == 0 else accel_row(x, body)
            residual = z - (x[0] if i == 0 else measured_accel(x, body))
            s = R[i]
            for a in range(4):
                for b in range(4):
                    s += h[a] * P[a, b] * h[b]
            innovation[k, i] = residual
            nis += residual * residual / s
            used += 1
            if abs(residual) > gate * np.sqrt(s):
                rejected[k] = True
                continue
            correct_scalar(x, P, residual, h, R[i])
        if used > 0:
            innovation[k, 2] = nis / used
        xs[k] = x
        Ps[k] = P
    return xs, Ps, innovation, rejected


@njit(cache=True)
def _smooth(xs: Floats, Ps: Floats, force: Floats, Q: Floats, car: Floats) -> None:
    for k in range(len(xs) - 2, -1, -1):
        x_prior, P_prior = ahead(xs[k], Ps[k], force[k + 1], Q, car)
        F = jacobian(xs[k], force[k + 1], car)
        xs[k], Ps[k] = smooth_step(xs[k], Ps[k], F, x_prior, P_prior, xs[k + 1], Ps[k + 1])


def _filter_reference(
    speed: Floats,
    accel: Floats,
    force: Floats,
    x0: Floats,
    P0: Floats,
    Q: Floats,
    R: Floats,
    car: Floats,
    body: bool,
    gate: float,
) -> tuple[Floats, Floats, Floats, Bools]:
    from filterpy.kalman import ExtendedKalmanFilter

    class Filter(ExtendedKalmanFilter):  # type: ignore[misc]
        def predict_x(self, u: float = 0.0) -> None:
            state: Floats = np.ravel(vars(self)["x"])
            self.x = transition(state, u, car).reshape(4, 1)

    ekf = Filter(4, 1)
    ekf.x, ekf.P = x0.reshape(4, 1).copy(), P0.copy()
    n = len(speed)
    xs, Ps = np.empty((n, 4)), np.empty((n, 4, 4))
    innovation, rejected = np.full((n, 3), np.nan), np.zeros(n, np.bool_)
    rows = (lambda _: np.array([[1.0, 0.0, 0.0, 0.0]]), lambda x: accel_row(x[:, 0], body)[None])
    readings = (lambda x: x[0:1], lambda x: np.array([[measured_accel(x[:, 0], body)]]))
    for k in range(n):
        if k > 0:
            ekf.F = jacobian(ekf.x[:, 0], force[k], car)
            ekf.Q = process_noise(ekf.x[:, 0], Q)
            ekf.predict(force[k])
        squares = []
        for i, z in enumerate((speed[k], accel[k])):
            if not np.isfinite(z):
                continue
            h = rows[i](ekf.x)
            residual = z - readings[i](ekf.x)[0, 0]
            s = (h @ ekf.P @ h.T)[0, 0] + R[i]
            innovation[k, i] = residual
            squares.append(residual**2 / s)
            if abs(residual) > gate * np.sqrt(s):
                rejected[k] = True
                continue
            ekf.update(np.array([[z]]), rows[i], readings[i], R=np.array([[R[i]]]))
        if squares:
            innovation[k, 2] = np.mean(squares)
        xs[k], Ps[k] = ekf.x[:, 0], ekf.P
    return xs, Ps, innovation, rejected


def _smooth_reference(xs: Floats, Ps: Floats, force: Floats, Q: Floats, car: Floats) -> None:
    for k in range(len(xs) - 2, -1, -1):
        F = jacobian(xs[k], force[k + 1], car)
        x_prior = transition(xs[k], force[k + 1], car)
        P_prior = F @ Ps[k] @ F.T + process_noise(xs[k], Q)
        C = np.linalg.solve(P_prior, F @ Ps[k]).T
        xs[k] += C @ (xs[k + 1] - x_prior)
        Ps[k] += C @ (Ps[k + 1] - P_prior) @ C.T
