"""Equations of motion of the simulated car; docs/simulator.md.

Six degrees of freedom of the body, one up and down per wheel, wheel spin, actuators that lag,
wind.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.jit import compiled
from roadlog.simulate.car import (
    ALONG,
    ANGULAR,
    ASIDE,
    BODY_RATE,
    BRAKE,
    DRIVE,
    ENERGY,
    EULER,
    EXTRAS,
    NORMAL,
    POSITION,
    POWER,
    SPECIFIC,
    SPIN,
    STEER,
    TRAVEL,
    TRAVEL_RATE,
    VELOCITY,
    CarParameters,
)
from roadlog.simulate.frames import BodyAxes, Centerline, body_axes, lane_at, to_body, to_road
from roadlog.simulate.road import RoadTables, surface
from roadlog.simulate.wheel import contact, steered, strut, tread, wheel
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G


class Push(NamedTuple):
    """What the wheels do to the body: forces N and moments N m about the CG, body axes."""

    x: float
    y: float
    z: float
    roll: float
    pitch: float
    yaw: float


@compiled
def body(
    state: Floats,
    push: Push,
    wind: Floats,
    axes: BodyAxes,
    car: CarParameters,
    geometry: Floats,
    out: Floats,
    extras: Floats,
) -> float:
    """Accelerations of the body under wheels, air and gravity; W of the air.

    Adds to the wheels' up and down what the body's acceleration takes from it.
    """
    u, v, w = state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2]
    p, q, r = state[BODY_RATE], state[BODY_RATE + 1], state[BODY_RATE + 2]
    gx, gy, gz = -G * axes.xu, -G * axes.yu, -G * axes.zu
    unsprung = (car.mass - car.sprung_mass) / 4
    wind_x, wind_y, _ = to_body(axes, wind[0], wind[1], 0.0)
    air_x, air_y = u - wind_x, v - wind_y
    pressure = 0.5 * car.air_density * car.drag_area * np.sqrt(air_x * air_x + air_y * air_y)
    drag_x, drag_y = -pressure * air_x, -car.side_drag * pressure * air_y
    ax = (push.x + drag_x) / car.mass + gx
    ay = (push.y + drag_y) / car.mass + gy
    az = push.z / car.sprung_mass + gz
    moment_x, moment_y = push.roll, push.pitch
    for i in range(4):
        z = geometry[i, 2] + state[TRAVEL + i]
        moment_x -= z * unsprung * (gy - ay)
        moment_y += z * unsprung * (gx - ax)
    ix, iy, iz = car.roll_inertia, car.pitch_inertia, car.yaw_inertia
    p_dot = (moment_x - (iz - iy) * q * r) / ix
    q_dot = (moment_y - (ix - iz) * r * p) / iy
    r_dot = (push.yaw - (iy - ix) * p * q) / iz
    for i in range(4):
        x, y = geometry[i, 0], geometry[i, 1]
        z = geometry[i, 2] + state[TRAVEL + i]
        out[TRAVEL_RATE + i] -= (
            az + p_dot * y - q_dot * x + r * p * x + r * q * y - (p * p + q * q) * z
        )
    out[VELOCITY] = ax - (q * w - r * v)
    out[VELOCITY + 1] = ay - (r * u - p * w)
    out[VELOCITY + 2] = az - (p * v - q * u)
    out[BODY_RATE], out[BODY_RATE + 1], out[BODY_RATE + 2] = p_dot, q_dot, r_dot
    extras[SPECIFIC], extras[SPECIFIC + 1], extras[SPECIFIC + 2] = ax - gx, ay - gy, az - gz
    extras[ANGULAR], extras[ANGULAR + 1], extras[ANGULAR + 2] = p_dot, q_dot, r_dot
    return drag_x * u + drag_y * v


@compiled
def kinematics(state: Floats, axes: BodyAxes, lane: Centerline, out: Floats) -> None:
    """Derivatives of position, Euler angles and road coordinates."""
    roll, nose = state[EULER], state[EULER + 1]
    p, q, r = state[BODY_RATE], state[BODY_RATE + 1], state[BODY_RATE + 2]
    ve, vn, vu = to_road(axes, state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2])
    out[POSITION], out[POSITION + 1], out[POSITION + 2] = ve, vn, vu
    cr, sr, cn, sn = np.cos(roll), np.sin(roll), np.cos(nose), np.sin(nose)
    turn = q * sr + r * cr
    out[EULER] = p + sn / cn * turn
    out[EULER + 1] = q * cr - r * sr
    out[EULER + 2] = turn / cn
    out[ALONG] = (ve * lane.cos + vn * lane.sin) / (1 - lane.curvature * state[ASIDE])
    out[ASIDE] = -ve * lane.sin + vn * lane.cos


@compiled
def stored_in_motion(state: Floats, car: CarParameters) -> float:
    """J, of the body's motion and height."""
    u, v, w = state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2]
    p, q, r = state[BODY_RATE], state[BODY_RATE + 1], state[BODY_RATE + 2]
    return (
        0.5 * car.mass * (u * u + v * v)
        + 0.5 * car.sprung_mass * w * w
        + 0.5 * (car.roll_inertia * p * p + car.pitch_inertia * q * q + car.yaw_inertia * r * r)
        + car.mass * G * state[POSITION + 2]
    )


@compiled
def normal(state: Floats, road: RoadTables) -> tuple[float, float, float]:
    """East, north, up of the road's normal under the CG."""
    _, slope_e, slope_n = surface(
        road, state[ALONG], state[ASIDE], state[POSITION], state[POSITION + 1]
    )
    norm = 1 / np.sqrt(1 + slope_e * slope_e + slope_n * slope_n)
    return -slope_e * norm, -slope_n * norm, norm


@compiled
def derivative(
    state: Floats,
    command: Floats,
    wind: Floats,
    car: CarParameters,
    geometry: Floats,
    road: RoadTables,
    out: Floats,
    extras: Floats,
) -> None:
    """Time derivative of the state into `out`; forces and energies into `extras`.

    command: steering rad, drive torque N m, brake torque N m, gearbox ratio. wind: m/s east and
    north. geometry: (4, 4) per wheel x, y from the CG, height of its center at rest, spring force
    at rest.
    """
    axes = body_axes(state[EULER], state[EULER + 1], state[EULER + 2])
    lane = lane_at(road, state[ALONG])
    ratio, unsprung = command[3] * car.final_drive, (car.mass - car.sprung_mass) / 4
    push = Push(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    energy = power = front_side = 0.0
    for i in range(4):
        x, y = geometry[i, 0], geometry[i, 1]
        at = contact(i, state, axes, lane, car, geometry, road)
        sole = tread(steered(i, state[STEER], y, extras[EXTRAS], car), axes, at)
        fx, fy, stored, gained = wheel(i, state, at, sole, ratio, car, out, extras)
        energy += stored + 0.5 * unsprung * at.heave * at.heave
        power += gained
        if i < 2:
            front_side += fy
        bx, by, bz = to_body(
            axes,
            fx * sole.te + fy * sole.le + at.load * at.ne,
            fx * sole.tn + fy * sole.ln + at.load * at.nn,
            fx * sole.tu + fy * sole.lu + at.load * at.nu,
        )
        force, link, stored, gained = strut(i, state, bx, by, car, geometry)
        energy += stored
        power += gained
        push = Push(
            push.x + bx,
            push.y + by,
            push.z + (force + link),
            push.roll + (y * (force + link) - at.arm * by),
            push.pitch + (at.arm * bx - x * (force + link) - car.wheel_inertia * out[SPIN + i]),
            push.yaw + (x * by - y * bx),
        )
        out[TRAVEL + i] = state[TRAVEL_RATE + i]
        out[TRAVEL_RATE + i] = (bz - force - link) / unsprung - G * axes.zu
    # the front axle's own force bends its steering; one step old
    extras[EXTRAS + 1] = front_side
    power += body(state, push, wind, axes, car, geometry, out, extras)
    kinematics(state, axes, lane, out)
    out[STEER] = (command[0] - state[STEER]) / car.steering_lag
    out[DRIVE] = (command[1] - state[DRIVE]) / car.drive_lag
    out[BRAKE] = (command[2] - state[BRAKE]) / car.brake_lag
    extras[ENERGY] = energy + stored_in_motion(state, car)
    extras[POWER] = power
    extras[NORMAL], extras[NORMAL + 1], extras[NORMAL + 2] = normal(state, road)
