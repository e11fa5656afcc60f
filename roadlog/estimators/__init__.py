"""The estimators: one module a method, listed in one explicit table."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from roadlog.correction import applied, corrected
from roadlog.drive import Drive
from roadlog.errors import ConfigError, EstimatorError, near
from roadlog.estimate import Estimate
from roadlog.estimators.base import Engine, Estimator, default_notes
from roadlog.vehicle import Vehicle

# estimator -> the module and the attribute that define it; modules are imported when asked for
TABLE: dict[str, str] = {
    "fusion": "roadlog.estimators.fusion:FUSION",
    "ls_window": "roadlog.estimators.ls_window:LS_WINDOW",
    "rls_forget": "roadlog.estimators.rls_forget:RLS_FORGET",
    "ti": "roadlog.estimators.ti:TI",
    "pn": "roadlog.estimators.pn:PN",
    "ti_rls": "roadlog.estimators.ti_rls:TI_RLS",
    "incl_kinematic": "roadlog.estimators.incl_kinematic:INCL_KINEMATIC",
    "kmbe": "roadlog.estimators.kmbe:KMBE",
    "debe": "roadlog.estimators.debe:DEBE",
    "tfobe": "roadlog.estimators.tfobe:TFOBE",
    "ekf_suspension": "roadlog.estimators.ekf_suspension:EKF_SUSPENSION",
    "lowpass_attitude": "roadlog.estimators.lowpass_attitude:LOWPASS_ATTITUDE",
    "ls_attitude": "roadlog.estimators.ls_attitude:LS_ATTITUDE",
    "fuel_level": "roadlog.estimators.fuel_level:FUEL_LEVEL",
    "static_slope": "roadlog.estimators.static_slope:STATIC_SLOPE",
    "kasaba": "roadlog.estimators.kasaba:KASABA",
    "grade_pitch_ekf": "roadlog.estimators.grade_pitch_ekf:GRADE_PITCH_EKF",
    "roll_bank_obs": "roadlog.estimators.roll_bank_obs:ROLL_BANK_OBS",
    "split_qs": "roadlog.estimators.split_qs:SPLIT_QS",
    "gnss_ins": "roadlog.estimators.gnss_ins:GNSS_INS",
    "imu_roll": "roadlog.estimators.gnss_ins:IMU_ROLL",
}

ENTRY_POINTS = "roadlog.estimators"


def get(name: str) -> Estimator:
    """The estimator of that name or alias; plug-ins are looked up for unknown names only.

    Raises ConfigError with near names.
    """
    if name in TABLE:
        return _load(TABLE[name])
    for estimator in all_estimators():
        if name in estimator.aliases:
            return estimator
    for point in entry_points(group=ENTRY_POINTS):
        if point.name == name:
            return _checked(point.load(), f"plug-in {point.value}")
    raise ConfigError(f"no estimator '{name}'. {near(name, TABLE)}")


def all_estimators() -> list[Estimator]:
    """Every estimator that ships with roadlog."""
    return [_load(target) for target in TABLE.values()]


def run(
    name: str,
    drive: Drive,
    vehicle: Vehicle,
    settings: Mapping[str, Any] | None = None,
    engine: Engine = "compiled",
) -> Estimate:
    """Run one estimator by name, on the drive as the vehicle file corrects its sensors.

    settings: parameters to set. Raises EstimatorError when the drive lacks a needed signal,
    ConfigError for an unknown name or parameter.
    """
    estimator = get(name)
    missing = estimator.missing(drive)
    if missing:
        raise EstimatorError(
            f"{estimator.name} cannot run: the drive has no {', no '.join(missing)}. "
            f"Map the signal in the profile, or choose another estimator (`roadlog info`)"
        )
    params = estimator.configure(settings or {})
    changes = applied(vehicle, drive)
    said = [f"applied from the vehicle file: {', '.join(changes)}"] if changes else []
    drive = corrected(drive, vehicle)
    started = time.perf_counter()
    estimate = estimator.with_systematic(estimator.run(drive, vehicle, params, engine)).bounded()
    return dataclasses.replace(
        estimate,
        name=estimator.name,
        parameters=dataclasses.asdict(params),
        notes=[*said, *default_notes(estimator, vehicle), *estimate.notes],
        run_time=time.perf_counter() - started,
    )


def _load(target: str) -> Estimator:
    module, attribute = target.split(":")
    return getattr(import_module(module), attribute)


def _checked(found: Any, where: str) -> Estimator:
    if not isinstance(found, Estimator):
        raise ConfigError(f"{where}: is no roadlog.estimators.base.Estimator but {type(found)}")
    return found
