"""Grade and pitch by trigonometric identities.

Massel 2004, equations (19)-(22), corrected: docs/methods/massel2004.md#trigonometric-identities.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.straight import (
    Longitudinal,
    StraightParameters,
    longitudinal,
    straight_flags,
    with_preset,
)
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.filters.windows import moving_count, moving_mean, moving_sum
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

PRESETS: dict[str, dict[str, Any]] = {
    "paper": {
        "average": "mean",
        "smooth": False,
        "small_angle": True,
        "causal": True,
        "wheels": "all",
    },
    "robust": {"average": "weighted", "smooth": True},
}


@dataclass(frozen=True)
class AnalyticParameters(StraightParameters):
    """What `ti` and `pn` share; docs/methods/massel2004.md#parameters-of-ti-and-pn."""

    window: float = parameter(0.6, "s", "of the moving means; the paper's 600 samples")
    vdot_min: float = parameter(0.02, "m/s2", "a sample (or window rms) below it is not used")
    sine_max: float = parameter(0.35, "-", "a sample whose sine of the grade is beyond is dropped")


@dataclass(frozen=True)
class TiParameters(AnalyticParameters):
    """docs/methods/massel2004.md#parameters-of-ti; none: as the preset says."""

    preset: Literal["paper", "robust"] = parameter(
        "robust", "", "paper: mean, causal; robust: weighted, centered"
    )
    small_angle: bool | None = parameter(
        None, "", "the paper's small-angle formulas instead of exact"
    )
    average: Literal["mean", "weighted"] | None = parameter(
        None, "", "mean of samples, or least squares weighted by dv/dt (no pole at 0)"
    )
    smooth: bool | None = parameter(None, "", "centered windows instead of the last samples")


@dataclass(frozen=True)
class AnalyticFit:
    """Averaged grade and pitch, rad, NaN where no sample of the window says anything."""

    grade: Floats
    pitch: Floats
    grade_sd: Floats
    pitch_sd: Floats
    clipped: Bools  # the sample was dropped as impossible


def sample_angles(motion: Longitudinal, params: TiParameters) -> tuple[Floats, Floats, Bools]:
    """Grade and pitch of every sample alone, and which were dropped as too steep.

    f_x^2 + f_z^2 - vdot^2 - g^2 = 2 vdot g sin G, equation (19) in our signs, exact.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        sine = identity(motion) / (2 * G * motion.vdot)
    usable = np.abs(motion.vdot) >= params.vdot_min
    clipped = usable & (np.abs(sine) > params.sine_max)
    sine = np.where(usable & ~clipped, sine, np.nan)
    grade = sine if params.small_angle else np.arcsin(sine)
    return grade, _pitch(motion, grade, bool(params.small_angle)), clipped


def identity(motion: Longitudinal) -> Floats:
    """f_x^2 + f_z^2 - vdot^2 - g^2, (m/s2)^2: left side of equation (19)."""
    return motion.f_x**2 + motion.f_z**2 - motion.vdot**2 - G**2


def _pitch(motion: Longitudinal, grade: Floats, small_angle: bool) -> Floats:
    along, normal = motion.vdot + G * np.sin(grade), G * np.cos(grade)
    if small_angle:  # equation (22)
        return (motion.f_x - along) / normal
    return np.arctan2(normal, along) - np.arctan2(motion.f_z, motion.f_x)


def fit_identities(motion: Longitudinal, params: TiParameters, rate: float) -> AnalyticFit:
    """Moving means of the samples' angles, or the least-squares solution of (19) in the window."""
    n = max(1, round(params.window * rate))
    smooth = bool(params.smooth)
    grade, pitch, clipped = sample_angles(motion, params)
    if params.average == "weighted":
        known = np.isfinite(identity(motion)) & np.isfinite(motion.vdot)
        vdot = np.where(known, motion.vdot, np.nan)
        energy = moving_sum(vdot**2, n, smooth)
        count = moving_count(vdot, n, smooth)
        excited = energy >= params.vdot_min**2 * np.maximum(count, 1)
        sine = moving_sum(vdot * identity(motion), n, smooth) / np.where(
            excited, 2 * G * energy, np.nan
        )
        clipped = np.abs(sine) > params.sine_max
        grade = np.arcsin(np.where(clipped, np.nan, sine))
        pitch = moving_mean(motion.inclination, n, smooth) - grade
    else:
        vdot = np.where(np.isfinite(grade), motion.vdot, np.nan)
        grade, pitch = moving_mean(grade, n, smooth), moving_mean(pitch, n, smooth)
    sd = analytic_sd(motion, vdot, n, smooth)
    # grade and inclination err independently: vertical and longitudinal accelerometer
    pitch_sd = np.hypot(sd, motion.inclination_sd * min(1.0, np.sqrt(motion.correlation / n)))
    return AnalyticFit(grade, pitch, sd, pitch_sd, clipped)


def analytic_sd(motion: Longitudinal, used_vdot: Floats, n: int, smooth: bool) -> Floats:
    """rad, sigma_fz / (sqrt(N) rms(vdot)) over the samples used in a window."""
    energy = moving_sum(used_vdot**2, n, smooth)
    return motion.f_z_sd / np.sqrt(np.where(energy > 0, energy, np.nan))


def analytic_estimate(
    drive: Drive, motion: Longitudinal, fit: AnalyticFit, params: AnalyticParameters
) -> Estimate:
    """Hold, flags and the sum of the two angles, alike for `ti` and `pn`."""
    present = np.isfinite(motion.f_x) & np.isfinite(motion.f_z) & np.isfinite(motion.vdot)
    usable = present & ~drive.standstill
    grade, pitch = (np.where(usable, angle, np.nan) for angle in (fit.grade, fit.pitch))
    known = np.isfinite(grade) & np.isfinite(pitch)
    # held over a lack of excitation or of input, not over a stop
    limit = round(params.hold_time * drive.rate)
    (grade, held), (pitch, _), (grade_sd, _), (pitch_sd, _) = (
        hold(np.where(known, values, np.nan), limit)
        for values in (grade, pitch, fit.grade_sd, fit.pitch_sd)
    )
    grade, pitch, grade_sd, pitch_sd = (
        np.where(drive.standstill, np.nan, values) for values in (grade, pitch, grade_sd, pitch_sd)
    )
    flags = (
        straight_flags(drive, present)
        | flag(held & ~drive.standstill, "held")
        | flag(usable & ~known, "excitation")
        | flag(fit.clipped, "saturated")
    )
    angles = {"grade": grade, "pitch": pitch, "inclination": grade + pitch}
    # the errors of grade and pitch cancel in their sum, up to the inclination's own
    inclination_sd = np.where(np.isfinite(grade), motion.inclination_sd, np.nan)
    sd = {"grade": grade_sd, "pitch": pitch_sd, "inclination": inclination_sd}
    return Estimate(drive.time, angles, sd, known, flags)


def ti(drive: Drive, vehicle: Vehicle, params: TiParameters, engine: Engine) -> Estimate:
    """Grade from the length of the specific force, pitch from its direction; no pitch model.

    A vertical accelerometer bias b shifts the grade by b cos(G) / vdot.
    """
    del engine  # vectorized formulas
    params = with_preset(params, PRESETS, params.preset)
    motion = longitudinal(drive, params, vehicle)
    return analytic_estimate(drive, motion, fit_identities(motion, params, drive.rate), params)


TI = Estimator(
    name="ti",
    run=ti,
    parameters=TiParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Massel 2004, eqs. (19)-(22); docs/methods/massel2004.md#trigonometric-identities",
    summary="grade and pitch by trigonometric identities; needs large dv/dt and a smooth road",
    systematic_deg={"grade": 4.5, "pitch": 4.5, "inclination": 0.45},
    tilted=("inclination",),
)
