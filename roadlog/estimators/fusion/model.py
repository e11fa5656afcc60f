"""The model of `fusion`: states, process and measurement rows, each written once.

A strapdown model in body axes (velocity and tilt of one point of the car) whose constants - sensor
biases, mounting, gains, lever arms - are states too. Both engines run these functions.
Source: fusion chapter, sections 3 (states), 5 (process) and 6 (rows); the body's angle on its
springs is taken one step further than there (`body_pitch`).
"""

from __future__ import annotations

from math import cos, exp, sin, sqrt, tan
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

RATE = 50.0  # Hz, of the smoother's steps; 25 Hz gives the same (section 10.6)

# States. U, V, W: m/s, velocity of the reference point in IMU axes. PHI, THETA: rad, roll and pitch
# of the IMU against the horizontal. EP, ER: rad, body pitch and roll that the suspension gains do
# not explain. BG, BA: biases of gyro (rad/s) and accelerometer (m/s2), three each. MPHI, MTHETA,
# MPSI: rad, IMU against the unmoving body. KAPPA: speed scale. KTHETA, KPHI: rad/(m/s2),
# suspension gains. KSIDE: rad/(m/s2), by which the pitch gain is larger when driving and smaller
# when braking. KBETA: rad/(m/s2), rear slip angle per lateral specific force. TAU: s, delay of the
# speed. XR: m, rear axle from the reference point. YW: m, speed sensor to the left of it. PSI: rad,
# yaw from east, counterclockwise. H: m, altitude. HO, HB: m, slow errors of the receiver's altitude
# and of the barometer. HC: m, altitude at an earlier visit of a place.
U, V, W, PHI, THETA, EP, ER = range(7)
BG, BA = 7, 10
MPHI, MTHETA, MPSI, KAPPA, KTHETA, KSIDE, KPHI, KBETA, TAU, XR, YW = range(13, 24)
PSI, H, HO, HB, HC = range(24, 29)
N = 29
MOVING = np.array([U, V, W, PHI, THETA, EP, ER, PSI, H, HO, HB, HC])  # all others are constants
COUPLED = np.array([U, V, W, PHI, THETA, PSI, H, HC])  # rows of F that couple states
DECAYING = np.array([EP, ER, HO, HB])  # rows of F with one number below 1

# Measurement rows, in the order in which they are applied.
SPEED, SLIP, CONTACT, STILL_VELOCITY, STILL_GYRO, FIX = 0, 1, 2, 3, 6, 9
EAST, NORTH, UP, ALTITUDE, HEADING, ROLL, BAROMETER, CLOSURE = range(8)  # columns of `fixes`
ROWS = FIX + 8
# m/s; slower, bumps as long as the car rock it below the frequencies in which vibration is measured
SHAKING_SPEED = 10.0
SLOWEST = 1.0  # m/s; slower still, they rock it no more
FORWARD, LATERAL, TIRE, UNSIGNED, NOSE, LEAN = range(6)  # columns of `sway`


class Steps(NamedTuple):
    """What the smoother is fed, on its own grid of k = 0 .. n-1.

    dt: s. force, rate: (n, 3) mean over [k, k+1) of specific force (m/s2) and rate (rad/s) of the
    reference point. force_at, rate_at: (n, 3) at k. sway: (n, 6) specific force that drives body
    pitch, body roll, rear slip, and that of pitch without its sign (m/s2), then pitch and roll by
    the body's inertia (rad). speed, speed_sd: (n,) m/s, NaN where there is no sample. still: (n,).
    fixes, fixes_sd: (n, 8) velocity east, north, up (m/s), altitude (m), yaw and roll (rad) of a
    GNSS receiver, altitude of a barometer (m), and 0 where a place is visited again. clone: (n,)
    where the altitude is kept for that. alive: (n,) the IMU is there. start: (n,) row of `starts`
    where a run of the IMU begins, else -1. starts: (m, 29) states to begin with. antenna: (3,) m
    from the reference point. height: m, reference point over the ground.
    """

    dt: float
    force: Floats
    rate: Floats
    force_at: Floats
    rate_at: Floats
    sway: Floats
    speed: Floats
    speed_sd: Floats
    still: Bools
    fixes: Floats
    fixes_sd: Floats
    clone: Bools
    alive: Bools
    start: NDArray[np.int64]
    starts: Floats
    antenna: Floats
    height: float


class Noise(NamedTuple):
    """Process and measurement noise (fusion chapter, sections 5 and 6). Names end in the unit."""

    accel: float  # m/s2/sqrt(Hz), forward and sideways
    accel_gain: float  # -, share of the acceleration along the axis
    yaw_slip: float  # -, share of u r
    vertical: float  # m/s2/sqrt(Hz)
    vertical_gain: float  # -, share of u q
    gyro: float  # rad/sqrt(s)
    gyro_cross: float  # sqrt(s), times the yaw rate: its share in the other axes
    gyro_bias: float  # rad/s/sqrt(s)
    accel_bias: float  # m/s2/sqrt(s)
    body: float  # rad, body angle that the suspension gains do not explain
    shaken: float  # rad, body angle by the unevenness of the road, at SHAKING_SPEED and faster
    body_gain: float  # -, share of the body angle explained by the suspension gains
    inertia_gain: float  # -, share of the body angle explained by its inertia
    body_time: float  # s
    pitch_gain: float  # rad/(m/s2), prior mean
    roll_gain: float  # rad/(m/s2), prior mean
    yaw: float  # rad/sqrt(s)
    yaw_gain: float  # -, share of the yaw rate
    altitude: float  # m/sqrt(s)
    altimeter: float  # m, slow error of the altimeter
    altimeter_time: float  # s
    barometer: float  # m, slow error of the barometer
    barometer_time: float  # s
    slip_sd: float  # m/s
    slip_gain: float  # -, share of the tire slip velocity
    slip_yaw: float  # m, times the yaw rate
    contact_sd: float  # m/s
    still_sd: float  # m/s
    still_gyro_sd: float  # rad/s
    every: int  # steps between two uses of the road, axle and standstill rows
    gate: float  # sd, beyond which a residual loses weight
    still_gate: float  # sd, of the standing gyro
    scale: Floats  # (ROWS,) by which the sd of each row is larger than said above


@njit(cache=True)
def derivative(x: Floats, f: Floats, w: Floats, dx: Floats) -> None:
    """Time derivatives of the states into dx (29,) (section 5); constants have none."""
    p, q, r = w[0] - x[BG], w[1] - x[BG + 1], w[2] - x[BG + 2]
    sph, cph, sth, cth = sin(x[PHI]), cos(x[PHI]), sin(x[THETA]), cos(x[THETA])
    u, v, z = x[U], x[V], x[W]
    dx[:] = 0.0
    dx[U] = f[0] - x[BA] - G * sth + r * v - q * z
    dx[V] = f[1] - x[BA + 1] - G * sph * cth - r * u + p * z
    dx[W] = f[2] - x[BA + 2] - G * cph * cth + q * u - p * v
    dx[PHI] = p - tan(x[THETA]) * (q * sph + r * cph)
    dx[THETA] = -q * cph + r * sph
    dx[PSI] = (q * sph + r * cph) / cth
    dx[H] = u * sth + cth * (v * sph + z * cph)


@njit(cache=True)
def propagate(x: Floats, f: Floats, w: Floats, dt: float, noise: Noise, clone: bool) -> Floats:
    """The states one step later, by the midpoint rule; small errors decay (section 5).

    clone: keep the altitude for the next visit of this place.
    """
    dx = np.empty(N)
    derivative(x, f, w, dx)
    derivative(x + 0.5 * dt * dx, f, w, dx)
    y = x + dt * dx
    y[EP] *= exp(-dt / noise.body_time)
    y[ER] *= exp(-dt / noise.body_time)
    y[HO] *= exp(-dt / noise.altimeter_time)
    y[HB] *= exp(-dt / noise.barometer_time)
    if clone:
        y[HC] = x[H]
    return y


@njit(cache=True)
def transition(x: Floats, w: Floats, dt: float, noise: Noise, clone: bool, F: Floats) -> None:
    """F = I + dt A into F (29, 29), A the Jacobian of `derivative` (section 5)."""
    p, q, r = w[0] - x[BG], w[1] - x[BG + 1], w[2] - x[BG + 2]
    sph, cph, sth, cth = sin(x[PHI]), cos(x[PHI]), sin(x[THETA]), cos(x[THETA])
    tth = sth / cth
    u, v, z = x[U], x[V], x[W]
    F[:] = 0.0
    for i in range(N):
        F[i, i] = 1.0
    F[U, V], F[U, W], F[U, THETA] = dt * r, -dt * q, -dt * G * cth
    F[U, BA], F[U, BG + 2], F[U, BG + 1] = -dt, -dt * v, dt * z
    F[V, U], F[V, W], F[V, PHI], F[V, THETA] = (
        -dt * r,
        dt * p,
        -dt * G * cph * cth,
        dt * G * sph * sth,
    )
    F[V, BA + 1], F[V, BG + 2], F[V, BG] = -dt, dt * u, -dt * z
    F[W, U], F[W, V], F[W, PHI], F[W, THETA] = (
        dt * q,
        -dt * p,
        dt * G * sph * cth,
        dt * G * cph * sth,
    )
    F[W, BA + 2], F[W, BG + 1], F[W, BG] = -dt, -dt * u, dt * v
    F[PHI, PHI] -= dt * tth * (q * cph - r * sph)
    F[PHI, THETA] = -dt * (q * sph + r * cph) / cth**2
    F[PHI, BG], F[PHI, BG + 1], F[PHI, BG + 2] = -dt, dt * tth * sph, dt * tth * cph
    F[THETA, PHI] = dt * (q * sph + r * cph)
    F[THETA, BG + 1], F[THETA, BG + 2] = dt * cph, -dt * sph
    F[PSI, PHI] = dt * (q * cph - r * sph) / cth
    F[PSI, THETA] = dt * (q * sph + r * cph) * sth / cth**2
    F[PSI, BG + 1], F[PSI, BG + 2] = -dt * sph / cth, -dt * cph / cth
    F[H, U], F[H, V], F[H, W] = dt * sth, dt * cth * sph, dt * cth * cph
    F[H, PHI] = dt * cth * (cph * v - sph * z)
    F[H, THETA] = dt * (cth * u - sth * (v * sph + z * cph))
    F[EP, EP] = F[ER, ER] = exp(-dt / noise.body_time)
    F[HO, HO] = exp(-dt / noise.altimeter_time)
    F[HB, HB] = exp(-dt / noise.barometer_time)
    if clone:
        F[HC, HC], F[HC, H] = 0.0, 1.0


@njit(cache=True)
def process_noise(
    x: Floats, f: Floats, w: Floats, s: Floats, dt: float, noise: Noise, q: Floats
) -> None:
    """Diagonal of Q over one step into q (29,) (section 5)."""
    q[:] = 0.0
    forward = f[0] - G * sin(x[THETA])
    q[U] = dt * (noise.accel**2 + (noise.accel_gain * forward) ** 2)
    q[V] = dt * (
        noise.accel**2 + (noise.accel_gain * f[1]) ** 2 + (noise.yaw_slip * w[2] * x[U]) ** 2
    )
    q[W] = dt * (noise.vertical**2 + (noise.vertical_gain * w[1] * x[U]) ** 2)
    q[PHI] = q[THETA] = dt * (noise.gyro**2 + (noise.gyro_cross * w[2]) ** 2)
    share = 1.0 - exp(-2 * dt / noise.body_time)
    body = noise.body + noise.shaken * sqrt(max(SHAKING_SPEED / max(abs(x[U]), SLOWEST), 1.0))
    q[EP] = share * (
        body**2
        + (noise.body_gain * noise.pitch_gain * s[FORWARD]) ** 2
        + (noise.inertia_gain * s[NOSE]) ** 2
    )
    q[ER] = share * (
        body**2
        + (noise.body_gain * noise.roll_gain * s[LATERAL]) ** 2
        + (noise.inertia_gain * s[LEAN]) ** 2
    )
    for i in range(3):
        q[BG + i] = dt * noise.gyro_bias**2
        q[BA + i] = dt * noise.accel_bias**2
    q[PSI] = dt * (noise.yaw + noise.yaw_gain * abs(w[2])) ** 2
    q[H] = dt * noise.altitude**2
    q[HO] = noise.altimeter**2 * (1.0 - exp(-2 * dt / noise.altimeter_time))
    q[HB] = noise.barometer**2 * (1.0 - exp(-2 * dt / noise.barometer_time))


@njit(cache=True)
def body_pitch(x: Floats, s: Floats) -> float:
    """rad, of the body against the road (section 4), with its mounting.

    Balance of moments of the body on its springs: J angle'' = K f - angle - c angle', where
    angle'' is the acceleration against the horizontal, which the gyro knows. The first two terms
    behind the lag c are `sway`; so a body that the road rocks is told from the road itself. Of the
    force, what the sensor's bias and mounting make of gravity is none.
    """
    force = s[FORWARD] - x[BA] - G * x[MTHETA]
    return x[MTHETA] + x[KTHETA] * force + x[KSIDE] * s[UNSIGNED] + s[NOSE] + x[EP]


@njit(cache=True)
def body_roll(x: Floats, s: Floats) -> float:
    """rad, of the body against the road, with its mounting."""
    force = s[LATERAL] - x[BA + 1] - G * x[MPHI]
    return x[MPHI] + x[KPHI] * force + s[LEAN] + x[ER]


@njit(cache=True)
def row(
    kind: int, k: int, x: Floats, steps: Steps, noise: Noise, h: Floats
) -> tuple[float, float, float]:
    """One measurement row at step k, linearised at x (section 6).

    Writes the row of H into h (29,). Returns residual z - h(x), its sd and the gate in sd (0: no
    gate); the residual is NaN where there is no such measurement at this step.
    """
    nothing = (np.nan, 1.0, 0.0)
    if kind == SPEED:
        if not np.isfinite(steps.speed[k]):
            return nothing
        h[:] = 0.0
        predicted = _speed(x, steps.force_at[k], steps.rate_at[k], steps, k, h)
        return steps.speed[k] - predicted, steps.speed_sd[k], noise.gate
    if kind >= FIX:
        column = kind - FIX
        z = steps.fixes[k, column]
        if not np.isfinite(z):
            return nothing
        h[:] = 0.0
        residual = z - _fix(column, x, steps.rate_at[k], steps.antenna, h)
        if column == HEADING:
            residual = (residual + np.pi) % (2 * np.pi) - np.pi
        return residual, steps.fixes_sd[k, column], noise.gate
    if k % noise.every != 0 or steps.still[k] == (kind < STILL_VELOCITY):
        return nothing
    w, s = steps.rate_at[k], steps.sway[k]
    h[:] = 0.0
    if kind == SLIP:
        sd = sqrt(
            noise.slip_sd**2
            + (noise.slip_gain * s[TIRE] * x[U]) ** 2
            + (noise.slip_yaw * (w[2] - x[BG + 2])) ** 2
        )
        return -_slip(x, w, s, h), sd, noise.gate
    if kind == CONTACT:
        return -_contact(x, s, h), noise.contact_sd, noise.gate
    if kind < STILL_GYRO:
        h[kind - STILL_VELOCITY] = 1.0
        return -x[kind - STILL_VELOCITY], noise.still_sd, 0.0
    axis = kind - STILL_GYRO
    h[BG + axis] = 1.0
    return w[axis] - x[BG + axis], noise.still_gyro_sd, noise.still_gate


@njit(cache=True)
def _speed(x: Floats, f: Floats, w: Floats, steps: Steps, k: int, h: Floats) -> float:
    """What the speed channel shows: forward speed of the wheel, along the road, late by TAU.

    No derivative to a_theta, mpsi, v and w: the second-order term would let a misfit of the speed
    turn the mounting (the chapter saw 6-10 deg).
    """
    q, r = w[1] - x[BG + 1], w[2] - x[BG + 2]
    body = body_pitch(x, steps.sway[k])
    change = f[0] - x[BA] - G * sin(x[THETA]) + r * x[V]
    wheel = x[U] - body * x[W] - x[MPSI] * x[V] - r * x[YW] - q * steps.height - x[TAU] * change
    scale = 1.0 + x[KAPPA]
    h[U], h[KAPPA], h[TAU], h[YW] = scale, wheel, -scale * change, -scale * r
    h[THETA] = scale * x[TAU] * G * cos(x[THETA])
    h[BA] = scale * x[TAU]
    h[BG + 1] = scale * steps.height
    h[BG + 2] = scale * (x[YW] + x[TAU] * x[V])
    return scale * wheel


@njit(cache=True)
def _slip(x: Floats, w: Floats, s: Floats, h: Floats) -> float:
    """m/s, sideways velocity of the rear axle beyond that of a linear tire: 0.

    No derivative to the body roll, whose lever w is noise.
    """
    r = w[2] - x[BG + 2]
    body = body_roll(x, s)
    slip = x[KBETA] * s[TIRE]
    h[V], h[W], h[U] = 1.0, -body, x[MPSI] + slip
    h[BG + 2], h[XR], h[MPSI], h[KBETA] = -x[XR], r, x[U], s[TIRE] * x[U]
    return x[V] + r * x[XR] + x[MPSI] * x[U] - body * x[W] + slip * x[U]


@njit(cache=True)
def _contact(x: Floats, s: Floats, h: Floats) -> float:
    """m/s, velocity of the car out of the road: 0.

    No derivative to the body roll: its lever v is as small as what else moves a car sideways, and
    would turn the mounting.
    """
    pitch, roll = body_pitch(x, s), body_roll(x, s)
    h[W], h[V], h[U] = 1.0, roll, pitch
    h[MTHETA], h[BA], h[EP] = x[U] * (1 - G * x[KTHETA]), -x[U] * x[KTHETA], x[U]
    h[KTHETA], h[KSIDE] = x[U] * (s[FORWARD] - x[BA] - G * x[MTHETA]), x[U] * s[UNSIGNED]
    return x[W] + roll * x[V] + pitch * x[U]


@njit(cache=True)
def _fix(column: int, x: Floats, w: Floats, d: Floats, h: Floats) -> float:
    """What a receiver or a barometer shows: antenna velocity, altitude, angles of two antennas."""
    if column == ALTITUDE:
        h[H] = h[HO] = 1.0
        return x[H] + x[HO]
    if column == BAROMETER:
        h[H] = h[HB] = 1.0
        return x[H] + x[HB]
    if column == CLOSURE:
        h[H], h[HC] = 1.0, -1.0
        return x[H] - x[HC]
    if column == HEADING:
        h[PSI], h[MPSI] = 1.0, -1.0
        return x[PSI] - x[MPSI]
    if column == ROLL:
        h[PHI], h[MPHI] = 1.0, -1.0
        return x[PHI] - x[MPHI]
    p, q, r = w[0] - x[BG], w[1] - x[BG + 1], w[2] - x[BG + 2]
    u = x[U] + q * d[2] - r * d[1]
    v = x[V] + r * d[0] - p * d[2]
    z = x[W] + p * d[1] - q * d[0]
    sph, cph, sth, cth = sin(x[PHI]), cos(x[PHI]), sin(x[THETA]), cos(x[THETA])
    if column == UP:
        h[U], h[V], h[W] = sth, cth * sph, cth * cph
        h[PHI] = cth * (cph * v - sph * z)
        h[THETA] = cth * u - sth * (v * sph + z * cph)
        predicted = u * sth + cth * (v * sph + z * cph)
    else:
        forward, left = u * cth - sth * (v * sph + z * cph), v * cph - z * sph
        climb = u * sth + cth * (v * sph + z * cph)
        along, across = cos(x[PSI]), sin(x[PSI])
        if column == EAST:
            across = -across
        else:
            along, across = across, along
        predicted = along * forward + across * left
        h[U] = along * cth
        h[V] = -along * sth * sph + across * cph
        h[W] = -along * sth * cph - across * sph
        h[PHI] = -along * sth * (v * cph - z * sph) - across * (v * sph + z * cph)
        h[THETA] = -along * climb
        h[PSI] = across * forward - along * left
    # the lever arm's velocity depends on the gyro bias as that of the point depends on it
    h[BG] = h[V] * d[2] - h[W] * d[1]
    h[BG + 1] = h[W] * d[0] - h[U] * d[2]
    h[BG + 2] = h[U] * d[1] - h[V] * d[0]
    return predicted
