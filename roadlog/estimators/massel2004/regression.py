"""What the two least squares of pitch and inclination over dv/dt share: data, root, result.

docs/methods/massel2004.md#models.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from roadlog.drive import Drive
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import parameter
from roadlog.estimators.straight import Longitudinal, StraightParameters
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

PAPER: dict[str, Any] = {  # presets of both
    "excitation_min": 0.0,
    "inclination_source": "paper",
    "causal": True,
    "wheels": "all",
}
ROBUST: dict[str, Any] = {"excitation_min": 0.05, "inclination_source": "x"}
MIN_ANGLE = 1e-3  # rad; the root of a smaller square has no finite sd


@dataclass(frozen=True)
class RegressionParameters(StraightParameters):
    """Of both; none: as the preset says."""

    excitation_min: float | None = parameter(None, "m/s2", "least std of dv/dt to learn from")
    inclination_source: Literal["paper", "x"] | None = parameter(
        None, "", "paper: root of model 1; x: mean of model 2"
    )
    pitch_hold_time: float = parameter(30.0, "s", "pitch is held this long")


class Data(NamedTuple):
    """Two models over dv/dt, m/s2, and where all of it is known.

    vertical: f_z - g = -vdot p - g/2 i^2. along: f_x - vdot = -vdot/2 p^2 + g i.
    """

    vertical: Floats
    along: Floats
    vdot: Floats
    known: Bools

    @classmethod
    def of(cls, motion: Longitudinal) -> Data:
        vertical, along, vdot = motion.f_z - G, motion.f_x - motion.vdot, motion.vdot
        known = np.isfinite(vertical) & np.isfinite(along) & np.isfinite(vdot)
        return cls(vertical, along, vdot, known)


@dataclass(frozen=True)
class RegressionFit:
    """Pitch and inclination, rad, NaN where they are not known, with sds.

    inclination_squared: rad^2, of the vertical model. excitation: std of dv/dt, m/s2. known: there
    is data.
    """

    pitch: Floats
    inclination: Floats
    pitch_sd: Floats
    inclination_sd: Floats
    inclination_squared: Floats
    excitation: Floats
    known: Bools


def root(squared: Floats, signed: Floats) -> Floats:
    """Inclination from its square; the other model gives the sign."""
    return np.sign(signed) * np.sqrt(np.maximum(squared, 0.0))


def root_sd(intercept_sd: Floats, inclination: Floats) -> Floats:
    """Of a root: i^2 is 2/g times the intercept of the vertical model."""
    return intercept_sd / (G * np.maximum(np.abs(inclination), MIN_ANGLE))


def estimate_of(drive: Drive, fit: RegressionFit, valid: Bools, flags: np.ndarray) -> Estimate:
    """Grade is inclination less pitch; excitation and squared inclination go along."""
    angles = {
        "grade": fit.inclination - fit.pitch,
        "pitch": fit.pitch,
        "inclination": fit.inclination,
    }
    sd = {
        "grade": np.hypot(fit.inclination_sd, fit.pitch_sd),
        "pitch": fit.pitch_sd,
        "inclination": fit.inclination_sd,
    }
    columns = {"excitation": fit.excitation, "inclination_squared": fit.inclination_squared}
    details = {"fit": Detail("roadlog.v1.PitchRegression", drive.time, columns)}
    return Estimate(drive.time, angles, sd, valid, flags, details)
