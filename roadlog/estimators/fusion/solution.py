"""What the smoother of `fusion` found: angles, their variances, and the constants of the drive.

Source: docs/methods/fusion.md#outputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.car.suspension import knows_springs
from roadlog.drive import runs
from roadlog.errors import EstimatorError
from roadlog.estimators.fusion.body import body_pitch, body_roll
from roadlog.estimators.fusion.consistency import Consistency, believed, tempered
from roadlog.estimators.fusion.fit import Fit
from roadlog.estimators.fusion.load import LADEN, UNKNOWN_SD, USUAL_SD, load_pitch
from roadlog.estimators.fusion.mounting import mounting_prior
from roadlog.estimators.fusion.noise import ROAD_BAND
from roadlog.estimators.fusion.outputs import Output
from roadlog.estimators.fusion.recursion import OWN_STATES
from roadlog.estimators.fusion.smoother import Smoothed, smooth
from roadlog.estimators.fusion.states import (
    ACCEL_BIAS,
    CONSTANTS,
    GYRO_BIAS,
    MOUNTING,
    N,
    Row,
    State,
)
from roadlog.estimators.fusion.steps import HEIGHTS, STEP_RATE, beginning, grid, has
from roadlog.filters import Engine
from roadlog.filters.lowpass import gaussian
from roadlog.jit import interpreted
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

SHIFTED = {  # output -> column of the offset in it
    Output.GRADE: 0,
    Output.INCLINATION: 0,
    Output.BANK: 1,
    Output.ROLL_TOTAL: 1,
}
OFFSET_PARTS = (  # of grade and bank: constants, and rad of offset in one unit of each
    ((State.ACCEL_BIAS_X, 1 / G), (State.MOUNTING_PITCH, 1.0)),
    ((State.ACCEL_BIAS_Y, 1 / G), (State.MOUNTING_ROLL, 1.0)),
)
ANGLE_STATES = (  # what the angles are made of
    State.THETA,
    State.PHI,
    State.MOUNTING_PITCH,
    State.MOUNTING_ROLL,
    State.ACCEL_BIAS_X,
    State.ACCEL_BIAS_Y,
    State.PITCH_GRADIENT,
    State.PITCH_GRADIENT_SIDE,
    State.ROLL_GRADIENT,
    State.BODY_PITCH,
    State.BODY_ROLL,
)
ROAD_ROWS = Row.SPEED, Row.SLIP, Row.CONTACT  # that tell the constants
UNITS = "its states end as no number: check units, axes and clocks (`roadlog info`)"
# rad, of an offset that the road alone tells: of a mounting that nobody stated, and of a stated one
LOOSE_PITCH, LOADED_PITCH = np.radians(0.5), np.radians(0.3)
UNKNOWN_ARM = 0.03  # m/s2, of an accelerometer bias found in curves, the IMU's place unknown


@dataclass(frozen=True)
class Solution:
    """What was found on the smoother's own steps.

    time (n,): s. angles: name -> rad (n,). known (n,): the steps at which uncertainty is given.
    variance: name -> rad2 (n,). offset_sd, shape_sd (n, 2): rad, of the mean of grade and bank, and
    of what is left if that were known. constants: name -> value and name_sd, SI units, of the whole
    drive. innovations: row -> the steps that it was used at and its residuals over their predicted
    sd. consistency: how well the drive fits one car.
    """

    fit: Fit
    time: Floats
    angles: dict[str, Floats]
    known: Bools
    variance: dict[str, Floats]
    offset_sd: Floats
    shape_sd: Floats
    constants: dict[str, Floats]
    innovations: dict[Row, tuple[NDArray[np.int64], Floats]]
    consistency: Consistency


def solved(fit: Fit, engine: Engine) -> Solution:
    """Smoothed, iterated once where the drive may be looked at twice."""
    look_ahead, at = fit.inputs.params.smooth, OWN_STATES
    if look_ahead:
        at = smooth(beginning(fit.steps), fit.noise, fit.P0, engine=engine).x
    smoothed = smooth(fit.steps, fit.noise, fit.P0, at, engine, look_ahead, ANGLE_STATES)
    if not np.isfinite(smoothed.x_end).all():
        raise EstimatorError("fusion cannot run: IMU and speed do not fit one car; " + UNITS)
    consistency = Consistency.of(fit, smoothed.x_end)
    offset, shares = _offset_variance(fit, smoothed, consistency)
    load, doubt = _load(fit, smoothed, consistency)
    return Solution(
        fit=fit,
        time=grid(fit.inputs.drive),
        angles=_angles(fit, smoothed, shares, load),
        known=np.isfinite(smoothed.shape_variance[:, Output.GRADE]),
        variance=_variances(fit, smoothed, offset, doubt, consistency),
        offset_sd=np.sqrt(offset),
        shape_sd=consistency.shape * np.sqrt(smoothed.shape_variance),
        constants=_constants(fit, smoothed, consistency),
        innovations=_used(smoothed.innovations),
        consistency=consistency,
    )


def _used(innovations: Floats) -> dict[Row, tuple[NDArray[np.int64], Floats]]:
    """Of (n, 17), what is there: most rows are at every tenth step or rarer."""
    at = {row: np.flatnonzero(np.isfinite(innovations[:, row])) for row in Row}
    return {row: (used, innovations[used, row]) for row, used in at.items() if len(used)}


def _angles(fit: Fit, smoothed: Smoothed, shares: Floats, load: float) -> dict[str, Floats]:
    """The road's and the body's angles.

    Of what the road does faster than ROAD_BAND the body's own bounce is the larger part; it counts
    as body.
    shares (2,): of the offsets found of grade and bank, what is believed. load: rad, pitch by it.
    """
    x, s = dict(zip(ANGLE_STATES, smoothed.x.T, strict=True)), fit.steps.sway.T
    begin = fit.steps.starts[0]
    back = [
        (1 - share) * sum((x[state] - begin[state]) * per for state, per in parts)
        for share, parts in zip(shares, OFFSET_PARTS, strict=True)
    ]
    inclination = x[State.THETA] - x[State.MOUNTING_PITCH] + back[0]
    roll_total = x[State.PHI] - x[State.MOUNTING_ROLL] + back[1]
    with interpreted():
        grade, bank = inclination - body_pitch(x, s), roll_total - body_roll(x, s)
    if fit.inputs.params.smooth:
        grade, bank = _slow(grade, fit.steps.alive), _slow(bank, fit.steps.alive)
    return {
        "grade": grade,
        "bank": bank,
        "pitch": inclination - grade + load,
        "roll": roll_total - bank,
    }


def _slow(values: Floats, alive: Bools) -> Floats:
    """Below ROAD_BAND, over each run of the IMU."""
    result = values.copy()
    for run in runs(alive):
        result[run] = gaussian(values[run], ROAD_BAND, STEP_RATE)
    return result


def _load(fit: Fit, smoothed: Smoothed, consistency: Consistency) -> tuple[float, float]:
    """rad and rad2, of the pitch that the load makes of the constant one that was found."""
    at, inputs, own = State.MOUNTING_PITCH, fit.inputs, fit.inputs.params.load_pitch_sd
    usual = USUAL_SD if knows_springs(inputs.vehicle, "pitch") else UNKNOWN_SD
    prior = (own, 0.0) if own else (usual, LADEN)
    before, after = fit.P0[at, at], smoothed.P_end[at, at]
    # what the data say alone, without the prior
    shared = _loose_pitch(fit) ** 2
    told = 1 / tempered(after, before, consistency.factor(*ROAD_ROWS), shared) - 1 / before
    if told <= 0:
        return load_pitch(0.0, np.inf, 0.0, *prior)
    away = smoothed.x_end[at] - fit.steps.starts[0, at]
    found = inputs.mounting.turn(smoothed.x_end[MOUNTING])[1] + away * after / (before - after)
    mounting = mounting_prior(inputs.vehicle, inputs.params)  # before it was turned, and in doubt
    return load_pitch(found, told**-0.5, mounting.sd[1], *prior)


def _offset_variance(
    fit: Fit, smoothed: Smoothed, consistency: Consistency
) -> tuple[Floats, Floats]:
    """rad2 (n, 2), of the constants that shift all of grade and of bank; and the share of what was
    found of either (2,) that is believed: the mean goes as far as the variance says.
    """
    found = np.maximum(smoothed.variance[:, :2] - smoothed.shape_variance, 0.0)
    P0 = np.diag(fit.P0)
    factors = (
        consistency.factor(Row.SPEED, Row.CONTACT),
        consistency.factor(Row.SPEED, Row.SLIP),
    )
    columns, shares = [], []
    for i, parts in enumerate(OFFSET_PARTS):
        before = float(sum(P0[state] * per**2 for state, per in parts))
        shared = _loose_pitch(fit) ** 2 if i == 0 else 0.0
        columns.append(tempered(found[:, i], before, factors[i], shared))
        shares.append(believed(found[:, i], columns[i], before))
    return np.stack(columns, axis=1) + _unknown_arm(fit), np.array(shares)


def _variances(
    fit: Fit, smoothed: Smoothed, offset: Floats, load: float, consistency: Consistency
) -> dict[str, Floats]:
    """rad2, of every output at the smoother's steps.

    offset (n, 2): of grade and of bank. load: of the body's pitch by it; its roll is in no sum.
    """
    static = dict.fromkeys((Output.PITCH, Output.INCLINATION), load)
    static |= dict.fromkeys((Output.ROLL, Output.BANK), fit.inputs.params.load_roll_sd**2)
    result = {}
    for output in Output:
        whole = smoothed.variance[:, output]
        if output in SHIFTED:  # all but the offset moves with the drive
            column = SHIFTED[output]
            known = np.maximum(smoothed.variance[:, column] - smoothed.shape_variance[:, column], 0)
            whole = np.maximum(whole - known, 0.0) * consistency.shape**2 + offset[:, column]
        else:
            whole = whole * consistency.shape**2
        result[output.name.lower()] = whole + static.get(output, 0.0)
    return result


def _constants(fit: Fit, smoothed: Smoothed, consistency: Consistency) -> dict[str, Floats]:
    """What was found of every constant, after the last step: it holds for the whole drive.

    Mounting and biases in the IMU's own axes, those of the log.
    """
    mounting = fit.inputs.mounting
    x, turn = smoothed.x_end.copy(), np.eye(N)
    for axes in (GYRO_BIAS, ACCEL_BIAS):
        turn[axes, axes] = mounting.rotation.T
        x[axes] = mounting.rotation.T @ x[axes]
    x[MOUNTING] = mounting.rpy(x[MOUNTING])
    x[State.SPEED_DELAY] += fit.inputs.source.lag
    before, after = (np.diag(turn @ P @ turn.T) for P in (fit.P0, smoothed.P_end))
    sd = np.sqrt(tempered(after, before, consistency.factor(*ROAD_ROWS)))
    columns = {}
    for state in CONSTANTS:
        columns[state.name.lower()] = x[[state]]
        columns[f"{state.name.lower()}_sd"] = sd[[state]]
    return columns


def _loose_pitch(fit: Fit) -> float:
    """rad, by which what the road tells of the offset of grade is off as a whole.

    What turns the body with the speed, or who sits where, looks like a mounting. Climb or altitude
    keep it out of the grade.
    """
    vehicle = fit.inputs.vehicle
    if has(fit.steps, *HEIGHTS):
        return 0.0
    if not vehicle.states_mounting:
        return LOOSE_PITCH
    is_known = vehicle.imu_position is not None and knows_springs(vehicle, "pitch")
    return 0.0 if is_known else LOADED_PITCH


def _unknown_arm(fit: Fit) -> Floats:
    """rad2 (2,), of grade and bank: where the IMU's place is not known, its own acceleration in a
    bend looks like a bias. Climb or altitude keep it out of the grade.
    """
    if fit.inputs.vehicle.imu_position is not None:
        return np.zeros(2)
    return (UNKNOWN_ARM / G) ** 2 * np.array([not has(fit.steps, *HEIGHTS), True])
