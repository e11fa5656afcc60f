"""mean_slope: the grade as a moving mean of the accelerometer less the car's own acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.estimators.base import Drive, Engine, Estimate, Estimator, Vehicle, parameter
from roadlog.units import STANDARD_GRAVITY


@dataclass(frozen=True)
class MeanSlopeParameters:
    """What `--set mean_slope.window=8` sets."""

    window: float = parameter(4.0, "s", "length of the moving mean")


def run(drive: Drive, vehicle: Vehicle, params: MeanSlopeParameters, engine: Engine) -> Estimate:
    """sin(grade) = (f_x - dv/dt) / g, averaged."""
    del vehicle, engine  # a method without a model of the car and without a filter
    slope = (drive["imu.accel_x"] - np.gradient(drive.speed, drive.dt)) / STANDARD_GRAVITY
    known = np.isfinite(slope)
    kernel = np.ones(max(1, round(params.window * drive.rate)))
    total = np.convolve(np.where(known, slope, 0.0), kernel, "same")
    count = np.convolve(known, kernel, "same")
    mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
    return Estimate(drive.time, {"grade": np.arcsin(np.clip(mean, -1, 1))}, valid=known)


MEAN_SLOPE = Estimator(
    name="mean_slope",
    run=run,
    parameters=MeanSlopeParameters,
    needs=("imu.accel_x", "speed"),
    gives=("grade",),
    reference="none: an example",
    summary="moving mean of the longitudinal acceleration less dv/dt",
)
