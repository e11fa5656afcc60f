"""The speed channel that `fusion` rests on, and by how much a receiver lags behind it.

Source: docs/methods/fusion.md#speed-source, docs/methods/fusion.md#receiver-delay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, Samples, nan_mean
from roadlog.estimators.fusion.steps import STEP_RATE
from roadlog.motion.evidence import Evidence, unexplained
from roadlog.signals import WHEELS
from roadlog.types import Bools, Floats

SPEED_GAP = 3.0  # s without speed, flagged
STANDSTILL_GAP = 1.0  # s, speed is interpolated across for the standstill mask
EARLIEST, LATEST = -1.0, 4.0  # s, of the receiver behind the car's own speed
COARSE, FINE = 0.1, 0.01  # s, steps in which that is looked for, one after the other
CLEAR_LAG = 0.85  # correlation of speed and acceleration from which a lag counts
LARGE_LAG = 0.1  # s; a smaller one is the filter's to find
NO_TURN = 1.2  # of what the lag leaves unexplained: turning the IMU leaves more; 1.07 on circles
DELAY_CORRELATION = (
    5.0  # the sd of a delay grows by this: the residuals of speeds are no white noise
)
DELAY_COHERENCE = 0.9  # correlation of the two speeds, below which no delay is looked for
DELAY_SPREAD = 0.5  # m/s, sd of the speed, below which neither
DELAY_GATE = 3.0  # sd, a smaller delay is not applied
# s2/m, sd: by how much a driven axle runs ahead of the other, per driving force; usual is 0.009
AXLE_SLIP, AXLE_GATE = 0.003, 4.0
STRAIGHT, ROLLING = 0.1, 5.0  # rad/s, m/s, within and beyond which the axles are compared
MIN_INDEPENDENT, LEAST_SPREAD = 10.0, 1e-12  # such samples; (m/s2)2
SLIP_TIME = 1.0  # s, sd of the window over which they are; samples as far apart are independent


@dataclass(frozen=True)
class SpeedSource:
    """The speed channel: name, samples, and how far left of the center line it is measured (m).

    lag: s, by which its samples have been moved to be on time; `edge`: they lie LATEST or more
    apart from the accelerations, and were not moved. driven: the axle that was found to be driven,
    where the vehicle file does not say it and takes another for it.
    """

    name: str
    time: Floats
    value: Floats
    offset: float
    offset_sd: float
    lag: float = 0.0
    edge: bool = False
    driven: str = ""


def speed_source(drive: Drive, vehicle: Vehicle) -> SpeedSource:
    """The best speed: undriven axle, all wheels, /speed, GNSS."""
    best = drive.sources_of_speed()[0]
    samples = drive.native[best]
    if best != "wheel_speeds":
        value = samples.columns["v" if best == "speed" else "speed"]
        return SpeedSource(best, *known_samples(samples.time, value), 0.0, 0.02)
    front = [name for name in ("fl", "fr") if name in samples.columns]
    rear = [name for name in ("rl", "rr") if name in samples.columns]
    driven = driven_axle(drive, vehicle)
    if driven == "rear" and front:
        rear = []
    elif driven == "front" and rear:
        front = []
    rows = [samples.columns[name] for name in rear]
    rows += [_at_rear_axle(samples, name, drive, vehicle) for name in front]
    wheels = [*rear, *front]
    sides = sum(1 if name.endswith("l") else -1 for name in wheels) / len(wheels)
    offset = sides * vehicle.track / 2
    offset_sd = 0.05 if sides else 0.02  # m; of one wheel the track is not that well known
    time, value = known_samples(samples.time, nan_mean(np.stack(rows)))
    name, other = f"wheel_speeds ({', '.join(wheels)})", driven if driven != vehicle.driven else ""
    return SpeedSource(name, time, value, offset, offset_sd, driven=other)


def driven_axle(drive: Drive, vehicle: Vehicle) -> str:
    """As the vehicle file says; where it does not, the axle that runs ahead when the car is driven.

    A driven wheel slips by its force, which reads as a speed error of the sign of the grade.
    """
    evidence = Evidence.of(drive)
    needed = [*(f"wheel_speeds.{wheel}" for wheel in WHEELS), "imu.accel_x", "imu.gyro_z"]
    if vehicle.source("driven").kind != "default" or not all(role in evidence for role in needed):
        return vehicle.driven
    *wheels, force, turn = (evidence.smooth(evidence[role], SLIP_TIME) for role in needed)
    front, rear = 0.5 * (wheels[0] + wheels[1]), 0.5 * (wheels[2] + wheels[3])
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = (rear - np.sqrt(np.maximum(front**2 - (vehicle.wheelbase * turn) ** 2, 0))) / rear
        use = (force > 0) & (rear > ROLLING) & (np.abs(turn) < STRAIGHT) & np.isfinite(ahead)
    independent = use.sum() / evidence.rate / SLIP_TIME
    if independent < MIN_INDEPENDENT:
        return vehicle.driven
    x, y = force[use] - force[use].mean(), ahead[use] - ahead[use].mean()
    slip = float(x @ y / max(x @ x, LEAST_SPREAD))
    sd = float(
        np.sqrt(np.mean((y - slip * x) ** 2) / max(np.mean(x**2), LEAST_SPREAD) / independent)
    )
    if abs(slip) < max(AXLE_SLIP, AXLE_GATE * sd):
        return vehicle.driven
    return "rear" if slip > 0 else "front"


def on_time(source: SpeedSource, drive: Drive) -> SpeedSource:
    """The samples moved by their lag behind the accelerations, where that is large and clear.

    On a circle a lag and a turned IMU look alike: what a turn explains as well is no lag.
    """
    evidence = Evidence.of(drive)
    value = np.interp(drive.time, source.time, source.value)
    speed = Evidence.block(value, drive.rate)
    late = evidence.band(evidence.slope(speed))
    forces = np.stack([evidence.band(evidence[f"imu.accel_{axis}"]) for axis in "xy"])
    lag = evidence.lag(forces[0], late, LATEST)
    if lag is None or lag.r < CLEAR_LAG or abs(lag.lag) < LARGE_LAG:
        return source
    moved = unexplained(late, forces, round(lag.lag * evidence.rate))
    if unexplained(late, forces, 0) < NO_TURN * moved:
        return source
    if abs(lag.lag) >= LATEST - 1 / evidence.rate:
        return replace(source, edge=True)
    return replace(source, time=source.time - lag.lag, lag=lag.lag)


def _at_rear_axle(samples: Samples, wheel: str, drive: Drive, vehicle: Vehicle) -> Floats:
    """m/s, forward speed of a front wheel taken to the rear axle: u^2 = v^2 - (L r)^2."""
    speed = samples.columns[wheel]
    yaw_rate = np.interp(samples.time, drive.time, np.nan_to_num(drive.get("imu.gyro_z")))
    across = np.minimum(np.abs(vehicle.wheelbase * yaw_rate), 0.5 * np.abs(speed))
    return np.sign(speed) * np.sqrt(speed**2 - across**2)


def binned(own: Floats, values: Floats, n: int) -> Floats:
    """Mean of the samples nearest to each step; NaN where there is none."""
    index = np.round(own * STEP_RATE).astype(np.int64)
    inside = (index >= 0) & (index < n)
    count = np.bincount(index[inside], minlength=n)
    total = np.bincount(index[inside], values[inside], minlength=n)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def interpolated(source: SpeedSource, time: Floats) -> Floats:
    """m/s at each step, NaN in gaps of the speed."""
    result = np.interp(time, source.time, source.value)
    after = np.clip(np.searchsorted(source.time, time), 1, len(source.time) - 1)
    gap = source.time[after] - source.time[after - 1]
    outside = (time < source.time[0] - STANDSTILL_GAP) | (time > source.time[-1] + STANDSTILL_GAP)
    result[(gap > STANDSTILL_GAP) | outside] = np.nan
    return result


def without_speed(source: SpeedSource, time: Floats) -> Bools:
    """Where the nearest speed sample is further than SPEED_GAP."""
    after = np.clip(np.searchsorted(source.time, time), 0, len(source.time) - 1)
    before = np.clip(after - 1, 0, None)
    away = np.minimum(np.abs(source.time[after] - time), np.abs(time - source.time[before]))
    return away > SPEED_GAP


def known_samples(time: Floats, value: Floats) -> tuple[Floats, Floats]:
    """The samples that have a value, and their times."""
    known = np.isfinite(value)
    return time[known], value[known]


def gnss_delay(drive: Drive, source: SpeedSource) -> tuple[float, bool]:
    """s, by which the receiver lags behind the IMU, 0 where that is not observable; and whether it
    lies beyond what is looked for.

    The delay that leaves the least squares of v_gnss(t) - (a + b v(t - delay)), with its standard
    error from the curvature: a receiver at 1 Hz has no accelerations to compare. Where the receiver
    gives the speed, its `lag`.
    """
    if source.name == "gnss":
        return source.lag, source.edge
    gnss = drive.native.get("gnss", Samples(np.empty(0), {}))
    if "speed" not in gnss.columns or len(source.time) < 2:
        return 0.0, False
    own, speed = known_samples(gnss.time, gnss.columns["speed"])
    inside = (own > source.time[0] + LATEST) & (own < source.time[-1] - LATEST)
    own, speed = own[inside], speed[inside]
    total = float(np.sum((speed - np.mean(speed)) ** 2)) if len(own) else 0.0
    if len(own) < 10 or total < len(own) * DELAY_SPREAD**2:
        return 0.0, False  # at constant speed there is nothing to align
    tried = np.arange(EARLIEST, LATEST + COARSE / 2, COARSE)
    best = int(np.argmin(_misfits(own, speed, source, tried)))
    is_edge = best in (0, len(tried) - 1)
    tried = tried[best] + np.arange(-COARSE, COARSE + FINE / 2, FINE)
    misfits = _misfits(own, speed, source, tried)
    best = int(np.clip(np.argmin(misfits), 1, len(tried) - 2))
    if misfits[best] > (1 - DELAY_COHERENCE**2) * total:
        return 0.0, False
    if is_edge:
        return 0.0, True
    left, low, right = misfits[best - 1 : best + 2]
    curvature = (left - 2 * low + right) / FINE**2
    delay = float(tried[best] + 0.5 * FINE * (left - right) / (left - 2 * low + right))
    sd = DELAY_CORRELATION * np.sqrt(2 * low / len(own) / curvature)
    return (delay if abs(delay) > DELAY_GATE * sd else 0.0), False


def _misfits(own: Floats, speed: Floats, source: SpeedSource, delays: Floats) -> Floats:
    """Sum of squares of the receiver's speed about a line through the car's, at each delay."""
    result = np.empty(len(delays))
    for i, delay in enumerate(delays):
        shown = np.interp(own - delay, source.time, source.value)
        A = np.stack([np.ones(len(own)), shown], axis=1)
        result[i] = np.sum((speed - A @ np.linalg.lstsq(A, speed, rcond=None)[0]) ** 2)
    return result
