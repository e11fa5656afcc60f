"""Where a car went: dead reckoning held to the receiver's fixes; docs/roads.md#way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.geo import TransverseMercator
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

STEP = 5.0  # m between points; at 5 m a spline holds a line of 17 m radius within 3 mm
WANDER, WANDER_TIME = 1.0, 60.0  # m and s, of the fixes
DRIFT = 0.03  # m/sqrt(s), of the reckoning by a receiver's velocity, which has no lasting error
DRIFT_ALONE = 0.5  # m/sqrt(s), of the reckoning by wheels and the course between places
SPEED_ANCHOR = 2.0  # s, sd of the Gaussian over which the wheels are held to the receiver's speed
SLIP = 0.2  # of the wheels' speed, that the receiver's may be off
HEADING_ANCHOR = 5.0  # s, sd of the Gaussian over which the gyro is held to the course
SLOWEST = 1.0  # m/s, below which a course tells nothing
DELAYS = np.arange(-0.5, 2.51, 0.05)  # s, looked through for the receiver's
DELAY_BAND = 5.0  # s, sd of the Gaussian whose slow part is left out
DELAY_FIXES = 60  # fewer tell no delay
DELAY_MISFIT = 0.5  # of the speed's variance that may be left
BLIND = 3.0  # s between fixes, beyond which the way in between is not known
LOST = 0.3  # m/s, by which the reckoning goes astray between such fixes


@dataclass(frozen=True, eq=False)
class Way:
    """A drive's way on its clock, in `plane`.

    distance: m, horizontal. x, y: m, of the vehicle's reference point. course: rad, of the
    antenna's way; heading: rad, of the car; both unwrapped, counterclockwise from east.
    altitude: time in s and the road's height in m at the fixes that have one. fixed: s, times
    of all.
    """

    plane: TransverseMercator
    distance: Floats
    x: Floats
    y: Floats
    course: Floats
    heading: Floats
    altitude: tuple[Floats, Floats] | None
    fixed: Floats

    def near(self, time: Floats) -> Bools:
        """Whether the place is known: fixes on both sides, no farther apart than BLIND."""
        after = np.clip(np.searchsorted(self.fixed, time), 1, len(self.fixed) - 1)
        gap = self.fixed[after] - self.fixed[after - 1]
        inside = (time >= self.fixed[0]) & (time <= self.fixed[-1])
        result: Bools = inside & (gap <= BLIND)
        return result


def way_of(
    drive: Drive, slope: Floats, inclination: Floats, antenna: tuple[float, float, float]
) -> Way | None:
    """The way of a drive; None with fewer than two fixes on the move.

    slope, inclination: rad, of the road and of the car, on the drive's clock. antenna: m, ahead
    of and left of the vehicle's reference point, and above the road.
    """
    fixes = _Fixes.of(drive, receiver_delay(drive, inclination))
    if fixes is None:
        return None
    wheels = np.abs(np.nan_to_num(drive.speed)) * np.cos(slope)
    turned = _turned(drive)
    course = fixes.course(drive.time, turned)
    heading = _heading(drive, course, turned, wheels)
    speed = _held_speed(drive, wheels, fixes)
    distance = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) * drive.dt
    x, y = _reckoned(drive.time, distance, course, fixes)
    ahead, left, up = antenna
    return Way(
        plane=fixes.plane,
        distance=distance,
        x=x - ahead * np.cos(heading) + left * np.sin(heading),
        y=y - ahead * np.sin(heading) - left * np.cos(heading),
        course=course,
        heading=heading,
        altitude=fixes.heights and (fixes.heights[0], fixes.heights[1] - up),
        fixed=fixes.time,
    )


def receiver_delay(drive: Drive, inclination: Floats) -> float:
    """s, by which the receiver lags behind the IMU; 0 where that does not show.

    Speed as the accelerometer tells it, gravity taken off by the car's inclination (rad), against
    the receiver's own speed, both without what changes slower than DELAY_BAND. A car that turns
    about a point behind the IMU slips sideways there, and its accelerometer feels r (l - K v2) r of
    that: l and K are fitted along. Not against the wheels: their slip goes with the acceleration
    and looks like a lead.
    """
    gnss = drive.native["gnss"]
    speed = gnss.columns.get("speed", np.full(len(gnss.time), np.nan))
    known = np.isfinite(speed)
    if "imu.accel_x" not in drive or known.sum() < DELAY_FIXES:
        return 0.0
    at, measured = gnss.time[known], speed[known]
    moving = measured > SLOWEST
    if moving.sum() < DELAY_FIXES:
        return 0.0
    gridded = np.interp(drive.time, at, measured)
    slow = gridded - _quick(gridded, DELAY_BAND * drive.rate)
    wanted = (measured - np.interp(at, drive.time, slow))[moving]
    told = _told_speeds(drive, inclination)
    misfit = np.array([_misfit(told, drive.time, at[moving] - d, wanted) for d in DELAYS])
    best = int(misfit.argmin())
    if best in (0, len(DELAYS) - 1) or misfit[best] > DELAY_MISFIT * float(np.var(wanted)):
        return 0.0
    left, low, right = misfit[best - 1 : best + 2]
    return float(
        DELAYS[best] + 0.5 * (DELAYS[1] - DELAYS[0]) * (left - right) / (left - 2 * low + right)
    )


def _told_speeds(drive: Drive, inclination: Floats) -> Floats:
    """(3, n): quick part of the accelerometer's speed, and of what slipping sideways adds to it."""
    push = np.nan_to_num(drive["imu.accel_x"] - G * np.sin(inclination))
    turning = np.square(_yaw_rate(drive))
    causes = np.array([push, turning, turning * np.square(np.nan_to_num(drive.speed))])
    causes -= causes.mean(axis=1, keepdims=True)
    told = (np.cumsum(causes, axis=1) - 0.5 * causes) * drive.dt
    return _quick(told, DELAY_BAND * drive.rate)


def _misfit(told: Floats, time: Floats, at: Floats, wanted: Floats) -> float:
    """m2/s2, mean square that the told speeds leave of the wanted one."""
    first, *others = (np.interp(at, time, values) for values in told)
    left = wanted - first
    aside = np.stack(others, axis=1)
    left = left - aside @ np.linalg.lstsq(aside, left, rcond=None)[0]
    return float(np.mean(left**2))


def _quick(values: Floats, sd: float) -> Floats:
    """Without their Gaussian mean over the last axis."""
    from scipy.ndimage import gaussian_filter1d

    result: Floats = values - gaussian_filter1d(values, sd)
    return result


def _smooth(values: Floats, sd: float) -> Floats:
    """Gaussian sum over the last axis, nothing beyond its ends."""
    from scipy.ndimage import gaussian_filter1d

    result: Floats = gaussian_filter1d(values, sd, mode="constant")
    return result


@dataclass(frozen=True, eq=False)
class _Fixes:
    """The receiver's fixes on the drive's clock, its delay taken off. x, y: m in `plane`.

    heights, courses, speeds: times in s and values of their own; courses are unwrapped.
    speeds: None where the courses are not the receiver's either, but made of its places.
    """

    time: Floats
    x: Floats
    y: Floats
    plane: TransverseMercator
    heights: tuple[Floats, Floats] | None
    courses: tuple[Floats, Floats]
    speeds: tuple[Floats, Floats] | None

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
        heights, speeds = (_finite(time, gnss.columns.get(name)) for name in ("altitude", "speed"))
        own, courses = _courses(drive, time, time[known], x, y)
        if len(courses[0]) < 2:
            return None
        return cls(time[known], x, y, plane, heights, courses, speeds if own else None)

    def course(self, time: Floats, turned: Floats) -> Floats:
        """rad, of the way; as the gyro turned (rad, at `time`) between the receiver's own."""
        at, values = self.courses
        off = np.unwrap(values - np.interp(at, time, turned))
        result: Floats = turned + np.interp(time, at, off)
        return result


def _finite(time: Floats, values: Floats | None) -> tuple[Floats, Floats] | None:
    if values is None:
        return None
    known = np.isfinite(values)
    return (time[known], values[known]) if known.sum() > 1 else None


def _courses(
    drive: Drive, time: Floats, fixed: Floats, x: Floats, y: Floats
) -> tuple[bool, tuple[Floats, Floats]]:
    """Time and course on the move: the receiver's own (then True), or that of its places."""
    columns = drive.native["gnss"].columns
    speed = np.interp(time, drive.time, np.abs(np.nan_to_num(drive.speed)))
    course = columns.get("course")
    if course is not None and np.isfinite(course).sum() > 1:
        known = np.isfinite(course) & (speed > SLOWEST)
        return True, (time[known], course[known])
    gap = np.maximum(np.gradient(fixed), 1e-3)
    vx, vy = np.gradient(x) / gap, np.gradient(y) / gap
    known = np.hypot(vx, vy) > SLOWEST
    return False, (fixed[known], np.arctan2(vy, vx)[known])


def _yaw_rate(drive: Drive) -> Floats:
    """rad/s; 0 without a gyro."""
    if "imu.gyro_z" not in drive:
        return np.zeros(len(drive.time))
    return np.nan_to_num(drive["imu.gyro_z"])


def _turned(drive: Drive) -> Floats:
    """rad, that the gyro has turned since the beginning."""
    rate = _yaw_rate(drive)
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * drive.dt


def _heading(drive: Drive, course: Floats, turned: Floats, speed: Floats) -> Floats:
    """rad, of the car: its yaw rate, held over HEADING_ANCHOR to the course less the sideslip.

    The sideslip of a car that corners is l r / v - K v r, of which l and K are fitted.
    """
    if "imu.gyro_z" not in drive:
        return course
    moving = speed > SLOWEST
    weight, sd = moving.astype(np.float64), HEADING_ANCHOR * drive.rate
    rate, fast = _yaw_rate(drive), np.maximum(speed, SLOWEST)
    told = np.array([course - turned, rate / fast, rate * fast])
    total = np.maximum(_smooth(weight, sd), 1e-12)
    quick = told - _smooth(weight * told, sd) / total
    off, *slips = quick[:, moving]
    share = np.linalg.lstsq(np.stack(slips, axis=1), off, rcond=None)[0]
    error = told[0] - share @ told[1:]
    result: Floats = turned + _smooth(weight * error, sd) / total
    return np.where(total > 1e-6, result, course)


def _held_speed(drive: Drive, wheels: Floats, fixes: _Fixes) -> Floats:
    """m/s, horizontal: the wheels', scaled over SPEED_ANCHOR to the receiver's where it has one.

    Wheels slip by as much as a road climbs; a receiver's speed is true on the whole.
    """
    if fixes.speeds is None:
        return wheels
    at, speed = fixes.speeds
    after = np.clip(np.searchsorted(at, drive.time), 1, len(at) - 1)
    known = (at[after] - at[after - 1] <= BLIND) & (wheels > SLOWEST)
    sd = SPEED_ANCHOR * drive.rate
    told, own = _smooth(known * np.array([np.interp(drive.time, at, speed), wheels]), sd)
    there = own > SLOWEST / 10
    if not there.any():
        return wheels
    scale = np.interp(drive.time, drive.time[there], told[there] / own[there])
    result: Floats = wheels * np.clip(scale, 1 - SLIP, 1 + SLIP)
    return result


def _reckoned(
    time: Floats, distance: Floats, course: Floats, fixes: _Fixes
) -> tuple[Floats, Floats]:
    """x and y in m at each time: dead reckoning by course and distance, held to the fixes."""
    step = np.diff(distance)
    middle = 0.5 * (course[1:] + course[:-1])
    reckoned, off = [], []
    for wave, place in ((np.cos, fixes.x), (np.sin, fixes.y)):
        reckoned.append(np.concatenate([[0.0], np.cumsum(step * wave(middle))]))
        off.append(place - np.interp(fixes.time, time, reckoned[-1]))
    held = _held(fixes.time, np.stack(off, axis=1), DRIFT if fixes.speeds else DRIFT_ALONE)
    x, y = (r + np.interp(time, fixes.time, o) for r, o in zip(reckoned, held.T, strict=True))
    return x, y


def _held(time: Floats, off: Floats, drift: float) -> Floats:
    """m, where reckoning is really off from where the fixes (n, 2) say; most likely of all.

    The reckoning drifts at random, most between fixes far apart; the fixes wander (Gauss-Markov).
    """
    from scipy.linalg import solveh_banded

    gap = np.maximum(np.diff(time), 1e-3)
    alike = np.exp(-gap / WANDER_TIME)
    told = 1 / (WANDER**2 * (1 - alike**2))
    kept = 1 / (drift**2 * gap + (LOST * np.maximum(gap - BLIND, 0.0)) ** 2)
    first = np.concatenate([[1 / WANDER**2], told])
    wander = first + np.append(alike**2 * told, 0.0)  # on the diagonal; beside it -alike told
    walk = np.append(0.0, kept) + np.append(kept, 0.0)
    beside = np.append(0.0, -alike * told - kept)
    seen = wander[:, None] * off
    seen[1:] -= (alike * told)[:, None] * off[:-1]
    seen[:-1] -= (alike * told)[:, None] * off[1:]
    result: Floats = solveh_banded(np.stack([beside, wander + walk]), seen)
    return result
