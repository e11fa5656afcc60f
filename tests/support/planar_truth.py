"""A small rolling car with linear tires: truth for tests that need no full simulator.

Independent of the estimators' force layers: its tires make their forces from slip. Not in it:
relaxation, load sensitivity and transfer, combined slip, roughness, sensor biases.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, Samples
from roadlog.units import STANDARD_GRAVITY as G

RATE, STEPS = 100, 5  # Hz of the grid, integration steps in each
GNSS_EVERY = 10
DEG = np.pi / 180
TIRE_SLIP_STIFFNESS = 22.0  # force per load and slip


@dataclass(frozen=True)
class PlanarTruth:
    """A drive, and the truth on its grid: angles rad, beta rad, forces N."""

    drive: Drive
    grade: np.ndarray
    bank: np.ndarray
    roll: np.ndarray
    beta: np.ndarray
    lateral_front: np.ndarray
    lateral_rear: np.ndarray
    longitudinal: np.ndarray


def planar_truth(
    vehicle: Vehicle,
    duration: float,
    grade: Callable[[float], float] = lambda _t: 0.0,
    steer: Callable[[float], float] = lambda _t: 0.0,
    accel: Callable[[float], float] = lambda _t: 0.0,
    bank: Callable[[float], float] = lambda _t: 0.0,
    speed: float = 10.0,
    gnss: bool = False,
    noise: float = 1.0,
    seed: int = 1,
) -> PlanarTruth:
    """Drive for `duration` s; accel is the wanted acceleration. noise: 1 gives a good IMU's.

    Brakes act on all wheels below zero force, the engine on the rear wheels above it. The IMU and
    the antennas sit at the CG, which the car rolls away from its roll axis.
    """
    m, a, b = vehicle.mass, vehicle.cg_to_front_axle, vehicle.cg_to_rear_axle
    h, i_x, radius = vehicle.roll_arm, vehicle.roll_inertia, vehicle.wheel_radius
    drag = 0.5 * vehicle.air_density * vehicle.drag_area
    c_f, c_r = vehicle.front_cornering_stiffness, vehicle.rear_cornering_stiffness
    k_r, b_r = float(vehicle.roll_stiffness or 0), float(vehicle.roll_damping or 0)
    rolling, turning = vehicle.rolling_resistance * m * G, 4 * vehicle.wheel_inertia / radius**2
    n, dt = round(duration * RATE), 1.0 / (RATE * STEPS)
    v, v_y, r, phi, phi_dot, psi = speed, 0.0, 0.0, 0.0, 0.0, 0.0
    rows = []
    for step in range(n * STEPS):
        t = step * dt
        delta, wanted, slope, tilt = steer(t), accel(t), grade(t), bank(t)
        before, after = bank(t - dt), bank(t + dt)
        p_f = (after - before) / (2 * dt) + np.sin(slope) * r
        p_f_dot = (after - 2 * tilt + before) / dt**2
        front = c_f * (delta - np.arctan2(v_y + a * r, v))
        rear = c_r * -np.arctan2(v_y - b * r, v)
        side = front * np.cos(delta) + rear
        resist = drag * v * v + m * G * np.sin(slope) - m * v_y * r + front * np.sin(delta)
        tires = m * wanted + resist
        torque = (tires + rolling + turning * wanted) * radius
        roll_accel = (h * side + (m * G * h - k_r) * phi - b_r * phi_dot) / i_x
        if step % STEPS == 0:
            f_x = (tires - drag * v * v - front * np.sin(delta)) / m
            motion = (slope, tilt, v, v_y, r, delta, phi, phi_dot + p_f, psi)
            rows.append((*motion, torque, f_x, side / m, front, rear, tires))
        v += dt * wanted
        v_y += dt * (side / m - v * r - G * np.sin(tilt) + h * roll_accel)
        r += dt * (a * front * np.cos(delta) - b * rear) / vehicle.yaw_inertia
        phi_dot += dt * (roll_accel - p_f_dot)
        phi += dt * phi_dot
        psi += dt * r
    columns = np.array(rows).T
    slope, tilt, v, v_y, r, delta, phi, p, psi, torque, f_x, f_y, front, rear, tires = columns
    rng = np.random.default_rng(seed)

    def noisy(values: np.ndarray, sd: float) -> np.ndarray:
        return values + noise * sd * rng.standard_normal(len(values))

    time = np.arange(n) / RATE
    pitch_total = slope + vehicle.pitch_gain * f_x
    signals = {
        "imu.accel_x": noisy(f_x / (1 - G * vehicle.pitch_gain), 0.02),
        "imu.accel_y": noisy(f_y * np.cos(phi) + G * np.sin(phi), 0.02),
        "imu.accel_z": np.full(n, G),
        "imu.gyro_x": noisy(p, 0.001),
        "imu.gyro_y": noisy(-np.gradient(pitch_total, time), 0.001),
        "imu.gyro_z": noisy(r, 0.001),
        "steering.road_wheel_angle": delta,
        "speed.v": noisy(v, 0.01),
    }
    # wheels touch the road below a CG that swings over them, slip by their force, and steer
    contact = v + vehicle.cg_height * np.gradient(pitch_total, time)
    per_load = torque / (radius * m * G)
    for wheel in ("fl", "fr", "rl", "rr"):
        driven = wheel[0] == "r"
        slip = np.where(per_load > 0, 2 * per_load * driven, per_load) / TIRE_SLIP_STIFFNESS
        slip -= vehicle.rolling_resistance / TIRE_SLIP_STIFFNESS
        rolling = contact * (1 + slip)
        if not driven:
            rolling = rolling * np.cos(delta) + (v_y + a * r) * np.sin(delta)
        signals[f"wheel_speeds.{wheel}"] = noisy(rolling, 0.01)
        signals[f"wheel_torques.drive_{wheel}"] = np.maximum(torque, 0.0) / 2 * driven
        signals[f"wheel_torques.brake_{wheel}"] = np.maximum(-torque, 0.0) / 4
    native = {}
    if gnss:
        fix = slice(None, None, GNSS_EVERY)
        own = time[fix]
        course = psi + np.arctan2(v_y - h * p, v)
        fields = {
            "speed": noisy(np.hypot(v, v_y - h * p)[fix], 0.03),
            "course": noisy(course[fix], 0.03 / speed),
            "climb": noisy((v * np.sin(slope))[fix], 0.045),
            "heading": noisy(psi[fix], 0.15 * DEG),
            "roll": noisy((tilt + phi)[fix], 0.20 * DEG),
        }
        native["gnss"] = Samples(own, fields)
        signals |= {f"gnss.{k}": np.interp(time, own, values) for k, values in fields.items()}
    drive = Drive(time, 0, float(RATE), signals, native)
    return PlanarTruth(drive, slope, tilt, phi, np.arctan2(v_y, v), front, rear, tires)
