"""Units that sources use, and their way to SI."""

from __future__ import annotations

import math

from roadlog.errors import ConfigError, near

STANDARD_GRAVITY = 9.80665  # m/s2, CODATA
DEG = math.pi / 180  # rad

# unit -> (quantity, factor to SI)
UNITS: dict[str, tuple[str, float]] = {
    "": ("number", 1.0),
    "-": ("number", 1.0),
    "%": ("number", 0.01),
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "us": ("time", 1e-6),
    "ns": ("time", 1e-9),
    "min": ("time", 60.0),
    "h": ("time", 3600.0),
    "m": ("length", 1.0),
    "mm": ("length", 1e-3),
    "cm": ("length", 1e-2),
    "km": ("length", 1e3),
    "ft": ("length", 0.3048),
    "m/s": ("speed", 1.0),
    "cm/s": ("speed", 1e-2),
    "mm/s": ("speed", 1e-3),
    "km/h": ("speed", 1 / 3.6),
    "mph": ("speed", 0.44704),
    "kn": ("speed", 1852 / 3600),
    "m/s^2": ("acceleration", 1.0),
    "mm/s^2": ("acceleration", 1e-3),
    "cm/s^2": ("acceleration", 1e-2),
    "g": ("acceleration", STANDARD_GRAVITY),
    "mg": ("acceleration", STANDARD_GRAVITY * 1e-3),
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180),
    "cdeg": ("angle", math.pi / 180 * 1e-2),
    "mdeg": ("angle", math.pi / 180 * 1e-3),
    "mrad": ("angle", 1e-3),
    "rad/s": ("angular rate", 1.0),
    "deg/s": ("angular rate", math.pi / 180),
    "mrad/s": ("angular rate", 1e-3),
    "cdeg/s": ("angular rate", math.pi / 180 * 1e-2),
    "mdeg/s": ("angular rate", math.pi / 180 * 1e-3),
    "rpm": ("angular rate", 2 * math.pi / 60),
    "1/s": ("angular rate", 1.0),
    "N": ("force", 1.0),
    "kN": ("force", 1e3),
    "N m": ("torque", 1.0),
    "kN m": ("torque", 1e3),
}

# units of a slope: its tangent in parts
SLOPES = {"%": 0.01, "‰": 0.001, "m/m": 1.0}

# a position as NMEA 0183 writes it: degrees * 100 + minutes
DEGREES_MINUTES = "ddmm.mmmm"

# how a column may write the time besides a number of a unit: of the day, days since 1899-12-30
# (spreadsheets) and since the year 0 (MATLAB), and a date as one number
CLOCK_FORMS = ("hhmmss", "excel", "datenum", "yyyymmddhhmmss")

_SPELLINGS = {
    "m/s2": "m/s^2",
    "m/s²": "m/s^2",
    "mm/s2": "mm/s^2",
    "mm/s²": "mm/s^2",
    "cm/s2": "cm/s^2",
    "cm/s²": "cm/s^2",
    "m/s**2": "m/s^2",
    "m s^-2": "m/s^2",
    "kph": "km/h",
    "kmh": "km/h",
    "kmph": "km/h",
    "mps": "m/s",
    "knots": "kn",
    "°": "deg",
    "degree": "deg",
    "degrees": "deg",
    "dps": "deg/s",
    "mdps": "mdeg/s",
    "m°/s": "mdeg/s",
    "m°": "mdeg",
    "cdps": "cdeg/s",
    "°/s": "deg/s",
    "rads": "rad/s",
    "Nm": "N m",
    "N*m": "N m",
    "N·m": "N m",
    "kNm": "kN m",
    "percent": "%",
    "prozent": "%",
    "pct": "%",
    "G": "g",
    "grad": "deg",
    "Grad": "deg",
    "grad/s": "deg/s",
    "°/sec": "deg/s",
    "deg/sec": "deg/s",
    "degree/s": "deg/s",
    "degrees/s": "deg/s",
    "rad/sec": "rad/s",
    "rad s^-1": "rad/s",
    "deg s^-1": "deg/s",
    "m s^-1": "m/s",
    "m/sec": "m/s",
    "m/s/s": "m/s^2",
    "m/sec^2": "m/s^2",
    "m/s^2": "m/s^2",
    "Km/h": "km/h",
    "KM/H": "km/h",
    "km/hr": "km/h",
    "MPH": "mph",
    "mi/h": "mph",
    "miles/h": "mph",
    "kt": "kn",
    "kts": "kn",
    "1/min": "rpm",
    "U/min": "rpm",
    "Metres": "m",
    "metres": "m",
    "N.m": "N m",
    "N-m": "N m",
    "sec": "s",
    "seconds": "s",
    "meter": "m",
    "meters": "m",
    "metre": "m",
    "1": "-",
}


def canonical(unit: str) -> str:
    """The spelling that `UNITS` holds; ConfigError with near names for an unknown unit."""
    text = unit.strip()
    text = _SPELLINGS.get(text, text)
    if text not in UNITS:
        raise ConfigError(f"unknown unit '{unit}'. {near(unit, UNITS)}")
    return text


def is_written(role: str, unit: str) -> bool:
    """Whether no factor leads from the unit to SI: a slope by its tangent, degrees and minutes."""
    slope = role.startswith(("truth.grade", "truth.bank")) and unit in SLOPES
    return slope or (role in ("gnss.latitude", "gnss.longitude") and unit == DEGREES_MINUTES)


def to_si(unit: str, expected: str) -> float:
    """Factor from `unit` to the SI unit `expected`; ConfigError when the quantities differ."""
    quantity, factor = UNITS[canonical(unit)]
    wanted, si_factor = UNITS[canonical(expected)]
    if quantity != wanted:
        raise ConfigError(f"unit '{unit}' measures {quantity}, but {wanted} [{expected}] is needed")
    return factor / si_factor
