"""Torque at the wheels and speed of the free ones, from whatever the drive measured of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.once import once
from roadlog.signals import WHEELS
from roadlog.types import Bools, Floats

DRIVE_ROLES = ("wheel_torques.drive_fl", "powertrain.engine_torque", "powertrain.drive_force")
NEEDS_TORQUE = "|".join(DRIVE_ROLES)
SHIFT_TIME = 0.5  # s around a change of gear in which the torque is not known
DRIVEN_SHARE = {
    "front": (0.5, 0.5, 0.0, 0.0),
    "rear": (0.0, 0.0, 0.5, 0.5),
    "all": (0.25, 0.25, 0.25, 0.25),
}


@dataclass(frozen=True)
class Driveline:
    """Wheel torques and inertias on the drive's grid; wheels in the order fl, fr, rl, rr.

    drive, brake: N m, (n, 4), brake >= 0, NaN where not measured. inertia: kg m2 of each wheel
    with its share of the engine's, (n, 4). unknown: True around a change of gear and in an open
    one, (n,). notes: what had to be assumed.
    """

    drive: Floats
    brake: Floats
    inertia: Floats
    unknown: Bools
    notes: list[str]


@once
def driveline(drive: Drive, vehicle: Vehicle) -> Driveline:
    """Wheel torques, from the first known of wheel torque, engine torque and drive force.

    Source: docs/methods/common.md#driveline.
    """
    notes = []
    share = np.array(DRIVEN_SHARE[vehicle.driven])
    gear = drive.get("powertrain.gear_ratio")
    geared = np.isfinite(gear).any()
    if not geared:
        notes.append("no gear ratio in this drive: the engine's inertia is left out")
    ratio = np.where(np.isfinite(gear), gear, 0.0) * vehicle.final_drive
    reflected = vehicle.engine_inertia * ratio**2
    brake = _wheels(drive, "brake")
    measured = bool(np.isfinite(brake).any())
    torques = DRIVE_ROLES[0] in drive or (DRIVE_ROLES[1] in drive and geared)
    if DRIVE_ROLES[0] in drive:
        torque = _wheels(drive, "drive")
    elif torques:
        axle = drive[DRIVE_ROLES[1]] * gear * vehicle.final_drive * vehicle.driveline_efficiency
        torque = axle[:, None] * share
    else:  # the force of all wheels has the brakes' in it
        own = np.nan_to_num(brake).sum(axis=1)
        torque = (drive.get(DRIVE_ROLES[2]) * vehicle.wheel_radius + own)[:, None] * share
    if not measured:
        brake = np.where(np.isfinite(torque), 0.0, np.nan)
        if torques:
            notes.append("no brake torque in this drive: braking reads as an uphill grade")
    return Driveline(
        drive=torque,
        brake=brake,
        inertia=vehicle.wheel_inertia + reflected[:, None] * share,
        unknown=_shifting(gear, drive.rate) if geared else np.zeros(len(drive), np.bool_),
        notes=notes,
    )


def undriven_axle(drive: Drive, vehicle: Vehicle) -> str | None:
    """`front` or `rear`, where the car has undriven wheels and the drive their speeds."""
    axle = {"front": "rear", "rear": "front"}.get(vehicle.driven)
    return axle if axle and f"wheel_speeds.{axle[0]}l" in drive else None


@once
def free_wheel_speed(drive: Drive, vehicle: Vehicle) -> Floats:
    """m/s along the road: the undriven wheels where there are any, else the drive's speed.

    A driven wheel slips by its torque, which reads as a speed error of the sign of the grade.
    """
    axle = undriven_axle(drive, vehicle)
    if axle is not None:
        return drive.wheel_speed(axle)
    for role in ("speed.v", "gnss.speed"):
        if role in drive:
            return drive[role]
    return drive.speed


def _wheels(drive: Drive, kind: str) -> Floats:
    """(n, 4); a wheel that has no channel counts as 0 where any other has a value."""
    torque = np.stack([drive.get(f"wheel_torques.{kind}_{w}") for w in WHEELS], axis=1)
    absent = [f"wheel_torques.{kind}_{w}" not in drive for w in WHEELS]
    known = np.isfinite(torque).any(axis=1)
    torque[:, absent] = np.where(known, 0.0, np.nan)[:, None]
    return torque


def _shifting(gear: Floats, rate: float) -> Bools:
    """Within SHIFT_TIME of a change of gear, or in an open one."""
    held = np.nan_to_num(gear)
    change = np.concatenate([[False], np.abs(np.diff(held)) > 0.0])
    reach = np.ones(2 * round(SHIFT_TIME * rate) + 1)
    near = np.convolve(change, reach, mode="full")[len(reach) // 2 :][: len(gear)] > 0.5
    return near | (held == 0.0)
