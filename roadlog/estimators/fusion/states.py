"""The states and the measurement rows of `fusion`, by name.

Source: docs/methods/fusion.md#states, docs/methods/fusion.md#measurement-rows.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class State(IntEnum):
    """Index of each state. Body axes: x forward, y left, z up; angles as in docs/conventions.md."""

    U = 0  # m/s, forward velocity of the reference point, in the axes of the IMU
    V = 1  # m/s, to the left
    W = 2  # m/s, upward
    PHI = 3  # rad, roll of the IMU against the horizontal
    THETA = 4  # rad, pitch of the IMU against the horizontal, nose up
    BODY_PITCH = 5  # rad, body pitch that the suspension gradients do not explain
    BODY_ROLL = 6  # rad, body roll that they do not explain
    GYRO_BIAS_X = 7  # rad/s
    GYRO_BIAS_Y = 8  # rad/s
    GYRO_BIAS_Z = 9  # rad/s
    ACCEL_BIAS_X = 10  # m/s2
    ACCEL_BIAS_Y = 11  # m/s2
    ACCEL_BIAS_Z = 12  # m/s2
    MOUNTING_ROLL = 13  # rad, of the IMU against the unmoving body
    MOUNTING_PITCH = 14  # rad, nose up
    MOUNTING_YAW = 15  # rad
    SPEED_SCALE = 16  # -, by which the speed channel shows more
    PITCH_GRADIENT = 17  # rad/(m/s2), body pitch per longitudinal specific force
    PITCH_GRADIENT_SIDE = 18  # rad/(m/s2), by which it is larger driving, smaller braking
    ROLL_GRADIENT = 19  # rad/(m/s2), body roll per lateral specific force
    SLIP_GRADIENT = 20  # rad/(m/s2), rear slip angle per lateral specific force
    SPEED_DELAY = 21  # s, of the speed channel
    REAR_AXLE_X = 22  # m, rear axle from the reference point, forward
    SPEED_OFFSET_Y = 23  # m, speed sensor to the left of the reference point
    PSI = 24  # rad, yaw from east, counterclockwise
    ALTITUDE = 25  # m
    RECEIVER_ERROR = 26  # m, slow error of the receiver's altitude
    BAROMETER_ERROR = 27  # m, slow error of the barometer
    KEPT_ALTITUDE = 28  # m, at an earlier visit of a place


N = len(State)
W_THETA = N  # behind the diagonal of the process noise: its covariance of W and THETA
GYRO_BIAS = slice(State.GYRO_BIAS_X, State.GYRO_BIAS_Z + 1)
ACCEL_BIAS = slice(State.ACCEL_BIAS_X, State.ACCEL_BIAS_Z + 1)
MOUNTING = slice(State.MOUNTING_ROLL, State.MOUNTING_YAW + 1)

# what begins anew behind a gap of the IMU; all others are constants of the drive
MOVING_STATES = np.array(
    [
        State.U,
        State.V,
        State.W,
        State.PHI,
        State.THETA,
        State.BODY_PITCH,
        State.BODY_ROLL,
        State.PSI,
        State.ALTITUDE,
        State.RECEIVER_ERROR,
        State.BAROMETER_ERROR,
        State.KEPT_ALTITUDE,
    ]
)
CONSTANTS = tuple(state for state in State if state not in MOVING_STATES)
# states that others drive, and the number of states, the first ones, that drive them
DRIVEN = np.array(
    [State.U, State.V, State.W, State.PHI, State.THETA, State.PSI, State.ALTITUDE],
)
DRIVERS = State.ACCEL_BIAS_Z + 1
# states that forget
DECAYING = np.array(
    [State.BODY_PITCH, State.BODY_ROLL, State.RECEIVER_ERROR, State.BAROMETER_ERROR]
)


class Row(IntEnum):
    """Measurement rows, in the order in which they are applied."""

    SPEED = 0  # m/s, of the speed channel
    SLIP = 1  # m/s, sideways velocity of the rear axle beyond that of a linear tire: 0
    CONTACT = 2  # m/s, velocity out of the road: 0
    STILL_U = 3  # m/s, velocity at standstill: 0
    STILL_V = 4  # m/s
    STILL_W = 5  # m/s
    STILL_GYRO_X = 6  # rad/s, bias of the gyro at standstill
    STILL_GYRO_Y = 7  # rad/s
    STILL_GYRO_Z = 8  # rad/s
    VELOCITY_EAST = 9  # m/s, of the antenna; from here on the columns of `Fix`
    VELOCITY_NORTH = 10  # m/s
    VELOCITY_UP = 11  # m/s
    ALTITUDE = 12  # m, of the receiver
    HEADING = 13  # rad, of two antennas
    ROLL = 14  # rad, of two antennas
    BAROMETER = 15  # m
    CLOSURE = 16  # m, altitude less that of an earlier visit of the place: 0


ROWS = len(Row)
FIRST_FIX = Row.VELOCITY_EAST
