"""FUSION: grade, bank, pitch and roll by one smoother over the whole drive.

A strapdown model in body axes, corrected by the speed, by "the rear axle slips no more than a
linear tire does", by "the car stays on the road", by stops, and by GNSS where it is there. Grade
and bank have no prior of their own: they are absolute angle minus body angle.
Source: fusion chapter; sections are named below.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from roadlog.car.correction import corrected
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimate import Detail, Estimate, complete_angles
from roadlog.estimators.base import ANY_SPEED, Estimator, flag
from roadlog.estimators.fusion.bryson_frazier import filtered
from roadlog.estimators.fusion.innovations import CHANGED, scales
from roadlog.estimators.fusion.inputs import build, grid, with_fixes
from roadlog.estimators.fusion.model import (
    ALTITUDE,
    BA,
    BAROMETER,
    BG,
    CLOSURE,
    EAST,
    EP,
    ER,
    FORWARD,
    HEADING,
    KAPPA,
    KBETA,
    KPHI,
    KSIDE,
    KTHETA,
    LATERAL,
    LEAN,
    MOVING,
    MPHI,
    MPSI,
    MTHETA,
    NOSE,
    PHI,
    RATE,
    ROLL,
    TAU,
    THETA,
    TIRE,
    UNSIGNED,
    UP,
    XR,
    YW,
    N,
    Noise,
    Steps,
)
from roadlog.estimators.fusion.outputs import (
    BANK,
    GRADE,
    INCLINATION,
    PITCH,
    ROLL_ANGLE,
    ROLL_TOTAL,
)
from roadlog.estimators.fusion.priors import (
    FusionParameters,
    Mounting,
    know_torque,
    mounting_prior,
    noise_of,
    priors,
)
from roadlog.estimators.fusion.recursion import OWN_STATES
from roadlog.estimators.fusion.smoother import Smoothed, smooth
from roadlog.estimators.fusion.speed import SpeedSource, gnss_delay, speed_source
from roadlog.estimators.fusion.torque import torque_bias
from roadlog.filters import Engine
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

DEG = np.pi / 180
SMALL_MOUNTING = 1.0 * DEG  # beyond this the IMU is turned and smoothed again (section 7)
MAX_ROUNDS = 4  # of adapting
LEARNING = 600.0  # s of driving in which noise and mounting show; more costs time and tells little
SPEED_GAP = 3.0  # s without speed, flagged (section 7)
SETTLE = 2.0  # s at the ends of a run of the IMU, flagged
LINEAR_TIRES = 5.0  # m/s2 of lateral specific force, beyond which tires are not linear
OFFSET_LIMIT = 0.15 * DEG  # sd of the mean of grade or bank, beyond which it is not observable
ROAD_BAND = 1.5  # Hz, what changes faster is the body on its springs, not the road
UNKNOWN_ARM = 0.03  # m/s2, of an accelerometer bias that curves tell an IMU of unknown place (10.4)
LEARNED = 0.7  # a constant whose sd is this share of its prior's was found in the drive

OF_THE_DRIVE = ("dt", "starts", "antenna", "height")  # what `Steps` has not one of at each step
OUTPUTS = {
    "grade": GRADE,
    "bank": BANK,
    "pitch": PITCH,
    "roll": ROLL_ANGLE,
    "inclination": INCLINATION,
    "roll_total": ROLL_TOTAL,
}
# constant -> state; the fields of roadlog.v1.FusionConstants, each with its _sd
CONSTANTS = {
    "gyro_bias_x": BG,
    "gyro_bias_y": BG + 1,
    "gyro_bias_z": BG + 2,
    "accel_bias_x": BA,
    "accel_bias_y": BA + 1,
    "accel_bias_z": BA + 2,
    "mounting_roll": MPHI,
    "mounting_pitch": MTHETA,
    "mounting_yaw": MPSI,
    "speed_scale": KAPPA,
    "pitch_gradient": KTHETA,
    "pitch_gradient_side": KSIDE,
    "roll_gradient": KPHI,
    "slip_gradient": KBETA,
    "speed_delay": TAU,
    "rear_axle_x": XR,
    "speed_offset_y": YW,
}


@dataclass(frozen=True)
class Fit:
    """What the smoother is given. P0 (29, 29): prior of all states."""

    steps: Steps
    source: SpeedSource
    P0: Floats
    noise: Noise
    torques: bool
    mounting: Mounting


def fusion(drive: Drive, vehicle: Vehicle, params: FusionParameters, engine: Engine) -> Estimate:
    """All angles with their uncertainty, and every constant found with its standard error."""
    fit = _adapted(
        _given(drive, vehicle, params, mounting_prior(vehicle, params)), drive, vehicle, params
    )
    steps, source, P0 = fit.steps, fit.source, fit.P0
    at = (
        smooth(_beginning(steps), fit.noise, P0, OWN_STATES, engine).x
        if params.smooth
        else OWN_STATES
    )
    result = smooth(steps, fit.noise, P0, at, engine, params.smooth)
    angles, variance = _angles(fit, result, params)
    time = grid(drive)
    shape = np.sqrt(result.shape_variance)
    arm = _unknown_arm(vehicle, steps)
    for name, column in (("grade", 0), ("inclination", 0), ("bank", 1), ("roll_total", 1)):
        variance[name] = variance[name] + arm[column]
    offset = np.sqrt(np.maximum(result.variance[:, :2] - result.shape_variance, 0.0) + arm)
    alive = _nearest(time, steps.alive, drive.time)
    out = {name: np.interp(drive.time, time, values) for name, values in angles.items()}
    reported = np.isfinite(shape[:, GRADE])
    known = time[reported]
    sd = {
        name: np.interp(drive.time, known, np.sqrt(values[reported]))
        for name, values in variance.items()
    }
    for values in (*out.values(), *sd.values()):
        values[~alive] = np.nan
    unknown = np.interp(drive.time, known, (offset[reported] > OFFSET_LIMIT).any(axis=1)) > 0.5
    missing = _without_speed(source, drive.time)
    settling = ~_eroded(alive, round(SETTLE * drive.rate))
    lateral = np.interp(drive.time, time, np.abs(steps.sway[:, TIRE]))
    flags = (
        flag(~alive | missing, "missing")
        | flag(_nearest(time, steps.still, drive.time), "standstill")
        | flag(lateral > LINEAR_TIRES, "model")
        | flag(settling, "converging")
        | flag(unknown, "uncertain")
    )
    details = {
        "shape": Detail(
            "roadlog.v1.FusionShape",
            known,
            {"grade_shape_sd": shape[reported, GRADE], "bank_shape_sd": shape[reported, BANK]},
        ),
        "constants": _constants(fit, result, time),
    }
    out = complete_angles(out)
    used = [*_used(steps, source), *(["torques"] if fit.torques else [])]
    constants = details["constants"].columns
    notes = [
        f"used: {', '.join(used)}",
        *_mounting_notes(fit, constants),
        *_found(constants, np.sqrt(np.diag(P0))),
        *_offset_notes(offset[reported]),
    ]
    return Estimate(drive.time, out, sd, alive & ~missing, flags, details, notes)


def _given(drive: Drive, vehicle: Vehicle, params: FusionParameters, mounting: Mounting) -> Fit:
    """Inputs, priors and noise, with the IMU turned by what is known of its mounting."""
    if not np.array_equal(mounting.rotation, np.eye(3)):
        drive = corrected(drive, Vehicle().mounted(mounting.rotation))
    source = speed_source(drive, vehicle)
    steps = build(drive, vehicle, source, params.speed_sd, params.creep_speed_sd)
    mean, P0 = priors(vehicle, params, source, mounting)
    torque = torque_bias(drive, vehicle, steps)
    if torque is not None:
        know_torque(mean, P0, *torque)
    steps.starts[:] += mean
    noise = noise_of(steps, vehicle, params, drive)
    delay = gnss_delay(drive, source)
    if delay:  # behind a speed that may be late itself: the IMU tells by how much
        alone = _beginning(steps)
        late = float(filtered(alone, noise, P0)[0][_last(alone), TAU])
        delay += late if abs(late) > steps.dt / 2 else 0.0  # a fix counts at the nearest step
    steps = with_fixes(steps, drive, source, delay)
    return Fit(steps, source, P0, noise, torque is not None, mounting)


def _adapted(fit: Fit, drive: Drive, vehicle: Vehicle, params: FusionParameters) -> Fit:
    """With the noise that the drive shows, and the IMU turned until it is straight."""
    for _ in range(MAX_ROUNDS):
        steps = _beginning(fit.steps)
        x, innovations = filtered(steps, fit.noise, fit.P0)
        if _is_wrong(scales(innovations, steps.dt)):
            known = steps._replace(starts=_knowing(steps, x))
            scale = scales(filtered(known, fit.noise, fit.P0)[1], steps.dt)
            if _is_wrong(scale):
                fit = replace(fit, noise=fit.noise._replace(scale=scale))
                x = filtered(steps, fit.noise, fit.P0)[0]
        turned = _straightened(steps, fit.mounting, x) if params.smooth else None
        if turned is None:
            break
        fit = _given(drive, vehicle, params, turned)
    return fit


def _beginning(steps: Steps) -> Steps:
    """The steps of the first LEARNING seconds that the IMU is there."""
    end = int(np.searchsorted(np.cumsum(steps.alive), LEARNING / steps.dt)) + 1
    if end >= len(steps.alive):
        return steps
    parts = steps._asdict().items()
    return steps._replace(**{k: part[:end] for k, part in parts if k not in OF_THE_DRIVE})


def _is_wrong(scale: Floats) -> bool:
    return bool(np.any(scale > CHANGED))


def _knowing(steps: Steps, x: Floats) -> Floats:
    """(m, 29) states to begin with, where the constants are known from the whole drive."""
    starts = steps.starts.copy()
    constants = np.setdiff1d(np.arange(N), MOVING)
    starts[:, constants] = x[_last(steps), constants]
    return starts


def _last(steps: Steps) -> int:
    """The last step that the IMU is there."""
    return int(np.flatnonzero(steps.alive)[-1])


def _straightened(steps: Steps, mounting: Mounting, x: Floats) -> Mounting | None:
    """The mounting turned by what the filter found; None where that is small (section 7)."""
    moving = steps.alive & ~steps.still
    found: Floats = x[_last(steps), MPHI : MPSI + 1].copy()
    bank = None
    if not np.isfinite(steps.fixes[:, ROLL]).any():
        found[0] = 0.0  # nothing tells it
        bank = float(np.mean(x[moving, PHI]))
    if not _has_heights(steps):
        found[1] = 0.0  # what the springs tell of it is weak
    if np.abs(found).max() < SMALL_MOUNTING and not mounting.wrong(found).any():
        return None
    return mounting.turned(found, bank)


def _angles(
    fit: Fit, result: Smoothed, params: FusionParameters
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """The road's and the body's angles and all variances on the smoother's steps (section 7).

    Mounting and load turn the body alike: data give their sum, the priors divide it. Of what the
    road does faster than ROAD_BAND the body's own bounce is the larger part; it counts as body.
    """
    steps, x, s = fit.steps, result.x, fit.steps.sway
    forward = s[:, FORWARD] - x[:, BA] - G * x[:, MTHETA]
    lateral = s[:, LATERAL] - x[:, BA + 1] - G * x[:, MPHI]
    pitch = x[:, KTHETA] * forward + x[:, KSIDE] * s[:, UNSIGNED] + s[:, NOSE] + x[:, EP]
    roll = x[:, KPHI] * lateral + s[:, LEAN] + x[:, ER]
    inclination, roll_total = x[:, THETA] - x[:, MTHETA], x[:, PHI] - x[:, MPHI]
    grade, bank = inclination - pitch, roll_total - roll
    if params.smooth:
        grade, bank = _slow(grade, steps.alive), _slow(bank, steps.alive)
    load, mounting = params.load_pitch_sd**2, fit.P0[MTHETA, MTHETA]
    mounted = fit.mounting.whole(result.x_end[MPHI : MPSI + 1])[1]
    share = load / (load + mounting)
    angles = {
        "grade": grade,
        "bank": bank,
        "pitch": inclination - grade + share * mounted,
        "roll": roll_total - bank,
    }
    static = share**2 * result.P_end[MTHETA, MTHETA] + share * mounting
    variance = {name: result.variance[:, column] for name, column in OUTPUTS.items()}
    for name in ("pitch", "inclination"):
        variance[name] = variance[name] + static
    return angles, variance


def _slow(values: Floats, alive: Bools) -> Floats:
    """Zero-phase Gaussian low-pass, halving ROAD_BAND, over each run of the IMU."""
    from scipy.ndimage import gaussian_filter1d

    width = RATE * np.sqrt(np.log(2) / 2) / (np.pi * ROAD_BAND)
    result = values.copy()
    for run in runs(alive):
        result[run] = gaussian_filter1d(values[run], width, mode="nearest")
    return result


def _constants(fit: Fit, result: Smoothed, time: Floats) -> Detail:
    """What was found of every constant, after the last step: it holds for the whole drive.

    Mounting and biases in the IMU's own axes, those of the log.
    """
    x, P = result.x_end.copy(), result.P_end
    turn = np.eye(N)
    for first in (BG, BA):
        axes = slice(first, first + 3)
        turn[axes, axes] = fit.mounting.rotation.T
        x[axes] = fit.mounting.rotation.T @ x[axes]
    x[MPHI : MPSI + 1] = fit.mounting.whole(x[MPHI : MPSI + 1])
    sd = np.sqrt(np.diag(turn @ P @ turn.T))
    columns = {}
    for name, state in CONSTANTS.items():
        columns[name] = x[[state]]
        columns[f"{name}_sd"] = sd[[state]]
    return Detail("roadlog.v1.FusionConstants", time[-1:], columns)


def _unknown_arm(vehicle: Vehicle, steps: Steps) -> Floats:
    """rad2, variance of grade and bank that curves leave where the IMU's place is not known.

    Its own acceleration in a bend looks like a bias; climb or altitude tell the grade better.
    """
    if vehicle.imu_position is not None:
        return np.zeros(2)
    return (UNKNOWN_ARM / G) ** 2 * np.array([0.0 if _has_heights(steps) else 1.0, 1.0])


def _has_heights(steps: Steps) -> bool:
    return bool(np.isfinite(steps.fixes[:, [UP, ALTITUDE, BAROMETER]]).any())


def _mounting_notes(fit: Fit, constants: Mapping[str, Floats]) -> list[str]:
    """A sentence on an IMU that had to be turned."""
    if np.array_equal(fit.mounting.rotation, np.eye(3)):
        return []
    turn = ", ".join(
        f"{axis} {np.degrees(constants[f'mounting_{axis}'][0]):+.1f}"
        for axis in ("roll", "pitch", "yaw")
    )
    return [f"the IMU is not mounted straight, and was turned (deg): {turn}"]


def _found(constants: Mapping[str, Floats], prior: Floats) -> list[str]:
    """A sentence on the constants that the drive told, with their standard errors."""
    found = [
        f"{name} {constants[name][0]:+.2g} +- {constants[f'{name}_sd'][0]:.1g}"
        for name, state in CONSTANTS.items()
        if constants[f"{name}_sd"][0] < LEARNED * prior[state]
    ]
    return [f"found (SI units, 1 sd): {', '.join(found)}"] if found else []


def _used(steps: Steps, source: SpeedSource) -> list[str]:
    """What the smoother was fed, for people."""
    names = {
        EAST: "GNSS velocity",
        UP: "GNSS climb",
        ALTITUDE: "altitude",
        HEADING: "antenna heading",
        ROLL: "antenna roll",
        BAROMETER: "barometer",
        CLOSURE: "places seen again",
    }
    fixes = [name for column, name in names.items() if np.isfinite(steps.fixes[:, column]).any()]
    return ["imu", source.name, *fixes, *(["stops"] if steps.still.any() else [])]


def _offset_notes(offset: Floats) -> list[str]:
    """A sentence on an angle whose mean no sensor of this drive can tell."""
    notes = []
    for name, column in (("grade", GRADE), ("bank", BANK)):
        sd = float(np.median(offset[:, column]))
        if sd > OFFSET_LIMIT:
            notes.append(
                f"the mean of {name} is known to {np.degrees(sd):.2f} deg only (1 sd); its shape "
                f"is better (detail `shape`)"
            )
    return notes


def _without_speed(source: SpeedSource, time: Floats) -> Bools:
    """Where the nearest speed sample is further than SPEED_GAP."""
    after = np.clip(np.searchsorted(source.time, time), 0, len(source.time) - 1)
    before = np.clip(after - 1, 0, None)
    away = np.minimum(np.abs(source.time[after] - time), np.abs(time - source.time[before]))
    return away > SPEED_GAP


def _nearest(time: Floats, mask: Bools, at: Floats) -> Bools:
    index = np.clip(
        np.round((at - time[0]) / (time[1] - time[0])).astype(np.int64), 0, len(mask) - 1
    )
    return mask[index]


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
    reference="roadlog; Bierman 1973 for the smoother",
    summary="strapdown smoother over the whole drive with everything the log has",
    vehicle=("pitch_gradient", "roll_gradient", "rear_cornering_stiffness", "imu_position"),
)
