"""Delay, scale and tire slip of every speed in the log, against the smoothed acceleration.

The accelerometer, freed of the slope by the smoothed inclination, says how the car's velocity
changes, on the IMU's own clock. A speed channel that is late by tau falls short by tau times the
acceleration; a wheel that slips under force runs ahead by its speed times the force. Over a drive
the two differ, because speeds differ; without the slip term it reads as a lead of some 10 ms.
Source: docs/calibration.md#delays-and-scales.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.calibrate.constant import Constant, unknown
from roadlog.calibrate.mounting import filled
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

DRIFT_BLOCK = 10.0  # s; in each an offset and a drift are free, and the jackknife leaves one out
MIN_SPEED = 2.0  # m/s
MIN_BLOCKS = 5
MIN_SHARE = 0.5  # of a block that must be used
ROUNDS = 4  # of moving the channel by the delay found
MAX_DELAY = 2.0  # s
CORRELATED = 0.5  # s, over which residuals of a speed are
# mean and sd before the data of what `fit` finds: scale, delay (s, per round), IMU to the left of
# the channel (m), ahead of the rear axle (m), height (m), yaw (rad), slip when driving and braking
# (s2/m). On a circle of one radius several of them look alike.
PRIOR = np.array(
    [
        (1.0, 0.03),
        (0.0, 0.5),
        (0.0, 0.5),
        (1.5, 0.7),
        (0.0, 1.0),
        (0.0, 0.02),
        (0.003, 0.005),
        (0.003, 0.005),
    ]
)
SCALE_PRIOR = np.array([(1.0, 0.05), (0.0, 0.01), (0.0, 0.01), (0.0, 0.7)])
SCALE_FLOOR = 5e-4  # rolling radii grow with speed and warmth
WORTH_SCALE = 0.01
TINY = 1e-12  # (m/s)2, least variance of a residual
FRONT, REAR = ("fl", "fr"), ("rl", "rr")


@dataclass(frozen=True)
class Reference:
    """What the IMU says of the motion, on the drive's grid; zero-mean errors, free of slopes.

    velocity: m/s, integral of acceleration (m/s2), for an IMU over the rear axle; turning: rad2/s,
    what each meter ahead of it adds; yawed: m/s, what each rad of wrong yaw adds. force: m/s2,
    specific force along the road.
    """

    time: Floats
    velocity: Floats
    turning: Floats
    yawed: Floats
    acceleration: Floats
    yaw_rate: Floats
    pitch_rate: Floats
    force: Floats
    speed: Floats
    cosine: Floats
    use: Bools


@dataclass(frozen=True)
class SpeedFit:
    """delay: s against the IMU. side: m, channel to the left of the IMU. ahead: m, IMU ahead of the
    rear axle. slip: s2/m, share of the
    speed by which the wheel runs ahead per driving m/s2.
    """

    delay: float
    delay_sd: float
    side: float
    side_sd: float
    ahead: float
    ahead_sd: float
    slip: float
    slip_sd: float


def reference(
    drive: Drive, estimate: Estimate, constants: dict[str, float], speed: Floats
) -> Reference:
    """drive: corrected. speed: m/s on its grid."""
    inclination = filled(estimate.inclination) + constants["mounting_pitch"]
    rate = filled(drive["imu.gyro_z"]) - constants["gyro_bias_z"]
    pitch_rate = filled(drive["imu.gyro_y"]) - constants["gyro_bias_y"]
    f_x = filled(drive["imu.accel_x"]) - constants["accel_bias_x"]
    f_y = filled(drive["imu.accel_y"]) - constants["accel_bias_y"]
    sideways = -constants["slip_gradient"] * f_y * speed  # at the rear axle
    acceleration = f_x - G * np.sin(inclination) + rate * sideways
    return Reference(
        drive.time,
        _integral(acceleration, drive.dt),
        _integral(rate**2, drive.dt),
        _integral(rate * speed, drive.dt),
        acceleration,
        rate,
        pitch_rate,
        f_x - G * filled(estimate.pitch),
        speed,
        np.cos(inclination),
        estimate.valid & (np.abs(speed) > MIN_SPEED),
    )


def fit(own: Floats, values: Floats, ref: Reference, slips: bool) -> SpeedFit | None:
    """One channel's samples against the reference; None where the drive is too short or steady."""
    known = np.isfinite(values)
    own, values = own[known], values[known]
    delay = 0.0
    for _ in range(ROUNDS):
        at = own - delay
        inside = (at > ref.time[0]) & (at < ref.time[-1])
        use = inside & ref.use[_nearest(at, ref)]
        columns = [ref.velocity, ref.acceleration, ref.yaw_rate, ref.turning, ref.pitch_rate]
        columns.append(ref.yawed)
        if slips:
            columns += [ref.speed * np.maximum(ref.force, 0), ref.speed * np.minimum(ref.force, 0)]
        A = np.stack([np.interp(at[use], ref.time, c) for c in columns], axis=1)
        solved = _blockwise(own[use], A, values[use], PRIOR[: A.shape[1]])
        if solved is None:
            return None
        solution, spread = solved
        delay -= solution[1] / solution[0]
        if abs(delay) > MAX_DELAY:
            return None
    slip, slip_sd = (solution[6], spread[6]) if slips else (0.0, 0.0)
    delay_sd = float(spread[1] / abs(solution[0]))
    side, side_sd = float(-solution[2]), float(spread[2])
    ahead, ahead_sd = float(solution[3]), float(spread[3])
    return SpeedFit(
        float(delay), delay_sd, side, side_sd, ahead, ahead_sd, float(slip), float(slip_sd)
    )


def scale(own: Floats, values: Floats, gnss: tuple[Floats, Floats], ref: Reference) -> Constant:
    """True speed over the channel's, by GNSS; both on the IMU's clock. A slipping wheel's share
    and a lever arm are free.
    """
    at, true = gnss
    shown = np.interp(at, own, values)
    index = _nearest(at, ref)
    use = np.isfinite(true) & (at > own[0]) & (at < own[-1]) & ref.use[index]
    index, shown, true = index[use], shown[use], true[use]
    v = true / ref.cosine[index]
    push = v * ref.force[index]
    A = np.stack([v, np.maximum(push, 0), np.minimum(push, 0), ref.yaw_rate[index]], axis=1)
    block = np.floor(at[use] / DRIFT_BLOCK).astype(np.int64)
    parts = [(A[block == b], shown[block == b]) for b in np.unique(block)]
    usual = float(np.median(np.diff(at))) if len(at) > 1 else np.inf
    solved = _solved(parts, SCALE_PRIOR, max(1.0, CORRELATED / usual))
    if solved is None:
        return unknown("speed_scale", "-", f"{len(parts)} stretches with GNSS speed: drive longer")
    value, sd = solved[0][0], float(np.hypot(solved[1][0], SCALE_FLOOR))
    if sd > WORTH_SCALE:
        return unknown("speed_scale", "-", f"{1 / value:.3f} +- {sd:.3f}: drive straight as well")
    evidence = f"against GNSS speed, {len(parts)} stretches of {DRIFT_BLOCK:.0f} s"
    return Constant("speed_scale", "-", float(1 / value), float(sd / value**2), evidence)


def _integral(values: Floats, dt: float) -> Floats:
    return np.concatenate([[0.0], np.cumsum(values[1:] + values[:-1])]) * dt / 2


def _nearest(at: Floats, ref: Reference) -> NDArray[np.int64]:
    """Index of the nearest point of the reference's grid."""
    rate = 1.0 / (ref.time[1] - ref.time[0])
    return np.clip(np.round((at - ref.time[0]) * rate), 0, len(ref.time) - 1).astype(np.int64)


def _blockwise(own: Floats, A: Floats, y: Floats, prior: Floats) -> tuple[Floats, Floats] | None:
    """`_solved` with an offset and a drift of each block free."""
    block = np.floor(own / DRIFT_BLOCK).astype(np.int64)
    usual = np.median(np.diff(own)) if len(own) > 1 else np.inf
    parts = []
    for b in np.unique(block):
        rows = block == b
        if rows.sum() < max(6, MIN_SHARE * DRIFT_BLOCK / usual):
            continue
        t = own[rows] - own[rows].mean()
        free = np.linalg.qr(np.stack([np.ones(len(t)), t], axis=1))[0]
        both = np.column_stack([A[rows], y[rows]])
        both = both - free @ (free.T @ both)
        parts.append((both[:, :-1], both[:, -1]))
    return _solved(parts, prior, max(1.0, CORRELATED / usual))


def _solved(
    parts: list[tuple[Floats, Floats]], prior: Floats, correlated: float
) -> tuple[Floats, Floats] | None:
    """Least squares of y = A x over all parts (A, y) with a prior (k, 2) of mean and sd.

    correlated: samples that count as one. The standard errors hold both what leaving out one part
    at a time says and what the prior leaves open. None where there are too few parts.
    """
    m = len(parts)
    if m < MIN_BLOCKS:
        return None
    normal = np.stack([A.T @ A for A, _ in parts])
    right = np.stack([A.T @ y for A, y in parts])
    square = sum(float(y @ y) for _, y in parts)
    count = sum(len(y) for _, y in parts)
    mean, weight = prior[:, 0], np.diag(prior[:, 1] ** -2.0)
    N, b = normal.sum(axis=0), right.sum(axis=0)
    x, variance = mean, np.inf
    for _ in range(2):  # the noise is known from the solution
        variance = max((square - 2 * b @ x + x @ N @ x) / count, TINY) * correlated
        x = np.linalg.solve(N / variance + weight, b / variance + weight @ mean)
    left = np.stack(
        [
            np.linalg.solve((N - n) / variance + weight, (b - r) / variance + weight @ mean)
            for n, r in zip(normal, right, strict=True)
        ]
    )
    scatter = (m - 1) / m * np.sum((left - left.mean(axis=0)) ** 2, axis=0)
    open_ = np.diag(np.linalg.inv(N / variance + weight))
    return x, np.sqrt(scatter + open_)


def axle(drive: Drive, wheels: tuple[str, str], ref: Reference, vehicle: Vehicle) -> Floats | None:
    """m/s at the wheel samples' times, mean of an axle, as seen at the rear axle: u2 = v2 - (L r)2.

    None where the log lacks one of the wheels: a single one is off the center line.
    """
    samples = drive.native["wheel_speeds"]
    if not all(wheel in samples.columns for wheel in wheels):
        return None
    speed = np.mean([samples.columns[wheel] for wheel in wheels], axis=0)
    if wheels == REAR:
        return speed
    rate = np.interp(samples.time, ref.time, ref.yaw_rate)
    across = np.minimum(np.abs(vehicle.wheelbase * rate), 0.5 * np.abs(speed))
    return np.sign(speed) * np.sqrt(speed**2 - across**2)
