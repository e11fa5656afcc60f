"""What `fusion` assumes: parameters, priors of the states, and the noise of process and rows.

Source: fusion chapter, sections 3 (priors), 5 (process) and 6 (rows).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.base import parameter
from roadlog.estimators.fusion.inputs import vibration
from roadlog.estimators.fusion.model import (
    BA,
    BG,
    EP,
    ER,
    HB,
    HC,
    HO,
    KAPPA,
    KBETA,
    KPHI,
    KSIDE,
    KTHETA,
    MPHI,
    MPSI,
    MTHETA,
    PHI,
    PSI,
    ROWS,
    SHAKING_SPEED,
    SLOWEST,
    TAU,
    THETA,
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
from roadlog.estimators.fusion.speed import SpeedSource
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

DEG = np.pi / 180
CALIBRATED_MOUNTING = 0.1 * DEG  # a mounting that the vehicle file gives is no better (section 3)
UNKNOWN_MOUNTING = 3.0 * DEG  # of an IMU that lies somewhere in the car (section 3)
CROSSFALL = 1.5 * DEG  # sd of a drive's mean bank: what levels an IMU that lies askew
TURN_TIME = 5.0  # s of a turn, over which an error in proportion to its rate lasts
UNKNOWN_SIDE = 0.4  # m, sd of the IMU's place across the car where it is not known
GIVEN_GAIN = 0.08  # share by which a suspension gain of a vehicle file is wrong (section 8.4)
CONFLICT = 2.0  # sd; a mounting found further from its prior was not mounted as that says
SAME_GAIN = 0.01  # a roll gradient this near m h / k was computed, not measured
FAST_GNSS = 5.0  # Hz; slower receivers are of the consumer kind, with a slower and larger error


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
    roll_gain_sd: float = parameter(0.002, "rad/(m/s2)", "prior; cars roll 3 to 7 deg/g")
    load_pitch_sd: float = parameter(
        0.0, "rad", "prior of the body's pitch by load; 0: pitch is against the unmoving body"
    )
    accel_noise: float = parameter(0.03, "m/s2/sqrt(Hz)", "forward and sideways")
    vertical_noise: float = parameter(0.05, "m/s2/sqrt(Hz)", "upward, at least")
    vertical_vibration: float = parameter(0.5, "-", "upward noise per vibration of the road")
    gyro_noise: float = parameter(0.02 * DEG, "rad/sqrt(s)", "of the tilt")
    gyro_cross: float = parameter(0.001, "-", "share of the yaw rate in the gyro's other axes")
    body_angle_sd: float = parameter(0.025 * DEG, "rad", "body angle the gains do not explain")
    body_vibration: float = parameter(
        2.5 * DEG, "rad/(m/s2/sqrt(Hz))", "body angle per vibration of the road"
    )
    known_body_vibration: float = parameter(
        0.9 * DEG, "rad/(m/s2/sqrt(Hz))", "the same where the vehicle file knows the springs"
    )
    body_share: float = parameter(0.05, "-", "body angle, as a share of the explained one")
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


@dataclass(frozen=True)
class Mounting:
    """What is known of the IMU against the unmoving body.

    rotation (3, 3): rows forward, left, up, in the IMU's axes, by which its signals are turned.
    mean, sd (3,): rad, prior of the roll, pitch and yaw that are left (MPHI, MTHETA, MPSI).
    """

    rotation: Floats
    mean: Floats
    sd: Floats

    def wrong(self, found: Floats) -> Bools:
        """(3,), whether each angle is further from its prior than that allows."""
        return np.abs(found - self.mean) > CONFLICT * self.sd

    def turned(self, found: Floats, mean_bank: float | None) -> Mounting:
        """Turned by what the data found, so that it is small again (section 7).

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

    def whole(self, left: Floats) -> Floats:
        """rad, roll, pitch and yaw of the IMU, from those left (3,)."""
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_matrix(_rotation(left) @ self.rotation).as_rotvec()
        return turn * [1.0, -1.0, 1.0]


def _rotation(angles: Floats) -> Floats:
    """(3, 3), of roll and yaw right-handed, pitch nose-up; rad."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(angles * [1.0, -1.0, 1.0]).as_matrix()


def mounting_prior(vehicle: Vehicle, params: FusionParameters) -> Mounting:
    """As the vehicle file has it, else straight."""
    known = vehicle.source("imu_mount").axis_sd
    sd = np.full(3, params.mounting_sd)
    if known is not None:
        sd = np.maximum(known, CALIBRATED_MOUNTING)
    return Mounting(np.eye(3), np.zeros(3), sd)


def priors(
    vehicle: Vehicle, params: FusionParameters, source: SpeedSource, mounting: Mounting
) -> tuple[Floats, Floats]:
    """Prior of the constants (29,) and of all states (29, 29) (section 3)."""
    mean, sd = np.zeros(N), np.zeros(N)
    sd[[U, V, W]] = 1.0, 0.3, 0.3
    sd[[PHI, THETA]] = 3 * DEG
    sd[[EP, ER]] = 0.1 * DEG
    sd[BG : BG + 3] = params.gyro_bias_sd
    sd[BA : BA + 3] = np.array([1, 1, 2]) * params.accel_bias_sd
    mean[MPHI : MPSI + 1], sd[MPHI : MPSI + 1] = mounting.mean, mounting.sd
    sd[KAPPA] = params.speed_scale_sd
    mean[KTHETA], mean[KPHI] = vehicle.pitch_gain, roll_gain(vehicle)
    sd[KTHETA] = _gain_sd(vehicle, "pitch", mean[KTHETA], params.pitch_gain_sd)
    sd[KSIDE] = params.pitch_side_sd
    sd[KPHI] = _gain_sd(vehicle, "roll", mean[KPHI], params.roll_gain_sd)
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
    if vehicle.imu_position is None:
        sd[YW] = np.hypot(sd[YW], UNKNOWN_SIDE)
    sd[PSI], sd[H], sd[HO], sd[HB], sd[HC] = 0.3, 5.0, 1.0, 1.0, 5.0
    return mean, np.diag(sd**2)


def roll_gain(vehicle: Vehicle) -> float:
    """rad/(m/s2), body roll per lateral specific force in the road's plane (section 8.4).

    m h / k is per force along the body's own axis, which the roll itself increases by g K.
    """
    gain = vehicle.roll_gain
    if vehicle.roll_stiffness is None:
        return gain
    of_body = vehicle.mass * vehicle.roll_arm / vehicle.roll_stiffness
    return gain / (1 - G * gain) if abs(gain / of_body - 1) < SAME_GAIN else gain


def _gain_sd(vehicle: Vehicle, axis: str, gain: float, unknown: float) -> float:
    """rad/(m/s2), as the vehicle file says it, or by what gains of a file are worth."""
    found = vehicle.source(f"{axis}_gradient").sd
    return found or (GIVEN_GAIN * gain if _knows_springs(vehicle, axis) else unknown)


def _knows_springs(vehicle: Vehicle, axis: str) -> bool:
    names = f"{axis}_gradient", f"{axis}_stiffness"
    return any(getattr(vehicle, name) is not None for name in names)


def _shaken(steps: Steps, vehicle: Vehicle, params: FusionParameters) -> float:
    """rad/(m/s2/sqrt(Hz)), body angle per vibration, on a road driven at SHAKING_SPEED.

    An uneven road shakes a car by the root of its speed. Bumps as long as the car also rock it,
    the slower the more of them below the frequencies that count as vibration (`process_noise`).
    """
    known = _knows_springs(vehicle, "pitch") and _knows_springs(vehicle, "roll")
    moving = np.abs(steps.speed[np.isfinite(steps.speed)])
    usual = max(float(np.median(moving)), SLOWEST) if len(moving) else SHAKING_SPEED
    share = params.known_body_vibration if known else params.body_vibration
    return share * np.sqrt(max(SHAKING_SPEED / usual, 1.0))


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
        gyro_cross=params.gyro_cross * np.sqrt(TURN_TIME),
        gyro_bias=1e-5,  # 0.005 deg/s in 90 s; section 5 has half of it
        accel_bias=3e-4,
        body=params.body_angle_sd,
        shaken=_shaken(steps, vehicle, params) * rough,
        body_gain=params.body_share,
        inertia_gain=params.body_inertia_share,
        body_time=params.body_time,
        pitch_gain=vehicle.pitch_gain,
        roll_gain=roll_gain(vehicle),
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
        scale=np.ones(ROWS),
    )
