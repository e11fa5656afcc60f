"""Car: a sprung body on four wheels with tires, springs and a driveline; docs/simulator.md.

Six degrees of freedom of the body, one up and down per wheel, wheel spin, tires with relaxation
lengths, load sensitivity and combined slip, actuators that lag, brakes with dry
friction that truly hold (Dahl), wind, loads, grip that changes along the road.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from roadlog.car.vehicle import Vehicle
from roadlog.simulate.road import (
    RoadTables,
    curvature_at,
    friction_at,
    heading_at,
    roughness_at,
    surface,
)
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

WAGON_CG_HEIGHT = 0.58  # m, of the whole car, where the sprung mass has 0.61


class CarParameters(NamedTuple):
    """The true car; SI. Estimators get a data sheet instead.

    Defaults: docs/methods/common.md#preset-cars, `wagon`.
    """

    mass: float = 1850.0
    sprung_mass: float = 1650.0
    cg_to_front_axle: float = 1.40
    cg_to_rear_axle: float = 1.43
    track: float = 1.54
    sprung_cg_height: float = 0.61  # over the ground with tires of the effective radius
    roll_inertia: float = 634.0  # sprung
    pitch_inertia: float = 3000.0  # sprung
    yaw_inertia: float = 3300.0  # whole car
    wheel_inertia: float = 1.2
    engine_inertia: float = 0.18
    final_drive: float = 3.07
    driveline_efficiency: float = 0.92
    front_drive: float = 0.0  # share of the drive torque
    front_brake: float = 0.65  # share of the brake torque
    front_spring: float = 24e3  # N/m per wheel
    rear_spring: float = 29e3
    front_damper: float = 1900.0  # N s/m per wheel
    rear_damper: float = 2050.0
    front_roll_bar: float = 25e3  # N m/rad per axle
    rear_roll_bar: float = 8e3
    front_roll_center: float = 0.05  # m over the ground
    rear_roll_center: float = 0.12
    anti_dive: float = 0.06  # tangents of the links
    anti_lift: float = 0.10
    bump_stop: float = 3e5  # N/m beyond bump_travel
    bump_travel: float = 0.07  # m
    tire_stiffness: float = 220e3  # N/m, vertical
    tire_damping: float = 150.0  # N s/m, vertical
    free_radius: float = 0.325
    effective_radius: float = 0.3165
    longitudinal_relaxation: float = 0.25  # m
    lateral_relaxation: float = 0.55  # m
    rolling_resistance: float = 0.011
    drag_area: float = 0.726
    side_drag: float = 1.5  # side force coefficient over drag coefficient
    air_density: float = 1.2258
    ackermann: float = 0.5  # share of true Ackermann geometry
    steering_compliance: float = 1e-6  # rad/N of the front axle's lateral force
    toe: float = float(np.radians(0.05))  # rad, front
    steering_lag: float = 0.05  # s
    drive_lag: float = 0.15  # s
    brake_lag: float = 0.10  # s
    brake_windup: float = 0.01  # rad by which a stuck brake yields before it slips


def car_of(vehicle: Vehicle) -> CarParameters:
    """The true car that a data sheet describes: the `wagon` scaled to it.

    Springs, dampers and roll bars go with the mass, so that ride frequencies stay; tires stay.
    The data sheet of `wagon` gives the defaults back.
    """
    wagon = CarParameters()
    size = vehicle.mass / wagon.mass
    height = vehicle.cg_height / WAGON_CG_HEIGHT
    heavy = [
        "sprung_mass",
        "front_spring",
        "rear_spring",
        "front_damper",
        "rear_damper",
        "front_roll_bar",
        "rear_roll_bar",
        "bump_stop",
        "tire_stiffness",
        "tire_damping",
    ]
    same = [
        "mass",
        "cg_to_front_axle",
        "cg_to_rear_axle",
        "track",
        "roll_inertia",
        "pitch_inertia",
        "yaw_inertia",
        "wheel_inertia",
        "engine_inertia",
        "final_drive",
        "driveline_efficiency",
        "rolling_resistance",
        "drag_area",
        "air_density",
    ]
    return wagon._replace(
        **{name: size * getattr(wagon, name) for name in heavy},
        **{name: getattr(vehicle, name) for name in same},
        sprung_cg_height=height * wagon.sprung_cg_height,
        effective_radius=vehicle.wheel_radius,
        free_radius=vehicle.wheel_radius + wagon.free_radius - wagon.effective_radius,
        front_drive={"front": 1.0, "rear": 0.0, "all": 0.5}[vehicle.driven],
    )


# The state, 41 numbers; wheels in the order fl, fr, rl, rr.
POSITION, EULER, VELOCITY, RATE = 0, 3, 6, 9  # of the sprung CG; roll, pitch, yaw; body axes
TRAVEL, TRAVEL_RATE = 12, 16  # wheel up relative to the body
SPIN = 20  # rad/s
SLIP, SLIP_ANGLE = 24, 28  # relaxed kappa' and alpha' (tangent)
STEER, DRIVE, BRAKE = 32, 33, 34  # rad, N m at the driven axle, N m of all brakes
ALONG, ASIDE = 35, 36  # m, road coordinates
STUCK = 37  # -1..1, how far a brake's friction is wound up
STATES = 41

# What a derivative also yields.
FORCE_X, FORCE_Y, FORCE_Z = 0, 4, 8  # tire forces per wheel
SPECIFIC = 12  # specific force at the sprung CG, body axes
ANGULAR = 15  # angular acceleration, body axes
NORMAL = 18  # road normal under the CG, east north up
ENERGY, POWER = 21, 22  # J stored; W from engine, brakes, slip, drag, dampers and rolling together
EXTRAS = 23

# Tire shape: CommonRoad parameters_vehicle2; docs/simulator.md#tires
NOMINAL_LOAD = 4500.0  # N
DAMPED_BELOW = 2.0  # m/s; the relaxed slips oscillate at a crawl
SLIP_DAMPING = 0.02  # s/m
MAX_CREEP = 5.0  # rad/s; a sliding brake winds up within a step, however fast


@njit(cache=True)
def tire(kappa: float, tan_alpha: float, load: float, grip: float) -> tuple[float, float]:
    """Longitudinal and lateral force in N; combined slip by weighting functions."""
    if load <= 0.0:
        return 0.0, 0.0
    alpha = np.arctan(tan_alpha)
    change = (load - NOMINAL_LOAD) / NOMINAL_LOAD
    peak_x = grip * (1.1739 - 0.08 * change) * load
    x = 22.303 * load / (1.6411 * peak_x) * kappa
    force_x = peak_x * np.sin(1.6411 * np.arctan(x - 0.46403 * (x - np.arctan(x))))
    peak_y = grip * (1.0489 - 0.08 * change) * load
    stiffness = 21.92 * NOMINAL_LOAD * np.sin(2 * np.arctan(load / (1.8 * NOMINAL_LOAD)))
    y = stiffness / (1.3507 * peak_y) * alpha
    force_y = peak_y * np.sin(1.3507 * np.arctan(y + 0.0074722 * (y - np.arctan(y))))
    weight_x = np.cos(1.2568 * np.arctan(13.276 * np.cos(np.arctan(-13.778 * kappa)) * alpha))
    weight_y = np.cos(1.0719 * np.arctan(7.1433 * np.cos(np.arctan(9.1916 * alpha)) * kappa))
    return force_x * max(weight_x, 0.0), force_y * max(weight_y, 0.0)


@njit(cache=True)
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
    roll, nose, yaw = state[EULER], state[EULER + 1], state[EULER + 2]
    u, v, w = state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2]
    p, q, r = state[RATE], state[RATE + 1], state[RATE + 2]
    along, aside = state[ALONG], state[ASIDE]
    cr, sr, cn, sn = np.cos(roll), np.sin(roll), np.cos(nose), np.sin(nose)
    cy, sy = np.cos(yaw), np.sin(yaw)
    # rows: east, north, up; columns: body axes
    r00, r01, r02 = cy * cn, cy * sn * sr - sy * cr, cy * sn * cr + sy * sr
    r10, r11, r12 = sy * cn, sy * sn * sr + cy * cr, sy * sn * cr - cy * sr
    r20, r21, r22 = -sn, cn * sr, cn * cr
    gx, gy, gz = -G * r20, -G * r21, -G * r22
    heading = heading_at(road, along)
    bend = curvature_at(road, along)
    ch, sh = np.cos(heading), np.sin(heading)
    wheelbase = car.cg_to_front_axle + car.cg_to_rear_axle
    steer = state[STEER]
    ratio = command[3] * car.final_drive
    engine = car.engine_inertia * ratio * ratio
    unsprung = (car.mass - car.sprung_mass) / 4

    sum_x = sum_y = sum_s = moment_x = moment_y = moment_z = 0.0
    energy = power = 0.0
    front_side = 0.0
    for i in range(4):  # a first round: the tires' forces do not depend on the steering angle
        x, y, rest = geometry[i, 0], geometry[i, 1], geometry[i, 2]
        travel, travel_rate = state[TRAVEL + i], state[TRAVEL_RATE + i]
        z = rest + travel
        east = r00 * x + r01 * y + r02 * z
        north = r10 * x + r11 * y + r12 * z
        up = r20 * x + r21 * y + r22 * z
        ahead, left = east * ch + north * sh, -east * sh + north * ch
        s_i = along + ahead / (1 - bend * aside)
        n_i = aside + left - 0.5 * bend * ahead * ahead
        height, slope_e, slope_n = surface(
            road, s_i, n_i, state[POSITION] + east, state[POSITION + 1] + north
        )
        height += roughness_at(road, s_i, i % 2 == 0)
        norm = 1 / np.sqrt(1 + slope_e * slope_e + slope_n * slope_n)
        ne, nn, nu = -slope_e * norm, -slope_n * norm, norm
        radius = (state[POSITION + 2] + up - height) * nu
        # velocity of the contact point, body axes and then east north up
        arm = z - radius
        vx, vy = u + q * arm - r * y, v + r * x - p * arm
        vz = w + p * y - q * x + travel_rate
        ve = r00 * vx + r01 * vy + r02 * vz
        vn = r10 * vx + r11 * vy + r12 * vz
        vu = r20 * vx + r21 * vy + r22 * vz
        load = car.tire_stiffness * (car.free_radius - radius) - car.tire_damping * (
            ve * ne + vn * nn + vu * nu
        )
        load = max(load, 0.0)
        grip = friction_at(road, s_i)
        angle = 0.0
        if i < 2:
            side = 1.0 if i == 0 else -1.0
            tangent = np.tan(steer)
            angle = (
                np.arctan(tangent / (1 - car.ackermann * y * tangent / wheelbase))
                - car.steering_compliance * extras[EXTRAS]
                - side * car.toe
            )
        ca, sa = np.cos(angle), np.sin(angle)
        he, hn, hu = r00 * ca + r01 * sa, r10 * ca + r11 * sa, r20 * ca + r21 * sa
        inward = he * ne + hn * nn + hu * nu
        te, tn, tu = he - inward * ne, hn - inward * nn, hu - inward * nu
        norm = 1 / np.sqrt(te * te + tn * tn + tu * tu)
        te, tn, tu = te * norm, tn * norm, tu * norm
        le, ln, lu = nn * tu - nu * tn, nu * te - ne * tu, ne * tn - nn * te
        speed_x = ve * te + vn * tn + vu * tu
        speed_y = ve * le + vn * ln + vu * lu
        spin = state[SPIN + i]
        rim = car.effective_radius * spin
        slide = speed_x - rim
        slow = abs(speed_x)
        out[SLIP + i] = (-slide - slow * state[SLIP + i]) / car.longitudinal_relaxation
        out[SLIP_ANGLE + i] = (-speed_y - slow * state[SLIP_ANGLE + i]) / car.lateral_relaxation
        damping = 0.0
        if slow < DAMPED_BELOW:
            damping = SLIP_DAMPING * 0.5 * (1 + np.cos(np.pi * slow / DAMPED_BELOW))
        fx, fy = tire(
            state[SLIP + i] - damping * slide,
            state[SLIP_ANGLE + i] - damping * speed_y,
            load,
            grip,
        )
        extras[FORCE_X + i], extras[FORCE_Y + i], extras[FORCE_Z + i] = fx, fy, load
        if i < 2:
            front_side += fy
        # wheel spin
        share = (car.front_drive if i < 2 else 1 - car.front_drive) / 2
        drive = share * state[DRIVE] if ratio > 0.0 else 0.0
        clamp = (car.front_brake if i < 2 else 1 - car.front_brake) / 2 * max(state[BRAKE], 0.0)
        creep = MAX_CREEP * np.tanh(spin / MAX_CREEP)
        stuck = state[STUCK + i]
        out[STUCK + i] = (creep - abs(creep) * stuck) / car.brake_windup
        brake = clamp * stuck
        rolling = car.rolling_resistance * load * car.effective_radius * np.tanh(rim / 0.05)
        inertia = car.wheel_inertia + engine * share
        spin_up = (drive - brake - car.effective_radius * fx - rolling) / inertia
        out[SPIN + i] = spin_up
        power += (drive - brake - rolling) * spin + fx * slide + fy * speed_y
        energy += 0.5 * inertia * spin * spin
        energy += 0.5 * car.tire_stiffness * max(car.free_radius - radius, 0.0) ** 2
        # force of the road in body axes
        fe = fx * te + fy * le + load * ne
        fn = fx * tn + fy * ln + load * nn
        fu = fx * tu + fy * lu + load * nu
        bx = r00 * fe + r10 * fn + r20 * fu
        by = r01 * fe + r11 * fn + r21 * fu
        bz = r02 * fe + r12 * fn + r22 * fu
        # spring, damper, roll bar, bump stop; links
        is_front = i < 2
        spring = car.front_spring if is_front else car.rear_spring
        damper = car.front_damper if is_front else car.rear_damper
        bar = (car.front_roll_bar if is_front else car.rear_roll_bar) / (car.track * car.track)
        other = state[TRAVEL + (i + 1 if i % 2 == 0 else i - 1)]
        strut = geometry[i, 3] + spring * travel + damper * travel_rate + bar * (travel - other)
        beyond = abs(travel) - car.bump_travel
        if beyond > 0:
            strut += car.bump_stop * beyond * (1.0 if travel > 0 else -1.0)
            energy += 0.5 * car.bump_stop * beyond * beyond
        center = car.front_roll_center if is_front else car.rear_roll_center
        link = (-1.0 if i % 2 == 0 else 1.0) * 2 * center / car.track * by
        link += (-car.anti_dive if is_front else car.anti_lift) * bx
        energy += travel * (geometry[i, 3] + 0.5 * spring * travel)
        energy += 0.25 * bar * (travel - other) * (travel - other)
        power -= damper * travel_rate * travel_rate
        power -= car.tire_damping * (ve * ne + vn * nn + vu * nu) ** 2
        energy += 0.5 * unsprung * vz * vz
        sum_x += bx
        sum_y += by
        sum_s += strut + link
        moment_x += y * (strut + link) - arm * by
        moment_y += arm * bx - x * (strut + link) - car.wheel_inertia * spin_up
        moment_z += x * by - y * bx
        out[TRAVEL + i] = travel_rate
        out[TRAVEL_RATE + i] = (bz - strut - link) / unsprung + gz
    # the front axle's own force bends its steering; one step old
    extras[EXTRAS + 1] = front_side

    wind_x = r00 * wind[0] + r10 * wind[1]
    wind_y = r01 * wind[0] + r11 * wind[1]
    air_x, air_y = u - wind_x, v - wind_y
    pressure = 0.5 * car.air_density * car.drag_area * np.sqrt(air_x * air_x + air_y * air_y)
    drag_x, drag_y = -pressure * air_x, -car.side_drag * pressure * air_y
    power += drag_x * u + drag_y * v
    ax = (sum_x + drag_x) / car.mass + gx
    ay = (sum_y + drag_y) / car.mass + gy
    az = sum_s / car.sprung_mass + gz
    for i in range(4):
        z = geometry[i, 2] + state[TRAVEL + i]
        moment_x -= z * unsprung * (gy - ay)
        moment_y += z * unsprung * (gx - ax)
    ix, iy, iz = car.roll_inertia, car.pitch_inertia, car.yaw_inertia
    p_dot = (moment_x - (iz - iy) * q * r) / ix
    q_dot = (moment_y - (ix - iz) * r * p) / iy
    r_dot = (moment_z - (iy - ix) * p * q) / iz
    for i in range(4):
        x, y = geometry[i, 0], geometry[i, 1]
        z = geometry[i, 2] + state[TRAVEL + i]
        out[TRAVEL_RATE + i] -= (
            az + p_dot * y - q_dot * x + r * p * x + r * q * y - (p * p + q * q) * z
        )
    out[POSITION] = r00 * u + r01 * v + r02 * w
    out[POSITION + 1] = r10 * u + r11 * v + r12 * w
    out[POSITION + 2] = r20 * u + r21 * v + r22 * w
    turn = q * sr + r * cr
    out[EULER] = p + sn / cn * turn
    out[EULER + 1] = q * cr - r * sr
    out[EULER + 2] = turn / cn
    out[VELOCITY] = ax - (q * w - r * v)
    out[VELOCITY + 1] = ay - (r * u - p * w)
    out[VELOCITY + 2] = az - (p * v - q * u)
    out[RATE], out[RATE + 1], out[RATE + 2] = p_dot, q_dot, r_dot
    out[STEER] = (command[0] - steer) / car.steering_lag
    out[DRIVE] = (command[1] - state[DRIVE]) / car.drive_lag
    out[BRAKE] = (command[2] - state[BRAKE]) / car.brake_lag
    ve, vn = out[POSITION], out[POSITION + 1]
    out[ALONG] = (ve * ch + vn * sh) / (1 - bend * aside)
    out[ASIDE] = -ve * sh + vn * ch

    extras[SPECIFIC] = ax - gx
    extras[SPECIFIC + 1] = ay - gy
    extras[SPECIFIC + 2] = az - gz
    extras[ANGULAR], extras[ANGULAR + 1], extras[ANGULAR + 2] = p_dot, q_dot, r_dot
    _, slope_e, slope_n = surface(road, along, aside, state[POSITION], state[POSITION + 1])
    norm = 1 / np.sqrt(1 + slope_e * slope_e + slope_n * slope_n)
    extras[NORMAL], extras[NORMAL + 1], extras[NORMAL + 2] = -slope_e * norm, -slope_n * norm, norm
    energy += 0.5 * car.mass * (u * u + v * v) + 0.5 * car.sprung_mass * w * w
    energy += 0.5 * (ix * p * p + iy * q * q + iz * r * r)
    extras[ENERGY] = energy + car.mass * G * state[POSITION + 2]
    extras[POWER] = power
