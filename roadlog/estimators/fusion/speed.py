"""The speed channel that `fusion` rests on, and by how much a receiver lags behind it.

Source: docs/methods/fusion.md#speed-source, docs/methods/fusion.md#receiver-delay.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, Samples, nan_mean
from roadlog.estimators.fusion.steps import RATE
from roadlog.types import Bools, Floats

SPEED_GAP = 3.0  # s without speed, flagged
STANDSTILL_GAP = 1.0  # s, speed is interpolated across for the standstill mask
GNSS_DELAYS = np.arange(-29, 151) / 100  # s, tried for the receiver against the car's own speed
DELAY_CORRELATION = (
    5.0  # the sd of a delay grows by this: the residuals of speeds are no white noise
)
DELAY_COHERENCE = 0.9  # correlation of the two speeds, below which no delay is looked for
DELAY_SPREAD = 0.5  # m/s, sd of the speed, below which neither
DELAY_GATE = 3.0  # sd, a smaller delay is not applied


@dataclass(frozen=True)
class SpeedSource:
    """The speed channel: name, samples, and how far left of the center line it is measured (m)."""

    name: str
    time: Floats
    value: Floats
    offset: float
    offset_sd: float


def speed_source(drive: Drive, vehicle: Vehicle) -> SpeedSource:
    """The best speed: undriven axle, all wheels, /speed, GNSS."""
    best = drive.sources_of_speed()[0]
    samples = drive.native[best]
    if best != "wheel_speeds":
        value = samples.columns["v" if best == "speed" else "speed"]
        return SpeedSource(best, *known_samples(samples.time, value), 0.0, 0.02)
    front = [name for name in ("fl", "fr") if name in samples.columns]
    rear = [name for name in ("rl", "rr") if name in samples.columns]
    if vehicle.driven == "rear" and front:
        rear = []
    elif vehicle.driven == "front" and rear:
        front = []
    rows = [samples.columns[name] for name in rear]
    rows += [_at_rear_axle(samples, name, drive, vehicle) for name in front]
    wheels = [*rear, *front]
    sides = sum(1 if name.endswith("l") else -1 for name in wheels) / len(wheels)
    offset = sides * vehicle.track / 2
    offset_sd = 0.05 if sides else 0.02  # m; of one wheel the track is not that well known
    time, value = known_samples(samples.time, nan_mean(np.stack(rows)))
    return SpeedSource(f"wheel_speeds ({', '.join(wheels)})", time, value, offset, offset_sd)


def _at_rear_axle(samples: Samples, wheel: str, drive: Drive, vehicle: Vehicle) -> Floats:
    """m/s, forward speed of a front wheel taken to the rear axle: u^2 = v^2 - (L r)^2."""
    speed = samples.columns[wheel]
    yaw_rate = np.interp(samples.time, drive.time, np.nan_to_num(drive.get("imu.gyro_z")))
    across = np.minimum(np.abs(vehicle.wheelbase * yaw_rate), 0.5 * np.abs(speed))
    return np.sign(speed) * np.sqrt(speed**2 - across**2)


def binned(own: Floats, values: Floats, n: int) -> Floats:
    """Mean of the samples nearest to each step; NaN where there is none."""
    index = np.round(own * RATE).astype(np.int64)
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


def gnss_delay(drive: Drive, source: SpeedSource) -> float:
    """s, by which the receiver lags behind the car's own speed; 0 where that is not observable.

    The delay that leaves the least squares of v_gnss(t) - (a + b v(t - delay)), with its standard
    error from the curvature: a receiver at 1 Hz has no accelerations to compare.
    """
    gnss = drive.native.get("gnss", Samples(np.empty(0), {}))
    if source.name == "gnss" or "speed" not in gnss.columns or len(source.time) < 2:
        return 0.0
    own, speed = known_samples(gnss.time, gnss.columns["speed"])
    margin = max(abs(GNSS_DELAYS[0]), GNSS_DELAYS[-1])
    inside = (own > source.time[0] + margin) & (own < source.time[-1] - margin)
    own, speed = own[inside], speed[inside]
    total = float(np.sum((speed - np.mean(speed)) ** 2)) if len(own) else 0.0
    if len(own) < 10 or total < len(own) * DELAY_SPREAD**2:
        return 0.0  # at constant speed there is nothing to align
    misfits = np.empty(len(GNSS_DELAYS))
    for i, delay in enumerate(GNSS_DELAYS):
        A = np.stack([np.ones(len(own)), np.interp(own - delay, source.time, source.value)], axis=1)
        misfits[i] = np.sum((speed - A @ np.linalg.lstsq(A, speed, rcond=None)[0]) ** 2)
    best = int(np.argmin(misfits))
    if best in (0, len(misfits) - 1) or misfits[best] > (1 - DELAY_COHERENCE**2) * total:
        return 0.0
    step = GNSS_DELAYS[1] - GNSS_DELAYS[0]
    left, low, right = misfits[best - 1 : best + 2]
    curvature = (left - 2 * low + right) / step**2
    delay = float(GNSS_DELAYS[best] + 0.5 * step * (left - right) / (left - 2 * low + right))
    sd = DELAY_CORRELATION * np.sqrt(2 * low / len(own) / curvature)
    return delay if abs(delay) > DELAY_GATE * sd else 0.0
