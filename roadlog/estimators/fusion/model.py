"""The process of `fusion`: a strapdown model in body axes, and its noise; each written once.

Velocity and tilt of one point of the car, whose constants - sensor biases, mounting, gradients,
lever arms - are states too. Both engines run these functions.
Source: docs/methods/fusion.md#process.
"""

from __future__ import annotations

from math import cos, sin, sqrt

from roadlog.estimators.fusion.noise import SHAKING_SPEED, SLOWEST
from roadlog.estimators.fusion.states import DECAYING, DRIVEN, W_THETA, N
from roadlog.estimators.fusion.states import State as S
from roadlog.estimators.fusion.steps import Sway
from roadlog.jit import compiled
from roadlog.types import Floats, Record
from roadlog.units import STANDARD_GRAVITY as G


@compiled
def rates(x: Floats, w: Floats) -> tuple[float, float, float]:
    """rad/s, angular rate (3,) without the gyro's bias."""
    return w[0] - x[S.GYRO_BIAS_X], w[1] - x[S.GYRO_BIAS_Y], w[2] - x[S.GYRO_BIAS_Z]


@compiled
def tilt(x: Floats) -> tuple[float, float, float, float]:
    """Sine and cosine of the roll, sine and cosine of the pitch."""
    return sin(x[S.PHI]), cos(x[S.PHI]), sin(x[S.THETA]), cos(x[S.THETA])


@compiled
def derivative(x: Floats, f: Floats, w: Floats, dx: Floats) -> None:
    """Time derivatives of the DRIVEN states into their places in dx (29,); others have none."""
    p, q, r = rates(x, w)
    sph, cph, sth, cth = tilt(x)
    u, v, z = x[S.U], x[S.V], x[S.W]
    turning = q * sph + r * cph
    dx[S.U] = f[0] - x[S.ACCEL_BIAS_X] - G * sth + r * v - q * z
    dx[S.V] = f[1] - x[S.ACCEL_BIAS_Y] - G * sph * cth - r * u + p * z
    dx[S.W] = f[2] - x[S.ACCEL_BIAS_Z] - G * cph * cth + q * u - p * v
    dx[S.PHI] = p - sth / cth * turning
    dx[S.THETA] = -q * cph + r * sph
    dx[S.PSI] = turning / cth
    dx[S.ALTITUDE] = u * sth + cth * (v * sph + z * cph)


@compiled
def propagate(x: Floats, s: Record, noise: Record, y: Floats, dx: Floats) -> None:
    """The states one step later into y (29,), by the midpoint rule; small errors decay.

    dx (29,): scratch.
    """
    for i in range(N):
        y[i] = x[i]
    derivative(x, s.force, s.rate, dx)
    for i in DRIVEN:
        y[i] += 0.5 * s.dt * dx[i]
    derivative(y, s.force, s.rate, dx)
    for i in DRIVEN:
        y[i] = x[i] + s.dt * dx[i]
    for c in range(len(DECAYING)):
        y[DECAYING[c]] *= noise.decay[c]


@compiled
def coupling(x: Floats, s: Record, A: Floats) -> None:
    """What the first DRIVERS states make of the DRIVEN ones in a step, into A (7, 13).

    That is dt times the Jacobian of `derivative`, where it is not zero for ever: A is given as
    zeros, or as it was.
    """
    dt = s.dt
    p, q, r = rates(x, s.rate)
    sph, cph, sth, cth = tilt(x)
    u, v, z = x[S.U], x[S.V], x[S.W]
    turning, sliding = q * sph + r * cph, v * sph + z * cph
    U, V, W, PHI, THETA, PSI, ALTITUDE = 0, 1, 2, 3, 4, 5, 6
    A[U, S.V], A[U, S.W], A[U, S.THETA] = dt * r, -dt * q, -dt * G * cth
    A[V, S.U], A[V, S.W], A[V, S.PHI] = -dt * r, dt * p, -dt * G * cph * cth
    A[V, S.THETA] = dt * G * sph * sth
    A[W, S.U], A[W, S.V], A[W, S.PHI] = dt * q, -dt * p, dt * G * sph * cth
    A[W, S.THETA] = dt * G * cph * sth
    A[U, S.ACCEL_BIAS_X] = A[V, S.ACCEL_BIAS_Y] = A[W, S.ACCEL_BIAS_Z] = -dt
    A[U, S.GYRO_BIAS_Y], A[U, S.GYRO_BIAS_Z] = dt * z, -dt * v
    A[V, S.GYRO_BIAS_X], A[V, S.GYRO_BIAS_Z] = -dt * z, dt * u
    A[W, S.GYRO_BIAS_X], A[W, S.GYRO_BIAS_Y] = dt * v, -dt * u
    A[PHI, S.PHI] = -dt * sth / cth * (q * cph - r * sph)
    A[PHI, S.THETA] = -dt * turning / cth**2
    A[PHI, S.GYRO_BIAS_X] = -dt
    A[PHI, S.GYRO_BIAS_Y], A[PHI, S.GYRO_BIAS_Z] = dt * sth / cth * sph, dt * sth / cth * cph
    A[THETA, S.PHI] = dt * turning
    A[THETA, S.GYRO_BIAS_Y], A[THETA, S.GYRO_BIAS_Z] = dt * cph, -dt * sph
    A[PSI, S.PHI] = dt * (q * cph - r * sph) / cth
    A[PSI, S.THETA] = dt * turning * sth / cth**2
    A[PSI, S.GYRO_BIAS_Y], A[PSI, S.GYRO_BIAS_Z] = -dt * sph / cth, -dt * cph / cth
    A[ALTITUDE, S.U], A[ALTITUDE, S.V] = dt * sth, dt * cth * sph
    A[ALTITUDE, S.W] = dt * cth * cph
    A[ALTITUDE, S.PHI] = dt * cth * (cph * v - sph * z)
    A[ALTITUDE, S.THETA] = dt * (cth * u - sth * sliding)


@compiled
def process_noise(x: Floats, s: Record, noise: Record, q: Floats) -> None:
    """Diagonal of Q over one step into q (30,), then its covariance of W and THETA.

    The noise of the gyro is in the velocities too, and there it is the same error as in the tilt.
    Source: docs/methods/fusion.md#process-noise.
    """
    dt, f, w, sway, u = s.dt, s.force, s.rate, s.sway, x[S.U]
    for i in range(len(q)):
        q[i] = 0.0
    forward = f[0] - G * sin(x[S.THETA])
    q[S.U] = dt * (noise.accel**2 + (noise.accel_gain * forward) ** 2)
    q[S.V] = dt * (
        noise.accel**2
        + (noise.accel_gain * f[1]) ** 2
        + (noise.yaw_slip * w[2] * u) ** 2
        + (noise.yaw * u) ** 2
    )
    q[S.W] = dt * (
        noise.vertical**2 + (noise.vertical_gain * w[1] * u) ** 2 + (noise.pitch * u) ** 2
    )
    q[S.PHI] = dt * (noise.roll**2 + (noise.gyro_cross * w[2]) ** 2)
    q[S.THETA] = dt * (noise.pitch**2 + (noise.gyro_cross * w[2]) ** 2)
    q[W_THETA] = -dt * u * noise.pitch**2
    slow = sqrt(max(SHAKING_SPEED / max(abs(u), SLOWEST), 1.0))
    body = noise.body + noise.body_vibration * slow
    share = 1.0 - noise.decay[0] ** 2
    q[S.BODY_PITCH] = share * (
        body**2
        + noise.body_pitch**2
        + (noise.body_gain * noise.pitch_gradient * sway[Sway.FORWARD]) ** 2
        + (noise.inertia_gain * sway[Sway.PITCH_INERTIA]) ** 2
    )
    q[S.BODY_ROLL] = share * (
        body**2
        + noise.body_roll**2
        + (noise.body_gain * noise.roll_gradient * sway[Sway.LATERAL]) ** 2
        + (noise.inertia_gain * sway[Sway.ROLL_INERTIA]) ** 2
    )
    for i in range(3):
        q[S.GYRO_BIAS_X + i] = dt * noise.gyro_bias**2
        q[S.ACCEL_BIAS_X + i] = dt * (noise.accel_bias if i < 2 else noise.vertical_bias) ** 2
    q[S.PSI] = dt * (noise.yaw + noise.yaw_gain * abs(w[2])) ** 2
    q[S.ALTITUDE] = dt * noise.altitude**2
    q[S.RECEIVER_ERROR] = noise.altimeter**2 * (1.0 - noise.decay[2] ** 2)
    q[S.BAROMETER_ERROR] = noise.barometer**2 * (1.0 - noise.decay[3] ** 2)
