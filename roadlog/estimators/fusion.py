"""FUSION: grade, bank, pitch and roll by one smoother over the whole drive.

A strapdown model in body axes, corrected by the speed, by "the rear axle slips no more than a
linear tire does", by "the car stays on the road", by stops, and by GNSS where it is there. Grade
and bank have no prior of their own: they are absolute angle minus body angle.
Source: fusion chapter; sections are named below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive, runs
from roadlog.estimate import Detail, Estimate, complete_angles
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.fusion_inputs import RATE, SpeedSource, build, grid, vibration
from roadlog.estimators.fusion_model import (
    ALTITUDE,
    BA,
    BAROMETER,
    BG,
    CLOSURE,
    EAST,
    EP,
    ER,
    FORWARD,
    HB,
    HC,
    HEADING,
    HO,
    KAPPA,
    KBETA,
    KPHI,
    KSIDE,
    KTHETA,
    LATERAL,
    LEAN,
    MPHI,
    MPSI,
    MTHETA,
    NOSE,
    PHI,
    PSI,
    ROLL,
    TAU,
    THETA,
    TIRE,
    UNSIGNED,
    UP,
    XR,
    YW,
    H,
    N,
    Noise,
    Steps,
    U,
    V,
    W,
)
from roadlog.estimators.fusion_smoother import (
    BANK,
    GRADE,
    INCLINATION,
    PITCH,
    ROLL_ANGLE,
    ROLL_TOTAL,
    Smoothed,
    smooth,
)
from roadlog.estimators.fusion_torque import torque_bias
from roadlog.filters import Engine
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G
from roadlog.vehicle import Vehicle

DEG = np.pi / 180
SMALL_MOUNTING = 1.0 * DEG  # beyond this the filter linearises once more (section 7)
MAX_PASSES = 3
CALIBRATED_MOUNTING = 0.1 * DEG  # a mounting that the vehicle file gives is no better (section 3)
SPEED_GAP = 3.0  # s without speed, flagged (section 7)
SETTLE = 2.0  # s at the ends of a run of the IMU, flagged
LINEAR_TIRES = 5.0  # m/s2 of lateral specific force, beyond which tires are not linear
OFFSET_LIMIT = 0.15 * DEG  # sd of the mean of grade or bank, beyond which it is not observable
ROAD_BAND = 1.5  # Hz, what changes faster is the body on its springs, not the road
UNKNOWN_ARM = 0.03  # m/s2, of an accelerometer bias that curves tell an IMU of unknown place (10.4)
LEARNED = 0.7  # a constant whose sd is this share of its prior's was found in the drive
SAME_GAIN = 0.01  # a roll gradient this near m h / k was computed, not measured
FAST_GNSS = 5.0  # Hz; slower receivers are of the consumer kind, with a slower and larger error

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
class FusionParameters:
    """Fusion chapter, sections 3 (priors), 5 (process) and 6 (rows), unless said."""

    smooth: bool = parameter(
        True, "", "look ahead; without, each sample is of the past alone, but for the noise levels"
    )
    accel_bias_sd: float = parameter(0.05, "m/s2", "prior, x and y; z twice that")
    gyro_bias_sd: float = parameter(0.3 * DEG, "rad/s", "prior, per axis")
    mounting_sd: float = parameter(
        0.3 * DEG, "rad", "prior of the IMU against the body, where the vehicle file gives none"
    )
    speed_scale_sd: float = parameter(0.01, "-", "prior")
    speed_delay_sd: float = parameter(0.1, "s", "prior; 0.03 where one logger stamps all")
    pitch_gain_sd: float = parameter(0.001, "rad/(m/s2)", "prior")
    pitch_side_sd: float = parameter(
        0.0004, "rad/(m/s2)", "prior of the pitch gain's excess when driving over braking"
    )
    roll_gain_sd: float = parameter(0.0015, "rad/(m/s2)", "prior")
    load_pitch_sd: float = parameter(
        0.0, "rad", "prior of the body's pitch by load; 0: pitch is against the unmoving body"
    )
    accel_noise: float = parameter(0.03, "m/s2/sqrt(Hz)", "forward and sideways")
    vertical_noise: float = parameter(0.05, "m/s2/sqrt(Hz)", "upward, at least")
    vertical_vibration: float = parameter(0.5, "-", "upward noise per vibration of the road")
    gyro_noise: float = parameter(0.02 * DEG, "rad/sqrt(s)", "of the tilt")
    body_angle_sd: float = parameter(0.025 * DEG, "rad", "body angle the gains do not explain")
    body_vibration: float = parameter(
        1.8 * DEG, "rad/(m/s2/sqrt(Hz))", "body angle per vibration of the road"
    )
    body_share: float = parameter(0.08, "-", "body angle, as a share of the explained one")
    body_inertia_share: float = parameter(
        0.25, "-", "body angle, as a share of the one that its inertia explains"
    )
    body_time: float = parameter(0.5, "s", "correlation time of the body angle")
    speed_sd: float = parameter(0.15, "m/s", "of a step's speed; wheel errors are correlated")
    creep_speed_sd: float = parameter(0.3, "m/s", "of a step's speed below 1 m/s")
    slip_sd: float = parameter(0.15, "m/s", "sideways slip beyond the linear tire")
    contact_sd: float = parameter(0.10, "m/s", "velocity out of the road, at least")
    contact_vibration: float = parameter(
        2.5, "m/s/(m/s2/sqrt(Hz))", "velocity out of the road per vibration"
    )
    gate: float = parameter(4.0, "sd", "residuals beyond this lose weight")


def fusion(drive: Drive, vehicle: Vehicle, params: FusionParameters, engine: Engine) -> Estimate:
    """All angles with their uncertainty, and every constant found with its standard error."""
    steps, source = build(drive, vehicle, params.speed_sd, params.creep_speed_sd)
    mean, P0 = priors(vehicle, params, source)
    torque = torque_bias(drive, vehicle, steps)
    if torque is not None:
        know_torque(mean, P0, *torque)
    steps.starts[:] += mean
    noise = noise_of(steps, vehicle, params, drive)
    result = smooth(steps, noise, P0, 1, engine, params.smooth)
    if params.smooth and np.abs(result.x_end[[MTHETA, MPSI]]).max() > SMALL_MOUNTING:
        result = smooth(steps, noise, P0, MAX_PASSES, engine)
    angles, variance = _angles(result, steps, P0, params)
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
        "constants": _constants(result, time),
    }
    out = complete_angles(out)
    used = [*_used(steps, source), *(["torques"] if torque is not None else [])]
    notes = [
        f"used: {', '.join(used)}",
        *_found(result, P0),
        *_offset_notes(offset[reported]),
    ]
    return Estimate(drive.time, out, sd, alive & ~missing, flags, details, notes)


def priors(
    vehicle: Vehicle, params: FusionParameters, source: SpeedSource
) -> tuple[Floats, Floats]:
    """Prior of the constants (29,) and of all states (29, 29) (section 3)."""
    mean, sd = np.zeros(N), np.zeros(N)
    sd[[U, V, W]] = 1.0, 0.3, 0.3
    sd[[PHI, THETA]] = 3 * DEG
    sd[[EP, ER]] = 0.1 * DEG
    sd[BG : BG + 3] = params.gyro_bias_sd
    sd[BA : BA + 3] = np.array([1, 1, 2]) * params.accel_bias_sd
    mounted = vehicle.source("imu_mount").axis_sd
    sd[MPHI : MPSI + 1] = (
        params.mounting_sd if mounted is None else np.maximum(mounted, CALIBRATED_MOUNTING)
    )
    sd[KAPPA] = params.speed_scale_sd
    mean[KTHETA], mean[KPHI] = vehicle.pitch_gain, _roll_gain(vehicle)
    sd[KTHETA] = vehicle.source("pitch_gradient").sd or params.pitch_gain_sd
    sd[KSIDE] = params.pitch_side_sd
    sd[KPHI] = vehicle.source("roll_gradient").sd or params.roll_gain_sd
    known = vehicle.source("rear_cornering_stiffness").kind != "default"
    slip = vehicle.mass * vehicle.cg_to_front_axle / vehicle.wheelbase
    mean[KBETA] = slip / vehicle.rear_cornering_stiffness if known else 0.008
    sd[KBETA] = 0.004
    sd[TAU] = 3 * params.speed_delay_sd if source.name == "gnss" else params.speed_delay_sd
    if vehicle.imu_position is not None:
        mean[XR], sd[XR] = -vehicle.cg_to_rear_axle, 0.05
    else:
        mean[XR], sd[XR] = -1.4, 0.7
    mean[YW], sd[YW] = source.offset, source.offset_sd
    sd[PSI], sd[H], sd[HO], sd[HB], sd[HC] = 0.3, 5.0, 1.0, 1.0, 5.0
    return mean, np.diag(sd**2)


def _roll_gain(vehicle: Vehicle) -> float:
    """rad/(m/s2), body roll per lateral specific force in the road's plane (section 8.4).

    m h / k is per force along the body's own axis, which the roll itself increases by g K.
    """
    gain = vehicle.roll_gain
    if vehicle.roll_stiffness is None:
        return gain
    of_body = vehicle.mass * vehicle.roll_arm / vehicle.roll_stiffness
    return gain / (1 - G * gain) if abs(gain / of_body - 1) < SAME_GAIN else gain


def know_torque(mean: Floats, P0: Floats, bias: float, sd: float) -> None:
    """Put the accelerometer bias that the wheel torques tell into the prior (section 6)."""
    h = np.zeros(N)
    h[BA], h[MTHETA] = 1.0, G
    gain = P0 @ h / (h @ P0 @ h + sd**2)
    mean += gain * (bias - h @ mean)
    P0 -= np.outer(gain, h @ P0)


def noise_of(steps: Steps, vehicle: Vehicle, params: FusionParameters, drive: Drive) -> Noise:
    rough = vibration(steps)
    fast = "gnss" in drive.native and np.median(np.diff(drive.native["gnss"].time)) < 1 / FAST_GNSS
    return Noise(
        accel=params.accel_noise,
        accel_gain=0.01,
        yaw_slip=0.002,
        vertical=max(params.vertical_noise, params.vertical_vibration * rough),
        vertical_gain=0.002,
        gyro=params.gyro_noise,
        gyro_bias=5e-6,
        accel_bias=1e-4,
        body=params.body_angle_sd + params.body_vibration * rough,
        body_gain=params.body_share,
        inertia_gain=params.body_inertia_share,
        body_time=params.body_time,
        pitch_gain=vehicle.pitch_gain,
        roll_gain=_roll_gain(vehicle),
        yaw=0.02 * DEG,
        yaw_gain=0.002,
        altitude=1e-3,
        altimeter=1.0 if fast else 2.0,
        altimeter_time=60.0 if fast else 120.0,
        barometer=1.0,
        barometer_time=120.0,
        slip_sd=params.slip_sd,
        slip_gain=0.003,
        slip_yaw=0.05,
        contact_sd=float(np.hypot(params.contact_sd, params.contact_vibration * rough)),
        still_sd=0.02,
        still_gyro_sd=0.05 * DEG,
        every=round(0.1 / steps.dt),
        gate=params.gate,
        still_gate=3.0,
    )


def _angles(
    result: Smoothed, steps: Steps, P0: Floats, params: FusionParameters
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """The road's and the body's angles and all variances on the smoother's steps (section 7).

    Mounting and load turn the body alike: data give their sum, the priors divide it. Of what the
    road does faster than ROAD_BAND the body's own bounce is the larger part; it counts as body.
    """
    x, s = result.x, steps.sway
    pitch = x[:, KTHETA] * s[:, FORWARD] + x[:, KSIDE] * s[:, UNSIGNED] + s[:, NOSE] + x[:, EP]
    roll = x[:, KPHI] * s[:, LATERAL] + s[:, LEAN] + x[:, ER]
    inclination, roll_total = x[:, THETA] - x[:, MTHETA], x[:, PHI] - x[:, MPHI]
    grade, bank = inclination - pitch, roll_total - roll
    if params.smooth:
        grade, bank = _slow(grade, steps.alive), _slow(bank, steps.alive)
    load, mounting = params.load_pitch_sd**2, P0[MTHETA, MTHETA]
    share = load / (load + mounting)
    angles = {
        "grade": grade,
        "bank": bank,
        "pitch": inclination - grade + share * x[:, MTHETA],
        "roll": roll_total - bank,
    }
    static = share**2 * result.P_end[MTHETA, MTHETA] + share * mounting
    variance = {name: result.variance[:, column] for name, column in OUTPUTS.items()}
    for name in ("pitch", "inclination"):
        variance[name] = variance[name] + static
    # `sway` is of the sensor as it is: its constant error bends the body a little for good
    known = np.diag(result.P_end)
    for name, gain, bias, angle in (
        ("pitch", KTHETA, BA, MTHETA),
        ("roll", KPHI, BA + 1, MPHI),
    ):
        error = known[bias] + G**2 * known[angle]
        variance[name] = variance[name] + result.x_end[gain] ** 2 * error
    return angles, variance


def _slow(values: Floats, alive: Bools) -> Floats:
    """Zero-phase Gaussian low-pass, halving ROAD_BAND, over each run of the IMU."""
    from scipy.ndimage import gaussian_filter1d

    width = RATE * np.sqrt(np.log(2) / 2) / (np.pi * ROAD_BAND)
    result = values.copy()
    for run in runs(alive):
        result[run] = gaussian_filter1d(values[run], width, mode="nearest")
    return result


def _constants(result: Smoothed, time: Floats) -> Detail:
    """What was found of every constant, after the last step: it holds for the whole drive."""
    sd = np.sqrt(np.diag(result.P_end))
    columns = {}
    for name, state in CONSTANTS.items():
        columns[name] = result.x_end[[state]]
        columns[f"{name}_sd"] = sd[[state]]
    return Detail("roadlog.v1.FusionConstants", time[-1:], columns)


def _unknown_arm(vehicle: Vehicle, steps: Steps) -> Floats:
    """rad2, variance of grade and bank that curves leave where the IMU's place is not known.

    Its own acceleration in a bend looks like a bias; climb or altitude tell the grade better.
    """
    if vehicle.imu_position is not None:
        return np.zeros(2)
    heights = np.isfinite(steps.fixes[:, [UP, ALTITUDE, BAROMETER]]).any()
    return (UNKNOWN_ARM / G) ** 2 * np.array([0.0 if heights else 1.0, 1.0])


def _found(result: Smoothed, P0: Floats) -> list[str]:
    """A sentence on the constants that the drive told, with their standard errors."""
    sd, prior = np.sqrt(np.diag(result.P_end)), np.sqrt(np.diag(P0))
    found = [
        f"{name} {result.x_end[state]:+.2g} +- {sd[state]:.1g}"
        for name, state in CONSTANTS.items()
        if sd[state] < LEARNED * prior[state]
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
