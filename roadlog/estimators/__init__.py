"""The estimators: one module a method, listed in one explicit table."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from roadlog.drive import Drive
from roadlog.errors import ConfigError, EstimatorError, near
from roadlog.estimate import Estimate
from roadlog.estimators.base import Engine, Estimator, default_notes
from roadlog.vehicle import Vehicle

# estimator -> the module and the attribute that define it; modules are imported when asked for
TABLE: dict[str, str] = {
    "kmbe": "roadlog.estimators.kmbe:KMBE",
    "lowpass_attitude": "roadlog.estimators.lowpass_attitude:LOWPASS_ATTITUDE",
    "static_slope": "roadlog.estimators.static_slope:STATIC_SLOPE",
    "kasaba": "roadlog.estimators.kasaba:KASABA",
    "grade_pitch_ekf": "roadlog.estimators.grade_pitch_ekf:GRADE_PITCH_EKF",
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
    """Run one estimator by name.

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
    started = time.perf_counter()
    estimate = estimator.run(drive, vehicle, params, engine)
    return dataclasses.replace(
        estimate,
        name=estimator.name,
        parameters=dataclasses.asdict(params),
        notes=[*default_notes(estimator, vehicle), *estimate.notes],
        run_time=time.perf_counter() - started,
    )


def _load(target: str) -> Estimator:
    module, attribute = target.split(":")
    return getattr(import_module(module), attribute)


def _checked(found: Any, where: str) -> Estimator:
    if not isinstance(found, Estimator):
        raise ConfigError(f"{where}: is no roadlog.estimators.base.Estimator but {type(found)}")
    return found
