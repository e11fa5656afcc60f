"""One wheel of the simulated car: contact with the road, tire, spin and brake, strut.

Tires with relaxation lengths, load sensitivity and combined slip; brakes with dry friction that
truly hold (Dahl); docs/simulator.md.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.jit import compiled
from roadlog.simulate.car import (
    ALONG,
    ASIDE,
    BODY_RATE,
    BRAKE,
    DRIVE,
    FORCE_X,
    FORCE_Y,
    FORCE_Z,
    POSITION,
    SLIP,
    SLIP_ANGLE,
    SPIN,
    STUCK,
    TRAVEL,
    TRAVEL_RATE,
    VELOCITY,
    CarParameters,
)
from roadlog.simulate.frames import BodyAxes, Centerline, to_road
from roadlog.simulate.road import RoadTables, friction_at, roughness_at, surface
from roadlog.types import Floats

# Tire shape: CommonRoad parameters_vehicle2; docs/simulator.md#tires
NOMINAL_LOAD = 4500.0  # N
DAMPED_BELOW = 2.0  # m/s; the relaxed slips oscillate at a crawl
SLIP_DAMPING = 0.02  # s/m
MAX_CREEP = 5.0  # rad/s; a sliding brake winds up within a step, however fast


@compiled
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


class Contact(NamedTuple):
    """Where a wheel meets the road. n: normal; v: velocity of the contact point, east north up."""

    arm: float  # m, contact point over the CG, in body axes
    radius: float  # m
    ne: float
    nn: float
    nu: float
    ve: float
    vn: float
    vu: float
    heave: float  # m/s, of the wheel along the body's z
    approach: float  # m/s, along the normal, away from the road
    load: float  # N
    grip: float


class Tread(NamedTuple):
    """Axes of a tire on the road, east north up: t where it rolls to, l to its left."""

    te: float
    tn: float
    tu: float
    le: float
    ln: float
    lu: float
    along: float  # m/s, of the contact point along t
    aside: float  # and along l


@compiled
def contact(
    i: int,
    state: Floats,
    axes: BodyAxes,
    lane: Centerline,
    car: CarParameters,
    geometry: Floats,
    road: RoadTables,
) -> Contact:
    """Wheel i on the road: lever, normal, velocity, load and grip."""
    u, v, w = state[VELOCITY], state[VELOCITY + 1], state[VELOCITY + 2]
    p, q, r = state[BODY_RATE], state[BODY_RATE + 1], state[BODY_RATE + 2]
    along, aside = state[ALONG], state[ASIDE]
    x, y = geometry[i, 0], geometry[i, 1]
    z = geometry[i, 2] + state[TRAVEL + i]
    east, north, up = to_road(axes, x, y, z)
    ahead, left = east * lane.cos + north * lane.sin, -east * lane.sin + north * lane.cos
    s = along + ahead / (1 - lane.curvature * aside)
    n = aside + left - 0.5 * lane.curvature * ahead * ahead
    height, slope_e, slope_n = surface(
        road, s, n, state[POSITION] + east, state[POSITION + 1] + north
    )
    height += roughness_at(road, s, i % 2 == 0)
    norm = 1 / np.sqrt(1 + slope_e * slope_e + slope_n * slope_n)
    ne, nn, nu = -slope_e * norm, -slope_n * norm, norm
    radius = (state[POSITION + 2] + up - height) * nu
    arm = z - radius
    heave = w + p * y - q * x + state[TRAVEL_RATE + i]
    ve, vn, vu = to_road(axes, u + q * arm - r * y, v + r * x - p * arm, heave)
    approach = ve * ne + vn * nn + vu * nu
    load = car.tire_stiffness * (car.free_radius - radius) - car.tire_damping * approach
    return Contact(
        arm,
        radius,
        ne,
        nn,
        nu,
        ve,
        vn,
        vu,
        heave,
        approach,
        max(load, 0.0),
        friction_at(road, s),
    )


@compiled
def steered(i: int, steer: float, y: float, front_side: float, car: CarParameters) -> float:
    """rad, angle of wheel i: Ackermann, compliance under the axle's lateral force, toe."""
    if i >= 2:
        return 0.0
    wheelbase = car.cg_to_front_axle + car.cg_to_rear_axle
    side = 1.0 if i == 0 else -1.0
    tangent = np.tan(steer)
    return (
        np.arctan(tangent / (1 - car.ackermann * y * tangent / wheelbase))
        - car.steering_compliance * front_side
        - side * car.toe
    )


@compiled
def tread(angle: float, axes: BodyAxes, at: Contact) -> Tread:
    """Axes and sliding of a tire that is steered by `angle` rad, in the road's plane."""
    ca, sa = np.cos(angle), np.sin(angle)
    he, hn, hu = (
        axes.xe * ca + axes.ye * sa,
        axes.xn * ca + axes.yn * sa,
        axes.xu * ca + axes.yu * sa,
    )
    inward = he * at.ne + hn * at.nn + hu * at.nu
    te, tn, tu = he - inward * at.ne, hn - inward * at.nn, hu - inward * at.nu
    norm = 1 / np.sqrt(te * te + tn * tn + tu * tu)
    te, tn, tu = te * norm, tn * norm, tu * norm
    le, ln, lu = at.nn * tu - at.nu * tn, at.nu * te - at.ne * tu, at.ne * tn - at.nn * te
    along = at.ve * te + at.vn * tn + at.vu * tu
    aside = at.ve * le + at.vn * ln + at.vu * lu
    return Tread(te, tn, tu, le, ln, lu, along, aside)


@compiled
def wheel(
    i: int,
    state: Floats,
    at: Contact,
    sole: Tread,
    ratio: float,
    car: CarParameters,
    out: Floats,
    extras: Floats,
) -> tuple[float, float, float, float]:
    """Forces of wheel i along and to the left, J stored, W; derivatives of slips, spin, brake."""
    spin, stuck = state[SPIN + i], state[STUCK + i]
    rim = car.effective_radius * spin
    slide = sole.along - rim
    slow = abs(sole.along)
    out[SLIP + i] = (-slide - slow * state[SLIP + i]) / car.longitudinal_relaxation
    out[SLIP_ANGLE + i] = (-sole.aside - slow * state[SLIP_ANGLE + i]) / car.lateral_relaxation
    damping = 0.0
    if slow < DAMPED_BELOW:
        damping = SLIP_DAMPING * 0.5 * (1 + np.cos(np.pi * slow / DAMPED_BELOW))
    fx, fy = tire(
        state[SLIP + i] - damping * slide,
        state[SLIP_ANGLE + i] - damping * sole.aside,
        at.load,
        at.grip,
    )
    extras[FORCE_X + i], extras[FORCE_Y + i], extras[FORCE_Z + i] = fx, fy, at.load
    share = (car.front_drive if i < 2 else 1 - car.front_drive) / 2
    drive = share * state[DRIVE] if ratio > 0.0 else 0.0
    clamp = (car.front_brake if i < 2 else 1 - car.front_brake) / 2 * max(state[BRAKE], 0.0)
    creep = MAX_CREEP * np.tanh(spin / MAX_CREEP)
    out[STUCK + i] = (creep - abs(creep) * stuck) / car.brake_windup
    brake = clamp * stuck
    rolling = car.rolling_resistance * at.load * car.effective_radius * np.tanh(rim / 0.05)
    inertia = car.wheel_inertia + car.engine_inertia * ratio * ratio * share
    out[SPIN + i] = (drive - brake - car.effective_radius * fx - rolling) / inertia
    energy = 0.5 * inertia * spin * spin
    energy += 0.5 * car.tire_stiffness * max(car.free_radius - at.radius, 0.0) ** 2
    power = (drive - brake - rolling) * spin + fx * slide + fy * sole.aside
    return fx, fy, energy, power - car.tire_damping * at.approach**2


@compiled
def strut(
    i: int, state: Floats, bx: float, by: float, car: CarParameters, geometry: Floats
) -> tuple[float, float, float, float]:
    """N that spring, damper, roll bar and bump stop of wheel i lift with, and its links under the
    road's force bx, by; J stored, W."""
    is_front = i < 2
    travel, travel_rate = state[TRAVEL + i], state[TRAVEL_RATE + i]
    spring = car.front_spring if is_front else car.rear_spring
    damper = car.front_damper if is_front else car.rear_damper
    bar = (car.front_roll_bar if is_front else car.rear_roll_bar) / (car.track * car.track)
    other = state[TRAVEL + (i + 1 if i % 2 == 0 else i - 1)]
    force = geometry[i, 3] + spring * travel + damper * travel_rate + bar * (travel - other)
    energy = travel * (geometry[i, 3] + 0.5 * spring * travel)
    energy += 0.25 * bar * (travel - other) * (travel - other)
    beyond = abs(travel) - car.bump_travel
    if beyond > 0:
        force += car.bump_stop * beyond * (1.0 if travel > 0 else -1.0)
        energy += 0.5 * car.bump_stop * beyond * beyond
    center = car.front_roll_center if is_front else car.rear_roll_center
    link = (-1.0 if i % 2 == 0 else 1.0) * 2 * center / car.track * by
    link += (-car.anti_dive if is_front else car.anti_lift) * bx
    return force, link, energy, -damper * travel_rate * travel_rate
