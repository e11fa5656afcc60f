"""The parameters of `fusion`."""

from __future__ import annotations

from dataclasses import dataclass

from roadlog.estimators.base import parameter
from roadlog.units import DEG


@dataclass(frozen=True)
class FusionParameters:
    """docs/methods/fusion.md#parameters-of-fusion."""

    smooth: bool = parameter(
        True, "", "look ahead; without, each sample is of the past alone, but for the noise levels"
    )
    accel_bias_sd: float = parameter(0.05, "m/s2", "prior, x and y; z twice that")
    gyro_bias_sd: float = parameter(1.0 * DEG, "rad/s", "prior, per axis; phones have 0.9 deg/s")
    mounting_sd: float = parameter(
        1.5 * DEG,
        "rad",
        "prior of roll and pitch of an IMU whose mounting nobody states; yaw twice",
    )
    speed_scale_sd: float = parameter(0.01, "-", "prior")
    speed_delay_sd: float = parameter(0.1, "s", "prior; 0.03 where one logger stamps all")
    pitch_gain_sd: float = parameter(0.001, "rad/(m/s2)", "prior")
    pitch_side_sd: float = parameter(
        0.0004, "rad/(m/s2)", "prior of the pitch gain's excess when driving over braking"
    )
    roll_gain_sd: float = parameter(0.002, "rad/(m/s2)", "prior; cars roll 3 to 7 deg/g")
    load_pitch_sd: float = parameter(
        0.0, "rad", "prior of the body's pitch by a load that is there; 0: perhaps there is none"
    )
    load_roll_sd: float = parameter(
        0.2 * DEG,
        "rad",
        "of the body's roll by load, that no row shows; a driver alone: 0.1 to 0.25",
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
