"""FUSION: grade, bank, pitch and roll by one smoother over the whole drive.

A strapdown model in body axes, corrected by the speed, by "the rear axle slips no more than a
linear tire does", by "the car stays on the road", by stops, and by GNSS where it is there. Grade
and bank have no prior of their own: they are absolute angle minus body angle.
The drive becomes `Inputs` (inputs.py), these a `Fit` (fit.py), this a `Solution` (solution.py), and
here an `Estimate`.
Source: docs/methods/fusion.md.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roadlog.car.suspension import LINEAR_TIRES
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Detail, Estimate, complete_angles
from roadlog.estimators.base import ANY_SPEED, Estimator, flag
from roadlog.estimators.fusion.consistency import refused
from roadlog.estimators.fusion.fit import fitted
from roadlog.estimators.fusion.notes import OFFSET_LIMIT, notes
from roadlog.estimators.fusion.outputs import Output
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.solution import Solution, solved
from roadlog.estimators.fusion.speed import without_speed
from roadlog.estimators.fusion.steps import Sway
from roadlog.filters import Engine
from roadlog.types import Bools, Flags, Floats

SETTLE = 2.0  # s at the ends of a run of the IMU, flagged


def fusion(drive: Drive, vehicle: Vehicle, params: FusionParameters, engine: Engine) -> Estimate:
    """All angles with their uncertainty, and every constant found with its standard error."""
    return estimate(solved(refused(fitted(drive, vehicle, params)), engine), drive.time)


def estimate(solution: Solution, time: Floats) -> Estimate:
    """The solution at `time` (s) of the drive, with its flags and notes."""
    own, known = solution.time, solution.time[solution.known]
    alive = _nearest(own, solution.fit.steps.alive, time)
    angles = {name: np.interp(time, own, values) for name, values in solution.angles.items()}
    sd = {
        name: np.interp(time, known, np.sqrt(values[solution.known]))
        for name, values in solution.variance.items()
    }
    for values in (*angles.values(), *sd.values()):
        values[~alive] = np.nan
    fits = not solution.consistency.faults
    missing = ~alive | without_speed(solution.fit.inputs.source, time)
    shape = solution.shape_sd[solution.known]
    details = {
        "shape": Detail(
            "roadlog.v1.FusionShape",
            known,
            {"grade_shape_sd": shape[:, Output.GRADE], "bank_shape_sd": shape[:, Output.BANK]},
        ),
        "constants": Detail("roadlog.v1.FusionConstants", own[-1:], solution.constants),
    }
    flags = _flags(solution, time, alive, missing)
    return Estimate(
        time,
        complete_angles(angles),
        sd,
        ~missing & fits,
        flags,
        details,
        notes(solution),
        innovations=_innovations(solution, time),
    )


def _innovations(solution: Solution, time: Floats) -> dict[str, NDArray[np.float32]]:
    """Row -> residual over its predicted sd at the sample nearest to its step, NaN elsewhere."""
    at = np.clip(np.searchsorted(time, solution.time - 0.5 * (time[1] - time[0])), 0, len(time) - 1)
    found = {}
    for row, (used, values) in solution.innovations.items():
        placed = np.full(len(time), np.nan, np.float32)  # in sd: seven digits are plenty
        placed[at[used]] = values
        found[row.name.lower()] = placed
    return found


def _flags(solution: Solution, time: Floats, alive: Bools, missing: Bools) -> Flags:
    own, known, steps = solution.time, solution.time[solution.known], solution.fit.steps
    beyond = (solution.offset_sd[solution.known] > OFFSET_LIMIT).any(axis=1)
    settling = ~_eroded(alive, round(SETTLE * solution.fit.inputs.drive.rate))
    lateral = np.interp(time, own, np.abs(steps.sway[:, Sway.TIRE]))
    return (
        flag(missing, "missing")
        | flag(_nearest(own, steps.still, time), "standstill")
        | flag(lateral > LINEAR_TIRES, "model")
        | flag(settling, "converging")
        | flag(np.full(len(time), bool(solution.consistency.faults)), "rejected")
        | flag(np.interp(time, known, beyond) > 0.5, "uncertain")
    )


def _nearest(time: Floats, mask: Bools, at: Floats) -> Bools:
    step = time[1] - time[0]
    return mask[np.clip(np.round((at - time[0]) / step).astype(np.int64), 0, len(mask) - 1)]


def _eroded(mask: Bools, margin: int) -> Bools:
    """True where the mask is True over `margin` samples to either side, within the record."""
    from scipy.ndimage import minimum_filter1d

    return minimum_filter1d(mask.astype(np.int8), 2 * margin + 1, mode="constant", cval=0) == 1


FUSION = Estimator(
    name="fusion",
    run=fusion,
    parameters=FusionParameters,
    needs=(*(f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"), ANY_SPEED),
    gives=("grade", "bank", "pitch", "roll"),
    reference="roadlog; docs/methods/fusion.md#states",
    helped=("gnss", "barometer"),
    summary="strapdown smoother over the whole drive with everything the log has",
    vehicle=("pitch_gradient", "roll_gradient", "rear_cornering_stiffness", "imu_position"),
)
