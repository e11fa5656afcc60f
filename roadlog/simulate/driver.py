"""Driver: steers along the road, keeps the speed, brakes, waits at stops and shifts gears.

Source: docs/simulator.md#driver.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.jit import compiled
from roadlog.simulate.car import (
    ALONG,
    ASIDE,
    BODY_RATE,
    DRIVE,
    EULER,
    VELOCITY,
    CarParameters,
)
from roadlog.simulate.road import RoadTables, curvature_at, heading_at, slope_at
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

PERIOD = 0.01  # s, between two decisions

RATIOS = np.array([3.90, 2.19, 1.41, 1.00, 0.81])  # of the gearbox
SECOND = 1
SHIFT_UP = np.array([5.5, 10.0, 18.5, 26.0])  # m/s
SHIFT_DOWN = np.array([3.0, 7.0, 14.0, 21.0])  # m/s
SHIFT_TIME = 0.7  # s without torque demand
SHIFT_OPEN = (0.25, 0.55)  # s into the shift, between which the clutch is open


class DriverParameters(NamedTuple):
    """Gains: docs/simulator.md#driver."""

    speed_gain: float = 1.5  # 1/s
    speed_integral: float = 0.6  # 1/s2
    integral_limit: float = 3.0  # m
    preview: float = 0.15  # s
    understeer: float = 0.0025  # rad/(m/s2), of wheel angle per lateral acceleration
    offset_gain: float = 0.02  # rad/m
    heading_gain: float = 0.35
    gain_speed: tuple[float, float] = (10.0, 2.0)  # m/s: gains fall as 10 / (v + 2)
    yaw_damping: float = 0.02  # s
    engine_drag: float = -120.0  # N m at the axle; below it the brakes help
    engine_limit: float = 450.0  # N m, where gears are shifted; without, second gear does it all
    hold_torque: float = 1500.0  # N m
    stop_speed: float = 0.25  # m/s, below which a stopping driver holds the brake
    release: float = 0.9  # share of the slope's pull that the engine must carry before release


# The driver's memory
INTEGRAL, HOLDING, GEAR, NEXT_GEAR, SHIFTING = 0, 1, 2, 3, 4  # m, 0/1, index, index, s left
MEMORY = 5


@compiled
def steer_along(
    state: Floats, driver: DriverParameters, car: CarParameters, road: RoadTables
) -> float:
    """rad, road wheel angle that the driver asks for."""
    u, v, r = state[VELOCITY], state[VELOCITY + 1], state[BODY_RATE + 2]
    along = state[ALONG]
    bend = curvature_at(road, along + driver.preview * u)
    wheelbase = car.cg_to_front_axle + car.cg_to_rear_axle
    ahead = state[EULER + 2] - heading_at(road, along)
    if u > 0.1:
        ahead += np.arctan2(v, u)
    error = driver.offset_gain * state[ASIDE] + driver.heading_gain * ahead
    gain = driver.gain_speed[0] / (max(u, 0.0) + driver.gain_speed[1])
    angle = wheelbase * bend + driver.understeer * u * u * bend - error * gain
    return angle - driver.yaw_damping * (r - u * bend)


@compiled
def decide(
    state: Floats,
    memory: Floats,
    v_ref: float,
    a_ref: float,
    gears: bool,
    driver: DriverParameters,
    car: CarParameters,
    road: RoadTables,
    command: Floats,
) -> None:
    """Drive torque, brake torque and gearbox ratio into command[1:]; once every PERIOD."""
    v = state[VELOCITY]
    radius = car.effective_radius
    pull = G * np.sin(np.arctan(slope_at(road, state[ALONG])))
    stands = v_ref < 1e-3
    if stands and abs(v) < driver.stop_speed:
        memory[HOLDING] = 1.0
    if memory[HOLDING] > 0.0 and stands:
        memory[INTEGRAL] = 0.0
        command[1], command[2] = 0.0, driver.hold_torque
        if gears:
            memory[GEAR] = memory[NEXT_GEAR] = 0.0
            memory[SHIFTING] = 0.0
        command[3] = RATIOS[int(memory[GEAR])]
        return
    if memory[HOLDING] > 0.0 and memory[INTEGRAL] == 0.0:  # a hill start begins with its pull
        limit = driver.integral_limit
        memory[INTEGRAL] = min(limit, max(-limit, pull / driver.speed_integral))
    error = v_ref - v
    force = car.mass * (
        a_ref + driver.speed_gain * error + driver.speed_integral * memory[INTEGRAL]
    )
    memory[INTEGRAL] += error * PERIOD
    memory[INTEGRAL] = min(driver.integral_limit, max(-driver.integral_limit, memory[INTEGRAL]))
    torque = force * radius
    drag = driver.engine_drag * min(1.0, max(v, 0.0) / 2.0)
    command[1] = max(torque, drag)
    command[2] = max(drag - torque, 0.0)
    if memory[HOLDING] > 0.0:
        if state[DRIVE] >= driver.release * car.mass * pull * radius:
            memory[HOLDING] = 0.0
        else:
            command[2] = driver.hold_torque
    if gears:
        _shift(memory, v, command)
        limit = driver.engine_limit * command[3] * car.final_drive * car.driveline_efficiency
        command[1] = min(command[1], limit)
    else:
        command[3] = RATIOS[SECOND]


@compiled
def _shift(memory: Floats, v: float, command: Floats) -> None:
    gear = int(memory[GEAR])
    if memory[SHIFTING] <= 0.0:
        if gear < len(SHIFT_UP) and v > SHIFT_UP[gear]:
            memory[NEXT_GEAR], memory[SHIFTING] = gear + 1.0, SHIFT_TIME
        elif gear > 0 and v < SHIFT_DOWN[gear - 1]:
            memory[NEXT_GEAR], memory[SHIFTING] = gear - 1.0, SHIFT_TIME
    command[3] = RATIOS[gear]
    if memory[SHIFTING] > 0.0:
        into = SHIFT_TIME - memory[SHIFTING]
        memory[SHIFTING] -= PERIOD
        command[1] = 0.0
        if into >= SHIFT_OPEN[1]:
            memory[GEAR] = memory[NEXT_GEAR]
            command[3] = RATIOS[int(memory[GEAR])]
        elif into >= SHIFT_OPEN[0]:
            command[3] = 0.0
