"""Speed of the center of gravity along and across the road, from wheels that slip, steer and rock.

Source: docs/methods/common.md#road-speed.
"""

from __future__ import annotations

import numpy as np

from roadlog.car.driveline import DRIVE_ROLES, driveline, free_wheel_speed, undriven_axle
from roadlog.car.lever_arm import specific_force_at_cg
from roadlog.car.planar_car import MIN_LOAD, wheel_loads
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.once import once
from roadlog.signals import WHEELS
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

SLIP_STIFFNESS = 22.3  # -, tire force per load and slip; docs/references.md#commonroad, K_x
MAX_SLIP = 0.1  # - and rad, up to which a force is in proportion to its slip
MAX_PITCH_RATE = 0.5  # rad/s; no body on wheels pitches faster


@once
def road_speed(drive: Drive, vehicle: Vehicle) -> Floats:
    """m/s of the center of gravity along the body's x axis, which is what forces accelerate.

    The undriven wheels' rolling speed, less their slip by brakes and rolling resistance; where they
    steer, turned back by their angle less their slip angle; and with h w_y, by which the CG swings
    over the tires as the body pitches. What the drive did not measure counts as zero. Without
    undriven wheels the speed is taken as it is.
    """
    speed = free_wheel_speed(drive, vehicle)
    axle = undriven_axle(drive, vehicle)
    if axle is None:
        return speed
    force = specific_force_at_cg(drive, vehicle.imu_position)
    speed = speed / (1 + _slip(drive, vehicle, axle, force.x))
    if axle == "front":
        alpha = np.nan_to_num(force.y * (1 - G * vehicle.roll_gain)) * _front_compliance(vehicle)
        alpha = np.clip(alpha, -MAX_SLIP, MAX_SLIP)
        delta = np.nan_to_num(drive.get("steering.road_wheel_angle"))
        speed = speed * np.cos(delta - alpha) / np.cos(alpha)
    pitch_rate = drive.get("imu.gyro_y")
    plausible = np.abs(pitch_rate) <= MAX_PITCH_RATE
    return speed + vehicle.cg_height * np.where(plausible, pitch_rate, 0.0)


def _slip(drive: Drive, vehicle: Vehicle, axle: str, f_x: Floats) -> Floats:
    """Slip (R w - v) / v of an undriven axle by its torque; 0 where that is not known."""
    if not any(role in drive for role in DRIVE_ROLES):
        return np.zeros(len(drive))
    wheels = [k for k, wheel in enumerate(WHEELS) if wheel[0] == axle[0]]
    in_plane = np.nan_to_num(f_x) * (1 - G * vehicle.pitch_gain)
    load = wheel_loads(in_plane, np.zeros(len(drive)), vehicle)[:, wheels].sum(axis=1)
    load = np.maximum(load, MIN_LOAD)
    braking = driveline(drive, vehicle).brake[:, wheels].sum(axis=1) / vehicle.wheel_radius
    slip = -(braking / load + vehicle.rolling_resistance) / SLIP_STIFFNESS
    return np.clip(np.nan_to_num(slip), -MAX_SLIP, 0.0)


def lateral_velocity(drive: Drive, vehicle: Vehicle, f_y: Floats) -> Floats:
    """m/s at the CG, left +: v_y = b r - v a m f_y' / (L C_r), from the rear slip angle.

    f_y' = f_y (1 - g K_phi) is the lateral specific force in the road plane. Right on a banked
    road, because f_y' m is the tire force. Source: docs/methods/common.md#lateral-velocity.
    """
    in_plane = f_y * (1 - G * vehicle.roll_gain)
    v_y = vehicle.cg_to_rear_axle * drive.get("imu.gyro_z")
    return v_y - drive.speed * tire_slip_compliance(vehicle) * in_plane


def _front_compliance(vehicle: Vehicle) -> float:
    """rad/(m/s2), slip angle of the front axle per lateral specific force: b m / (L C_f)."""
    return (
        vehicle.cg_to_rear_axle
        * vehicle.mass
        / (vehicle.wheelbase * vehicle.front_cornering_stiffness)
    )


def tire_slip_compliance(vehicle: Vehicle) -> float:
    """rad/(m/s2), slip angle of the rear axle per lateral specific force: a m / (L C_r)."""
    return (
        vehicle.cg_to_front_axle
        * vehicle.mass
        / (vehicle.wheelbase * vehicle.rear_cornering_stiffness)
    )
