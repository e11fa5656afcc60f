"""Signals that are outside what can be for most of the time: a unit, a form, a lost sign.

What is found here is left out of the checks after it: nothing can be inferred of a position of 3000
degrees. A factor is advised only where the signal fits with it, in size and against another signal.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from roadlog.checks.finding import Finding
from roadlog.geo import EARTH_RADIUS, of_degrees_minutes
from roadlog.signals import AXES, SECTIONS, SIGNALS, WHEELS
from roadlog.spool import release
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.units import DEGREES_MINUTES, STANDARD_GRAVITY

ROWS = 200_000  # that are looked at, evenly taken
MOSTLY = 0.5  # share of samples
FITS = 0.2  # of the logarithm: how near a speed by the positions must be to another speed
NEAR_GRAVITY = 0.1  # share
DRIVEN = 100.0  # m, over which speeds and positions are compared
FULL_DEGREE = 57.29577951308232  # deg in a radian

# what cannot be, whatever the unit of the profile
LIMITS: dict[str, tuple[float, float]] = {
    "gnss.latitude": (-90.0, 90.0),
    "gnss.longitude": (-180.0, 360.0),
    "gnss.altitude": (-450.0, 9000.0),
    "barometer.altitude": (-2000.0, 15000.0),
    **dict.fromkeys(("gnss.speed", "speed.v"), (-10.0, 700.0)),  # no car reverses for long
    **dict.fromkeys((f"wheel_speeds.{wheel}" for wheel in WHEELS), (-10.0, 700.0)),
    "gnss.climb": (-150.0, 150.0),
    **dict.fromkeys((f"imu.accel_{axis}" for axis in AXES), (-80.0, 80.0)),
    **dict.fromkeys((f"imu.gyro_{axis}" for axis in AXES), (-2000.0, 2000.0)),
    "powertrain.engine_torque": (-6000.0, 6000.0),
    "powertrain.drive_force": (-300000.0, 300000.0),
    "powertrain.gear_ratio": (-500.0, 500.0),
    **dict.fromkeys(
        (f"wheel_torques.{kind}_{wheel}" for kind in ("drive", "brake") for wheel in WHEELS),
        (-100000.0, 100000.0),
    ),
    **dict.fromkeys(("gnss.course", "gnss.heading"), (-700.0, 700.0)),  # a hundred turns
    "gnss.roll": (-3.2, 3.2),
    "fuel.sender": (-10.0, 10.0),
    "truth.grade": (-1.0, 1.0),
    "truth.bank": (-1.0, 1.0),
    **dict.fromkeys(("truth.inclination", "truth.pitch"), (-1.6, 1.6)),
    **dict.fromkeys(("truth.roll_total", "truth.roll"), (-3.2, 3.2)),
    **{  # a code for none, as -1 of phones, is not as sure as can be
        role: (0.0, np.inf) for role in SIGNALS if role.endswith(("_accuracy", "_sd"))
    },
}
# signals of one device, which share a unit
GROUPS = (
    ("gnss.latitude", "gnss.longitude"),
    tuple(f"imu.accel_{axis}" for axis in AXES),
    tuple(f"imu.gyro_{axis}" for axis in AXES),
    tuple(f"wheel_speeds.{wheel}" for wheel in WHEELS),
)
# what a source may have meant: kind -> (factor to what is expected, name)
MEANT: dict[str, tuple[tuple[float, str], ...]] = {
    "position": ((1 / 60, "minutes of arc"), (1e-7, "1e-7 degrees"), (1e-6, "1e-6 degrees")),
    "altitude": ((-1.0, "a height counted downward"), (1e-3, "mm"), (1e-2, "cm")),
    "speed": ((-1.0, "counted backward"), (1e-3, "mm/s"), (1e-2, "cm/s")),
    "accel": (
        (STANDARD_GRAVITY * 1e-3, "mg"),
        (1e-3, "mm/s^2"),
        (1e-2, "cm/s^2"),
        *((STANDARD_GRAVITY / 2**k, f"counts of a sensor, {2**k} a g") for k in range(8, 17)),
    ),
    "gyro": ((1e-3, "thousandths of a degree or radian a second"),),
    "truth": ((1 / FULL_DEGREE, "degrees"),),
    **dict.fromkeys(
        ("course", "heading"), ((0.01 / FULL_DEGREE, "cdeg"), (1 / FULL_DEGREE, "degrees"))
    ),
    "roll": ((1 / FULL_DEGREE, "degrees"), (0.01 / FULL_DEGREE, "cdeg")),
}
# what sources write throughout where they have no value: ends of integers, and nines
CODES = frozenset(
    [
        sign * float(2**bits - less)
        for bits in (15, 16, 31, 32)
        for less in (0, 1)
        for sign in (1, -1)
    ]
    + [sign * (10.0**digits - 1) for digits in range(4, 10) for sign in (1, -1)]
)
_EXACT = {
    "mg": 'unit = "mg"',
    "degrees": 'unit = "deg"',
    "mm": 'unit = "mm"',
    "cm": 'unit = "cm"',
    "cdeg": 'unit = "cdeg"',
}

RoleSignals = dict[str, tuple[Floats, Floats]]  # role -> s, values


def beyond(tables: Mapping[str, Table]) -> tuple[list[Finding], dict[str, Table]]:
    """Findings, and the tables without the signals that they are of."""
    signals = _signals(tables)
    found: list[Finding] = []
    dropped: set[str] = set()
    for roles in _groups(signals):
        outside = [role for role in roles if _mostly_outside(role, signals[role][1])]
        if outside:
            found.append(_finding(roles, outside, signals))
            dropped.update(roles)
    positions = GROUPS[0]
    if dropped.isdisjoint(positions) and all(role in signals for role in positions):
        ratio = _against_speed(signals, FULL_DEGREE)
        if ratio is not None and abs(np.log(ratio)) < FITS:
            text = "moves 57 times slower than the car: in radians"
            advice = 'say unit = "rad" in the profile'
            found.append(Finding("unit", "fault", positions, text, advice, value=FULL_DEGREE))
            dropped.update(positions)
    return found, {topic: _without(table, dropped) for topic, table in tables.items()}


def _signals(tables: Mapping[str, Table]) -> RoleSignals:
    """Known values of each signal, of long tables some evenly taken."""
    found: RoleSignals = {}
    for section in SECTIONS.values():
        table = tables.get(section.topic)
        if table is None or not len(table):
            continue
        step = max(1, len(table) // ROWS)
        for signal in section.signals:
            column = table.columns.get(signal.field)
            if signal.role not in LIMITS or column is None or column.strides == (0,):
                continue
            values = np.asarray(column[::step], np.float64)
            known = np.isfinite(values)
            if known.any():
                time = np.asarray(table.time[::step][known] * 1e-9)
                found[signal.role] = time, values[known]
            release([column, table.time])
    return found


def _groups(signals: RoleSignals) -> Iterator[tuple[str, ...]]:
    grouped = {role for roles in GROUPS for role in roles}
    for roles in (*GROUPS, *((role,) for role in LIMITS if role not in grouped)):
        if there := tuple(role for role in roles if role in signals):
            yield there


def _outside(role: str, values: Floats) -> np.ndarray:
    low, high = LIMITS[role]
    return (values < low) | (values > high)


def _mostly_outside(role: str, values: Floats) -> bool:
    return bool(_outside(role, values).mean() > MOSTLY)


def _finding(roles: tuple[str, ...], outside: Sequence[str], signals: RoleSignals) -> Finding:
    values = signals[outside[0]][1]
    low, high = float(values.min()), float(values.max())
    limits = LIMITS[outside[0]]
    text = (
        f"{outside[0]} is {low:.6g} to {high:.6g}, and nothing is beyond {limits[0]:g} to "
        f"{limits[1]:g}"
    )
    cause, factor = _cause(roles, signals)
    return Finding("impossible", "fault", roles, text, cause, value=factor)


def _cause(roles: tuple[str, ...], signals: RoleSignals) -> tuple[str, float | None]:
    """What the source may have meant, tried on the data, and the factor."""
    if size := _wrapped(roles, signals):
        return f"negative numbers written without their sign (2^{size}): read it as signed", None
    fitting = [
        (factor, name)
        for factor, name in MEANT.get(_kind(roles[0]), ())
        if _fits(roles, signals, factor)
    ]
    if not fitting and (written := _degrees_minutes(roles, signals)):
        return written, None
    if all(np.ptp(signals[role][1]) == 0 and signals[role][1][0] in CODES for role in roles):
        return "one value throughout, a code for none? Then leave it out of the profile", None
    if not fitting:
        return "nothing that is tried makes it fit: another signal, or another unit?", None
    factor, name = min(fitting, key=lambda pair: _off_gravity(roles, signals, pair[0]))
    advice = _EXACT.get(name, f"scale = {factor:.7g}")
    more = _minutes(roles, signals) if _kind(roles[0]) == "position" and factor == 1 / 60 else ""
    return f"{name}? Then say {advice} in the profile{more}", factor


def _kind(role: str) -> str:
    if role in GROUPS[0]:
        return "position"
    section, field = role.split(".")
    if section == "truth":
        return "truth"
    word = field.partition("_")[0]
    return {"v": "speed", "climb": "speed"}.get(
        word, "speed" if section == "wheel_speeds" else word
    )


def _fits(roles: tuple[str, ...], signals: RoleSignals, factor: float) -> bool:
    """Whether all is within limits with a factor, and agrees with what else there is."""
    if any((_outside(role, signals[role][1] * factor)).mean() > 0.01 for role in roles):
        return False
    kind = _kind(roles[0])
    if kind == "position":
        ratio = _against_speed(signals, factor)
        return ratio is None or any(abs(np.log(ratio * unit)) < FITS for unit in (1.0, 3.6, 2.237))
    return _off_gravity(roles, signals, factor) < NEAR_GRAVITY


def _off_gravity(roles: tuple[str, ...], signals: RoleSignals, factor: float) -> float:
    """Share by which three accelerations times a factor miss gravity; 0 for other signals."""
    if _kind(roles[0]) != "accel" or len(roles) < len(AXES):
        return 0.0
    size = float(np.linalg.norm([np.median(signals[role][1]) for role in roles])) * factor
    return abs(size / STANDARD_GRAVITY - 1)


def _minutes(roles: tuple[str, ...], signals: RoleSignals) -> str:
    """What else minutes may be: `ddmm.mmmm` never has minutes beyond 59."""
    rest = np.concatenate([np.abs(signals[role][1]) % 100 for role in roles])
    also = f'; or degrees and minutes in one number, then unit = "{DEGREES_MINUTES}"'
    west = "; a longitude that counts positive to the west needs a minus"
    return (also if (rest < 60).all() else "") + west


def _degrees_minutes(roles: tuple[str, ...], signals: RoleSignals) -> str:
    """What to write where positions fit as degrees and minutes in one number; empty for not."""
    if _kind(roles[0]) != "position" or not _minutes(roles, signals).startswith("; or"):
        return ""
    read = {role: (signals[role][0], of_degrees_minutes(signals[role][1])) for role in roles}
    if not _fits(roles, {**signals, **read}, 1.0):
        return ""
    return f'degrees and minutes in one number? Then say unit = "{DEGREES_MINUTES}" in the profile'


def _wrapped(roles: tuple[str, ...], signals: RoleSignals) -> int:
    """Bits of a number whose sign was lost; 0 for none: several values just below 2^bits."""
    for bits in (64, 32):
        for role in roles:
            values = signals[role][1]
            high = values[_outside(role, values)]
            near = (high > 2.0**bits * 0.999) & (high <= 2.0**bits)
            if len(high) and near.all() and (bits == 64 or len(np.unique(high)) > 1):
                return bits
    return 0


def _against_speed(signals: RoleSignals, factor: float) -> float | None:
    """Way by the positions, times a factor, over the way by a speed; None where none tells."""
    if any(role not in signals for role in GROUPS[0]):
        return None
    (time, north), (_, east) = (signals[role] for role in GROUPS[0])
    if len(north) != len(east) or len(north) < 10:
        return None
    speeds = ("speed.v", "gnss.speed", *(f"wheel_speeds.{wheel}" for wheel in WHEELS))
    role = next((r for r in speeds if r in signals and len(signals[r][0]) > 1), "")
    if not role or _mostly_outside(role, signals[role][1]):
        return None
    north, east = np.radians(north * factor), np.radians(east * factor)
    way = EARTH_RADIUS * np.hypot(np.diff(north), np.diff(east) * np.cos(north[:-1])).sum()
    own, speed = signals[role]
    driven = float(np.trapezoid(np.abs(np.interp(time, own, speed)), time))
    return float(way / driven) if driven > DRIVEN and way > 0 else None


def _without(table: Table, roles: set[str]) -> Table:
    fields = {
        role.partition(".")[2]: np.nan
        for role in roles
        if SECTIONS[role.partition(".")[0]].topic == table.topic
    }
    if not fields:
        return table
    blank = {name: np.broadcast_to(np.float64("nan"), len(table)) for name in fields}
    return dataclasses.replace(table, columns={**table.columns, **blank})
