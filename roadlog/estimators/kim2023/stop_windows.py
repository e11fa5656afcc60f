"""Stops of a drive and the windows next to them: what `static_slope` measures.

Kim 2023, corrected and extended: docs/methods/kim2023.md#windows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.estimators.kim2023.stops import NOISE_MARGIN, StaticSlopeParameters, Stop, vectors
from roadlog.estimators.kim2023.strapdown import (
    StrapdownPath,
    StrapdownStart,
    attitude,
    dead_reckon,
    to_navigation,
)
from roadlog.filters import Engine
from roadlog.signals import ACCELERATION, DECELERATION, FLAGS
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

START_RATE = 0.07  # s, half of the mean that gives the rate at a stop
LIFTED_SHARE = 0.6  # of the window's length, that the slope may begin after at most
VOID = FLAGS["missing"] | FLAGS["excitation"] | FLAGS["standstill"]  # the window has no end


@dataclass(frozen=True)
class Statics:
    """The standing body: angles in rad, gravity in m/s2, noise density in m/s2/sqrt(Hz).

    time, gravity_time: s of known samples that were averaged for the angles and for the gravity.
    steady: the specific force did not change.
    """

    inclination: float
    roll_total: float
    gravity: float
    noise: float
    time: float
    gravity_time: float
    steady: bool

    @property
    def sd(self) -> float:
        """rad, of both angles, from noise alone."""
        return self.noise / (G * np.sqrt(self.time)) if self.time > 0 else np.nan


@dataclass(frozen=True)
class Event:
    """One window into (DECELERATION) or out of (ACCELERATION) a stop, begun at `sample`.

    lift_off: sample of the path from which on its slope counts. duration: s. flags: bits of
    `signals.FLAGS`, 0 when the event may be used.
    """

    sample: int
    kind: int
    stop: Stop
    statics: Statics
    path: StrapdownPath
    lift_off: int
    duration: float
    flags: int

    @property
    def valid(self) -> bool:
        """Whether it counts in the running mean."""
        return self.flags == 0

    @property
    def grade(self) -> float:
        """rad, slope of the path, eq. (15); NaN when the window has no end."""
        return np.nan if self.flags & VOID else self.path.slope_after(self.lift_off)

    @property
    def pitch(self) -> float:
        """rad, eq. (16); NaN when the window has no end."""
        return self.statics.inclination - self.grade

    @property
    def pitch_sd(self) -> float:
        """rad, of the pitch from accelerometer noise; docs/methods/kim2023.md#pitch-and-its-mean.

        Of the height between the times t0 and t: white noise integrated twice, and what the mean
        at rest errs by, which is integrated twice as well.
        """
        if self.flags & VOID:
            return np.nan
        t = self.duration
        t0 = t * self.lift_off / (len(self.path) - 1)
        white = (t - t0) ** 2 * (t + 2 * t0) / 3
        mean = (t**2 - t0**2) ** 2 / (4 * self.statics.gravity_time)
        length = self.path.s[-1] - self.path.s[self.lift_off]
        return float(self.statics.noise * np.sqrt(white + mean) / length)


class Windows:
    """The windows of one drive: integrates from stops and judges the result.

    force, rate: (n, 3), m/s2 and rad/s. bias: m/s2, taken off the force along x. lever: (3,) m from
    the pitch center to the IMU. full: docs/methods/kim2023.md#alignment instead of the paper's.
    """

    def __init__(
        self,
        drive: Drive,
        static: Bools,
        lever: Floats,
        bias: float,
        full: bool,
        params: StaticSlopeParameters,
        engine: Engine,
    ) -> None:
        self.rate_hz = drive.rate
        self.dt = drive.dt
        self.static = static
        self.force = vectors(drive, "accel") - [bias, 0.0, 0.0]
        self.rate = vectors(drive, "gyro")
        self.known: Bools = np.asarray(
            np.isfinite(np.hstack([self.force, self.rate])).all(axis=1), np.bool_
        )
        self.lever = lever
        self.full = full
        self.params = params
        self.engine: Engine = engine

    def events(self, stop: Stop) -> list[Event]:
        """The windows of one stop in time order: none where the drive's start or a gap is."""
        into = stop.starts and self.params.direction != "forward"
        out = stop.ends and self.params.direction != "reverse"
        kinds = [DECELERATION] * into + [ACCELERATION] * out
        return [self._event(stop, kind) for kind in kinds]

    def _event(self, stop: Stop, kind: int) -> Event:
        params = self.params
        back = kind == DECELERATION
        sample = stop.first if back else stop.still.stop - 1
        averaged = self._averaged(stop, kind)
        statics = self._statics(averaged, self._weighed(stop, kind, averaged))
        end, reason = self._reach(stop, kind, sample)
        # from the window's first sample to the far end of the averaging the gyro must be known
        near = slice(min(sample, averaged.start), max(sample + 1, averaged.stop))
        aligned = not self.full or bool(self.known[near].all())
        if statics.time < params.min_averaging or not aligned or not self.known[sample]:
            path = StrapdownPath(*np.zeros((5, 1)))
            return Event(sample, kind, stop, statics, path, 0, 0.0, FLAGS["missing"])
        step = -self.dt if back else self.dt
        picked = slice(end, sample + 1) if back else slice(sample, end + 1)
        order = slice(None, None, -1 if back else 1)
        rate = self.rate[picked][order] - stop.gyro_bias
        start = statics.inclination
        velocity, lever = np.zeros(3), np.zeros(3)
        if self.full:
            start += self._turned(sample, averaged, stop.gyro_bias)
            lever = self.lever
            if back:
                velocity = self._rocking(sample, stop.gyro_bias, start, statics.roll_total)
        path = dead_reckon(
            self.force[picked][order],
            rate,
            step,
            StrapdownStart(attitude(start, statics.roll_total), statics.gravity, velocity, lever),
            params.distance,
            params.integration == "trapezoid",
            self.engine,
        )
        flags = reason if path.s[-1] < params.distance else self._judged(path)
        if abs(statics.gravity - G) > params.gravity_tolerance:
            flags |= FLAGS["saturated"]
        if not statics.steady:
            flags |= FLAGS["model"]
        lifted = min(params.lift_off, LIFTED_SHARE * params.distance)
        lift_off = int(np.argmax(path.s >= lifted)) if self.full else 0
        duration = (len(path) - 1) * self.dt
        return Event(sample, kind, stop, statics, path, lift_off, duration, flags)

    def _judged(self, path: StrapdownPath) -> int:
        """Flags of a complete window: a bent road (chord test), a car that rolled back."""
        flags = 0
        if path.chord_deviation > self.params.chord_max:
            flags |= FLAGS["rejected"]
        if path.way_back > self.params.way_back_max:
            flags |= FLAGS["model"]
        return flags

    def _reach(self, stop: Stop, kind: int, sample: int) -> tuple[int, int]:
        """The last sample that a window may use, and the flag if that is too near."""
        limit = round(self.params.max_time * self.rate_hz)
        step = -1 if kind == DECELERATION else 1
        ahead = np.arange(sample + step, sample + step * (limit + 1), step)
        ahead = ahead[(ahead >= 0) & (ahead < len(self.known))]
        reason = FLAGS["excitation"] if len(ahead) == limit else FLAGS["missing"]
        standing = self.static[ahead] & ((ahead < stop.first) | (ahead > stop.last))
        for bad, name in ((~self.known[ahead], "missing"), (standing, "standstill")):
            hits = np.flatnonzero(bad)
            if len(hits):
                ahead, reason = ahead[: hits[0]], FLAGS[name]
        return (int(ahead[-1]) if len(ahead) else sample), reason

    def _averaged(self, stop: Stop, kind: int) -> slice:
        """Samples of the standing car whose mean gives its attitude."""
        count = round(self.params.averaging * self.rate_hz)
        after = stop.still.stop
        if kind == ACCELERATION:
            return slice(max(stop.first, after - count), after)
        first = stop.first
        if self.full:
            latest = after - round(self.params.min_averaging * self.rate_hz)
            first = min(first + round(self.params.settle * self.rate_hz), max(first, latest))
        return slice(first, min(first + count, after))

    def _weighed(self, stop: Stop, kind: int, averaged: slice) -> slice:
        """Samples of the body at rest whose mean gives the gravity: those averaged, and beyond."""
        if not self.full:
            return averaged
        count = max(
            round(self.params.gravity_averaging * self.rate_hz), averaged.stop - averaged.start
        )
        if kind == ACCELERATION:
            return slice(
                min(averaged.start, max(stop.still.start, averaged.stop - count)), averaged.stop
            )
        return slice(averaged.start, min(averaged.start + count, stop.still.stop))

    def _statics(self, averaged: slice, weighed: slice) -> Statics:
        force = self.force[averaged][self.known[averaged]]
        n = len(force)
        if n < 2:
            return Statics(np.nan, np.nan, np.nan, np.nan, n * self.dt, n * self.dt, False)
        x, y, z = force.mean(axis=0)
        still = self.force[weighed][self.known[weighed]]
        halves = force[: n // 2], force[n // 2 :]
        change = halves[1].mean(axis=0) - halves[0].mean(axis=0)
        spread = np.sqrt(np.mean([half[:, 0].var() for half in halves]))
        noise = float(spread / np.sqrt(self.rate_hz))
        time = n * self.dt
        # the difference of two means over half the time each has 2 / sqrt(time) of the density
        allowed = self.params.unsteady_max + NOISE_MARGIN * 2 * noise / np.sqrt(time)
        return Statics(
            inclination=float(np.arctan2(x, np.hypot(y, z))),
            roll_total=float(np.arctan2(y, z)),
            gravity=float(np.linalg.norm(still.mean(axis=0))),
            noise=noise,
            time=time,
            gravity_time=len(still) * self.dt,
            steady=bool(np.hypot(change[0], change[1]) <= allowed),
        )

    def _turned(self, sample: int, averaged: slice, bias: Floats) -> float:
        """rad, inclination at `sample` minus its mean over the averaging, from the gyro."""
        first, after = min(sample, averaged.start), max(sample + 1, averaged.stop)
        nose_up = -(self.rate[first:after, 1] - bias[1])
        steps = 0.5 * (nose_up[1:] + nose_up[:-1]) * self.dt
        angle = np.concatenate([[0.0], np.cumsum(steps)])
        mean = angle[averaged.start - first : averaged.stop - first].mean()
        return float(angle[sample - first] - mean)

    def _rocking(self, sample: int, bias: Floats, inclination: float, roll_total: float) -> Floats:
        """m/s (3,), of the IMU while the body still rocks: R (w x lever), w a short mean.

        A single sample of a noisy gyro would add up to 0.27 deg on a lever of 1.9 m.
        """
        half = round(START_RATE * self.rate_hz)
        around = slice(max(sample - half, 0), sample + half + 1)
        rates = self.rate[around][self.known[around]]
        speed = np.cross(rates.mean(axis=0) - bias, self.lever)
        return np.array(to_navigation(attitude(inclination, roll_total), *speed))


def running_mean(events: list[Event], params: StaticSlopeParameters) -> tuple[Floats, Floats]:
    """Mean pitch after each event and its standard deviation, rad; eq. (17) over valid events.

    The deviation is the larger of the scatter of the events and what noise predicts.
    """
    mean, sd = np.full(len(events), np.nan), np.full(len(events), np.nan)
    pitch = np.array([event.pitch for event in events])
    variance = np.array([event.pitch_sd for event in events]) ** 2
    usable = np.array([event.valid for event in events], np.bool_)
    weights = 1 / variance if params.weights == "variance" else np.ones(len(events))
    start = 0
    for k, event in enumerate(events):
        if params.reset_on_load and k > 0 and _loaded(events[k - 1], event, params):
            start = k
        used = np.flatnonzero(usable[start : k + 1]) + start
        if not len(used):
            continue
        weight = weights[used] / weights[used].sum()
        mean[k] = weight @ pitch[used]
        noise = weight**2 @ variance[used]
        scatter = weight**2 @ (pitch[used] - mean[k]) ** 2 * len(used) / max(len(used) - 1, 1)
        sd[k] = np.sqrt(max(noise, scatter))
    return mean, sd


def _loaded(before: Event, after: Event, params: StaticSlopeParameters) -> bool:
    """Whether the body took another inclination while the car stood: somebody got in."""
    change = abs(after.statics.inclination - before.statics.inclination)
    return before.stop is after.stop and change > params.load_step
