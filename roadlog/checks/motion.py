"""Checks of what physics ties together: units, axes, signs and clocks of speeds and inertial data.

What one check finds is put right before the next one looks, so that a fault is named once and by
its cause.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from roadlog.checks.finding import Finding
from roadlog.motion.evidence import (
    MAX_LAG,
    NEAR_LAG,
    TRACK_WIDTH,
    Evidence,
    Lag,
    correlation,
)
from roadlog.motion.lag import SpeedTrack, shift
from roadlog.signals import AXES, WHEELS
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

GRAVITY_TOLERANCE = 0.5  # m/s2, mean size of the specific force against g
WEIGHTLESS = 2.0  # m/s2; a smaller mean has no gravity in it at all
MAX_LATERAL = 12.0  # m/s2, that tires give
TURNING = 0.01  # rad/s, sd of the course rate in the band from which it tells of a gyro
MAX_ANGLE = 1.0  # rad; no road and no road wheel reaches it
GOOD_FIT, BETTER_FIT = 0.9, 0.2  # mean cosine between two courses, and what tells two forms apart
LATENCY = 0.15  # s, of speed against acceleration
CLOCKS = 1.0  # s; no sensor is that late, its clock is another
STEP = 0.5  # s, by which the lag of a part must differ from the rest to be a step of a clock
PART, MIN_PARTS = 30.0, 4  # s of a block whose lag is looked at, and how many a drift takes
GROWS, STEADY = 0.25, 5.0  # s, and sd of it, from which a lag that grows is a drift
CLEAR = 0.85  # correlation of speed and acceleration from which a lag counts
LIVELY = 0.1  # m/s2, sd of the acceleration in the band from which a lag counts
DEGREES = 180 / np.pi
COUNTS = (131.0, 65.5, 32.8, 16.4)  # a deg/s, of gyros of 250, 500, 1000 and 2000 deg/s


@dataclass
class Examination:
    """The evidence as it is put right step by step, and what was found on the way."""

    evidence: Evidence
    degrees: frozenset[str] = frozenset()  # angles that the log has in degrees
    found: list[Finding] = field(default_factory=list)

    def add(
        self,
        check: str,
        signals: tuple[str, ...] | str,
        text: str,
        advice: str,
        value: float | None = None,
        at: float | None = None,
    ) -> None:
        """Note a fault."""
        names = (signals,) if isinstance(signals, str) else signals
        self.found.append(Finding(check, "fault", names, text, advice, at, value))

    def scale(self, roles: tuple[str, ...], factor: float) -> None:
        """Put signals right for the checks that follow."""
        signals = dict(self.evidence.signals)
        signals |= {role: signals[role] * factor for role in roles if role in signals}
        self.evidence = Evidence(self.evidence.rate, signals)

    def drop(self, roles: tuple[str, ...]) -> None:
        """Leave signals that tell nothing out of the checks that follow."""
        signals = {k: v for k, v in self.evidence.signals.items() if k not in roles}
        self.evidence = Evidence(self.evidence.rate, signals)


def gravity(exam: Examination) -> None:
    """Size of the mean specific force: m/s2, or g."""
    accel = exam.evidence.triad("accel")
    if accel is None or np.isnan(accel).all(axis=1).any():
        return
    size = float(np.linalg.norm(np.nanmedian(accel, axis=1)))
    roles = tuple(f"imu.accel_{axis}" for axis in AXES)
    if abs(size - 1.0) < 0.1:
        exam.add("unit", roles, "gravity reads 1: the unit is g", 'say unit = "g"', G)
        exam.scale(roles, G)
    elif abs(size - G) > GRAVITY_TOLERANCE:
        exam.add(
            "gravity",
            roles,
            f"mean specific force is {size:.2f} m/s2 instead of 9.81",
            "check unit and scale; a device that removes gravity (linear or user acceleration) is "
            "no use here, map its raw accelerations",
            size,
        )
        if size > WEIGHTLESS:
            exam.scale(roles, G / size)
        else:
            exam.drop(roles)


def latency(exam: Examination) -> None:
    """Lag of every speed behind the accelerations, steps of a clock, and both put right."""
    evidence = exam.evidence
    for name, speed in evidence.speeds().items():
        roles = roles_of(name, evidence)
        clear = _clear_lags(evidence, speed)
        step = _step(clear)
        if step is not None:
            at, before, after = step
            exam.add(
                "clock_step",
                (*roles, "imu.accel"),
                f"the lag between their clocks changes from {before:+.2f} s to {after:+.2f} s",
                "one of the two recorders' clocks was set while driving: ingest the parts before "
                "and after it as logs of their own",
                after - before,
                at,
            )
            exam.drop(roles)
            continue
        drift = _drift(clear)
        if drift is not None:
            exam.add(
                "clock_drift",
                (*roles, "imu.accel"),
                f"the lag between their clocks changes by {drift:+.2f} s in the drive",
                "a clock runs at another rate, or a queue before the recorder fills: take the "
                "sensors' own stamps instead of those of arrival",
                drift,
            )
            exam.drop(roles)
            continue
        lag = clear_lag(evidence, speed)
        if lag is None:
            continue
        if abs(lag.lag) > CLOCKS:
            exam.add(
                "clocks_differ",
                (*roles, "imu.accel"),
                f"lie {lag.lag:+.2f} s apart (correlation {abs(lag.r):.2f})",
                "two devices with clocks of their own: merge them with `roadlog ingest A B`, which "
                f"finds the offset, or add {lag.lag:.2f} s to the speed's delay in the profile",
                lag.lag,
            )
        elif abs(lag.lag) > LATENCY and not abs(lag.lag) <= 2 * lag.sd:
            way = "behind" if lag.lag > 0 else "ahead of"
            exam.add(
                "latency",
                roles,
                f"is {abs(lag.lag):.2f} s {way} the accelerations (correlation {abs(lag.r):.2f})",
                f"add {lag.lag:.2f} s to its delay in the profile",
                lag.lag,
            )
        late = (
            [r for r in evidence.signals if r.startswith("gnss.")]
            if name == "gnss.speed"
            else roles
        )
        _shift(exam, tuple(late), lag.lag)


def gyro_unit(exam: Examination) -> None:
    """Degrees for radians, by the turn of the track, the wheels and the lateral acceleration."""
    evidence = exam.evidence
    roles = tuple(role for axis in AXES if (role := f"imu.gyro_{axis}") in evidence)
    if "imu.gyro_z" not in roles:  # the one about which a car turns, however it lies
        return
    gyro, accel = np.array([evidence[role] for role in roles]), evidence.triad("accel")
    ratios = []
    if evidence.course_rate is not None:
        target = evidence.band(evidence.course_rate)
        if np.isfinite(target).any() and np.nanstd(target) > TURNING:
            parts = [evidence.band(evidence.smooth(g, TRACK_WIDTH)) for g in gyro]
            power = sum(_power(part, target, evidence.rate) for part in parts)
            ratios.append(np.sqrt(power) / float(np.nanstd(target)))
    speed = next(iter(evidence.speeds().values()), None)
    if speed is not None:
        if accel is not None:
            ratios += [1 / r for r in _lateral_ratios(evidence, gyro, accel, speed)]
        lateral = np.linalg.norm(gyro, axis=0) * np.abs(speed)
        if not ratios and np.isfinite(lateral).any():
            ratios = [DEGREES if np.nanpercentile(lateral, 95) > MAX_LATERAL else 1.0]
    ratios = [ratio for ratio in ratios if np.isfinite(ratio) and ratio > 0]
    if not ratios or min(ratios) < np.sqrt(DEGREES):
        return
    text, factor = f"turns {min(ratios):.0f} times faster than the car can", DEGREES
    advice = 'its unit is deg/s, say unit = "deg/s" in the profile'
    if (counts := min(ratios) / DEGREES) > np.sqrt(COUNTS[-1]):
        usual = min(COUNTS, key=lambda count: abs(np.log(count / counts)))
        factor *= usual
        advice = (
            f'counts of a sensor, about {counts:.0f} a deg/s? Then say unit = "deg/s", '
            f"scale = {1 / usual:.6g} in the profile (1/{usual:g}, of the MPU-6050 and its kin; "
            "the data sheet tells)"
        )
    exam.add("unit", roles, text, advice, factor)
    exam.scale(roles, 1 / factor)


def angles(exam: Examination) -> None:
    """Angles in degrees; a course that counts from north."""
    evidence = exam.evidence
    role = "steering.road_wheel_angle"
    if role in evidence and np.nanpercentile(np.abs(evidence[role]), 99) > MAX_ANGLE:
        largest = float(np.nanmax(np.abs(evidence[role])))
        exam.add(
            "unit",
            role,
            f"reaches {np.degrees(largest):.0f} deg, which no road wheel does",
            'if the source has degrees, say unit = "deg"; if it is the steering wheel\'s angle, '
            "divide by the steering ratio with scale",
            largest,
        )
        exam.drop((role,))
    for role in ("gnss.course", "gnss.heading"):
        if role in evidence:
            _course(exam, role)


def _course(exam: Examination, role: str) -> None:
    """Whether an angle counts counterclockwise from east in radians, by the positions."""
    track = exam.evidence.track
    degrees = role in exam.degrees
    clockwise = False
    if track is not None:
        given = exam.evidence[role]
        moving = np.isfinite(track[1]) & np.isfinite(given)
        if moving.sum() >= 10 * exam.evidence.rate:

            def fit(angle: Floats) -> float:
                return float(np.mean(np.cos(angle - track[1])[moving]))

            if not degrees:  # taken for radians, and their quarter turn with them
                read = np.radians(given)
                turned = np.pi / 2 + np.radians(given - np.pi / 2)
                own = max(fit(given), fit(np.pi / 2 - given))
                best = max(fit(read), fit(np.pi / 2 - read), fit(turned))
                degrees = best > max(GOOD_FIT, own + BETTER_FIT)
                given = read if degrees else given
            other = fit(np.pi / 2 - given)
            clockwise = other > max(GOOD_FIT, fit(given) + BETTER_FIT)
    if degrees or clockwise:
        faults = {"is in degrees": degrees, "counts clockwise from north": clockwise}
        reads = [text for text, there in faults.items() if there]
        advice = 'say unit = "deg"' if degrees else 'say unit = "rad"'
        if clockwise:
            advice += f", scale = -1.0, offset = {90.0 if degrees else np.pi / 2:.7g}"
        exam.add("course", role, " and ".join(reads), advice)


def _clear_lags(evidence: Evidence, speed: Floats) -> list[tuple[float, float]]:
    """Middle and lag, in s, of each block that says it beyond doubt, on the axis that has most."""
    late = evidence.band(evidence.slope(speed))
    clear: list[tuple[float, float]] = []
    for axis in AXES:
        if f"imu.accel_{axis}" in evidence:
            other = evidence.band(evidence[f"imu.accel_{axis}"])
            if np.isfinite(other).any() and np.nanstd(other) > LIVELY:
                blocks = evidence.block_lags(other, late, PART)
                own = [(middle, lag) for middle, lag, r in blocks if abs(r) > CLEAR]
                clear = max(clear, own, key=len)
    return clear


def _step(clear: list[tuple[float, float]]) -> tuple[float, float, float] | None:
    """Time and lags before and after a step of a clock: two blocks on each side must agree."""
    for k in range(1, len(clear)):
        before = [own for _, own in clear[:k]][-2:]
        after = [own for _, own in clear[k:]][:2]
        if len(before) < 2 or len(after) < 2:
            continue
        if np.ptp(before) < STEP / 2 and np.ptp(after) < STEP / 2:
            change = float(np.mean(after) - np.mean(before))
            if abs(change) > STEP:
                at = (clear[k - 1][0] + clear[k][0]) / 2
                return at, float(np.mean(before)), float(np.mean(after))
    return None


def _drift(clear: list[tuple[float, float]]) -> float | None:
    """s, by which the lag grows from the first block to the last, where it does so steadily."""
    if len(clear) < MIN_PARTS:
        return None
    time, lag = np.array(clear).T
    time = (time - time.mean()) / np.ptp(time)
    change = float(time @ lag / (time @ time))
    left = lag - lag.mean() - change * time
    sd = np.sqrt((left @ left) / (len(lag) - 2) / (time @ time))
    return change if abs(change) > max(GROWS, STEADY * float(sd)) else None


def clear_lag(evidence: Evidence, speed: Floats) -> Lag | None:
    """Lag of a speed behind the acceleration that follows it, when it is beyond doubt."""
    pair = _longitudinal(evidence, speed)
    return pair[2] if pair else None


def _longitudinal(evidence: Evidence, speed: Floats) -> tuple[Floats, Floats, Lag] | None:
    """The acceleration that follows a speed, the speed's slope, both in the band, and the lag."""
    late = evidence.band(evidence.slope(speed))
    for reach in (NEAR_LAG, MAX_LAG):
        found = []
        for axis in AXES:
            if f"imu.accel_{axis}" not in evidence:
                continue
            other = evidence.band(evidence[f"imu.accel_{axis}"])
            lag = evidence.lag(other, late, reach)
            if lag is not None and abs(lag.r) > CLEAR and np.nanstd(other) > LIVELY:
                # the axis that carries it, not one that follows it by a little pitch
                found.append((float(np.nanstd(other)), axis, other, lag))
        if found:
            _, axis, other, lag = max(found, key=lambda item: item[0])
            return other, late, _exactly(evidence, evidence[f"imu.accel_{axis}"], speed, lag)
    return None


def _exactly(evidence: Evidence, accel: Floats, speed: Floats, lag: Lag) -> Lag:
    """The lag without the bias that a slow speed gives the correlation, and its sd."""
    time = np.arange(len(speed)) / evidence.rate
    ahead = SpeedTrack.of_acceleration(time, np.sign(lag.r) * accel)
    fine = shift(ahead, SpeedTrack.of_speed(time, speed), -lag.lag)
    return lag if fine is None else replace(lag, lag=-fine.seconds, sd=fine.sd)


def _lateral_ratios(
    evidence: Evidence, gyro: Floats, accel: Floats, speed: Floats
) -> Iterator[float]:
    for g in gyro:
        turn = evidence.band(speed * g)
        for a in accel:
            r, ratio = correlation(turn, evidence.band(a), evidence.rate)
            if abs(r) > CLEAR:
                yield ratio


def _power(x: Floats, target: Floats, rate: float) -> float:
    """Variance of x that goes with the target."""
    r, _ = correlation(target, x, rate)
    return float(r * r * np.nanvar(x)) if np.isfinite(x).any() else 0.0


def roles_of(name: str, evidence: Evidence) -> tuple[str, ...]:
    if name != "wheel_speeds":
        return (name,)
    return tuple(f"wheel_speeds.{w}" for w in WHEELS if f"wheel_speeds.{w}" in evidence)


def _shift(exam: Examination, roles: tuple[str, ...], lag: float) -> None:
    """Move signals to where they belong in time."""
    steps = round(lag * exam.evidence.rate)
    if not steps:
        return
    signals = dict(exam.evidence.signals)
    for role in roles:
        moved = np.roll(signals[role], -steps)
        if steps > 0:
            moved[-steps:] = np.nan
        else:
            moved[:-steps] = np.nan
        signals[role] = moved
    exam.evidence = Evidence(exam.evidence.rate, signals)
