"""The accelerometer's bias along the car by the wheel torques.

Source: docs/methods/fusion.md#torques.
"""

from __future__ import annotations

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.fusion.steps import STEP_RATE, Steps, grid
from roadlog.filters.kernels import odd_window, slope
from roadlog.filters.lowpass import zero_phase
from roadlog.signals import WHEELS
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

CUTOFF = 1.0  # Hz, of both sides of the balance
BRAKE_TORQUE = 5.0  # N m per car, brakes are on above
BRAKE_MARGIN = 0.5  # s without brakes to either side
MIN_SPEED = 3.0  # m/s
MIN_TIME = 5.0  # s of such driving
SCALE_SD = 0.03  # of the torque's scale
FRICTION_SD = 0.002  # of the rolling resistance coefficient: the limit of the method
DRAG_SD = 0.1  # of the air drag
INDEPENDENT = 2.0  # values per second behind the low-pass
ACCEL_WINDOW = 0.5  # s, for the derivative of the speed


def torque_bias(drive: Drive, vehicle: Vehicle, steps: Steps) -> tuple[float, float] | None:
    """m/s2, accelerometer bias plus g times the mounting pitch, and its sd.

    From f_x = s F / m + b where the brakes are off. None where torques, mass or wheel radius are
    not known, or the car drives too little.
    """
    force = drive_force(drive, vehicle)
    if force is None:
        return None
    time = grid(drive)
    known = np.isfinite(force) & np.isfinite(drive.speed)
    if not known.any():
        return None
    speed = np.interp(time, drive.time[known], drive.speed[known])
    there = np.interp(time, drive.time, known.astype(np.float64)) == 1.0
    mask = there & steps.alive & (speed > MIN_SPEED) & ~steps.still
    mask &= _without(np.interp(time, drive.time, _braking(drive, force)) > 0, BRAKE_MARGIN)
    if mask.sum() < MIN_TIME * STEP_RATE:
        return None
    change = slope(speed, odd_window(ACCEL_WINDOW, steps.dt), steps.dt)
    spinning = 4 * vehicle.wheel_inertia * change / vehicle.wheel_radius**2
    rolling = vehicle.rolling_resistance * vehicle.mass * G
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * speed**2
    pull = np.interp(time, drive.time[known], force[known]) - spinning - rolling - drag
    steer = np.nan_to_num(np.interp(time, drive.time, drive.get("steering.road_wheel_angle")))
    share = vehicle.cg_to_rear_axle / vehicle.wheelbase
    expected = pull / vehicle.mass - share * speed * steps.rate_at[:, 2] * steer
    measured = np.where(steps.alive, steps.force_at[:, 0], 0.0)
    X, f = (
        zero_phase(expected, CUTOFF, STEP_RATE)[mask],
        zero_phase(measured, CUTOFF, STEP_RATE)[mask],
    )
    scale = 1 / (1 - G * vehicle.pitch_gain)
    A = np.stack([X, np.ones_like(X)], axis=1)
    residual = f - A @ np.linalg.lstsq(A, f, rcond=None)[0]
    weight = INDEPENDENT / STEP_RATE / max(float(residual.var()), 1e-6)
    information = weight * A.T @ A + np.diag([1 / SCALE_SD**2, 0.0])
    covariance = np.linalg.inv(information)
    bias = (covariance @ (weight * A.T @ f + [scale / SCALE_SD**2, 0.0]))[1]
    air = DRAG_SD * float(drag[mask].mean()) / vehicle.mass
    return float(bias), float(np.sqrt(covariance[1, 1] + (FRICTION_SD * G) ** 2 + air**2))


def drive_force(drive: Drive, vehicle: Vehicle) -> Floats | None:
    """N at the wheels on the drive's clock; None where it or what it needs is not known."""
    drives = [f"wheel_torques.drive_{wheel}" for wheel in WHEELS]
    if vehicle.source("mass").kind == "default":
        return None
    if all(role in drive for role in drives):
        if vehicle.source("wheel_radius").kind == "default":
            return None
        total: Floats = np.sum([drive[role] for role in drives], axis=0)
        return total / vehicle.wheel_radius
    return drive.signals.get("powertrain.drive_force")


def _braking(drive: Drive, force: Floats) -> Floats:
    """1 where the brakes are on, as far as the log knows; else where the car is held back."""
    brakes = [role for wheel in WHEELS if (role := f"wheel_torques.brake_{wheel}") in drive]
    if not brakes:
        return (force < 0).astype(np.float64)
    torque = np.sum([np.nan_to_num(drive[role]) for role in brakes], axis=0)
    return (torque > BRAKE_TORQUE).astype(np.float64)


def _without(mask: Bools, margin: float) -> Bools:
    from scipy.ndimage import maximum_filter1d

    return maximum_filter1d(mask.astype(np.int8), 2 * round(margin * STEP_RATE) + 1) == 0
