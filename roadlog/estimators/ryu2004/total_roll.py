"""Total roll of the body (bank + roll), from two GNSS antennas or from the IMU alone.

`gnss_ins` is the layer that Ryu 2004 takes from elsewhere (sideslip and total roll); `imu_roll`
stands in where the log has no second antenna. Source: docs/methods/ryu2004.md#two-antennas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from roadlog.car.lever_arm import SpecificForce, specific_force_at_cg
from roadlog.car.road_speed import tire_slip_compliance
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.estimators.base import flag
from roadlog.estimators.luo2024.kmbe import KmbeParameters, kmbe
from roadlog.filters import Engine
from roadlog.filters.gaps import age, hold
from roadlog.filters.kalman import LinearModel, StateTrack, kalman_filter, rts_smoother
from roadlog.filters.kernels import odd_window, parabolic_mean, slope
from roadlog.once import once
from roadlog.types import Flags, Floats
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

TWO_ANTENNAS = ("gnss.heading", "gnss.roll", "gnss.speed", "gnss.course", "gnss.climb")
HOLD_TIME = 0.2  # s, inertial signals are held this long
INERTIAL_GAP = 0.3  # s, without inertial signals the filters stop
GNSS_GAP = 2.0  # s, without GNSS the result is no longer valid
RATE_BIAS_SD = 0.3 * DEG  # rad/s, of a gyro at the start
CLIMB_WINDOW = 0.6  # s, moving average of the climb angle
MIN_CLIMB_SPEED = 1.0  # m/s, below it a climb angle and a sideslip are not defined
DERIVATIVE_WINDOW = 0.5  # s
IMU_ROLL_INTERVAL = 0.1  # s between accelerometer angles


@dataclass(frozen=True)
class AngleTuning:
    """Noise of one angle filter: density of the angle rad/sqrt(s) and of the rate's bias
    rad/s/sqrt(s), sd of a measurement rad."""

    angle: float
    bias: float
    measurement: float


HEADING = AngleTuning(0.02 * DEG, 0.002 * DEG, 0.15 * DEG)
GNSS_ROLL = AngleTuning(0.1 * DEG, 0.002 * DEG, 0.20 * DEG)
IMU_ROLL = AngleTuning(0.3 * DEG, 0.002 * DEG, np.sqrt(5.0) * 1.5 * DEG)

VELOCITY_NOISE = (0.05, 0.05, 0.01, 0.003)  # v_x, v_y m/s2, biases m/s3, per sqrt(Hz)
VELOCITY_SD0 = (0.1**0.5, 0.1**0.5, 0.05, 0.05)
VELOCITY_SD = 0.03  # m/s, of the receiver along each horizontal axis


@dataclass(frozen=True)
class TotalRoll:
    """On the drive's grid, NaN where not known.

    angle, sd: rad, right side down. yaw_rate, roll_rate: rad/s, bias taken off. beta, beta_sd:
    rad, sideslip at the roll axis under the CG, NaN without two antennas; velocity (2, n)
    m/s likewise. force: m/s2, at the CG.
    since_update: s since the last measurement. source: `gnss_ins` or `imu_roll`.
    """

    angle: Floats
    sd: Floats
    yaw_rate: Floats
    roll_rate: Floats
    beta: Floats
    beta_sd: Floats
    velocity: Floats
    force: SpecificForce
    since_update: Floats
    source: str

    @property
    def flags(self) -> Flags:
        """Where it is not known, and where the gyros alone carry it on."""
        missing = ~np.isfinite(self.angle) | (self.since_update > GNSS_GAP)
        carried = ~missing & (self.since_update > INERTIAL_GAP)
        return flag(missing, "missing") | flag(carried, "held")

    @property
    def note(self) -> str:
        """Where total roll came from, for the user."""
        if self.source == "gnss_ins":
            return "total roll and sideslip from the two-antenna GNSS receiver (gnss_ins)"
        return (
            "no two-antenna GNSS in this drive: total roll from the IMU (imu_roll), so roll "
            "mounting and accelerometer bias go into it one to one"
        )


def has_two_antennas(drive: Drive) -> bool:
    """Whether a two-antenna receiver gave heading and roll."""
    return all(role in drive for role in TWO_ANTENNAS)


def total_roll(drive: Drive, vehicle: Vehicle, smooth: bool, engine: Engine) -> TotalRoll:
    """Total roll by the best means that the drive allows."""
    if has_two_antennas(drive):
        return gnss_ins(drive, vehicle, smooth, engine)
    return imu_roll(drive, vehicle, smooth, engine)


@once
def gnss_ins(drive: Drive, vehicle: Vehicle, smooth: bool, engine: Engine) -> TotalRoll:
    """Heading, total roll and velocity; docs/methods/ryu2004.md#two-antennas.

    GNSS samples count at their own times: 50 ms of latency left in cost 0.46 deg of sideslip.
    """
    force = specific_force_at_cg(drive, vehicle.imu_position)
    p, q, r = (_held(drive, f"imu.gyro_{axis}") for axis in "xyz")
    heading, heading_bias, heading_sd = _angle_filter(
        drive, r, _at_epochs(drive, "heading"), HEADING, smooth, engine
    )
    pitch_total = _climb_angle(drive) + vehicle.pitch_gain * np.nan_to_num(force.x)
    yaw_rate = r - heading_bias
    tilt_rate = p - np.sin(pitch_total) * yaw_rate
    angle, roll_bias, sd = _angle_filter(
        drive, tilt_rate, _at_epochs(drive, "roll"), GNSS_ROLL, smooth, engine
    )
    roll_rate = p - roll_bias
    attitude = _Attitude(
        np.stack([roll_rate, q, yaw_rate]), pitch_total, angle, heading, heading_sd
    )
    velocity, velocity_sd = _velocity_filter(drive, vehicle, attitude, smooth, engine)
    moving = velocity[0] >= MIN_CLIMB_SPEED
    forward = np.where(moving, velocity[0], np.nan)
    return TotalRoll(
        angle=angle,
        sd=sd,
        yaw_rate=yaw_rate,
        roll_rate=roll_rate,
        beta=np.arctan2(velocity[1], forward),
        beta_sd=np.hypot(velocity_sd, forward * heading_sd) / forward,
        velocity=velocity,
        force=force,
        since_update=age(np.isfinite(_at_epochs(drive, "roll"))) * drive.dt,
        source="gnss_ins",
    )


@once
def imu_roll(drive: Drive, vehicle: Vehicle, smooth: bool, engine: Engine) -> TotalRoll:
    """Total roll from IMU and speed; docs/methods/ryu2004.md#total-roll-from-the-imu.

    The yaw rate's share in the rate of the angle is decisive on a tilted plane. The absolute
    level is lost: roll mounting and accelerometer bias go into the angle one to one.
    """
    force = specific_force_at_cg(drive, vehicle.imu_position)
    p, r = _held(drive, "imu.gyro_x"), _held(drive, "imu.gyro_z")
    grade = kmbe(drive, vehicle, KmbeParameters(smooth=smooth), engine).grade
    pitch_total = np.nan_to_num(grade + vehicle.pitch_gain * force.x)
    n = odd_window(DERIVATIVE_WINDOW, drive.dt)
    in_plane = force.y * (1 - G * vehicle.roll_gain)
    v_y_dot = vehicle.cg_to_rear_axle * slope(r, n, drive.dt) - drive.speed * (
        tire_slip_compliance(vehicle) * slope(in_plane, n, drive.dt)
    )
    sine = (parabolic_mean(force.y - drive.speed * r, n) - v_y_dot) / G
    measured = np.where(np.abs(sine) < 1.0, np.arcsin(np.clip(sine, -1.0, 1.0)), np.nan)
    every = np.arange(len(drive)) % round(IMU_ROLL_INTERVAL * drive.rate) == 0
    measured = np.where(every, measured, np.nan)
    angle, bias, sd = _angle_filter(
        drive, p - np.sin(pitch_total) * r, measured, IMU_ROLL, smooth, engine
    )
    unknown = np.full(len(drive), np.nan)
    return TotalRoll(
        angle=angle,
        sd=sd,
        yaw_rate=r,
        roll_rate=p - bias,
        beta=unknown,
        beta_sd=unknown,
        velocity=np.stack([unknown, unknown]),
        force=force,
        since_update=age(np.isfinite(measured)) * drive.dt,
        source="imu_roll",
    )


def _held(drive: Drive, role: str) -> Floats:
    return hold(drive[role], round(HOLD_TIME * drive.rate))[0]


def _at_epochs(drive: Drive, field: str) -> Floats:
    """A GNSS field at the grid points nearest to its samples, NaN elsewhere; angles unwrapped."""
    samples = drive.native.get("gnss")
    result = np.full(len(drive), np.nan)
    if samples is None or field not in samples.columns:
        return result
    values = samples.columns[field]
    known = np.isfinite(values)
    values = values[known]
    if field in ("heading", "course"):
        values = np.unwrap(values)
    index = np.round(samples.time[known] * drive.rate).astype(np.int64)
    inside = (index >= 0) & (index < len(drive))
    result[index[inside]] = values[inside]
    return result


def _climb_angle(drive: Drive) -> Floats:
    """rad, slope of the motion: interpolated between fixes, averaged over CLIMB_WINDOW."""
    climb, speed = drive.get("gnss.climb"), drive.get("gnss.speed")
    ratio = np.where(speed > MIN_CLIMB_SPEED, climb / np.maximum(speed, MIN_CLIMB_SPEED), 0.0)
    angle = np.arcsin(np.clip(np.nan_to_num(ratio), -0.9, 0.9))
    n = odd_window(CLIMB_WINDOW, drive.dt)
    return np.convolve(np.pad(angle, n // 2, mode="edge"), np.full(n, 1.0 / n), mode="valid")


def _runs(*signals: Floats) -> list[slice]:
    known = np.ones(len(signals[0]), np.bool_)
    for signal in signals:
        known &= np.isfinite(signal)
    return runs(known)


def _solve(model: LinearModel, smooth: bool, engine: Engine) -> StateTrack:
    track = kalman_filter(model, engine)
    return rts_smoother(model, track, engine) if smooth else track


def _angle_filter(
    drive: Drive, rate: Floats, z: Floats, tune: AngleTuning, smooth: bool, engine: Engine
) -> tuple[Floats, Floats, Floats]:
    """Angle, rate bias and sd of the angle: x = [angle, bias], the rate integrated."""
    angle, bias, sd = (np.full(len(drive), np.nan) for _ in range(3))
    dt = drive.dt
    for run in _runs(rate):
        fixes = np.flatnonzero(np.isfinite(z[run]))
        if not len(fixes):
            continue
        run = slice(run.start + int(fixes[0]), run.stop)
        mean = 0.5 * (rate[run] + np.concatenate([[rate[run.start]], rate[run][:-1]]))
        model = LinearModel(
            x0=np.array([z[run.start], 0.0]),
            P0=np.diag([tune.measurement**2, RATE_BIAS_SD**2]),
            F=np.array([[[1.0, -dt], [0.0, 1.0]]]),
            Q=np.diag([tune.angle**2 * dt, tune.bias**2 * dt])[None],
            H=np.array([[[1.0, 0.0]]]),
            R=np.array([[tune.measurement**2]]),
            u=np.stack([mean * dt, np.zeros(len(mean))], axis=1),
            z=z[run, None],
        )
        track = _solve(model, smooth, engine)
        angle[run], bias[run], sd[run] = track.x[:, 0], track.x[:, 1], track.sd(0)
    return angle, bias, sd


class _Attitude(NamedTuple):
    """rates (3, n): of the body, bias taken off, rad/s. pitch_total, roll_total, heading,
    heading_sd (n,): rad."""

    rates: Floats
    pitch_total: Floats
    roll_total: Floats
    heading: Floats
    heading_sd: Floats


def _velocity_filter(
    drive: Drive, vehicle: Vehicle, attitude: _Attitude, smooth: bool, engine: Engine
) -> tuple[Floats, Floats]:
    """Velocity (2, n) at the roll axis under the CG and sd of its lateral part (n,)."""
    (p, q, r), heading, heading_sd = attitude.rates, attitude.heading, attitude.heading_sd
    imu = np.array(vehicle.imu_position or (0.0, 0.0, 0.0))
    lever = np.array(vehicle.antenna_position or (0.0, 0.0, 0.0)) - imu
    f_x = drive["imu.accel_x"] - G * np.sin(attitude.pitch_total)
    f_y = drive["imu.accel_y"] - G * np.sin(attitude.roll_total)
    V, track_angle = _at_epochs(drive, "speed"), _at_epochs(drive, "course") - heading
    z = np.stack(
        [
            V * np.cos(track_angle) + r * lever[1] - q * lever[2],
            V * np.sin(track_angle) - r * lever[0] + p * lever[2],
        ],
        axis=1,
    )
    velocity, sd = np.full((2, len(drive)), np.nan), np.full(len(drive), np.nan)
    for run in _runs(f_x, f_y, r, p, q, heading):
        fixes = np.flatnonzero(np.isfinite(z[run]).all(axis=1))
        if not len(fixes):
            continue
        run = slice(run.start + int(fixes[0]), run.stop)
        model = _velocity_model(r[run], f_x[run], f_y[run], z[run], heading_sd[run], drive.dt)
        track = _solve(model, smooth, engine)
        velocity[0, run], velocity[1, run] = track.x[:, 0], track.x[:, 1]
        sd[run] = track.sd(1)
    down = -vehicle.roll_arm - imu[2]  # from the IMU to the roll axis under the CG
    velocity[0] += r * imu[1] + q * down
    velocity[1] -= r * imu[0] + p * down
    return velocity, sd


def _velocity_model(
    r: Floats, f_x: Floats, f_y: Floats, z: Floats, heading_sd: Floats, dt: float
) -> LinearModel:
    """x = [v_x, v_y, bias x, bias y] at the IMU; second order in dt."""
    half = 0.5 * dt**2
    F = np.zeros((len(r), 4, 4))
    F[:] = np.eye(4)
    F[:, 0, 2] = F[:, 1, 3] = -dt
    F[:, 0, 1], F[:, 1, 0] = r * dt, -r * dt
    F[:, 0, 3], F[:, 1, 2] = -r * half, r * half
    F[:, 0, 0] = F[:, 1, 1] = 1 - r**2 * half
    u = np.zeros((len(r), 4))
    u[:, 0], u[:, 1] = f_x * dt + r * f_y * half, f_y * dt - r * f_x * half
    H = np.zeros((1, 2, 4))
    H[0, 0, 0] = H[0, 1, 1] = 1.0
    speed = np.nan_to_num(z[:, 0])
    R = np.stack(
        [
            np.full(len(r), VELOCITY_SD**2),
            VELOCITY_SD**2 + (speed * np.nan_to_num(heading_sd)) ** 2,
        ],
        axis=1,
    )
    return LinearModel(
        x0=np.array([z[0, 0], z[0, 1], 0.0, 0.0]),
        P0=np.diag(np.square(VELOCITY_SD0)),
        F=F,
        Q=np.diag(np.square(VELOCITY_NOISE) * dt)[None],
        H=H,
        R=R,
        u=u,
        z=z,
    )
