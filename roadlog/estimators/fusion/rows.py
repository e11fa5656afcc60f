"""The measurement rows of `fusion`, each written once: residual, standard deviation, gate, h.

Both engines run these functions.
Source: docs/methods/fusion.md#measurement-rows.
"""

from __future__ import annotations

from math import cos, sin, sqrt

import numpy as np

from roadlog.estimators.fusion.body import body_pitch, body_pitch_row, body_roll, forward_force
from roadlog.estimators.fusion.model import rates, tilt
from roadlog.estimators.fusion.states import FIRST_FIX, N, Row
from roadlog.estimators.fusion.states import State as S
from roadlog.estimators.fusion.steps import Fix, Sway
from roadlog.jit import compiled
from roadlog.types import Floats, Record
from roadlog.units import STANDARD_GRAVITY as G


@compiled
def is_there(kind: int, s: Record) -> bool:
    """Whether there is such a measurement at this step."""
    if kind == Row.SPEED:
        return np.isfinite(s.speed)
    if kind >= FIRST_FIX:
        return np.isfinite(s.fixes[kind - FIRST_FIX])
    return s.due and s.still == (kind >= Row.STILL_U)


@compiled
def row(kind: int, x: Floats, s: Record, noise: Record, h: Floats) -> tuple[float, float, float]:
    """One measurement row that is there at a step, linearized at x.

    Writes the row of the measurement matrix into h (29,). Returns residual z - h(x), its sd and the
    gate in sd (0: no gate).
    """
    for i in range(N):
        h[i] = 0.0
    scale = noise.scale[kind]
    if kind == Row.SPEED:
        return s.speed - _speed(x, s, h), s.speed_sd * scale, noise.gate
    if kind >= FIRST_FIX:
        column = kind - FIRST_FIX
        residual = s.fixes[column] - _fix(column, x, s, h)
        if column == Fix.HEADING:
            residual = (residual + np.pi) % (2 * np.pi) - np.pi
        return residual, s.fixes_sd[column] * scale, noise.gate
    if kind == Row.SLIP:
        sd = sqrt(
            noise.slip_sd**2
            + (noise.slip_gain * s.sway[Sway.TIRE] * x[S.U]) ** 2
            + (noise.slip_yaw * (s.rate_at[2] - x[S.GYRO_BIAS_Z])) ** 2
        )
        return -_slip(x, s, noise.levers, h), sd * scale, noise.gate
    if kind == Row.CONTACT:
        return -_contact(x, s.sway, noise.levers, h), noise.contact_sd * scale, noise.gate
    if kind < Row.STILL_GYRO_X:
        axis = kind - Row.STILL_U
        h[S.U + axis] = 1.0
        return -x[S.U + axis], noise.still_sd * scale, 0.0
    axis = kind - Row.STILL_GYRO_X
    h[S.GYRO_BIAS_X + axis] = 1.0
    residual = s.rate_at[axis] - x[S.GYRO_BIAS_X + axis]
    return residual, noise.still_gyro_sd * scale, noise.still_gate


@compiled
def _speed(x: Floats, s: Record, h: Floats) -> float:
    """m/s, of the speed channel: forward speed of the wheel along the road, late by the delay.

    No derivative to the body pitch, the mounting yaw, v and w: the second-order term would let a
    misfit of the speed turn the mounting (6 to 10 deg on one car).
    """
    _, q, r = rates(x, s.rate_at)
    pitch = x[S.MOUNTING_PITCH] + body_pitch(x, s.sway)
    offset, delay, scale = x[S.SPEED_OFFSET_Y], x[S.SPEED_DELAY], 1.0 + x[S.SPEED_SCALE]
    change = s.force_at[0] - x[S.ACCEL_BIAS_X] - G * sin(x[S.THETA]) + r * x[S.V]
    wheel = x[S.U] - pitch * x[S.W] - x[S.MOUNTING_YAW] * x[S.V]
    wheel += -r * offset - q * s.height - delay * change
    h[S.U], h[S.SPEED_SCALE] = scale, wheel
    h[S.SPEED_DELAY], h[S.SPEED_OFFSET_Y] = -scale * change, -scale * r
    h[S.THETA], h[S.ACCEL_BIAS_X] = scale * delay * G * cos(x[S.THETA]), scale * delay
    h[S.GYRO_BIAS_Y], h[S.GYRO_BIAS_Z] = scale * s.height, scale * (offset + delay * x[S.V])
    return scale * wheel


@compiled
def _slip(x: Floats, s: Record, levers: float, h: Floats) -> float:
    """m/s, sideways velocity of the rear axle beyond that of a linear tire: 0.

    No derivative to the body roll, whose lever w is noise; nor, of a shaken sensor (levers 0), by
    what the force tells of u and w: its noise is in v as well, and a lever times a residual with
    the same noise in it has a mean.
    """
    r = s.rate_at[2] - x[S.GYRO_BIAS_Z]
    roll = x[S.MOUNTING_ROLL] + body_roll(x, s.sway)
    angle = x[S.MOUNTING_YAW] + x[S.SLIP_GRADIENT] * s.sway[Sway.TIRE]
    h[S.V], h[S.W] = 1.0, -levers * roll
    h[S.U] = x[S.MOUNTING_YAW] + levers * (angle - x[S.MOUNTING_YAW])
    h[S.GYRO_BIAS_Z], h[S.REAR_AXLE_X] = -x[S.REAR_AXLE_X], r
    h[S.MOUNTING_YAW], h[S.SLIP_GRADIENT] = x[S.U], s.sway[Sway.TIRE] * x[S.U]
    return x[S.V] + r * x[S.REAR_AXLE_X] - roll * x[S.W] + angle * x[S.U]


@compiled
def _contact(x: Floats, s: Floats, levers: float, h: Floats) -> float:
    """m/s, velocity of the car out of the road: 0.

    No derivative to the body roll: its lever v is as small as what else moves a car sideways, and
    would turn the mounting. The levers of u and v are the mounting's alone where `levers` is 0,
    as in `_slip`.
    """
    pitch = x[S.MOUNTING_PITCH] + body_pitch(x, s)
    roll = x[S.MOUNTING_ROLL] + body_roll(x, s)
    body_pitch_row(x[S.PITCH_GRADIENT], forward_force(x, s), s, h)
    h[S.MOUNTING_PITCH] += 1.0
    for i in range(N):
        h[i] *= x[S.U]
    h[S.W] = 1.0
    h[S.V] = x[S.MOUNTING_ROLL] + levers * (roll - x[S.MOUNTING_ROLL])
    h[S.U] = x[S.MOUNTING_PITCH] + levers * (pitch - x[S.MOUNTING_PITCH])
    return x[S.W] + roll * x[S.V] + pitch * x[S.U]


@compiled
def _fix(column: int, x: Floats, s: Record, h: Floats) -> float:
    """What a receiver or a barometer shows: antenna velocity, altitude, angles of two antennas."""
    if column == Fix.ALTITUDE:
        h[S.ALTITUDE] = h[S.RECEIVER_ERROR] = 1.0
        return x[S.ALTITUDE] + x[S.RECEIVER_ERROR]
    if column == Fix.BAROMETER:
        h[S.ALTITUDE] = h[S.BAROMETER_ERROR] = 1.0
        return x[S.ALTITUDE] + x[S.BAROMETER_ERROR]
    if column == Fix.CLOSURE:
        h[S.ALTITUDE], h[S.KEPT_ALTITUDE] = 1.0, -1.0
        return x[S.ALTITUDE] - x[S.KEPT_ALTITUDE]
    if column == Fix.HEADING:
        h[S.PSI], h[S.MOUNTING_YAW] = 1.0, -1.0
        return x[S.PSI] - x[S.MOUNTING_YAW]
    if column == Fix.ROLL:
        h[S.PHI], h[S.MOUNTING_ROLL] = 1.0, -1.0
        return x[S.PHI] - x[S.MOUNTING_ROLL]
    return _antenna_velocity(column, x, s.rate_at, s.antenna, h)


@compiled
def _antenna_velocity(column: int, x: Floats, w: Floats, arm: Floats, h: Floats) -> float:
    """m/s, east, north or up; arm (3,): m, of the antenna from the reference point."""
    p, q, r = rates(x, w)
    u = x[S.U] + q * arm[2] - r * arm[1]
    v = x[S.V] + r * arm[0] - p * arm[2]
    z = x[S.W] + p * arm[1] - q * arm[0]
    sph, cph, sth, cth = tilt(x)
    climb = u * sth + cth * (v * sph + z * cph)
    if column == Fix.UP:
        h[S.U], h[S.V], h[S.W] = sth, cth * sph, cth * cph
        h[S.PHI] = cth * (cph * v - sph * z)
        h[S.THETA] = cth * u - sth * (v * sph + z * cph)
        predicted = climb
    else:
        forward, left = u * cth - sth * (v * sph + z * cph), v * cph - z * sph
        along, across = cos(x[S.PSI]), -sin(x[S.PSI])
        if column == Fix.NORTH:
            along, across = -across, along
        predicted = along * forward + across * left
        h[S.U] = along * cth
        h[S.V] = -along * sth * sph + across * cph
        h[S.W] = -along * sth * cph - across * sph
        h[S.PHI] = -along * sth * (v * cph - z * sph) - across * (v * sph + z * cph)
        h[S.THETA] = -along * climb
        h[S.PSI] = across * forward - along * left
    # the lever arm's velocity depends on the gyro bias as that of the point depends on it
    h[S.GYRO_BIAS_X] = h[S.V] * arm[2] - h[S.W] * arm[1]
    h[S.GYRO_BIAS_Y] = h[S.W] * arm[0] - h[S.U] * arm[2]
    h[S.GYRO_BIAS_Z] = h[S.U] * arm[1] - h[S.V] * arm[0]
    return predicted
