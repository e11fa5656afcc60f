"""Fuel in a tilted tank from one sender, the application of Wang 2025.

Wang 2025: docs/methods/wang2025.md#fuel-level.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.wang2025.ekf_suspension import EkfSuspensionParameters, ekf_suspension
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.kernels import odd_window, slope
from roadlog.filters.lowpass import exponential
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

LITERS = 1000.0  # L/m3
HOUR = 3600.0  # s
LEAST_WAY = 0.2  # km, before which nothing is said of the consumption
SENDER_MARGIN = 0.002  # m; nearer to floor or roof the sender only gives a bound
LEVEL_TILT = 1e-6  # tan; below it the surface counts as level


@dataclass(frozen=True)
class FuelLevelParameters:
    """docs/methods/wang2025.md#parameters-of-fuel_level."""

    tilt_source: Literal["specific_force", "attitude", "attitude_accel"] = parameter(
        "specific_force",
        "",
        "specific_force: IMU; attitude: inclination of ekf_suspension as in the paper; "
        "attitude_accel: with the surface's answer to dv/dt",
    )
    slosh_time: float = parameter(10.0, "s", "time constant of the low-pass")
    hold_time: float = parameter(60.0, "s", "held this long while the sender is dry or full; ours")
    range_distance: float = parameter(
        20e3, "m", "the remaining range is as if these last meters went on; ours"
    )


def tank_volume(level: Floats, tilt: Floats, vehicle: Vehicle) -> Floats:
    """m3 in a box tank: fuel height `level` (m) at the sender, surface falling forward by `tilt`.

    tilt is the tangent. Exact for a box, also where the surface meets floor or roof.
    """
    length, height, x = vehicle.tank_length, vehicle.tank_height, vehicle.tank_sender[0]

    def area(u: Floats) -> Floats:
        inside = np.clip(u, 0.0, height)
        return inside**2 / 2 + height * np.maximum(u - height, 0.0)

    level_surface = np.abs(tilt) < LEVEL_TILT
    t = np.where(level_surface, 1.0, tilt)
    tilted = (area(level + t * (length / 2 + x)) - area(level - t * (length / 2 - x))) / t
    flat = length * np.clip(level, 0.0, height)
    return vehicle.tank_width * np.where(level_surface, flat, tilted)


def fuel_level(
    drive: Drive, vehicle: Vehicle, params: FuelLevelParameters, engine: Engine
) -> Estimate:
    """Volume from the sender's level and the tilt of the surface, which is normal to the force."""
    level = drive.get("fuel.sender")
    lateral = np.nan_to_num(drive.get("imu.accel_y") / drive.get("imu.accel_z"))
    tilt = surface_tilt(drive, vehicle, params, engine)
    dry_or_full = (level <= SENDER_MARGIN) | (level >= vehicle.tank_height - SENDER_MARGIN)
    # a surface that falls to the left reads high at a sender on the right
    level_at_center_line = level + lateral * vehicle.tank_sender[1]
    raw = tank_volume(level_at_center_line, tilt, vehicle)
    raw, held = hold(np.where(dry_or_full, np.nan, raw), round(params.hold_time * drive.rate))
    known = np.isfinite(level) & np.isfinite(tilt)
    volume = np.full(len(drive), np.nan)
    alpha = 1 - math.exp(-drive.dt / params.slosh_time)
    for run in runs(np.isfinite(raw)):
        volume[run] = _lowpass(raw[run], alpha, round(params.slosh_time * drive.rate))
    tank = vehicle.tank_length * vehicle.tank_width * vehicle.tank_height
    columns = {
        "volume_raw": raw * LITERS,
        "volume": volume * LITERS,
        "level_fraction": volume / tank,
        "tilt": np.arctan(tilt),
    }
    used = consumed(drive, vehicle, params.range_distance)
    with np.errstate(divide="ignore", invalid="ignore"):
        columns |= {"consumption": used, "remaining_range": volume * LITERS / used}
    flags = flag(~known, "missing") | flag(held, "held") | flag(dry_or_full, "saturated")
    details = {"fuel": Detail("roadlog.v1.FuelEstimate", drive.time, columns)}
    valid = known & ~dry_or_full & np.isfinite(volume)
    return Estimate(drive.time, {}, {}, valid, flags, details)


def consumed(drive: Drive, vehicle: Vehicle, distance: float) -> Floats:
    """L/km over the last `distance` m, or all so far, by the map; NaN without one and at first.

    The force at the wheels is the log's drive force; else the specific force along the body, which
    holds the slope, times mass, with drag and rolling resistance.
    """
    if vehicle.consumption is None:
        return np.full(len(drive), np.nan)
    from scipy.interpolate import RegularGridInterpolator

    speeds, forces = (np.unique([row[k] for row in vehicle.consumption]) for k in range(2))
    rates = np.array([rate for *_, rate in sorted(vehicle.consumption)])
    table = RegularGridInterpolator((speeds, forces), rates.reshape(len(speeds), len(forces)))
    speed = np.abs(np.nan_to_num(drive.speed))
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * speed**2
    rolling = vehicle.rolling_resistance * vehicle.mass * G * (speed > 0)
    force = drive.get("powertrain.drive_force")
    force = np.where(
        np.isfinite(force), force, vehicle.mass * drive["imu.accel_x"] + drag + rolling
    )
    points = np.clip(speed, *speeds[[0, -1]]), np.clip(np.nan_to_num(force), *forces[[0, -1]])
    fuel = np.cumsum(table(np.stack(points, axis=1))) * drive.dt / HOUR
    driven = np.cumsum(speed) * drive.dt
    start = np.maximum(driven - distance, 0.0)
    way = (driven - start) / 1000
    before = np.interp(start, driven, fuel)
    return np.where(way > LEAST_WAY, (fuel - before) / np.maximum(way, LEAST_WAY), np.nan)


def surface_tilt(
    drive: Drive, vehicle: Vehicle, params: FuelLevelParameters, engine: Engine
) -> Floats:
    """Tangent of the surface's tilt in the body's x-z plane, falling forward +."""
    if params.tilt_source == "specific_force":
        return drive.get("imu.accel_x") / drive.get("imu.accel_z")
    inclination = ekf_suspension(drive, vehicle, EkfSuspensionParameters(), engine).inclination
    if params.tilt_source == "attitude":
        return np.tan(inclination)
    vdot = slope(drive.speed, odd_window(0.3, drive.dt), drive.dt)
    return np.tan(inclination + np.arctan(vdot / G))


def _lowpass(values: Floats, alpha: float, start: int) -> Floats:
    """First-order low-pass, started at the mean of the first `start` samples' worth of slosh."""
    return exponential(values, alpha, values[: max(1, start)].mean())


FUEL_LEVEL = Estimator(
    name="fuel_level",
    run=fuel_level,
    parameters=FuelLevelParameters,
    needs=("fuel.sender", "imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=(),
    reference="Wang 2025; docs/methods/wang2025.md#fuel-level",
    summary="liters of fuel in a tilted tank, from one sender and the specific force",
    vehicle=("tank_length", "tank_width", "tank_height", "tank_sender"),
)
