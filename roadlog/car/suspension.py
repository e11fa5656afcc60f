"""The body on its springs, from the vehicle file or from cars in general.

Source: docs/methods/fusion.md#body-angles.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.units import STANDARD_GRAVITY as G

# Hz, damping ratio, where the vehicle file says nothing
PITCH_MODE = (1.4, 0.37)  # of body pitch
ROLL_MODE = (1.65, 0.34)  # of body roll
TIRE_MODE = (8.0, 0.7)  # of the rear slip behind the lateral force
LINEAR_TIRES = 5.0  # m/s2, lateral specific force up to which tires are linear
REFERENCE_HEIGHT = 0.08  # m over the ground, of the reference point when the IMU position is known
DASHBOARD_HEIGHT = 0.75  # m over the ground, of an IMU whose position is not known
SAME_GRADIENT = 0.01  # a roll gradient this near m h / k was computed, not measured


def body_mode(vehicle: Vehicle, axis: Literal["pitch", "roll"]) -> tuple[float, float]:
    """J in s2 and c in s of the body's balance of moments, J angle'' + c angle' + angle = K f.

    Inertia, stiffness and damping of the vehicle file where it has them. The specific force is
    that of the reference point: a body that turns about it also swings its mass.
    """
    if axis == "pitch":
        frequency, ratio = PITCH_MODE
        arm = vehicle.cg_height - REFERENCE_HEIGHT
    else:
        frequency, ratio = ROLL_MODE
        arm = vehicle.roll_arm
    names = f"{axis}_inertia", f"{axis}_stiffness", f"{axis}_damping"
    w = 2 * np.pi * frequency
    inertia, lag = 1 / w**2, 2 * ratio / w
    of_body, stiffness, damping = (getattr(vehicle, name) for name in names)
    if stiffness is not None and vehicle.source(names[0]).kind != "default":
        swing = vehicle.mass * arm**2 if vehicle.imu_position is not None else 0.0
        inertia = (of_body + swing) / stiffness
        lag = 2 * ratio * np.sqrt(inertia)
    if stiffness is not None and damping is not None:
        lag = damping / stiffness
    return inertia, lag


def roll_gradient(vehicle: Vehicle) -> float:
    """rad/(m/s2), body roll per lateral specific force in the road's plane.

    m h / k is per force along the body's own axis, which the roll itself increases by g K.
    """
    gain = vehicle.roll_gain
    if vehicle.roll_stiffness is None:
        return gain
    of_body = vehicle.mass * vehicle.roll_arm / vehicle.roll_stiffness
    return gain / (1 - G * gain) if abs(gain / of_body - 1) < SAME_GRADIENT else gain


def knows_springs(vehicle: Vehicle, axis: str) -> bool:
    """Whether the vehicle file tells how far the body turns under a force."""
    names = f"{axis}_gradient", f"{axis}_stiffness"
    return any(getattr(vehicle, name) is not None for name in names)
