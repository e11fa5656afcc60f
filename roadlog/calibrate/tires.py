"""Cornering stiffness of both axles from the smoother's rear slip and the steering.

Source: docs/calibration.md#cornering-stiffness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.calibrate.constant import Constant, unknown
from roadlog.calibrate.mounting import filled
from roadlog.car.suspension import TIRE_MODE
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.filters.lowpass import second_order, zero_phase
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

CUTOFF = 2.0  # Hz
MIN_SPEED = 4.0  # m/s
MAX_YAW_ACCELERATION = 0.15  # rad/s2
INDEPENDENT = 2.0  # samples per second that count as independent
LATERAL = 0.5  # m/s2 rms, without which steering says nothing of the tires
RACK_SHARE = 0.2  # the rack's own give is in the understeer
SHEET_SHARE = 0.10  # of mass and axle distances that are only defaults
WORTH = 0.3  # share; a slip gradient that uncertain gives no stiffness
ARM_SD = 0.3  # m, of the rear axle's place: at one speed it looks like slip
UNIT = "N/rad"
REAR, FRONT = "rear_cornering_stiffness", "front_cornering_stiffness"


def stiffnesses(drive: Drive, slip: Constant, vehicle: Vehicle) -> list[Constant]:
    """Rear and front, from the rear slip gradient (rad per m/s2) and the understeer."""
    if slip.identifiable and slip.value is not None and slip.sd is not None:
        slip = replace(slip, sd=float(np.hypot(slip.sd, ARM_SD / _turning_speed(drive) ** 2)))
    if slip.sd is not None and slip.value is not None and slip.sd > WORTH * slip.value:
        value, sd = slip.value / DEG, slip.sd / DEG
        reason = f"rear slip is {value:.2f} ± {sd:.2f} deg/(m/s2): drive faster curves"
        return [unknown(name, UNIT, reason) for name in (REAR, FRONT)]
    if not slip.identifiable or slip.value is None or slip.sd is None:
        return [unknown(name, UNIT, slip.reason) for name in (REAR, FRONT)]
    load = vehicle.mass * vehicle.cg_to_front_axle / vehicle.wheelbase
    defaults = [
        name
        for name in ("mass", "cg_to_front_axle", "cg_to_rear_axle")
        if vehicle.source(name).kind == "default"
    ]
    sheet = SHEET_SHARE if defaults else 0.0
    remark = f"; rests on the default {', '.join(defaults)}" if defaults else ""
    rear = load / slip.value
    spread = float(np.hypot(slip.sd / slip.value, sheet))
    found = [Constant(REAR, UNIT, rear, rear * spread, slip.evidence + remark)]
    understeer = _understeer(drive, vehicle)
    if isinstance(understeer, str):
        return [*found, unknown(FRONT, UNIT, understeer)]
    gradient, sd, level = understeer
    total = gradient + slip.value
    total_sd = float(np.hypot(np.hypot(sd, RACK_SHARE * gradient), slip.sd))
    if total <= 0 or total_sd > WORTH * total:
        return [*found, unknown(FRONT, UNIT, "steering and rear slip leave the front slip open")]
    front = vehicle.mass * vehicle.cg_to_rear_axle / vehicle.wheelbase / total
    evidence = f"steering against yaw rate, {level:.1f} m/s2 rms of lateral force{remark}"
    spread = float(np.hypot(total_sd / total, sheet))
    return [*found, Constant(FRONT, UNIT, front, front * spread, evidence)]


def _understeer(drive: Drive, vehicle: Vehicle) -> tuple[float, float, float] | str:
    """rad per m/s2, its sd and the rms of the force; or why not."""
    role = "steering.road_wheel_angle"
    if role not in drive:
        return "no steering angle in the log"
    steer, speed, rate, force = (
        zero_phase(filled(x), CUTOFF, drive.rate)
        for x in (drive[role], drive.speed, drive["imu.gyro_z"], drive["imu.accel_y"])
    )
    force = (1 - G * vehicle.roll_gain) * second_order(force, *TIRE_MODE, drive.rate)
    calm = np.abs(np.gradient(rate, drive.dt)) < MAX_YAW_ACCELERATION
    use = (speed > MIN_SPEED) & calm & np.isfinite(drive[role])
    count = INDEPENDENT * use.sum() * drive.dt
    level = float(np.sqrt(np.mean(force[use] ** 2))) if use.any() else 0.0
    if count < 20 or level < LATERAL:
        return f"lateral force is {level:.1f} m/s2 rms ({LATERAL} needed): drive curves"
    A = np.stack([force[use], np.ones(use.sum())], axis=1)
    z = steer[use] - vehicle.wheelbase * rate[use] / speed[use]
    solution = np.linalg.lstsq(A, z, rcond=None)[0]
    rest = z - A @ solution
    covariance = np.linalg.inv(A.T @ A / use.sum()) * rest.var() / count
    return float(solution[0]), float(np.sqrt(covariance[0, 0])), level


def _turning_speed(drive: Drive) -> float:
    """m/s at which the car turns, weighted by its lateral force."""
    speed = filled(drive.speed)
    weight = (speed * filled(drive["imu.gyro_z"])) ** 2
    return float(np.sqrt(np.average(speed**2, weights=weight)))
