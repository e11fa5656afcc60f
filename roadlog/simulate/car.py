"""The simulated car: its parameters and its state; docs/simulator.md."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.car.vehicle import Vehicle

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
POSITION, EULER, VELOCITY, BODY_RATE = 0, 3, 6, 9  # of the sprung CG; roll, pitch, yaw; body axes
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
