"""Inclination from longitudinal specific force minus acceleration, sample by sample.

The base of the straight-driving methods: docs/methods/massel2004.md#inclination.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.straight import StraightParameters, longitudinal, straight_flags
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.windows import moving_mean
from roadlog.types import Floats


@dataclass(frozen=True)
class InclKinematicParameters(StraightParameters):
    """docs/methods/massel2004.md#parameters-of-incl_kinematic."""

    average_time: float = parameter(0.0, "s", "further centered moving mean; 0 for none")


def incl_kinematic(
    drive: Drive, vehicle: Vehicle, params: InclKinematicParameters, engine: Engine
) -> Estimate:
    """Inclination = asin((f_x - dv/dt) / g); an accelerometer bias b stays in it as b / g."""
    del engine  # one vectorized formula
    motion = longitudinal(drive, params, vehicle)
    inclination = averaged(motion.inclination, params.average_time, drive.rate)
    sd = motion.inclination_sd
    if params.average_time > params.slope_time:
        sd = sd * np.sqrt(params.slope_time / (1.2 * params.average_time))
    known = np.isfinite(inclination)
    limit = round(params.hold_time * drive.rate)
    inclination, was_held = hold(inclination, limit)
    sd, _ = hold(sd, limit)
    flags = straight_flags(drive, known) | flag(was_held, "held")
    return Estimate(drive.time, {"inclination": inclination}, {"inclination": sd}, known, flags)


def averaged(values: Floats, duration: float, rate: float, centered: bool = True) -> Floats:
    """Moving mean over `duration` seconds of what is known; unknown samples stay unknown."""
    n = round(duration * rate)
    if n <= 1:
        return values
    return np.where(np.isfinite(values), moving_mean(values, n, centered), np.nan)


INCL_KINEMATIC = Estimator(
    name="incl_kinematic",
    run=incl_kinematic,
    parameters=InclKinematicParameters,
    needs=("imu.accel_x", ANY_SPEED),
    gives=("inclination",),
    reference="roadlog; docs/methods/massel2004.md#inclination",
    summary="inclination from acceleration minus dv/dt, sample by sample; straight driving",
    systematic_deg={"inclination": 0.5},
    tilted=("inclination",),
)
