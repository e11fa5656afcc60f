"""A small car in the road's plane with linear tires: truth for tests that need no full simulator.

Independent of the estimators: its tires make their forces from slip, and it knows body roll and
pitch, bank and grade. Not in it: suspension dynamics, relaxation, load sensitivity, sensor errors.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.units import STANDARD_GRAVITY as G
from roadlog.vehicle import Vehicle

RATE, STEPS = 100.0, 10  # Hz of the grid, integration steps in each


@dataclass(frozen=True)
class PlanarTruth:
    """A drive, and the truth on its grid: grade, bank, roll (rad), v_y (m/s), forces (N)."""

    drive: Drive
    grade: np.ndarray
    bank: np.ndarray
    roll: np.ndarray
    v_y: np.ndarray
    lateral_front: np.ndarray
    lateral_rear: np.ndarray
    longitudinal: np.ndarray


def planar_truth(
    vehicle: Vehicle,
    duration: float,
    grade: Callable[[float], float],
    steer: Callable[[float], float],
    accel: Callable[[float], float] = lambda _t: 0.0,
    bank: Callable[[float], float] = lambda _t: 0.0,
    speed: float = 10.0,
    noise: float = 0.0,
    seed: int = 1,
) -> PlanarTruth:
    """Drive for `duration` s; accel is the wanted acceleration. noise: 1 gives a good IMU's.

    Brakes act on all wheels below zero force, the engine on the rear wheels above it.
    """
    m, a, b = vehicle.mass, vehicle.cg_to_front_axle, vehicle.cg_to_rear_axle
    radius, k_drag = vehicle.wheel_radius, 0.5 * vehicle.air_density * vehicle.drag_area
    c_f, c_r = vehicle.front_cornering_stiffness, vehicle.rear_cornering_stiffness
    rolling = vehicle.rolling_resistance * m * G
    turning = 4 * vehicle.wheel_inertia / radius**2
    n, dt = round(duration * RATE), 1.0 / (RATE * STEPS)
    v, v_y, r = speed, 0.0, 0.0
    rows = []
    for k in range(n):
        for i in range(STEPS):
            t = (k * STEPS + i) * dt
            delta, wanted = steer(t), accel(t)
            front = c_f * (delta - np.arctan2(v_y + a * r, v))
            rear = c_r * -np.arctan2(v_y - b * r, v)
            # what the wheels must give for the wanted acceleration, turning parts included
            resist = k_drag * v * v + m * G * np.sin(grade(t)) - m * v_y * r + front * np.sin(delta)
            tires = m * wanted + resist
            torque = (tires + rolling + turning * wanted) * radius
            v_dot = (tires - resist) / m
            y_dot = (front * np.cos(delta) + rear) / m - v * r - G * np.sin(bank(t))
            if i == 0:
                f_x = (tires - k_drag * v * v - front * np.sin(delta)) / m
                f_y = (front * np.cos(delta) + rear) / m
                values = (grade(t), bank(t), v, v_y, r, delta, torque, f_x, f_y, front, rear, tires)
                rows.append(values)
            v, v_y = v + dt * v_dot, v_y + dt * y_dot
            r += dt * (a * front * np.cos(delta) - b * rear) / vehicle.yaw_inertia
    columns = np.array(rows).T
    slope, tilt, v, v_y, r, delta, torque, f_x, f_y, front, rear, tires = columns
    rng = np.random.default_rng(seed)

    def noisy(values: np.ndarray, sd: float) -> np.ndarray:
        return values + noise * sd * rng.standard_normal(n)

    # the IMU tilts with the body: it sees the car's vertical share of gravity too
    signals = {
        "imu.accel_x": noisy(f_x / (1 - G * vehicle.pitch_gain), 0.02),
        "imu.accel_y": noisy(f_y / (1 - G * vehicle.roll_gain), 0.02),
        "imu.accel_z": np.full(n, G),
        "imu.gyro_x": np.zeros(n),
        "imu.gyro_y": np.zeros(n),
        "imu.gyro_z": noisy(r, 0.001),
        "steering.road_wheel_angle": delta,
        "speed.v": noisy(v, 0.01),
    }
    for wheel in ("fl", "fr", "rl", "rr"):
        driven = wheel[0] == "r"
        signals[f"wheel_speeds.{wheel}"] = noisy(v, 0.01)
        drives = np.maximum(torque, 0.0) / 2 * driven
        signals[f"wheel_torques.drive_{wheel}"] = drives
        signals[f"wheel_torques.brake_{wheel}"] = np.maximum(-torque, 0.0) / 4
    drive = Drive(np.arange(n) / RATE, 0, RATE, signals, {})
    roll = vehicle.roll_gain * f_y / (1 - G * vehicle.roll_gain)
    return PlanarTruth(drive, slope, tilt, roll, v_y, front, rear, tires)
