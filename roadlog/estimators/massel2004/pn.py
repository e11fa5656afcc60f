"""Grade and pitch by the fourth-order polynomial.

Massel 2004, corrected: docs/methods/massel2004.md#polynomial.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, parameter
from roadlog.estimators.massel2004.ti import (
    AnalyticFit,
    AnalyticParameters,
    analytic_estimate,
    analytic_sd,
)
from roadlog.estimators.straight import Longitudinal, longitudinal, with_preset
from roadlog.filters import Engine
from roadlog.filters.windows import moving_mean
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

PRESETS: dict[str, dict[str, Any]] = {
    "paper": {"smooth": False, "causal": True, "wheels": "all"},
    "robust": {"smooth": True},
}


@dataclass(frozen=True)
class PnParameters(AnalyticParameters):
    """docs/methods/massel2004.md#parameters-of-ti-and-pn; none: as the preset says."""

    preset: Literal["paper", "robust"] = parameter(
        "robust", "", "paper: causal; robust: centered windows"
    )
    smooth: bool | None = parameter(None, "", "centered windows instead of the last samples")


def sample_angles(motion: Longitudinal, params: PnParameters) -> tuple[Floats, Floats, Bools]:
    """Grade and pitch of every sample alone, and which were dropped: no root, or too steep.

    vdot^2/4 p^4 + C vdot p^2 + 2 g vdot p + E = 0 with C = f_x - vdot, E = C^2 + 2 g (f_z - g);
    p^4 is dropped. The rationalized root is the small one for both signs of vdot.
    """
    vdot = motion.vdot
    c = motion.f_x - vdot
    e = c**2 + 2 * G * (motion.f_z - G)
    discriminant = (G * vdot) ** 2 - c * vdot * e
    usable = np.abs(vdot) >= params.vdot_min
    root = np.sqrt(np.where(usable & (discriminant >= 0), discriminant, np.nan))
    pitch = -e / (G * vdot + np.sign(vdot) * root)
    grade = (c + vdot * pitch**2 / 2) / G - pitch
    possible = np.abs(grade) <= np.arcsin(params.sine_max)  # NaN is not
    grade, pitch = (np.where(possible, angle, np.nan) for angle in (grade, pitch))
    return grade, pitch, usable & ~possible


def pn(drive: Drive, vehicle: Vehicle, params: PnParameters, engine: Engine) -> Estimate:
    """The two small-angle models solved for pitch at every sample, then moving means.

    Its truncation error is below 0.05 deg up to 10 % grade and grows to 0.5 deg at 20 %.
    """
    del engine  # vectorized formulas
    params = with_preset(params, PRESETS, params.preset)
    motion = longitudinal(drive, params, vehicle)
    n, smooth = max(1, round(params.window * drive.rate)), bool(params.smooth)
    grade, pitch, clipped = sample_angles(motion, params)
    sd = analytic_sd(motion, np.where(np.isfinite(grade), motion.vdot, np.nan), n, smooth)
    fit = AnalyticFit(moving_mean(grade, n, smooth), moving_mean(pitch, n, smooth), sd, sd, clipped)
    return analytic_estimate(drive, motion, fit, params)


PN = Estimator(
    name="pn",
    run=pn,
    parameters=PnParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Massel 2004; docs/methods/massel2004.md#polynomial",
    summary="grade and pitch by a polynomial; needs large dv/dt, small grades and a smooth road",
    systematic_deg={"grade": 3.0, "pitch": 3.0, "inclination": 0.6},
    tilted=("inclination",),
)
