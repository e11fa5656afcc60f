"""Grade and pitch by trigonometric identities and recursive least squares, weighted by |dv/dt|.

Massel 2004: docs/methods/massel2004.md#combination.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.massel2004.rls_forget import PRESETS as RLS_PRESETS
from roadlog.estimators.massel2004.rls_forget import RlsForgetParameters, fit_recursively
from roadlog.estimators.massel2004.ti import PRESETS as TI_PRESETS
from roadlog.estimators.massel2004.ti import TiParameters, fit_identities
from roadlog.estimators.straight import (
    StraightParameters,
    longitudinal,
    straight_flags,
    with_preset,
)
from roadlog.filters import Engine
from roadlog.filters.gaps import hold
from roadlog.types import Floats

PRESETS: dict[str, dict[str, Any]] = {"paper": {"causal": True, "wheels": "all"}, "robust": {}}


@dataclass(frozen=True)
class TiRlsParameters(StraightParameters):
    """docs/methods/massel2004.md#parameters-of-ti_rls; the parts have their own defaults."""

    preset: Literal["paper", "robust"] = parameter("robust", "", "of both parts: paper or robust")
    vdot_full: float = parameter(0.3, "m/s2", "dv/dt from which only ti counts")


def ti_rls(drive: Drive, vehicle: Vehicle, params: TiRlsParameters, engine: Engine) -> Estimate:
    """w ti + (1 - w) rls with w = min(|dv/dt| / 0.3, 1); where one is unknown the other counts.

    Causal but for the derivative's kernel: the recursion lags, a centered ti would not match it.
    """
    params = with_preset(params, PRESETS, params.preset)
    motion = longitudinal(drive, params, vehicle)
    ti_params = with_preset(TiParameters(smooth=False), TI_PRESETS, params.preset)
    rls_params = with_preset(RlsForgetParameters(), RLS_PRESETS, params.preset)
    analytic = fit_identities(motion, ti_params, drive.rate)
    recursive = fit_recursively(motion, rls_params, drive.rate, engine)
    known = recursive.known & ~drive.standstill
    factor = np.where(known, np.minimum(np.abs(motion.vdot) / params.vdot_full, 1.0), np.nan)

    def combined(a: Floats, b: Floats) -> Floats:
        mixed = factor * a + (1 - factor) * b
        either = np.where(np.isfinite(mixed), mixed, np.where(np.isfinite(a), a, b))
        return np.where(known, either, np.nan)

    limit = round(params.hold_time * drive.rate)
    rls_grade_sd = np.hypot(recursive.pitch_sd, recursive.inclination_sd)
    rls_grade = recursive.inclination - recursive.pitch
    parts = {
        "grade": combined(analytic.grade, rls_grade),
        "pitch": combined(analytic.pitch, recursive.pitch),
    }
    sds = {
        # both parts share their errors largely: standard deviations add, not variances
        "grade": combined(analytic.grade_sd, rls_grade_sd),
        "pitch": combined(analytic.pitch_sd, recursive.pitch_sd),
        "inclination": np.where(known, motion.inclination_sd, np.nan),
    }
    valid = np.isfinite(parts["grade"]) & np.isfinite(parts["pitch"])
    held = np.zeros(len(drive), np.bool_)
    angles, sd = {}, {}
    for name, values in parts.items():
        angles[name], held = hold(np.where(valid, values, np.nan), limit)
    for name, values in sds.items():
        sd[name] = hold(np.where(valid, values, np.nan), limit)[0]
    angles["inclination"] = angles["grade"] + angles["pitch"]
    converging = np.cumsum(recursive.updated) * drive.dt < rls_params.excitation_time
    flags = (
        straight_flags(drive, recursive.known)
        | flag(held, "held")
        | flag(known & ~valid, "excitation")
        | flag(analytic.clipped, "saturated")
        | flag(converging, "converging")
    )
    columns = {"ti_share": factor, "excitation": recursive.excitation}
    details = {"weights": Detail("roadlog.v1.TiRlsWeights", drive.time, columns)}
    return Estimate(drive.time, angles, sd, valid & ~converging, flags, details)


TI_RLS = Estimator(
    name="ti_rls",
    run=ti_rls,
    parameters=TiRlsParameters,
    needs=("imu.accel_x", "imu.accel_z", ANY_SPEED),
    gives=("grade", "pitch", "inclination"),
    reference="Massel 2004; docs/methods/massel2004.md#combination",
    summary="ti where dv/dt is large, rls_forget where it is small; needs a smooth road",
    systematic_deg={"grade": 2.7, "pitch": 2.7, "inclination": 0.6},
    tilted=("inclination",),
)
