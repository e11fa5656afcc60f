"""Mass and rolling resistance from wheel torques and the specific force along the road.

Source: docs/calibration.md#mass-and-rolling-resistance.
F = m f + J/R2 dv/dt + f_rr m g + drag; the specific force f
holds the slope already, so no slope need be known. J holds the wheels and, by the square of its
gear, the engine: 3 to 6 % of a car in town.
"""

from __future__ import annotations

import numpy as np

from roadlog.calibrate.constant import JACKKNIFE_BLOCK, Constant, unknown
from roadlog.calibrate.mounting import filled
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.filters.kernels import odd_window, slope
from roadlog.filters.lowpass import zero_phase
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

CUTOFF = 1.0  # Hz
MIN_SPEED = 3.0  # m/s
BRAKES_OFF = 0.5  # s, to either side
BRAKE_TORQUE = 20.0  # N m of all wheels, below which no brake is on
SLOPE_WINDOW = 0.3  # s
TORQUE_SHARE = 0.05  # a torque signal's own scale, which nothing in the drive tells
RADIUS_SHARE = 0.03  # of a wheel radius that is only a default
ENGINE_SHARE = 0.4  # of the engine's inertia at the wheels, where that rests on defaults
GEARLESS_SHARE = 0.05  # of the mass: the engine's inertia in gears that the log does not tell
DRAG_SHARE = 0.15  # of a drag area that is only a default
FORCE = 0.3  # m/s2 rms of the driven specific force, without which it says nothing
MIN_TIME = 30.0  # s
MAX_ROLLING_SD = 0.003
NAMES = (("mass", "kg"), ("rolling_resistance", "-"))


def mass_and_rolling(
    drive: Drive, estimate: Estimate, vehicle: Vehicle, bias: float, bias_sd: float
) -> list[Constant]:
    """Both constants. bias, bias_sd: m/s2, of the accelerometer along the road."""
    force = _drive_force(drive, vehicle)
    if isinstance(force, str):
        return [unknown(name, unit, force) for name, unit in NAMES]
    speed = filled(drive.speed)
    change = slope(speed, odd_window(SLOPE_WINDOW, drive.dt), drive.dt)
    wheels, engine = _rotating(drive, vehicle)
    drag = 0.5 * vehicle.air_density * vehicle.drag_area
    along = filled(drive["imu.accel_x"] - bias - G * estimate.pitch)
    yaw_rate = filled(drive["imu.gyro_z"])
    steer = yaw_rate * vehicle.wheelbase / np.maximum(speed, MIN_SPEED)
    scrub = vehicle.cg_to_rear_axle / vehicle.wheelbase * speed * yaw_rate * steer  # per mass
    spin = zero_phase(engine * change, CUTOFF, drive.rate)
    y = zero_phase(filled(force) - wheels * change - drag * speed**2, CUTOFF, drive.rate) - spin
    x = zero_phase(along + scrub, CUTOFF, drive.rate)
    use = (speed > MIN_SPEED) & np.isfinite(force) & estimate.valid & _brakes_off(drive)
    level = float(np.std(x[use])) if use.any() else 0.0
    time = float(use.sum() * drive.dt)
    if time < MIN_TIME or level < FORCE:
        reason = (
            f"driven with brakes off for {time:.0f} s at {level:.2f} m/s2 rms "
            f"({MIN_TIME:.0f} s and {FORCE} needed)"
        )
        return [unknown(name, unit, reason) for name, unit in NAMES]
    mass, rest, mass_sd, rest_sd = _line(x[use], y[use], np.flatnonzero(use), drive.rate)
    radius = RADIUS_SHARE if vehicle.source("wheel_radius").kind == "default" else 0.0
    scale = float(np.hypot(TORQUE_SHARE, radius))
    if engine.any():
        sheet = any(vehicle.source(n).kind == "default" for n in ("engine_inertia", "final_drive"))
        share = ENGINE_SHARE if sheet else 0.0
        inertia_sd = share * abs(float(np.cov(spin[use], x[use])[0, 1])) / level**2
    else:
        inertia_sd = GEARLESS_SHARE * mass
    mass_sd = float(np.hypot(mass_sd, inertia_sd))
    remark = "" if not radius else "; rests on the default wheel_radius"
    evidence = f"torques over {time:.0f} s, {level:.2f} m/s2 rms{remark}"
    found = [Constant("mass", "kg", mass, float(np.hypot(mass_sd, scale * mass)), evidence)]
    rolling = rest / (mass * G)
    wind = DRAG_SHARE if vehicle.source("drag_area").kind == "default" else 0.05
    parts = [
        rest_sd / (mass * G),
        bias_sd / G,
        scale * rolling,
        inertia_sd * float(np.mean(x[use])) / (mass * G),
        wind * drag * float(np.mean(speed[use] ** 2)) / (mass * G),
    ]
    sd = float(np.sqrt(np.sum(np.square(parts))))
    if sd > MAX_ROLLING_SD or rolling <= 0:
        reason = f"masked by the accelerometer's bias ({rolling:.3f} +- {sd:.3f})"
        return [*found, unknown("rolling_resistance", "-", reason)]
    return [*found, Constant("rolling_resistance", "-", rolling, sd, evidence)]


def _drive_force(drive: Drive, vehicle: Vehicle) -> Floats | str:
    """N at the wheels' contact; or why not."""
    wheels = [f"wheel_torques.drive_{w}" for w in ("fl", "fr", "rl", "rr")]
    there = [drive[role] for role in wheels if role in drive]
    if there:
        brakes = [role.replace("drive", "brake") for role in wheels]
        total = np.sum(np.nan_to_num(there), axis=0)
        total = np.where(np.isfinite(there).any(axis=0), total, np.nan)
        braking = [np.nan_to_num(drive[role]) for role in brakes if role in drive]
        return (total - np.sum(braking, axis=0)) / vehicle.wheel_radius
    if "powertrain.drive_force" in drive:
        return drive["powertrain.drive_force"]
    return "no wheel torques and no drive force in the log"


def _rotating(drive: Drive, vehicle: Vehicle) -> tuple[float, Floats]:
    """kg, what wheels and engine add to the car's inertia but not to its weight.

    The engine's is 0 in an open gear and where the log does not know the gear.
    """
    ratio = np.nan_to_num(drive.get("powertrain.gear_ratio")) * vehicle.final_drive
    square = vehicle.wheel_radius**2
    return 4 * vehicle.wheel_inertia / square, vehicle.engine_inertia * ratio**2 / square


def _brakes_off(drive: Drive) -> np.ndarray:
    from scipy.ndimage import maximum_filter1d

    roles = [f"wheel_torques.brake_{w}" for w in ("fl", "fr", "rl", "rr")]
    braking = [np.nan_to_num(drive[role]) for role in roles if role in drive]
    on = np.sum(braking, axis=0) > BRAKE_TORQUE if braking else np.zeros(len(drive), np.bool_)
    return maximum_filter1d(on.astype(np.int8), 2 * round(BRAKES_OFF * drive.rate) + 1) == 0


def _line(
    x: Floats, y: Floats, index: np.ndarray, rate: float
) -> tuple[float, float, float, float]:
    """y = a x + b: a, b and their standard errors by leaving out blocks of JACKKNIFE_BLOCK seconds.

    The reduced major axis: noise of both sides is alike, neither is the cause.
    """
    block = np.unique(index // round(JACKKNIFE_BLOCK * rate), return_inverse=True)[1]
    n = np.bincount(block).astype(np.float64)
    sums = [np.bincount(block, values) for values in (x, y, x * x, x * y, y * y)]
    totals = np.array([n.sum(), *(s.sum() for s in sums)])
    without = totals - np.stack([n, *sums], axis=1)

    def solve(t: Floats) -> tuple[Floats, Floats]:
        mean_x, mean_y = t[..., 1] / t[..., 0], t[..., 2] / t[..., 0]
        var_x = t[..., 3] / t[..., 0] - mean_x**2
        cov = t[..., 4] / t[..., 0] - mean_x * mean_y
        var_y = t[..., 5] / t[..., 0] - mean_y**2
        a = np.sign(cov) * np.sqrt(np.maximum(var_y, 0) / np.maximum(var_x, 1e-12))
        return a, mean_y - a * mean_x

    a, b = solve(totals)
    left = solve(without)
    m = len(n)
    sd = [float(np.sqrt((m - 1) / m * np.sum((part - part.mean()) ** 2))) for part in left]
    return float(a), float(b), sd[0], sd[1]
