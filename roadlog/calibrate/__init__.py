"""Self-calibration: what drives tell of a car and its logger, without a data sheet.

Source: docs/calibration.md#how. `calibrate` takes several drives of one car with one logger and
gives every constant with its standard error, what it rests on, or why it is not identifiable.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from roadlog.calibrate.constant import Constant, combined
from roadlog.calibrate.drive import TURNS, DriveCalibration, calibrate_drive
from roadlog.calibrate.tumble import KINDS, is_tumble, tumble
from roadlog.car.suspension import DASHBOARD_HEIGHT
from roadlog.car.vehicle import DEFAULT, ValueSource, Vehicle
from roadlog.drive import Drive
from roadlog.errors import EstimatorError
from roadlog.rotation import PITCH_UP, from_vector, to_rpy, to_vector
from roadlog.signals import AXES
from roadlog.types import Floats

SENSORS = ("imu_mount", "accel_bias", "gyro_bias", "speed_scale", "speed_delay", "gnss_delay")
SCALARS = (  # constants that are vehicle parameters of the same name
    "speed_scale",
    "speed_delay",
    "gnss_delay",
    "pitch_gradient",
    "roll_gradient",
    "mass",
    "rolling_resistance",
    "rear_cornering_stiffness",
    "front_cornering_stiffness",
    "roll_stiffness",
    "roll_damping",
    "roll_inertia",
    "yaw_inertia",
)
HEIGHT_SD = 0.3  # m, of an IMU whose height over the CG does not show
SIDE_SD = 0.4  # m, of an IMU whose place across the car does not show


@dataclass(frozen=True)
class Calibration:
    """vehicle: the base with everything found, each with its source and sd. rotation (3, 3): rows
    forward, left, up in the logs' IMU axes, None where no log is of a drive. constants: by name.
    driven: front, rear or all, where all drives that show it agree. left_out: drive -> why.
    """

    vehicle: Vehicle
    rotation: Floats | None
    constants: dict[str, Constant]
    driven: str | None
    left_out: dict[str, str]

    def is_written(self, constant: Constant) -> bool:
        """Whether the vehicle has its value: those of mounting and biases also where they do not
        show, with the sd that says so.
        """
        name = constant.name
        kind = "imu_mount" if name in TURNS else name.rpartition("_")[0]
        if kind in ("imu_mount", "accel_bias", "gyro_bias", *KINDS):
            return self.vehicle.source(kind).kind == "calibrated"
        return constant.identifiable


def calibrate(drives: Mapping[str, Drive], vehicle: Vehicle) -> Calibration:
    """Everything that the drives tell together.

    drives: name -> drive as logged, uncorrected. vehicle: what is known besides; what it says of
    the sensors is found anew. Logs of an IMU that rests in many positions give its zeros and
    scales, with which the drives are read. Raises EstimatorError when no drive can be used.
    """
    lying = {name: drive for name, drive in drives.items() if is_tumble(drive)}
    at_rest = _of_tumbles(list(lying.values()))
    base = _with_tumbles(_without_sensors(vehicle), at_rest)
    drives = {name: drive for name, drive in drives.items() if name not in lying}
    if lying and not drives:
        return Calibration(base, None, at_rest, None, {})
    results: dict[str, DriveCalibration] = {}
    left_out: dict[str, str] = {}
    for name, drive in drives.items():
        try:
            results[name] = calibrate_drive(drive, base)
        except EstimatorError as error:
            left_out[name] = str(error)
    if not results:
        raise EstimatorError("; ".join(f"{name}: {why}" for name, why in left_out.items()))
    rotation, turns = _combined_rotation(list(results.values()))
    names = list(dict.fromkeys(name for r in results.values() for name in r.constants))
    constants = {
        name: combined([r.constants[name] for r in results.values() if name in r.constants])
        for name in names
    }
    constants |= turns
    axles = {r.driven for r in results.values()} - {None}
    driven = axles.pop() if len(axles) == 1 else None
    found = _vehicle(base, rotation, constants)
    if driven is not None and base.source("driven").kind == "default":
        found = found.with_values("calibrated", driven=driven)
    return Calibration(found, rotation, at_rest | constants, driven, left_out)


def _of_tumbles(drives: list[Drive]) -> dict[str, Constant]:
    found = [{f.name: f for f in tumble(drive)} for drive in drives]
    return {name: combined([one[name] for one in found]) for name in (found[0] if found else ())}


def _with_tumbles(base: Vehicle, constants: Mapping[str, Constant]) -> Vehicle:
    """With the zeros and scales whose three axes were all found."""
    for kind in KINDS if constants else ():
        parts = [constants[f"{kind}_{axis}"] for axis in AXES]
        if all(part.identifiable for part in parts):
            value: Any = tuple(float(part.value or 0.0) for part in parts)
            source = ValueSource("calibrated", axis_sd=_sds(parts))
            base = replace(base, sources={**base.sources, kind: source}, **{kind: value})
    return base


def _without_sensors(vehicle: Vehicle) -> Vehicle:
    """The vehicle, saying nothing of the sensors."""
    defaults = {f.name: f.default for f in fields(vehicle) if f.name in SENSORS}
    sources = {name: s for name, s in vehicle.sources.items() if name not in SENSORS}
    return replace(vehicle, sources=sources, **defaults)  # type: ignore[arg-type]


def _combined_rotation(results: list[DriveCalibration]) -> tuple[Floats, dict[str, Constant]]:
    """Mean rotation, axis by axis about the car, and the constants that tell it: roll right side
    down, pitch nose up, yaw counterclockwise, as everywhere.
    """
    first = results[0].rotation
    away = [to_vector(r.rotation @ first.T) for r in results]
    turns = {}
    turn = np.zeros(3)
    for k, name in enumerate(TURNS):
        shifted = [
            replace(r.constants[name], value=float(v[k]))
            for r, v in zip(results, away, strict=True)
        ]
        turns[name] = combined(shifted)
        turn[k] = turns[name].value or 0.0
    rotation = from_vector(turn) @ first
    angles = PITCH_UP * to_rpy(rotation)
    own = np.array([PITCH_UP * to_rpy(r.rotation) for r in results])
    return rotation, {
        name: replace(f, value=float(angles[k]), drives=_own(results, name, own[:, k]))
        for k, (name, f) in enumerate(turns.items())
    }


def _own(
    results: list[DriveCalibration], name: str, angles: Floats
) -> tuple[tuple[float, float], ...]:
    """An angle of the mounting by each drive that shows it, and its sd. angles: of all drives."""
    found = [(r.constants[name], float(angle)) for r, angle in zip(results, angles, strict=True)]
    return tuple((angle, f.sd or 0.0) for f, angle in found if f.identifiable)


def _vehicle(base: Vehicle, rotation: Floats, constants: Mapping[str, Constant]) -> Vehicle:
    """The base with what was found. A constant that does not show leaves the base as it is.

    Biases are written whole, and the mounting with its roll, because they act together: where
    one of them does not show, its sd says so.
    """
    values: dict[str, object] = {}
    sources: dict[str, ValueSource] = {}
    values["imu_mount"] = tuple(tuple(float(v) for v in row) for row in rotation)
    sources["imu_mount"] = ValueSource(
        "calibrated", axis_sd=_sds([constants[name] for name in TURNS])
    )
    for kind in ("accel_bias", "gyro_bias"):
        parts = [constants[f"{kind}_{axis}"] for axis in AXES]
        values[kind] = tuple(float(f.value or 0.0) for f in parts)
        sources[kind] = ValueSource("calibrated", axis_sd=_sds(parts))
    for name in SCALARS:
        constant = constants.get(name)
        if constant is not None and constant.identifiable and constant.value is not None:
            values[name] = constant.value
            sources[name] = ValueSource("calibrated", constant.sd)
    along = constants["imu_position_x"]
    if base.imu_position is None and along.identifiable and along.value is not None:
        across = constants["imu_position_y"]
        y, y_sd = (across.value, across.sd) if across.identifiable else (0.0, SIDE_SD)
        z = DASHBOARD_HEIGHT - base.cg_height
        values["imu_position"] = (along.value, float(y or 0.0), z)
        sds = (float(along.sd or 0.0), float(y_sd or SIDE_SD), HEIGHT_SD)
        sources["imu_position"] = ValueSource("calibrated", axis_sd=sds)
    kept = {name: s for name, s in base.sources.items() if s != DEFAULT}
    return replace(base, sources={**kept, **sources}, **values)  # type: ignore[arg-type]


def _sds(constants: list[Constant]) -> tuple[float, float, float]:
    x, y, z = (float(f.sd or 0.0) for f in constants)
    return x, y, z
