"""What `roadlog view` shows, as plain arrays: testable without a viewer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.errors import MissingSignalError, near
from roadlog.log import AngleTrack, DriveLog
from roadlog.metrics import angle_errors
from roadlog.signals import ANGLES
from roadlog.types import Floats

DEFAULT_RATE = 20.0  # Hz; 100 Hz makes files five times larger and the viewer slow


@dataclass(frozen=True)
class Curve:
    """One line: time s from the start of the drive, values, sd of the values or None."""

    time: Floats
    values: Floats
    sd: Floats | None = None


@dataclass(frozen=True)
class Inputs:
    """Sensor signals of one plot: names and the columns (n, k) they name, in `unit`."""

    unit: str
    names: tuple[str, ...]
    time: Floats
    values: Floats


@dataclass(frozen=True)
class DriveView:
    """Everything that a recording of one log holds; angles and errors in degrees.

    truth: angle -> curve. estimates and errors: angle -> estimator -> curve.
    """

    name: str
    duration: float
    estimators: tuple[str, ...]
    truth: dict[str, Curve]
    estimates: dict[str, dict[str, Curve]]
    errors: dict[str, dict[str, Curve]]
    inputs: dict[str, Inputs]


_INPUTS = {
    "imu/accel": ("m/s²", ("imu.accel_x", "imu.accel_y", "imu.accel_z")),
    "imu/gyro": ("°/s", ("imu.gyro_x", "imu.gyro_y", "imu.gyro_z")),
    "speed": ("m/s", ("speed.v", *(f"wheel_speeds.{w}" for w in ("fl", "fr", "rl", "rr")))),
}


def drive_view(
    log: DriveLog, estimators: Sequence[str] = (), rate: float = DEFAULT_RATE
) -> DriveView:
    """Collect what is shown of a log, at `rate` Hz.

    estimators: only these (default: all in the log). Raises MissingSignalError for an estimator
    that the log has no result of.
    """
    names = tuple(estimators or log.estimators)
    for name in names:
        if name not in log.estimators:
            raise MissingSignalError(
                f"{log.path}: no estimate '{name}'. {near(name, log.estimators)}"
            )
    drive = log.drive(rate)
    truth = log.truth()
    true_curves: dict[str, Curve] = {}
    estimates: dict[str, dict[str, Curve]] = {}
    errors: dict[str, dict[str, Curve]] = {}
    if truth is not None:
        true_curves = {a: _curve(truth, a, drive, rate, with_sd=False) for a in truth.angles}
    for name in names:
        track = log.estimate(name)
        for angle in track.angles:
            estimates.setdefault(angle, {})[name] = _curve(track, angle, drive, rate)
            found = angle_errors(track, truth, angle, skip=0.0) if truth is not None else None
            if truth is not None and found is not None:
                start = (int(truth.time[0]) - drive.start_ns) * 1e-9
                values = np.where(found.valid, np.degrees(found.error), np.nan)
                errors.setdefault(angle, {})[name] = _thin(
                    found.time + start, values, np.degrees(found.sd), rate
                )
    order = {angle: k for k, angle in enumerate(ANGLES)}
    return DriveView(
        log.path.stem,
        float(drive.time[-1]),
        names,
        true_curves,
        dict(sorted(estimates.items(), key=lambda item: order[item[0]])),
        dict(sorted(errors.items(), key=lambda item: order[item[0]])),
        _inputs(drive),
    )


def _curve(track: AngleTrack, angle: str, drive: Drive, rate: float, with_sd: bool = True) -> Curve:
    time: Floats = np.multiply(track.time - drive.start_ns, 1e-9)
    values = np.degrees(np.where(track.valid, track.angles[angle], np.nan))
    sd = np.degrees(track.sd[angle]) if with_sd else None
    return _thin(time, values, sd, rate)


def _thin(time: Floats, values: Floats, sd: Floats | None, rate: float) -> Curve:
    """Every k-th sample, so that about `rate` Hz are left."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    every = max(1, round(1 / (rate * step))) if step > 0 else 1
    known = sd is not None and bool(np.isfinite(sd).any())
    return Curve(time[::every], values[::every], sd[::every] if known and sd is not None else None)


def _inputs(drive: Drive) -> dict[str, Inputs]:
    result = {}
    for path, (unit, roles) in _INPUTS.items():
        there = tuple(role for role in roles if role in drive)
        if there:
            scale = np.degrees(1.0) if unit == "°/s" else 1.0
            values = scale * np.stack([drive[role] for role in there], axis=1)
            names = tuple(role.partition(".")[2] for role in there)
            result[path] = Inputs(unit, names, drive.time, values)
    return result
