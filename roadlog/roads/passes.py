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
from roadlog.geo import TransverseMercator
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

STEP = 5.0  # m between points; at 5 m a spline holds a line of 17 m radius within 3 mm
ANCHOR = 150.0  # m, sd of the Gaussian over which dead reckoning is held to the fixes
HEADING_ANCHOR = 20.0  # s, sd of the Gaussian over which the gyro is held to the course
SLOWEST = 1.0  # m/s, below which a course tells nothing
DELAYS = np.arange(-0.5, 2.51, 0.05)  # s, looked through for the receiver's
DELAY_BAND = 5.0  # s, sd of the Gaussian whose slow part is left out
DELAY_FIXES = 60  # fewer tell no delay
DELAY_MISFIT = 0.5  # of the speed's variance that may be left
BLIND = 3.0  # s between fixes, beyond which the way in between is not known
SHAPE_SHARE = 0.5  # of an sd, for changes along the road, where the estimator does not say


@dataclass(frozen=True, eq=False)
class Pass:
    """One drive, a point every `STEP` of horizontal distance; (n,) each.

    car: drives with the same text share the IMU's mounting. distance: m. latitude, longitude: deg;
    altitude: m, NaN where unknown. course: rad, of the way, counterclockwise from east; heading:
    rad, of the car. grade, bank: rad, in the car's axes; bank may be NaN. *_sd: rad, in all;
    *_shape_sd: rad, of what changes along the road, a constant offset left out.
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
    fixes = _Fixes.of(drive, receiver_delay(drive, estimate))
    if fixes is None:
        return None
    time = _clock(drive, estimate)
    columns = _angles(estimate)
    usable = estimate.valid & np.isfinite(columns["grade"]) & (columns["grade_sd"] > 0)
    slope = np.interp(drive.time, time[usable], columns["grade"][usable]) if usable.any() else 0.0
    speed = np.abs(np.nan_to_num(drive.speed)) * np.cos(slope)
    distance = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * drive.dt
    course = fixes.course(drive.time)
    heading = _heading(drive, course, speed)
    x, y = _way(drive.time, distance, course, fixes)
    known = usable & fixes.near(time)
    at = np.interp(time, drive.time, distance)
    bins = np.floor(at[known] / STEP).astype(np.int64)
    if len(bins) == 0:
        return None
    _, index, count = np.unique(bins, return_inverse=True, return_counts=True)

    def mean(values: Floats) -> Floats:
        result: Floats = np.bincount(index, values[known]) / count
        return result

    def over_time(values: Floats) -> Floats:
        return mean(np.interp(time, drive.time, values))

    latitude, longitude = fixes.plane.inverse(over_time(x), over_time(y))
    return Pass(
        name=name,
        car=car_of(vehicle or Vehicle()),
        estimator=estimate.name,
        distance=mean(at),
        latitude=latitude,
        longitude=longitude,
        altitude=mean(np.interp(time, *fixes.heights)) if fixes.heights else _unknown(count),
        course=over_time(course),
        heading=over_time(heading),
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


def receiver_delay(drive: Drive, estimate: Estimate) -> float:
    """s, by which the receiver lags behind the IMU; 0 where that does not show.

    Speed as the accelerometer tells it, gravity taken off by the estimate's inclination, against
    the receiver's own speed, both without what changes slower than DELAY_BAND. Not against the
    wheels: their slip goes with the acceleration and looks like a lead.
    """
    from scipy.ndimage import gaussian_filter1d

    inclination = estimate.angles.get("inclination", estimate.angles["grade"])
    gnss = drive.native["gnss"]
    speed = gnss.columns.get("speed", np.full(len(gnss.time), np.nan))
    known = np.isfinite(speed)
    if "imu.accel_x" not in drive or known.sum() < DELAY_FIXES:
        return 0.0
    at, measured = gnss.time[known], speed[known]
    there = np.isfinite(inclination)
    tilt = np.interp(drive.time, _clock(drive, estimate)[there], inclination[there])
    push = np.nan_to_num(drive["imu.accel_x"]) - G * np.sin(tilt)
    told = np.cumsum(push - push.mean()) * drive.dt
    grid = np.interp(drive.time, at, measured)
    sd = DELAY_BAND * drive.rate
    told, slow = told - gaussian_filter1d(told, sd), gaussian_filter1d(grid, sd)
    wanted = measured - np.interp(at, drive.time, slow)
    moving = measured > SLOWEST
    if moving.sum() < DELAY_FIXES:
        return 0.0
    misfit = np.array(
        [np.mean((wanted - np.interp(at - d, drive.time, told))[moving] ** 2) for d in DELAYS]
    )
    best = int(misfit.argmin())
    if best in (0, len(DELAYS) - 1) or misfit[best] > DELAY_MISFIT * float(np.var(wanted[moving])):
        return 0.0
    left, low, right = misfit[best - 1 : best + 2]
    return float(
        DELAYS[best] + 0.5 * (DELAYS[1] - DELAYS[0]) * (left - right) / (left - 2 * low + right)
    )


def _clock(drive: Drive, estimate: Estimate) -> Floats:
    """The estimate's time in s on the drive's clock."""
    result: Floats = np.multiply(estimate.time_ns - drive.start_ns, 1e-9)
    return result


@dataclass(frozen=True, eq=False)
class _Fixes:
    """The receiver's fixes on the drive's clock, its delay taken off. x, y: m in `plane`."""

    time: Floats
    x: Floats
    y: Floats
    plane: TransverseMercator
    heights: tuple[Floats, Floats] | None
    courses: tuple[Floats, Floats]

    @classmethod
    def of(cls, drive: Drive, delay: float) -> _Fixes | None:
        """None with fewer than two of them on the move. delay: s, behind the IMU."""
        gnss = drive.native["gnss"]
        latitude, longitude = gnss.columns["latitude"], gnss.columns["longitude"]
        known = np.isfinite(latitude) & np.isfinite(longitude)
        if known.sum() < 2:
            return None
        time = gnss.time - delay
        middle = float(np.median(latitude[known])), float(np.median(longitude[known]))
        plane = TransverseMercator(*middle)
        x, y = plane.forward(latitude[known], longitude[known])
        altitude = gnss.columns.get("altitude")
        heights = None
        if altitude is not None and np.isfinite(altitude).sum() > 1:
            high = np.isfinite(altitude)
            heights = time[high], altitude[high]
        courses = _courses(drive, time, time[known], x, y)
        return None if courses is None else cls(time[known], x, y, plane, heights, courses)

    def course(self, time: Floats) -> Floats:
        """rad, of the way, unwrapped."""
        return np.interp(time, *self.courses)

    def near(self, time: Floats) -> np.ndarray:
        """Whether the place is known: fixes on both sides, no farther apart than BLIND."""
        after = np.clip(np.searchsorted(self.time, time), 1, len(self.time) - 1)
        gap = self.time[after] - self.time[after - 1]
        inside = (time >= self.time[0]) & (time <= self.time[-1])
        result: np.ndarray = inside & (gap <= BLIND)
        return result


def _courses(
    drive: Drive, time: Floats, fixed: Floats, x: Floats, y: Floats
) -> tuple[Floats, Floats] | None:
    """Time and unwrapped course on the move: the receiver's own, or that of its places."""
    columns = drive.native["gnss"].columns
    speed = np.interp(time, drive.time, np.abs(np.nan_to_num(drive.speed)))
    course = columns.get("course")
    if course is not None and np.isfinite(course).sum() > 1:
        known = np.isfinite(course) & (speed > SLOWEST)
        own, values = time[known], course[known]
    else:
        gap = np.maximum(np.gradient(fixed), 1e-3)
        vx, vy = np.gradient(x) / gap, np.gradient(y) / gap
        known = np.hypot(vx, vy) > SLOWEST
        own, values = fixed[known], np.arctan2(vy, vx)[known]
    return (own, np.unwrap(values)) if len(own) > 1 else None


def _heading(drive: Drive, course: Floats, speed: Floats) -> Floats:
    """rad, of the car: its yaw rate, held to the course over HEADING_ANCHOR.

    So its sideslip in bends counts, which a course does not know of.
    """
    from scipy.ndimage import gaussian_filter1d

    if "imu.gyro_z" not in drive:
        return course
    rate = np.nan_to_num(drive["imu.gyro_z"])
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * drive.dt
    weight = (speed > SLOWEST).astype(np.float64)
    sd = HEADING_ANCHOR * drive.rate
    total = gaussian_filter1d(weight, sd, mode="constant")
    error = gaussian_filter1d(weight * (course - turned), sd, mode="constant")
    result: Floats = turned + error / np.maximum(total, 1e-12)
    return np.where(total > 1e-6, result, course)


def _way(time: Floats, distance: Floats, course: Floats, fixes: _Fixes) -> tuple[Floats, Floats]:
    """x and y in m at each time: dead reckoning by course and distance, held to the fixes."""
    step = np.diff(distance)
    middle = 0.5 * (course[1:] + course[:-1])
    result = []
    for wave, place in ((np.cos, fixes.x), (np.sin, fixes.y)):
        reckoned = np.concatenate([[0.0], np.cumsum(step * wave(middle))])
        error = place - np.interp(fixes.time, time, reckoned)
        at = np.interp(fixes.time, time, distance)
        grid = np.arange(at[0], at[-1] + 2 * STEP, STEP)
        held = _smoothed(at, error, grid)
        result.append(reckoned + np.interp(distance, grid, held))
    return result[0], result[1]


def _smoothed(at: Floats, values: Floats, grid: Floats) -> Floats:
    """Gaussian mean of scattered values on a uniform grid over distance; rests count once."""
    from scipy.ndimage import gaussian_filter1d

    cell = np.clip(np.round((at - grid[0]) / STEP).astype(np.int64), 0, len(grid) - 1)
    count = np.bincount(cell, minlength=len(grid)).astype(np.float64)
    mean = np.bincount(cell, values, len(grid)) / np.maximum(count, 1)
    there = (count > 0).astype(np.float64)
    sd = ANCHOR / STEP
    total = gaussian_filter1d(there, sd, mode="constant")
    result: Floats = gaussian_filter1d(there * mean, sd, mode="constant") / np.maximum(total, 1e-9)
    return result
