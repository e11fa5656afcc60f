"""What lies in the car: its mass moves the CG, bends the springs and tilts the body."""

from __future__ import annotations

import numpy as np

from roadlog.simulate.car import CarParameters
from roadlog.simulate.scenario import Load
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

STATIC_ITERATIONS = 20  # each leaves a twentieth of the error


def cg_shift(car: CarParameters, load: Load | None) -> Floats:
    """m, (3,) by which a load moves the sprung CG, vehicle axes."""
    if load is None:
        return np.zeros(3)
    return np.array(load.position) * load.mass / (car.sprung_mass + load.mass)


def loaded_car(car: CarParameters, load: Load | None) -> tuple[CarParameters, Floats]:
    """The car with its load, and per wheel: x, y, center's height from the CG, spring force.

    The springs are those of the empty car: they stand where the empty car is level.
    """
    x, y, z = cg_shift(car, load)
    wheelbase = car.cg_to_front_axle + car.cg_to_rear_axle
    geometry = np.empty((4, 4))
    for i in range(4):
        at_x = car.cg_to_front_axle if i < 2 else -car.cg_to_rear_axle
        arm = car.cg_to_rear_axle if i < 2 else car.cg_to_front_axle
        at_y = car.track / 2 * (1 if i % 2 == 0 else -1)
        spring = car.sprung_mass * G * arm / wheelbase / 2
        rest = -(car.sprung_cg_height - car.effective_radius) - z
        geometry[i] = at_x - x, at_y - y, rest, spring
    if load is None:
        return car, geometry
    # parallel axes: the load is a point, the sum turns about the common CG
    reduced = car.sprung_mass * load.mass / (car.sprung_mass + load.mass)
    lx, ly, lz = load.position
    loaded = car._replace(
        mass=car.mass + load.mass,
        sprung_mass=car.sprung_mass + load.mass,
        cg_to_front_axle=car.cg_to_front_axle - x,
        cg_to_rear_axle=car.cg_to_rear_axle + x,
        sprung_cg_height=car.sprung_cg_height + z,
        roll_inertia=car.roll_inertia + reduced * (ly**2 + lz**2),
        pitch_inertia=car.pitch_inertia + reduced * (lx**2 + lz**2),
        yaw_inertia=car.yaw_inertia + reduced * (lx**2 + ly**2),
    )
    return loaded, geometry


def static_pitch(car: CarParameters, load: Load | None) -> float:
    """rad, nose up, of the car at rest on a level road: springs and tires in series.

    With the tilt the CG moves over the axles and the links carry a part of the weight, so the
    equilibrium is found by iteration.
    """
    loaded, geometry = loaded_car(car, load)
    unsprung = (car.mass - car.sprung_mass) / 4
    wheelbase = car.cg_to_front_axle + car.cg_to_rear_axle
    pitch = 0.0
    for _ in range(STATIC_ITERATIONS):
        lean = loaded.sprung_cg_height * pitch
        heights = []
        for i, arm, link, spring in (
            (0, loaded.cg_to_rear_axle - lean, car.anti_dive, car.front_spring),
            (2, loaded.cg_to_front_axle + lean, -car.anti_lift, car.rear_spring),
        ):
            force = loaded.sprung_mass * G * arm / wheelbase / 2
            tire = (force + unsprung * G) / car.tire_stiffness
            over = force * (1 + link * pitch) - geometry[i, 3]
            stop = spring * car.bump_travel
            beyond = max(over - stop, 0.0)
            travel = min(over, stop) / spring + beyond / (spring + car.bump_stop)
            heights.append(-tire - travel)
        pitch = float(np.arctan((heights[0] - heights[1]) / wheelbase))
    return pitch
