"""The process of `fusion`: a strapdown model in body axes, and its noise; each written once.

Velocity and tilt of one point of the car, whose constants - sensor biases, mounting, gradients,
lever arms - are states too. Both engines run these functions.
Source: docs/methods/fusion.md#process.
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt, tan

import numpy as np
from numba import njit

from roadlog.estimators.fusion.noise import SHAKING_SPEED, SLOWEST, Noise
from roadlog.estimators.fusion.states import W_THETA, N
from roadlog.estimators.fusion.states import State as S
from roadlog.estimators.fusion.steps import Sway
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G


@njit(cache=True)
def rates(x: Floats, w: Floats) -> tuple[float, float, float]:
    """rad/s, angular rate (3,) without the gyro's bias."""
    return w[0] - x[S.GYRO_BIAS_X], w[1] - x[S.GYRO_BIAS_Y], w[2] - x[S.GYRO_BIAS_Z]


@njit(cache=True)
def tilt(x: Floats) -> tuple[float, float, float, float]:
    """Sine and cosine of the roll, sine and cosine of the pitch."""
    return sin(x[S.PHI]), cos(x[S.PHI]), sin(x[S.THETA]), cos(x[S.THETA])


@njit(cache=True)
def derivative(x: Floats, f: Floats, w: Floats, dx: Floats) -> None:
    """Time derivatives of the states into dx (29,); constants have none."""
    p, q, r = rates(x, w)
    sph, cph, sth, cth = tilt(x)
    u, v, z = x[S.U], x[S.V], x[S.W]
    dx[:] = 0.0
    dx[S.U] = f[0] - x[S.ACCEL_BIAS_X] - G * sth + r * v - q * z
    dx[S.V] = f[1] - x[S.ACCEL_BIAS_Y] - G * sph * cth - r * u + p * z
    dx[S.W] = f[2] - x[S.ACCEL_BIAS_Z] - G * cph * cth + q * u - p * v
    dx[S.PHI] = p - tan(x[S.THETA]) * (q * sph + r * cph)
    dx[S.THETA] = -q * cph + r * sph
    dx[S.PSI] = (q * sph + r * cph) / cth
    dx[S.ALTITUDE] = u * sth + cth * (v * sph + z * cph)


@njit(cache=True)
def propagate(x: Floats, f: Floats, w: Floats, dt: float, noise: Noise, clone: bool) -> Floats:
    """The states one step later, by the midpoint rule; small errors decay.

    clone: keep the altitude for the next visit of this place.
    """
    dx = np.empty(N)
    derivative(x, f, w, dx)
    derivative(x + 0.5 * dt * dx, f, w, dx)
    y = x + dt * dx
    y[S.BODY_PITCH] *= exp(-dt / noise.body_time)
    y[S.BODY_ROLL] *= exp(-dt / noise.body_time)
    y[S.RECEIVER_ERROR] *= exp(-dt / noise.altimeter_time)
    y[S.BAROMETER_ERROR] *= exp(-dt / noise.barometer_time)
    if clone:
        y[S.KEPT_ALTITUDE] = x[S.ALTITUDE]
    return y


@njit(cache=True)
def transition(x: Floats, w: Floats, dt: float, noise: Noise, clone: bool, F: Floats) -> None:
    """F = I + dt A into F (29, 29), A the Jacobian of `derivative`."""
    p, q, r = rates(x, w)
    sph, cph, sth, cth = tilt(x)
    u, v, z = x[S.U], x[S.V], x[S.W]
    F[:] = 0.0
    for i in range(N):
        F[i, i] = 1.0
    F[S.U, S.V], F[S.U, S.W], F[S.U, S.THETA] = dt * r, -dt * q, -dt * G * cth
    F[S.V, S.U], F[S.V, S.W], F[S.V, S.PHI] = -dt * r, dt * p, -dt * G * cph * cth
    F[S.V, S.THETA] = dt * G * sph * sth
    F[S.W, S.U], F[S.W, S.V], F[S.W, S.PHI] = dt * q, -dt * p, dt * G * sph * cth
    F[S.W, S.THETA] = dt * G * cph * sth
    F[S.U, S.ACCEL_BIAS_X] = F[S.V, S.ACCEL_BIAS_Y] = F[S.W, S.ACCEL_BIAS_Z] = -dt
    F[S.U, S.GYRO_BIAS_Y], F[S.U, S.GYRO_BIAS_Z] = dt * z, -dt * v
    F[S.V, S.GYRO_BIAS_X], F[S.V, S.GYRO_BIAS_Z] = -dt * z, dt * u
    F[S.W, S.GYRO_BIAS_X], F[S.W, S.GYRO_BIAS_Y] = dt * v, -dt * u
    _transition_of_angles(x, q, r, dt, F)
    F[S.ALTITUDE, S.U], F[S.ALTITUDE, S.V] = dt * sth, dt * cth * sph
    F[S.ALTITUDE, S.W] = dt * cth * cph
    F[S.ALTITUDE, S.PHI] = dt * cth * (cph * v - sph * z)
    F[S.ALTITUDE, S.THETA] = dt * (cth * u - sth * (v * sph + z * cph))
    F[S.BODY_PITCH, S.BODY_PITCH] = F[S.BODY_ROLL, S.BODY_ROLL] = exp(-dt / noise.body_time)
    F[S.RECEIVER_ERROR, S.RECEIVER_ERROR] = exp(-dt / noise.altimeter_time)
    F[S.BAROMETER_ERROR, S.BAROMETER_ERROR] = exp(-dt / noise.barometer_time)
    if clone:
        F[S.KEPT_ALTITUDE, S.KEPT_ALTITUDE], F[S.KEPT_ALTITUDE, S.ALTITUDE] = 0.0, 1.0


@njit(cache=True)
def _transition_of_angles(x: Floats, q: float, r: float, dt: float, F: Floats) -> None:
    """The rows of roll, pitch and yaw in F."""
    sph, cph, sth, cth = tilt(x)
    tth = sth / cth
    F[S.PHI, S.PHI] -= dt * tth * (q * cph - r * sph)
    F[S.PHI, S.THETA] = -dt * (q * sph + r * cph) / cth**2
    F[S.PHI, S.GYRO_BIAS_X] = -dt
    F[S.PHI, S.GYRO_BIAS_Y], F[S.PHI, S.GYRO_BIAS_Z] = dt * tth * sph, dt * tth * cph
    F[S.THETA, S.PHI] = dt * (q * sph + r * cph)
    F[S.THETA, S.GYRO_BIAS_Y], F[S.THETA, S.GYRO_BIAS_Z] = dt * cph, -dt * sph
    F[S.PSI, S.PHI] = dt * (q * cph - r * sph) / cth
    F[S.PSI, S.THETA] = dt * (q * sph + r * cph) * sth / cth**2
    F[S.PSI, S.GYRO_BIAS_Y], F[S.PSI, S.GYRO_BIAS_Z] = -dt * sph / cth, -dt * cph / cth


@njit(cache=True)
def process_noise(
    x: Floats, f: Floats, w: Floats, s: Floats, dt: float, noise: Noise, q: Floats
) -> None:
    """Diagonal of Q over one step into q (30,), then its covariance of W and THETA.

    The noise of the gyro is in the velocities too, and there it is the same error as in the tilt.
    Source: docs/methods/fusion.md#process-noise.
    """
    q[:] = 0.0
    forward = f[0] - G * sin(x[S.THETA])
    q[S.U] = dt * (noise.accel**2 + (noise.accel_gain * forward) ** 2)
    q[S.V] = dt * (
        noise.accel**2
        + (noise.accel_gain * f[1]) ** 2
        + (noise.yaw_slip * w[2] * x[S.U]) ** 2
        + (noise.yaw * x[S.U]) ** 2
    )
    q[S.W] = dt * (
        noise.vertical**2 + (noise.vertical_gain * w[1] * x[S.U]) ** 2 + (noise.pitch * x[S.U]) ** 2
    )
    q[S.PHI] = dt * (noise.roll**2 + (noise.gyro_cross * w[2]) ** 2)
    q[S.THETA] = dt * (noise.pitch**2 + (noise.gyro_cross * w[2]) ** 2)
    q[W_THETA] = -dt * x[S.U] * noise.pitch**2
    share = 1.0 - exp(-2 * dt / noise.body_time)
    body = noise.body + noise.body_vibration * sqrt(
        max(SHAKING_SPEED / max(abs(x[S.U]), SLOWEST), 1.0)
    )
    q[S.BODY_PITCH] = share * (
        body**2
        + (noise.body_gain * noise.pitch_gradient * s[Sway.FORWARD]) ** 2
        + (noise.inertia_gain * s[Sway.PITCH_INERTIA]) ** 2
    )
    q[S.BODY_ROLL] = share * (
        body**2
        + (noise.body_gain * noise.roll_gradient * s[Sway.LATERAL]) ** 2
        + (noise.inertia_gain * s[Sway.ROLL_INERTIA]) ** 2
    )
    for i in range(3):
        q[S.GYRO_BIAS_X + i] = dt * noise.gyro_bias**2
        q[S.ACCEL_BIAS_X + i] = dt * noise.accel_bias**2
    q[S.PSI] = dt * (noise.yaw + noise.yaw_gain * abs(w[2])) ** 2
    q[S.ALTITUDE] = dt * noise.altitude**2
    q[S.RECEIVER_ERROR] = noise.altimeter**2 * (1.0 - exp(-2 * dt / noise.altimeter_time))
    q[S.BAROMETER_ERROR] = noise.barometer**2 * (1.0 - exp(-2 * dt / noise.barometer_time))
