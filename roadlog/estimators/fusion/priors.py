"""What `fusion` assumes of every state before it sees the drive.

Source: docs/methods/fusion.md#states.
"""

from __future__ import annotations

import numpy as np

from roadlog.car.suspension import knows_springs, roll_gradient
from roadlog.car.vehicle import Vehicle
from roadlog.estimators.fusion.inputs import Inputs
from roadlog.estimators.fusion.states import ACCEL_BIAS, GYRO_BIAS, MOUNTING, N, State
from roadlog.types import Floats
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

FORWARD_SD, SIDE_SD = 1.0, 0.3  # m/s, of the first velocity forward; sideways and upward
TILT_SD = 3 * DEG  # of the first roll and pitch: dv/dt over two seconds is no better
BODY_SD = 0.1 * DEG  # body angle that the gradients do not explain
ACCEL_BIAS_AXES = (1.0, 1.0, 2.0)  # times `accel_bias_sd`: z is the worst axis of a MEMS sensor
LOAD_SD = 0.4 * DEG  # of the body's pitch by who sits where: it was empty when it was measured
SLIP_GRADIENT, SLIP_GRADIENT_SD = 0.008, 0.002  # rad/(m/s2), of passenger cars: 3 to 7 deg/g
GIVEN_GAIN = 0.08  # share by which a suspension gradient of a vehicle file is wrong
GNSS_DELAY_FACTOR = 3.0  # a receiver's speed may be later than a car's by so much
KNOWN_AXLE_SD = 0.05  # m, of the rear axle's place where the IMU's is known
UNKNOWN_AXLE, UNKNOWN_AXLE_SD = -1.4, 0.5  # m, from an IMU at the dashboard; hardly behind the axle
UNKNOWN_SIDE = 0.4  # m, sd of the IMU's place across the car where it is not known
YAW_SD = 0.3  # rad, of the first course
ALTITUDE_SD = 5.0  # m, of the first altitude, also of that of a place before its first visit
ALTIMETER_SD = 1.0  # m, of the slow error of receiver and barometer


def priors(inputs: Inputs) -> tuple[Floats, Floats]:
    """Mean of the constants (29,), 0 elsewhere, and covariance of all states (29, 29)."""
    vehicle, params = inputs.vehicle, inputs.params
    mean, sd = np.zeros(N), np.zeros(N)
    sd[State.U], sd[[State.V, State.W]] = FORWARD_SD, SIDE_SD
    sd[[State.PHI, State.THETA]] = TILT_SD
    sd[[State.BODY_PITCH, State.BODY_ROLL]] = BODY_SD
    sd[GYRO_BIAS] = params.gyro_bias_sd
    sd[ACCEL_BIAS] = np.array(ACCEL_BIAS_AXES) * params.accel_bias_sd
    mean[MOUNTING], sd[MOUNTING] = inputs.mounting.mean, inputs.mounting.sd
    sd[State.MOUNTING_PITCH] = np.hypot(sd[State.MOUNTING_PITCH], LOAD_SD)
    sd[State.SPEED_SCALE] = params.speed_scale_sd
    gradients = vehicle.pitch_gain, roll_gradient(vehicle)
    mean[[State.PITCH_GRADIENT, State.ROLL_GRADIENT]] = gradients
    sd[State.PITCH_GRADIENT] = _gradient_sd(vehicle, "pitch", gradients[0], params.pitch_gain_sd)
    sd[State.PITCH_GRADIENT_SIDE] = params.pitch_side_sd
    sd[State.ROLL_GRADIENT] = _gradient_sd(vehicle, "roll", gradients[1], params.roll_gain_sd)
    known = vehicle.source("rear_cornering_stiffness").kind != "default"
    slip = vehicle.mass * vehicle.cg_to_front_axle / vehicle.wheelbase
    mean[State.SLIP_GRADIENT] = slip / vehicle.rear_cornering_stiffness if known else SLIP_GRADIENT
    sd[State.SLIP_GRADIENT] = SLIP_GRADIENT_SD
    late = GNSS_DELAY_FACTOR if inputs.source.name == "gnss" else 1.0
    sd[State.SPEED_DELAY] = late * params.speed_delay_sd
    mean[State.SPEED_OFFSET_Y] = inputs.source.offset
    sd[State.SPEED_OFFSET_Y] = inputs.source.offset_sd
    if vehicle.imu_position is not None:
        mean[State.REAR_AXLE_X], sd[State.REAR_AXLE_X] = -vehicle.cg_to_rear_axle, KNOWN_AXLE_SD
    else:
        mean[State.REAR_AXLE_X], sd[State.REAR_AXLE_X] = UNKNOWN_AXLE, UNKNOWN_AXLE_SD
        sd[State.SPEED_OFFSET_Y] = np.hypot(sd[State.SPEED_OFFSET_Y], UNKNOWN_SIDE)
    sd[State.PSI] = YAW_SD
    sd[[State.ALTITUDE, State.KEPT_ALTITUDE]] = ALTITUDE_SD
    sd[[State.RECEIVER_ERROR, State.BAROMETER_ERROR]] = ALTIMETER_SD
    P0 = np.diag(sd**2)
    if inputs.torque is not None:
        _know_torque(mean, P0, *inputs.torque)
    return mean, P0


def _gradient_sd(vehicle: Vehicle, axis: str, gradient: float, unknown: float) -> float:
    """rad/(m/s2), as the vehicle file says it, or by what gradients of a file are worth."""
    found = vehicle.source(f"{axis}_gradient").sd
    return found or (GIVEN_GAIN * gradient if knows_springs(vehicle, axis) else unknown)


def _know_torque(mean: Floats, P0: Floats, bias: float, sd: float) -> None:
    """The bias by the wheel torques into the prior; docs/methods/fusion.md#torques."""
    h = np.zeros(N)
    h[State.ACCEL_BIAS_X], h[State.MOUNTING_PITCH] = 1.0, G
    gain = P0 @ h / (h @ P0 @ h + sd**2)
    mean += gain * (bias - h @ mean)
    P0 -= np.outer(gain, h @ P0)
