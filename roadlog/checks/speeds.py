"""Checks of what says how fast the car is: units, wheels and sources that disagree, dead pulses."""

from __future__ import annotations

import numpy as np

from roadlog.checks.motion import Examination, clear_lag, roles_of
from roadlog.drive import nan_median
from roadlog.motion.evidence import COURSE_SPEED, TRACK_WIDTH, Evidence
from roadlog.signals import AXES, WHEELS
from roadlog.types import Floats
from roadlog.units import UNITS

UNIT_TOLERANCE = 0.25  # of the logarithm's scale: how near a ratio must be to a unit's factor
SPEED_TOLERANCE = 0.05  # two sources of speed, tires and calibration included
WHEEL_TOLERANCE = 0.03  # a wheel against the others: wear is 1 %, an emergency wheel 3 % and more
STANDING = 0.3  # m/s
DRIVEN_ACCEL, DRIVEN_RATE = 0.25, 0.02  # m/s2, rad/s, sd in the band of a drive; no parked car's
MAX_SPEED = 70.0  # m/s, of an ordinary drive
STRAIGHT = 0.05  # rad/s, yaw rate below which wheels and smoothed tracks are as long as the path
SPEED_UNITS = ("km/h", "mph", "kn")


def dead(exam: Examination) -> None:
    """A speed that says the car stands, while fixes, another speed or the IMU say it drives."""
    evidence = exam.evidence
    sources = evidence.speeds()
    still = {name for name, v in sources.items() if not _moves(np.abs(v), STANDING)}
    for name in still & {"wheel_speeds", "speed.v"}:
        moving = [other for other in sources if other not in still]
        if evidence.track is not None and _moves(evidence.track[0], COURSE_SPEED):
            moving.append("the positions")
        if not moving and _is_driven(exam):
            moving.append("the inertial sensor")
        if moving:
            roles = roles_of(name, evidence)
            exam.add(
                "dead",
                roles,
                f"is 0 throughout while {moving[0]} says that the car moves",
                "no pulses come, or the car was carried: leave it out of the profile",
            )
            exam.drop(roles)


def _is_driven(exam: Examination) -> bool:
    """Whether the IMU accelerates and turns as one that lies in a driven car."""
    for kind, least in (("accel", DRIVEN_ACCEL), ("gyro", DRIVEN_RATE)):
        triad = exam.evidence.triad(kind)
        if triad is None:
            return False
        parts = [exam.evidence.band(row) for row in triad]
        spread = [float(np.nanstd(part)) for part in parts if np.isfinite(part).any()]
        if not spread or max(spread) < least:
            return False
    return True


def speeds(exam: Examination) -> None:
    """Units of the speeds, wheels that disagree, speeds that disagree."""
    evidence = exam.evidence
    _wheels(exam)
    sources = exam.evidence.speeds()
    reference = _track_speed(evidence)
    for name, speed in sources.items():
        ratios = {}
        if reference is not None:
            ratios[reference[0]] = _ratio(evidence.smooth(speed, TRACK_WIDTH), reference[1])
        elif (lag := clear_lag(evidence, speed)) is not None:
            ratios["the accelerations"] = 1 / lag.ratio
        others = {n: _ratio(speed, s) for n, s in sources.items() if n != name}
        ratios |= {n: r for n, r in others.items() if r is not None and r > 1.5}
        unit = next((u for r in ratios.values() if (u := _speed_unit(r))), None)
        top = np.nanmax(np.abs(speed)) if np.isfinite(speed).any() else 0.0
        against = next(iter(ratios), None)
        if unit is None and top > MAX_SPEED:
            unit, against = "km/h", f"a car's top speed ({top:.0f} m/s)"
        roles = roles_of(name, evidence)
        if unit is not None:
            factor = UNITS[unit][1]
            exam.add(
                "unit",
                roles,
                f"is {1 / factor:.2f} times too large against {against}",
                f'its unit is {unit}, say unit = "{unit}" in the profile',
                1 / factor,
            )
            exam.scale(roles, factor)
    _agree(exam, reference)


def _wheels(exam: Examination) -> None:
    evidence = exam.evidence
    roles = [f"wheel_speeds.{w}" for w in WHEELS if f"wheel_speeds.{w}" in evidence]
    if len(roles) < 3:
        return
    rows = np.stack([evidence[role] for role in roles])
    middle = nan_median(rows)
    driving = np.isfinite(rows).all(axis=0) & (middle > COURSE_SPEED)
    turn = evidence.course_rate if evidence.course_rate is not None else _turn(evidence)
    if turn is not None:
        driving &= np.abs(evidence.smooth(turn, TRACK_WIDTH)) < STRAIGHT
    if driving.sum() < 10 * evidence.rate:
        return
    for role, row in zip(roles, rows, strict=True):
        ratio = float(np.median(row[driving] / middle[driving]))
        if abs(ratio - 1) > WHEEL_TOLERANCE:
            exam.add(
                "wheel_speeds",
                role,
                f"is {ratio:.3f} times the median of the wheels",
                f"another tire or a wrong scale: scale = {1 / ratio:.4f}, or leave it out",
                ratio,
            )
            exam.scale((role,), 1 / ratio if ratio else np.nan)


def _turn(evidence: Evidence) -> Floats | None:
    """Size of the yaw rate or more: of all that the gyro shows."""
    rates = [evidence[f"imu.gyro_{a}"] for a in AXES if f"imu.gyro_{a}" in evidence]
    return np.sqrt(np.sum(np.square(rates), axis=0)) if rates else None


def _agree(exam: Examination, reference: tuple[str, Floats] | None) -> None:
    sources = exam.evidence.speeds()
    if reference is None and sources:
        name = "gnss.speed" if "gnss.speed" in sources else next(iter(sources))
        reference = (name, sources[name])
    for name, speed in sources.items():
        if reference is None or name == reference[0]:
            continue
        if reference[0] not in sources:
            speed = exam.evidence.smooth(speed, TRACK_WIDTH)
        ratio = _ratio(speed, reference[1])
        if ratio and abs(ratio - 1) > SPEED_TOLERANCE:
            roles = roles_of(name, exam.evidence)
            exam.add(
                "speeds_disagree",
                roles,
                f"is {ratio:.3f} times the speed by {reference[0]}",
                f"a wrong tire radius or pulse count: scale = {1 / ratio:.4f}",
                ratio,
            )
            exam.scale(roles, 1 / ratio)


def _track_speed(evidence: Evidence) -> tuple[str, Floats] | None:
    """Speed by the positions where the track is straight: smoothing cuts corners."""
    if evidence.track is None or evidence.course_rate is None:
        return None
    straight = np.abs(evidence.smooth(evidence.course_rate, TRACK_WIDTH)) < STRAIGHT
    speed = np.where(straight, evidence.track[0], np.nan)
    return ("the positions", speed) if _moves(speed) else None


def _ratio(speed: Floats, other: Floats) -> float | None:
    both = np.isfinite(speed) & np.isfinite(other) & (np.abs(other) > COURSE_SPEED)
    if both.sum() < 50:
        return None
    return float(np.median(np.abs(speed[both]) / np.abs(other[both])))


def _speed_unit(ratio: float | None) -> str | None:
    """The unit whose number is this many times the one in m/s."""
    if ratio is None or not np.isfinite(ratio) or ratio <= 1.5:
        return None
    unit = min(SPEED_UNITS, key=lambda u: abs(np.log(ratio * UNITS[u][1])))
    return unit if abs(np.log(ratio * UNITS[unit][1])) < UNIT_TOLERANCE / 4 else None


def _moves(speed: Floats, least: float = COURSE_SPEED) -> bool:
    return bool((speed > least).sum() >= 50)
