"""The full car on a road: from a scenario to its motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.jit import compiled
from roadlog.rotation import from_rpy
from roadlog.signals import WHEELS
from roadlog.simulate import car as c
from roadlog.simulate.car import CarParameters
from roadlog.simulate.driver import (
    GEAR,
    MEMORY,
    NEXT_GEAR,
    PERIOD,
    SECOND,
    DriverParameters,
    decide,
    steer_along,
)
from roadlog.simulate.dynamics import derivative
from roadlog.simulate.load import cg_shift, loaded_car, static_pitch
from roadlog.simulate.motion import Motion
from roadlog.simulate.profiles import sampled
from roadlog.simulate.road import RoadTables, build, surface
from roadlog.simulate.sampling import gauss_markov, stream
from roadlog.simulate.scenario import Scenario, Wind, distance_of, speed_of
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

DT = 0.002  # s, of integration and of the motion; docs/simulator.md#integration
ROOM = 100.0  # m of road beyond the reference drive's end

# The columns of the history that `integrate` returns.
EXTRA = c.STATES  # after the state
RATIO = EXTRA + c.EXTRAS
COLUMNS = RATIO + 1


def drive_full(
    scenario: Scenario, seed: int, car: CarParameters | None = None, dt: float = DT
) -> Motion:
    """Drive a scenario with the full car; the log's time 0 comes after the lead-in."""
    car = car or CarParameters()
    rng = stream(seed, "scenario")
    profile, duration = speed_of(scenario, rng)
    steps = round((scenario.lead_in + duration) / PERIOD)
    time: Floats = np.multiply(np.arange(steps + 1), PERIOD) - scenario.lead_in
    v_ref = sampled(profile, time)
    v_ref = np.where(v_ref < 1e-6, 0.0, v_ref)
    start = scenario.start + distance_of(time, v_ref) - distance_of(time, v_ref)[0]
    road = build(scenario.road, start[-1] + ROOM, start, time, stream(seed, "road"))
    loaded, geometry = loaded_car(car, scenario.load)
    table = steering(scenario, time)
    history = integrate(
        first_state(road, scenario.start, v_ref[0], loaded, geometry),
        v_ref,
        np.gradient(v_ref, PERIOD),
        table,
        wind(scenario.wind, len(time), stream(seed, "wind")),
        round(PERIOD / dt),
        dt,
        scenario.gears,
        scenario.steering is not None,
        DriverParameters(hold_torque=scenario.hold_torque),
        loaded,
        geometry,
        road,
    )
    fine: Floats = np.multiply(np.arange(len(history)), dt) - scenario.lead_in
    begin = round(scenario.lead_in / dt)
    shift = cg_shift(car, scenario.load)
    motion = _motion(fine[begin:], history[begin:], loaded, static_pitch(car, scenario.load), shift)
    return replace(motion, home=scenario.road.home)


def steering(scenario: Scenario, time: Floats) -> Floats:
    """rad, open-loop steering angle over time; zeros when the driver steers."""
    chirp = scenario.steering
    if chirp is None:
        return np.zeros(len(time))
    t = np.clip(time, 0.0, chirp.duration)
    sweep = (chirp.last - chirp.first) / chirp.duration
    angle = chirp.amplitude * np.sin(2 * np.pi * (chirp.first * t + 0.5 * sweep * t * t))
    return np.where(time < chirp.duration, angle, 0.0)


def wind(wind: Wind, count: int, rng: np.random.Generator) -> Floats:
    """(count, 2) m/s to the east and north, every PERIOD."""
    mean = wind.speed * np.array([np.cos(wind.direction), np.sin(wind.direction)])
    gusts = wind.gust_sd * gauss_markov(rng, count, 2, wind.gust_time / PERIOD)
    result: Floats = mean + gusts
    return result


def first_state(
    road: RoadTables, start: float, speed: float, car: CarParameters, geometry: Floats
) -> Floats:
    """Near rest on its springs, along the road, rolling; the lead-in settles the rest."""
    state = np.zeros(c.STATES)
    k = int(start / road.step)
    arc = np.arange(k + 1) * road.step
    # the middle line begins at the origin; short of a table's step beyond that is straight
    x = float(np.sum(np.cos(road.heading[:k])) * road.step + start - arc[-1])
    y = float(np.sum(np.sin(road.heading[:k])) * road.step)
    height, east, north = surface(road, start, 0.0, x, y)
    heading = float(road.heading[k])
    along = east * np.cos(heading) + north * np.sin(heading)
    across = -east * np.sin(heading) + north * np.cos(heading)
    load = car.mass * G / 4
    up = car.free_radius - load / car.tire_stiffness - geometry[0, 2]
    nose = -np.arctan(along)
    roll = np.arctan(across * np.cos(nose))
    normal = np.array([-east, -north, 1.0]) / np.sqrt(1 + east**2 + north**2)
    state[c.POSITION : c.POSITION + 3] = np.array([x, y, height]) + up * normal
    state[c.EULER : c.EULER + 3] = roll, nose, heading
    state[c.VELOCITY] = speed
    state[c.SPIN : c.SPIN + 4] = speed / car.effective_radius
    state[c.ALONG] = start
    return state


@compiled
def _moved(state: Floats, step: float, slope: Floats, ahead: Floats) -> None:
    """state + step slope into `ahead`."""
    for j in range(len(state)):
        ahead[j] = state[j] + step * slope[j]


@compiled
def integrate(
    state: Floats,
    v_ref: Floats,
    a_ref: Floats,
    steer_ref: Floats,
    wind: Floats,
    substeps: int,
    dt: float,
    gears: bool,
    open_loop: bool,
    driver: DriverParameters,
    car: CarParameters,
    geometry: Floats,
    road: RoadTables,
) -> Floats:
    """(n, COLUMNS) history by Runge-Kutta of fourth order; decisions every `substeps` steps."""
    decisions = len(v_ref) - 1
    history = np.empty((decisions * substeps + 1, COLUMNS))
    state = state.copy()
    memory = np.zeros(MEMORY)
    memory[GEAR] = memory[NEXT_GEAR] = 0 if gears else SECOND
    command = np.zeros(4)
    extras = np.zeros(c.EXTRAS + 2)
    scratch = np.zeros(c.EXTRAS + 2)
    k1, k2, ahead = np.zeros(c.STATES), np.zeros(c.STATES), np.zeros(c.STATES)
    k3, k4 = np.zeros(c.STATES), np.zeros(c.STATES)
    row = 0
    for k in range(decisions + 1):
        if k < len(v_ref):
            decide(state, memory, v_ref[k], a_ref[k], gears, driver, car, road, command)
            if open_loop:
                command[0] = steer_ref[k]
            else:
                command[0] = steer_along(state, driver, car, road)
        gust = wind[k]
        for _ in range(substeps):
            derivative(state, command, gust, car, geometry, road, k1, extras)
            for j in range(c.STATES):
                history[row, j] = state[j]
            for j in range(c.EXTRAS):
                history[row, EXTRA + j] = extras[j]
            history[row, RATIO] = command[3]
            row += 1
            if k == decisions:
                return history
            scratch[c.EXTRAS] = extras[c.EXTRAS]
            _moved(state, 0.5 * dt, k1, ahead)
            derivative(ahead, command, gust, car, geometry, road, k2, scratch)
            _moved(state, 0.5 * dt, k2, ahead)
            derivative(ahead, command, gust, car, geometry, road, k3, scratch)
            _moved(state, dt, k3, ahead)
            derivative(ahead, command, gust, car, geometry, road, k4, scratch)
            for j in range(c.STATES):
                state[j] += dt / 6 * (k1[j] + 2 * k2[j] + 2 * k3[j] + k4[j])
            extras[c.EXTRAS] = extras[c.EXTRAS + 1]
    return history


def _motion(
    time: Floats, history: Floats, car: CarParameters, pitch_at_rest: float, shift: Floats
) -> Motion:
    """Truth from the history; docs/methods/common.md#symbols-and-signs."""
    state, extra = history[:, :EXTRA], history[:, EXTRA:RATIO]
    roll, nose, yaw = state[:, c.EULER : c.EULER + 3].T
    attitude = from_rpy(roll, nose, yaw)
    normal = extra[:, c.NORMAL : c.NORMAL + 3]
    x_b, y_b = attitude[:, :, 0], attitude[:, :, 1]
    along = x_b - np.sum(x_b * normal, axis=1)[:, None] * normal
    along /= np.linalg.norm(along, axis=1)[:, None]
    across = np.cross(normal, along)
    angles = {
        "grade": np.arcsin(along[:, 2]),
        "bank": np.arcsin(across[:, 2]),
        "pitch": np.arcsin(np.sum(x_b * normal, axis=1)),
        "roll": np.arcsin(np.sum(y_b * normal, axis=1)),
        "inclination": np.arcsin(x_b[:, 2]),
        "roll_total": np.arcsin(y_b[:, 2]),
    }
    velocity = state[:, c.VELOCITY : c.VELOCITY + 3]
    rate = state[:, c.BODY_RATE : c.BODY_RATE + 3]
    ratio, brake = history[:, RATIO], state[:, c.BRAKE]
    drive = np.where(ratio > 0, state[:, c.DRIVE], 0.0)
    gearing = ratio * car.final_drive * car.driveline_efficiency
    engine = np.where(ratio > 0, drive / np.where(ratio > 0, gearing, 1.0), 0.0)
    drive_share = np.array([car.front_drive] * 2 + [1 - car.front_drive] * 2) / 2
    brake_share = np.array([car.front_brake] * 2 + [1 - car.front_brake] * 2) / 2
    signals = {
        "speed.v": np.sum(np.einsum("nij,nj->ni", attitude, velocity) * along, axis=1),
        "steering.road_wheel_angle": state[:, c.STEER],
        "powertrain.engine_torque": engine,
        "powertrain.gear_ratio": ratio,
        "powertrain.drive_force": (drive - brake) / car.effective_radius,
    }
    for i, wheel in enumerate(WHEELS):
        signals[f"wheel_speeds.{wheel}"] = car.effective_radius * state[:, c.SPIN + i]
        signals[f"wheel_torques.drive_{wheel}"] = drive_share[i] * drive
        signals[f"wheel_torques.brake_{wheel}"] = brake_share[i] * np.maximum(brake, 0.0)
    force = extra[:, c.SPECIFIC : c.SPECIFIC + 3]
    return Motion(
        time,
        force,
        rate,
        extra[:, c.ANGULAR : c.ANGULAR + 3],
        angles,
        signals,
        _details(state, extra, pitch_at_rest, yaw),
        state[:, c.POSITION : c.POSITION + 3],
        np.einsum("nij,nj->ni", attitude, velocity),
        attitude,
        shift=tuple(shift),
        energy=extra[:, c.ENERGY],
        power=extra[:, c.POWER],
    )


def _details(
    state: Floats, extra: Floats, pitch_at_rest: float, yaw: Floats
) -> dict[str, tuple[str, dict[str, Floats]]]:
    """Truth channels beside the angles."""
    forces = {}
    for i, wheel in enumerate(WHEELS):
        forces[f"fx_{wheel}"] = extra[:, c.FORCE_X + i]
        forces[f"fy_{wheel}"] = extra[:, c.FORCE_Y + i]
        forces[f"fz_{wheel}"] = extra[:, c.FORCE_Z + i]
    forces["fy_front"] = forces["fy_fl"] + forces["fy_fr"]
    forces["fy_rear"] = forces["fy_rl"] + forces["fy_rr"]
    unknown = np.full(len(state), np.nan)
    forces |= {f"{name}_sd": unknown for name in forces}
    v_x, v_y = state[:, c.VELOCITY], state[:, c.VELOCITY + 1]
    sideslip = {
        "beta": np.where(np.abs(v_x) > 0.1, np.arctan2(v_y, v_x), np.nan),
        "beta_sd": unknown,
        "v_x": v_x,
        "v_y": v_y,
    }
    motion = {
        "force_x": extra[:, c.SPECIFIC],
        "force_y": extra[:, c.SPECIFIC + 1],
        "force_z": extra[:, c.SPECIFIC + 2],
        "rate_x": state[:, c.BODY_RATE],
        "rate_y": state[:, c.BODY_RATE + 1],
        "rate_z": state[:, c.BODY_RATE + 2],
        "x": state[:, c.POSITION],
        "y": state[:, c.POSITION + 1],
        "z": state[:, c.POSITION + 2],
        "heading": yaw,
        "distance": state[:, c.ALONG],
        "offset": state[:, c.ASIDE],
        "static_pitch": np.full(len(state), pitch_at_rest),
    }
    return {
        "tire_forces": ("TireForces", forces),
        "sideslip": ("Sideslip", sideslip),
        "motion": ("CarMotion", motion),
    }
