"""One drive's way over the road: where it went and what grade and bank it found there."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.roads.way import STEP, way_of
from roadlog.types import Floats

ANTENNA_HEIGHT = 1.3  # m above the road, where unknown: a phone's holder 1.1, a roof 1.5
SHAPE_SHARE = 0.5  # of an sd, for changes along the road, where the estimator does not say


@dataclass(frozen=True, eq=False)
class Pass:
    """One drive, a point every `STEP` of horizontal distance; (n,) each.

    car: drives with the same text share the IMU's mounting. distance: m. latitude, longitude: deg;
    altitude: m, of the road, NaN where unknown. course: rad, of the way, counterclockwise from
    east; heading: rad, of the car. grade, bank: rad, in the car's axes; bank may be NaN. *_sd: rad,
    in all; *_shape_sd: rad, of what changes along the road, a constant offset left out.
    """

    name: str
    car: str
    estimator: str
    distance: Floats
    latitude: Floats
    longitude: Floats
    altitude: Floats
    course: Floats
    heading: Floats
    grade: Floats
    bank: Floats
    grade_sd: Floats
    bank_sd: Floats
    grade_shape_sd: Floats
    bank_shape_sd: Floats

    def __len__(self) -> int:
        return len(self.distance)

    def to_bytes(self) -> bytes:
        """The pass as a compressed file; angles in single precision."""
        buffer = io.BytesIO()
        columns = {
            name: getattr(self, name).astype(np.float64 if name in _EXACT else np.float32)
            for name in _COLUMNS
        }
        names = {key: np.array(getattr(self, key)) for key in _NAMES}
        np.savez_compressed(buffer, **names, **columns)  # type: ignore[arg-type]
        return buffer.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> Pass:
        """What `to_bytes` wrote."""
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            values: dict[str, Any] = {key: str(file[key]) for key in _NAMES}
            values |= {name: file[name].astype(np.float64) for name in _COLUMNS}
            return cls(**values)


_NAMES = ("name", "car", "estimator")
_EXACT = ("distance", "latitude", "longitude")
_COLUMNS = (
    *_EXACT, "altitude", "course", "heading", "grade", "bank",
    "grade_sd", "bank_sd", "grade_shape_sd", "bank_shape_sd",
)  # fmt: skip


def car_of(vehicle: Vehicle) -> str:
    """What drives must share so that one mounting is taken for all of them.

    Logs without a vehicle file count as one car: an error that may be common is not averaged away.
    """
    mount = vehicle.imu_mount
    return f"{vehicle.name} {mount if mount is not None else ''}".strip()


def antenna_of(vehicle: Vehicle) -> tuple[float, float, float]:
    """m, ahead and left of the car's CG and above the road; at the CG's place where unknown."""
    if vehicle.antenna_position is None:
        return 0.0, 0.0, ANTENNA_HEIGHT
    ahead, left, up = vehicle.antenna_position
    return ahead, left, vehicle.cg_height + up


def pass_of(
    drive: Drive, estimate: Estimate, vehicle: Vehicle | None = None, name: str = ""
) -> Pass | None:
    """The pass of one estimate; None without positions, a speed, or a grade with its sd.

    Only points with a valid grade and a known place are in it.
    """
    if not {"gnss.latitude", "gnss.longitude"} <= set(drive.signals) or not drive.has_speed:
        return None
    if "grade" not in estimate.angles or not np.isfinite(estimate.sd.get("grade", np.nan)).any():
        return None
    time = _clock(drive, estimate)
    columns = _angles(estimate)
    usable = estimate.valid & np.isfinite(columns["grade"]) & (columns["grade_sd"] > 0)
    if not usable.any():
        return None
    slope = np.interp(drive.time, time[usable], columns["grade"][usable])
    way = way_of(drive, slope, _inclination(drive, estimate), antenna_of(vehicle or Vehicle()))
    if way is None:
        return None
    known = usable & way.near(time)
    at = np.interp(time, drive.time, way.distance)
    bins = np.floor(at[known] / STEP).astype(np.int64)
    if len(bins) == 0:
        return None
    _, index, count = np.unique(bins, return_inverse=True, return_counts=True)

    def mean(values: Floats) -> Floats:
        result: Floats = np.bincount(index, values[known]) / count
        return result

    def over_time(values: Floats) -> Floats:
        return mean(np.interp(time, drive.time, values))

    latitude, longitude = way.plane.inverse(over_time(way.x), over_time(way.y))
    return Pass(
        name=name,
        car=car_of(vehicle or Vehicle()),
        estimator=estimate.name,
        distance=mean(at),
        latitude=latitude,
        longitude=longitude,
        altitude=mean(np.interp(time, *way.altitude)) if way.altitude else _unknown(count),
        course=over_time(way.course),
        heading=over_time(way.heading),
        **{key: mean(values) for key, values in columns.items()},
    )


def _unknown(like: NDArray) -> Floats:
    return np.full(len(like), np.nan)


def _angles(estimate: Estimate) -> dict[str, Floats]:
    """grade, bank, their sds and the sds of their shapes, on the estimate's own clock."""
    columns: dict[str, Floats] = {}
    shape = estimate.details.get("shape")
    for angle in ("grade", "bank"):
        sd = estimate.sd.get(angle, _unknown(estimate.time))
        columns[angle] = estimate.angles.get(angle, _unknown(estimate.time))
        columns[f"{angle}_sd"] = sd
        key = f"{angle}_shape_sd"
        if shape is not None and key in shape.columns:
            columns[key] = np.interp(estimate.time, shape.time, shape.columns[key])
        else:
            columns[key] = SHAPE_SHARE * sd
    return columns


def _clock(drive: Drive, estimate: Estimate) -> Floats:
    """The estimate's time in s on the drive's clock."""
    result: Floats = np.multiply(estimate.time_ns - drive.start_ns, 1e-9)
    return result


def _inclination(drive: Drive, estimate: Estimate) -> Floats:
    """rad, of the car on the drive's clock; of the road where the estimate tells none."""
    values = estimate.angles.get("inclination", estimate.angles["grade"])
    known = np.isfinite(values)
    return np.interp(drive.time, _clock(drive, estimate)[known], values[known])
