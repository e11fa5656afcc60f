"""The estimators: one module a method, listed in one explicit table."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Collection, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from roadlog import plugins
from roadlog.car.correction import applied, corrected
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import ConfigError, EstimatorError, near
from roadlog.estimate import Estimate
from roadlog.estimators.base import Engine, Estimator, default_notes
from roadlog.filters.compiling import compiling
from roadlog.once import once

if TYPE_CHECKING:
    from roadlog.checks.finding import Finding

# estimator -> the module and the attribute that define it; modules are imported when asked for
TABLE: dict[str, str] = {
    "fusion": "roadlog.estimators.fusion.estimator:FUSION",
    "ls_window": "roadlog.estimators.massel2004.ls_window:LS_WINDOW",
    "rls_forget": "roadlog.estimators.massel2004.rls_forget:RLS_FORGET",
    "ti": "roadlog.estimators.massel2004.ti:TI",
    "pn": "roadlog.estimators.massel2004.pn:PN",
    "ti_rls": "roadlog.estimators.massel2004.ti_rls:TI_RLS",
    "incl_kinematic": "roadlog.estimators.massel2004.incl_kinematic:INCL_KINEMATIC",
    "kmbe": "roadlog.estimators.luo2024.kmbe:KMBE",
    "debe": "roadlog.estimators.luo2024.debe:DEBE",
    "tfobe": "roadlog.estimators.luo2024.tfobe:TFOBE",
    "ekf_suspension": "roadlog.estimators.wang2025.ekf_suspension:EKF_SUSPENSION",
    "lowpass_attitude": "roadlog.estimators.wang2025.lowpass_attitude:LOWPASS_ATTITUDE",
    "ls_attitude": "roadlog.estimators.wang2025.ls_attitude:LS_ATTITUDE",
    "fuel_level": "roadlog.estimators.wang2025.fuel_level:FUEL_LEVEL",
    "static_slope": "roadlog.estimators.kim2023.static_slope:STATIC_SLOPE",
    "kasaba": "roadlog.estimators.kim2023.kasaba:KASABA",
    "grade_pitch_ekf": "roadlog.estimators.kim2023.grade_pitch_ekf:GRADE_PITCH_EKF",
    "roll_bank_obs": "roadlog.estimators.ryu2004.roll_bank_obs:ROLL_BANK_OBS",
    "split_qs": "roadlog.estimators.ryu2004.split_qs:SPLIT_QS",
    "gnss_ins": "roadlog.estimators.ryu2004.gnss_ins:GNSS_INS",
    "imu_roll": "roadlog.estimators.ryu2004.gnss_ins:IMU_ROLL",
}

# other names of a method in its papers
ALIASES = {
    "kim": "static_slope",
    "tire_ukf": "tfobe",
    "tyre_ukf": "tfobe",
    "grade_ukf": "tfobe",
}
ENTRY_POINTS = "roadlog.estimators"

_corrected = once(corrected)  # the same for every estimator, so that these share what they need


def get(name: str) -> Estimator:
    """The estimator of that name or alias; plug-ins are looked up for unknown names only.

    Raises ConfigError with near names.
    """
    name = ALIASES.get(name, name)
    if name in TABLE:
        return _load(TABLE[name])
    added = plugins.installed(ENTRY_POINTS, Estimator)
    if name in added:
        return added[name]
    hint = "Name none to run all that can" if name == "all" else near(name, [*TABLE, *added])
    raise ConfigError(f"no estimator '{name}'. {hint}")


def all_estimators() -> list[Estimator]:
    """Every estimator that ships with roadlog."""
    return [_load(target) for target in TABLE.values()]


def runnable(drive: Drive | None) -> tuple[list[Estimator], dict[str, str]]:
    """The estimators that can run on a drive, and name -> why not of all others."""
    every = all_estimators()
    refused = {e.name: reason for e in every if (reason := e.refusal(drive))}
    return [e for e in every if e.name not in refused], refused


def run(
    name: str,
    drive: Drive,
    vehicle: Vehicle,
    settings: Mapping[str, Any] | None = None,
    engine: Engine = "compiled",
    faults: Collection[Finding] = (),
) -> Estimate:
    """Run one estimator by name, on the drive as the vehicle file corrects its sensors.

    settings: parameters to set. faults: of `roadlog.checks`; where one makes the angles wrong, none
    is valid. Raises EstimatorError when the drive lacks a needed signal,
    ConfigError for an unknown name or parameter.
    """
    estimator = get(name)
    reason = estimator.refusal(drive)
    if reason:
        raise EstimatorError(
            f"{estimator.name} cannot run: the drive has {reason}. "
            f"Map the signal in the profile, or choose another estimator (`roadlog info`)"
        )
    params = estimator.configure(settings or {})
    changes = applied(vehicle, drive)
    said = [f"applied from the vehicle file: {', '.join(changes)}"] if changes else []
    drive = _corrected(drive, vehicle) if changes else drive
    started = time.perf_counter()
    with compiling(estimator.name) as compiled:
        made = estimator.run(drive, vehicle, params, engine)
    estimate = estimator.with_systematic(made, drive, vehicle).bounded()
    estimate = estimator.doubted(estimate, drive, faults)
    return dataclasses.replace(
        estimate,
        name=estimator.name,
        parameters=dataclasses.asdict(params),
        notes=[*said, *default_notes(estimator, vehicle), *estimate.notes],
        run_time=time.perf_counter() - started - compiled.seconds,
        start_ns=drive.start_ns,
        engine=engine,
        inputs=tuple(sorted(drive.signals)),
    )


def _load(target: str) -> Estimator:
    module, attribute = target.split(":")
    return getattr(import_module(module), attribute)
