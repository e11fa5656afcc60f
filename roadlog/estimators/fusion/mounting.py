"""How the IMU sits in the body: what is known of it, and how it is turned straight.

Source: docs/methods/fusion.md#mounting.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import STATED_MOUNTING, Vehicle
from roadlog.estimators.fusion.load import LADEN_SD
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.states import MOUNTING, State
from roadlog.estimators.fusion.steps import HEIGHTS, Fix, Steps, has, last
from roadlog.rotation import PITCH_UP, from_vector, to_rpy, to_vector
from roadlog.types import Bools, Floats
from roadlog.units import DEG

YAW_LOOSER = 2.0  # times `mounting_sd`: a housing is put level, and forward by the eye
CALIBRATED_MOUNTING = 0.1 * DEG  # a mounting that the vehicle file gives is no better
UNKNOWN_MOUNTING = 3.0 * DEG  # of an IMU that lies somewhere in the car
CROSSFALL = 1.5 * DEG  # sd of a drive's mean bank: what levels an IMU that lies askew
CONFLICT = 2.0  # sd; a mounting found further from its prior was not mounted as that says
SMALL_MOUNTING = 1.0 * DEG  # beyond this the IMU is turned and smoothed again


@dataclass(frozen=True)
class Mounting:
    """What is known of the IMU against the unmoving body.

    rotation (3, 3): rows forward, left, up, in the IMU's axes, by which its signals are turned.
    mean, sd (3,): rad, prior of the roll, pitch and yaw that are left (`states.MOUNTING`).
    """

    rotation: Floats
    mean: Floats
    sd: Floats

    def wrong(self, found: Floats) -> Bools:
        """(3,), whether each angle is further from its prior than that and a load allow."""
        sd = np.hypot(self.sd, [0.0, LADEN_SD, 0.0])
        return np.abs(found - self.mean) > CONFLICT * sd

    def turned(self, found: Floats, mean_bank: float | None) -> Mounting:
        """Turned by what the data found, so that it is small again.

        An angle that its prior does not allow is unknown; and so then is the roll, which nothing
        but antennas tells, save that the mean of bank over a drive is small. mean_bank: rad, of the
        drive; None where antennas tell the roll.
        """
        rest, wrong = self.mean - found, self.wrong(found)
        sd = np.where(wrong, np.maximum(self.sd, UNKNOWN_MOUNTING), self.sd)
        if wrong.any() and mean_bank is not None:
            share = UNKNOWN_MOUNTING**2 / (UNKNOWN_MOUNTING**2 + CROSSFALL**2)
            found = found + np.array([share * mean_bank, 0.0, 0.0])
            rest[0], sd[0] = 0.0, np.sqrt(share) * CROSSFALL
        return Mounting(_rotation(found) @ self.rotation, rest, sd)

    def turn(self, left: Floats) -> Floats:
        """(3,) rad, the whole turn about the car's axes, nose-up, from the angles left (3,)."""
        return PITCH_UP * to_vector(_rotation(left) @ self.rotation)

    def rpy(self, left: Floats) -> Floats:
        """(3,) rad, roll, pitch (nose-up) and yaw of the IMU in the car, from those left (3,)."""
        return PITCH_UP * to_rpy(_rotation(left) @ self.rotation)


def _rotation(angles: Floats) -> Floats:
    """(3, 3), of roll and yaw right-handed, pitch nose-up; rad."""
    return from_vector(PITCH_UP * angles)


def mounting_prior(vehicle: Vehicle, params: FusionParameters) -> Mounting:
    """As the vehicle file has it, else straight as far as an eye can tell."""
    source = vehicle.source("imu_mount")
    known = source.axis_sd or source.sd
    if known is not None:
        sd = np.maximum(np.broadcast_to(known, 3), CALIBRATED_MOUNTING)
    elif vehicle.states_mounting:
        sd = np.full(3, STATED_MOUNTING)
    else:
        sd = params.mounting_sd * np.array([1.0, 1.0, YAW_LOOSER])
    return Mounting(np.eye(3), np.zeros(3), sd)


def straightened(steps: Steps, mounting: Mounting, x: Floats) -> Mounting | None:
    """The mounting turned by what the filter found; None where that is small."""
    moving = steps.alive & ~steps.still
    found: Floats = x[last(steps), MOUNTING].copy()
    bank = None
    if not has(steps, Fix.ROLL):
        found[0] = 0.0  # not observable
        bank = float(np.mean(x[moving, State.PHI]))
    if not has(steps, *HEIGHTS):
        found[1] = 0.0  # hardly observable from the springs
    if np.abs(found).max() < SMALL_MOUNTING and not mounting.wrong(found).any():
        return None
    return mounting.turned(found, bank)
