"""The car in the road's plane under its tire forces: equations that both layers of tfobe share.

Luo 2024, equations (2)-(5) and (12), corrected: docs/methods/common.md#planar-car.
Wheels in the order fl, fr, rl, rr.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.jit import compiled
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

MIN_LOAD = 100.0  # N; a lifted wheel must not divide by zero
PRINTED_DRAG_DIVISOR = 21.15  # eq. (4) means km/h but is fed m/s: drag 13 times too small


class PlanarCar(NamedTuple):
    """SI; drag in N s2/m2, dt the step in s."""

    mass: float
    yaw_inertia: float
    front: float  # CG to front axle
    rear: float
    track: float
    cg_height: float
    wheel_radius: float
    rolling_resistance: float
    drag: float
    dt: float


def planar_car(vehicle: Vehicle, dt: float, printed: bool = False) -> PlanarCar:
    """The model's parameters; `printed` leaves out what eqs. (4) and (5) leave out."""
    drag = 0.5 * vehicle.air_density * vehicle.drag_area
    return PlanarCar(
        mass=vehicle.mass,
        yaw_inertia=vehicle.yaw_inertia,
        front=vehicle.cg_to_front_axle,
        rear=vehicle.cg_to_rear_axle,
        track=vehicle.track,
        cg_height=vehicle.cg_height,
        wheel_radius=vehicle.wheel_radius,
        rolling_resistance=0.0 if printed else vehicle.rolling_resistance,
        drag=vehicle.drag_area / PRINTED_DRAG_DIVISOR if printed else drag,
        dt=dt,
    )


@compiled
def resultants(
    F: Floats, first: int, c: float, s: float, car: PlanarCar
) -> tuple[float, float, float]:
    """Longitudinal and lateral force in N and yaw moment in N m of the tires on the car.

    F: from `first` on 8 forces, longitudinal, then lateral ones in wheel axes. c, s: cosine and
    sine of the road wheels' angle, left +.
    """
    rear = first + 4
    front_x, front_y = F[first] + F[first + 1], F[rear] + F[rear + 1]
    rear_y = F[rear + 2] + F[rear + 3]
    force_x = front_x * c - front_y * s + F[first + 2] + F[first + 3]
    force_y = front_x * s + front_y * c + rear_y
    half = 0.5 * car.track
    moment = (
        car.front * (front_x * s + front_y * c)
        - half * ((F[first] - F[first + 1]) * c + F[first + 2] - F[first + 3])
        + half * (F[rear] - F[rear + 1]) * s
        - car.rear * rear_y
    )
    return force_x, force_y, moment


def steer(delta: Floats) -> Floats:
    """Cosine and sine of road wheel angles in rad, (n, 2): once a step, not at each sigma point."""
    return np.stack([np.cos(delta), np.sin(delta)], axis=1)


def wheel_loads(f_x: Floats, f_y: Floats, vehicle: Vehicle) -> Floats:
    """N, (n, 4), from the specific forces in the road's plane; eq. (12) without its cos(grade)."""
    m, h, wheelbase = vehicle.mass, vehicle.cg_height, vehicle.wheelbase
    length = m * h * f_x / (2 * wheelbase)
    lateral = m * h * f_y / (wheelbase * vehicle.track)
    front, rear = vehicle.cg_to_rear_axle, vehicle.cg_to_front_axle  # lever of the other axle
    static = m * G / (2 * wheelbase)
    return np.stack(
        [
            static * front - length - lateral * front,
            static * front - length + lateral * front,
            static * rear + length - lateral * rear,
            static * rear + length + lateral * rear,
        ],
        axis=1,
    )
