"""The noise of `fusion`: of the process over a step, and of every measurement row.

Source: docs/methods/fusion.md#process-noise, docs/methods/fusion.md#measurement-rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.car.suspension import knows_springs, roll_gradient
from roadlog.drive import runs
from roadlog.estimators.fusion.inputs import Inputs, is_shaken
from roadlog.estimators.fusion.states import ROWS
from roadlog.estimators.fusion.steps import STEP_RATE, Steps
from roadlog.filters.spectrum import welch
from roadlog.motion.imu_noise import ImuNoise
from roadlog.types import Floats, Record
from roadlog.units import DEG

# Process, per root second where nothing else is said.
ACCEL_GAIN = 0.01  # -, scale and cross-axis error of a MEMS accelerometer
YAW_SLIP = 0.002  # -, of u r: gyro scale times speed
VERTICAL_GAIN = 0.002  # -, of u q, likewise
GYRO_BIAS = 1e-5  # rad/s, 0.005 deg/s in 90 s: sensors warm up
ACCEL_BIAS = 3e-4  # m/s2, at least: 0.003 m/s2 in 90 s, likewise
# -, of its own prior, by which the accelerometer's bias may wander over WARM_UP s, or the drive
WANDER, WARM_UP = 0.5, 600.0
TURN_TIME = 5.0  # s of a turn, over which an error in proportion to its rate lasts
YAW_GAIN = 0.002  # -, scale error of the gyro
ALTITUDE = 1e-3  # m, little: altitude is the integral of the climb
FAST_GNSS = 5.0  # Hz; slower receivers are of the consumer kind, with a slower and larger error
ALTIMETER, ALTIMETER_TIME = 1.0, 60.0  # m, s: slow altitude error of a fast receiver
CONSUMER_ALTIMETER, CONSUMER_ALTIMETER_TIME = 2.0, 120.0  # m, s: of a slow one
BAROMETER, BAROMETER_TIME = 1.0, 120.0  # m, s: weather and gusts at the port
# m/s; slower, bumps as long as the car rock it below the frequencies in which vibration is measured
SHAKING_SPEED = 10.0
SEGMENT = 10.0  # s, whose spectra are compared
SLOWEST = 1.0  # m/s; slower still, they rock it no more
# Rows.
ROAD_BAND = 1.5  # Hz, what changes faster is the body on its springs, not the road
INTERVAL = (
    0.1  # s between two uses of the road, axle and standstill rows: their errors last so long
)
SLIP_GAIN = 0.003  # -, share of the tire's slip velocity per m/s2: tires are not quite linear
SLIP_YAW = 0.05  # m, times the yaw rate: how well the rear axle's place is known
STILL_SD = 0.02  # m/s, a car that stands rocks by so much
STILL_GYRO_SD = 0.05 * DEG  # rad/s, of a gyro at rest
STILL_GATE = 3.0  # sd, somebody moves the standing car


class Noise(NamedTuple):
    """Process and measurement noise; docs/methods/fusion.md#process-noise."""

    accel: float  # m/s2/sqrt(Hz), forward and sideways
    accel_gain: float  # -, share of the acceleration along the axis
    yaw_slip: float  # -, share of u r
    vertical: float  # m/s2/sqrt(Hz)
    vertical_gain: float  # -, share of u q
    roll: float  # rad/sqrt(s), of the gyro about x
    pitch: float  # rad/sqrt(s), of the gyro about y
    gyro_cross: float  # sqrt(s), times the yaw rate: its share in the other axes
    gyro_bias: float  # rad/s/sqrt(s)
    accel_bias: float  # m/s2/sqrt(s), forward and sideways
    vertical_bias: float  # m/s2/sqrt(s)
    body: float  # rad, body angle that the suspension gains do not explain
    body_vibration: (
        float  # rad, body angle by the unevenness of the road, at SHAKING_SPEED and faster
    )
    body_pitch: float  # rad, of the explained body angle, by the noise of the force
    body_roll: float  # rad
    body_gain: float  # -, share of the body angle explained by the suspension gains
    inertia_gain: float  # -, share of the body angle explained by its inertia
    body_time: float  # s
    pitch_gradient: float  # rad/(m/s2), prior mean
    roll_gradient: float  # rad/(m/s2), prior mean
    yaw: float  # rad/sqrt(s), of the gyro about z
    yaw_gain: float  # -, share of the yaw rate
    altitude: float  # m/sqrt(s)
    altimeter: float  # m, slow error of the altimeter
    altimeter_time: float  # s
    barometer: float  # m, slow error of the barometer
    barometer_time: float  # s
    slip_sd: float  # m/s
    slip_gain: float  # -, share of the tire slip velocity
    slip_yaw: float  # m, times the yaw rate
    contact_sd: float  # m/s
    still_sd: float  # m/s
    still_gyro_sd: float  # rad/s
    every: int  # steps between two uses of the road, axle and standstill rows
    gate: float  # sd, beyond which a residual loses weight
    still_gate: float  # sd, of the standing gyro
    levers: float  # 1 where what the force tells may stand in derivatives; 0 of a shaken sensor
    scale: Floats  # (ROWS,) by which the sd of each row is larger than said above

    def record(self, dt: float) -> Record:
        """The same as the kernels see it, and what a step of dt s leaves of each DECAYING state."""
        times = (self.body_time, self.body_time, self.altimeter_time, self.barometer_time)
        numbers = {**self._asdict(), "decay": np.exp(-dt / np.array(times))}
        kinds = [(name, np.float64, np.shape(value)) for name, value in numbers.items()]
        record = np.recarray(1, np.dtype(kinds))
        for name, value in numbers.items():
            record[name] = value
        return record[0]


def noise_of(inputs: Inputs) -> Noise:
    """The noise of this drive: what is set, its own IMU's, its road's, its receiver's."""
    drive, vehicle, params = inputs.drive, inputs.vehicle, inputs.params
    own = ImuNoise.of(drive.native["imu"])
    rough = np.sqrt(max(vibration(inputs.steps) ** 2 - own.accel[2] ** 2, 0.0))  # the road's alone
    walk = max(ACCEL_BIAS, WANDER * params.accel_bias_sd / np.sqrt(max(drive.time[-1], WARM_UP)))
    fast = "gnss" in drive.native and np.median(np.diff(drive.native["gnss"].time)) < 1 / FAST_GNSS
    return Noise(
        accel=float(np.hypot(params.accel_noise, max(own.accel[0], own.accel[1]))),
        accel_gain=ACCEL_GAIN,
        yaw_slip=YAW_SLIP,
        vertical=float(
            np.hypot(max(params.vertical_noise, params.vertical_vibration * rough), own.accel[2])
        ),
        vertical_gain=VERTICAL_GAIN,
        roll=float(np.hypot(params.gyro_noise, own.gyro[0])),
        pitch=float(np.hypot(params.gyro_noise, own.gyro[1])),
        gyro_cross=params.gyro_cross * np.sqrt(TURN_TIME),
        gyro_bias=GYRO_BIAS,
        accel_bias=walk,
        vertical_bias=walk,
        body=params.body_angle_sd,
        body_vibration=_body_per_vibration(inputs) * rough,
        body_pitch=vehicle.pitch_gain * own.accel[0] * np.sqrt(2 * ROAD_BAND),
        body_roll=roll_gradient(vehicle) * own.accel[1] * np.sqrt(2 * ROAD_BAND),
        body_gain=params.body_share,
        inertia_gain=params.body_inertia_share,
        body_time=params.body_time,
        pitch_gradient=vehicle.pitch_gain,
        roll_gradient=roll_gradient(vehicle),
        yaw=float(np.hypot(params.gyro_noise, own.gyro[2])),
        yaw_gain=YAW_GAIN,
        altitude=ALTITUDE,
        altimeter=ALTIMETER if fast else CONSUMER_ALTIMETER,
        altimeter_time=ALTIMETER_TIME if fast else CONSUMER_ALTIMETER_TIME,
        barometer=BAROMETER,
        barometer_time=BAROMETER_TIME,
        slip_sd=params.slip_sd,
        slip_gain=SLIP_GAIN,
        slip_yaw=SLIP_YAW,
        contact_sd=float(np.hypot(params.contact_sd, params.contact_vibration * rough)),
        still_sd=STILL_SD,
        still_gyro_sd=float(np.hypot(STILL_GYRO_SD, own.gyro.max() * np.sqrt(_used_per_s(inputs)))),
        every=round(INTERVAL / inputs.steps.dt),
        gate=params.gate,
        still_gate=STILL_GATE,
        levers=float(not is_shaken(own)),
        scale=np.ones(ROWS),
    )


def _used_per_s(inputs: Inputs) -> float:
    """1/s, by which white noise grows in a row that takes the sensor's value at a step.

    That value is the mean of two steps, or of a slower sensor's interval; rows that come faster
    than its samples share one.
    """
    rate = 1 / max(float(np.median(np.diff(inputs.drive.native["imu"].time))), 1e-9)
    return float(np.clip(rate, 1 / INTERVAL, STEP_RATE / 2))


def _body_per_vibration(inputs: Inputs) -> float:
    """rad/(m/s2/sqrt(Hz)), body angle per vibration, on a road driven at SHAKING_SPEED.

    An uneven road excites a car by the root of its speed. Bumps as long as the car also rock it,
    the slower the more of them below the frequencies that count as vibration (`process_noise`).
    """
    params, speed = inputs.params, inputs.steps.speed
    known = all(knows_springs(inputs.vehicle, axis) for axis in ("pitch", "roll"))
    moving = np.abs(speed[np.isfinite(speed)])
    usual = max(float(np.median(moving)), SLOWEST) if len(moving) else SHAKING_SPEED
    share = params.known_body_vibration if known else params.body_vibration
    return share * np.sqrt(max(SHAKING_SPEED / usual, 1.0))


def vibration(steps: Steps) -> float:
    """m/s2/sqrt(Hz), how rough the road is: median PSD of f_z in 0.3-2 Hz.

    Source: docs/methods/fusion.md#vibration.

    Median over time as well: curbs and hairpins are not the road.
    """
    levels, weights = [], []
    for run in runs(steps.alive):
        size = run.stop - run.start
        segment = min(size, round(SEGMENT * STEP_RATE))
        frequency, psd = welch(steps.force_at[run, 2], STEP_RATE, segment)
        band = (frequency >= 0.3) & (frequency <= 2.0)
        if band.any():
            levels.append(np.median(psd[band]))
            weights.append(size)
    return float(np.sqrt(np.average(levels, weights=weights) / 2)) if levels else 0.0
