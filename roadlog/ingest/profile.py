"""Profiles: how one source's names, units and axes become roadlog's signals (design section 6)."""

from __future__ import annotations

import math
import operator
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import ConfigError, near
from roadlog.ingest.frame import Frame
from roadlog.signals import SECTIONS
from roadlog.types import Bools, Floats
from roadlog.units import to_si

AXES = "xyz"
CLOCKS = ("log", "publish", "header")
TIME_KEYS = ("column", "unit", "clock")
ENTRY_KEYS = ("from", "file", "unit", "scale", "offset", "delay", "valid")
ORTHOGONAL = 1e-3  # how far a mount matrix may be from a rotation: three printed digits

_COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
_CONDITION = re.compile(r"^\s*(.+?)\s*(==|!=|<=|>=|<|>)\s*([-+.\deE]+)\s*$")
_DURATION = re.compile(r"^\s*([-+.\deE]+)\s*([a-z]+)\s*$")


@dataclass(frozen=True)
class Clock:
    """The `[time]` section: which column of a table, in which unit; which stamp of an MCAP."""

    column: str = ""
    unit: str = ""
    clock: str = "log"


@dataclass(frozen=True)
class Condition:
    """`valid = "NAME == 1"`: a comparison of another signal of the same row."""

    name: str
    compare: str
    value: float

    def holds(self, values: Floats) -> Bools:
        """Which rows are valid; an unknown value is not."""
        return np.isfinite(values) & _COMPARISONS[self.compare](values, self.value)


@dataclass(frozen=True)
class Entry:
    """One signal: SI value = (raw * scale + offset) * unit, at raw time - delay [s]."""

    role: str
    source: str
    file: str = ""
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    valid: Condition | None = None


@dataclass(frozen=True)
class Profile:
    """A checked profile.

    entries: section -> field -> entry. mounts: section -> rotation matrix, vehicle = R @ sensor.
    """

    name: str
    text: str
    clock: Clock = Clock()
    entries: Mapping[str, Mapping[str, Entry]] = field(default_factory=dict)
    mounts: Mapping[str, Floats] = field(default_factory=dict)

    @classmethod
    def load(cls, name_or_path: str | Path) -> Profile:
        """A profile file, or the shipped profile of that name. Raises ConfigError."""
        path = Path(name_or_path)
        if path.suffix != ".toml" and str(name_or_path) in shipped():
            text = files("roadlog").joinpath(f"profiles/{name_or_path}.toml").read_text("utf-8")
            return cls.from_toml(text, str(name_or_path))
        if not path.is_file():
            raise ConfigError(
                f"{name_or_path}: no such profile file, and no shipped profile of that name. "
                + near(str(name_or_path), shipped())
            )
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            raise ConfigError(f"{path}: profile cannot be read: {error}") from error
        return cls.from_toml(text, path.stem, str(path))

    @classmethod
    def from_toml(cls, text: str, name: str, where: str = "") -> Profile:
        """Parse a profile; an unknown key, role or unit is a ConfigError that names it."""
        where = where or f"profile {name}"
        try:
            document = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise ConfigError(f"{where}: not a TOML file: {error}") from error
        clock = _clock(document.pop("time", {}), where)
        entries: dict[str, dict[str, Entry]] = {}
        mounts: dict[str, Floats] = {}
        for section, table in document.items():
            _known(section, SECTIONS, f"{where}: unknown section [{section}]")
            if not isinstance(table, dict):
                raise ConfigError(f"{where}: [{section}] must be a table of signals")
            here = f"{where}: [{section}]"
            mount = table.pop("mount", None)
            if mount is not None:
                if section != "imu":
                    raise ConfigError(f"{here}: only [imu] has a mount")
                mounts[section] = rotation(mount, here)
            fields = SECTIONS[section].fields
            for key in table:
                _known(key, fields, f"{here}: unknown signal '{key}'")
            entries[section] = {
                key: _entry(f"{section}.{key}", value, SECTIONS[section], f"{here} {key}")
                for key, value in table.items()
            }
        if not any(entries.values()):
            raise ConfigError(f"{where}: maps no signal; see `roadlog profile new --help`")
        return cls(name, text, clock, entries, mounts)

    @property
    def names(self) -> set[str]:
        """Every source name that the profile reads."""
        found = set()
        for entry in self:
            found.add(entry.source)
            if entry.valid:
                found.add(entry.valid.name)
        return found

    def __iter__(self) -> Any:
        return (entry for table in self.entries.values() for entry in table.values())


def shipped() -> list[str]:
    """Names of the profiles that come with roadlog."""
    folder = files("roadlog").joinpath("profiles")
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


def find(entry_name: str, entry: Entry, frames: list[Frame]) -> tuple[Frame, str]:
    """The frame and column that an entry's source (or its condition) means.

    A name is a column, or `FRAME.COLUMN` where several frames have the column. Raises ConfigError
    with the near names.
    """
    among = [f for f in frames if not entry.file or _any_match(f.file, entry.file)]
    if not among:
        names = ", ".join(sorted({f.file for f in frames}))
        raise ConfigError(f"{entry.role}: no source file matches '{entry.file}' (have: {names})")
    found = [(f, c) for f in among for c in f.columns if entry_name in (c, f"{f.name}.{c}")]
    if not found:
        known = {c for f in among for c in f.columns}
        full = {f"{f.name}.{c}" for f in among for c in f.columns if f.name}
        choices = full if "." in entry_name and full else known
        raise ConfigError(
            f"{entry.role}: the source has no '{entry_name}'. {near(entry_name, choices)}"
        )
    if len(found) > 1:
        places = ", ".join(f"{f.name or f.file}.{c}" for f, c in found)
        raise ConfigError(
            f"{entry.role}: '{entry_name}' is in several places ({places}); "
            f'write one of them, or add file = "..."'
        )
    return found[0]


def _any_match(files_: str, pattern: str) -> bool:
    return any(fnmatch(name, pattern) for name in files_.split(", "))


def rotation(mount: Any, where: str) -> Floats:
    """Rotation matrix (vehicle = R @ sensor) of a mount: axes, matrix or rpy_deg.

    Axes: `{forward = "+x", left = "-z"}` says which sensor axis points where; up follows.
    rpy_deg: roll, pitch and yaw of the sensor in the vehicle, R = Rz(yaw) Ry(pitch) Rx(roll).
    Raises ConfigError.
    """
    if not isinstance(mount, dict):
        raise ConfigError(f"{where}: mount must be a table {{ forward = ..., left = ... }}")
    keys = set(mount)
    if keys == {"matrix"}:
        try:
            matrix = np.array(mount["matrix"], np.float64)
        except (TypeError, ValueError):
            matrix = np.empty(0)
        if matrix.shape != (3, 3):
            raise ConfigError(f"{where}: mount matrix must have three rows of three numbers")
    elif keys == {"rpy_deg"}:
        angles = mount["rpy_deg"]
        if not (isinstance(angles, list) and len(angles) == 3 and all(map(_is_number, angles))):
            raise ConfigError(f"{where}: mount rpy_deg must be [roll, pitch, yaw]")
        matrix = _from_rpy(*np.radians(angles))
    elif keys <= {"forward", "left", "up"} and len(keys) >= 2:
        rows = {way: _axis(axis, f"{where}: mount {way}") for way, axis in mount.items()}
        if "forward" not in rows:
            rows["forward"] = np.cross(rows["left"], rows["up"])
        if "left" not in rows:
            rows["left"] = np.cross(rows["up"], rows["forward"])
        rows.setdefault("up", np.cross(rows["forward"], rows["left"]))
        matrix = np.stack([rows["forward"], rows["left"], rows["up"]])
    else:
        raise ConfigError(
            f"{where}: mount needs two of forward, left, up; or matrix; or rpy_deg "
            f"(found: {', '.join(sorted(keys)) or 'nothing'})"
        )
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > ORTHOGONAL or np.linalg.det(matrix) < 0:
        raise ConfigError(f"{where}: mount is no rotation of right-handed axes")
    return matrix


def _axis(text: Any, where: str) -> Floats:
    match = re.fullmatch(r"([+-]?)([xyzXYZ])", text.strip()) if isinstance(text, str) else None
    if not match:
        raise ConfigError(f"{where}: '{text}' is no axis; write +x, -x, +y, -y, +z or -z")
    row = np.zeros(3)
    row[AXES.index(match[2].lower())] = -1.0 if match[1] == "-" else 1.0
    return row


def _from_rpy(roll: float, pitch: float, yaw: float) -> Floats:
    cr, sr, cp, sp = math.cos(roll), math.sin(roll), math.cos(pitch), math.sin(pitch)
    cy, sy = math.cos(yaw), math.sin(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _clock(table: Any, where: str) -> Clock:
    here = f"{where}: [time]"
    if not isinstance(table, dict):
        raise ConfigError(f"{here} must be a table")
    for key, value in table.items():
        _known(key, TIME_KEYS, f"{here}: unknown key '{key}'")
        if not isinstance(value, str):
            raise ConfigError(f"{here}: {key} must be a text")
    clock = Clock(**table)
    if clock.clock not in CLOCKS:
        raise ConfigError(f"{here}: clock must be one of {', '.join(CLOCKS)}, not '{clock.clock}'")
    if clock.unit:
        _factor(clock.unit, "s", here)
    return clock


def _entry(role: str, value: Any, section: Any, where: str) -> Entry:
    if not isinstance(value, dict):
        raise ConfigError(f'{where}: must be {{ from = "NAME", unit = "UNIT" }}')
    for key in value:
        _known(key, ENTRY_KEYS, f"{where}: unknown key '{key}'")
    for key in ("from", "file", "unit", "valid"):
        if key in value and not isinstance(value[key], str):
            raise ConfigError(f"{where}: {key} must be a text")
    for key in ("scale", "offset"):
        if key in value and not _is_number(value[key]):
            raise ConfigError(f"{where}: {key} must be a number")
    if not value.get("from"):
        raise ConfigError(f"{where}: from is missing")
    expected = next(s.unit for s in section.signals if s.role == role)
    unit = value.get("unit", "")
    if unit:
        _factor(unit, expected, where)
    elif expected != "-":
        raise ConfigError(f"{where}: unit is missing (roadlog keeps it in {expected})")
    return Entry(
        role,
        value["from"],
        value.get("file", ""),
        unit,
        float(value.get("scale", 1.0)),
        float(value.get("offset", 0.0)),
        _delay(value["delay"], where) if "delay" in value else 0.0,
        _condition(value["valid"], where) if "valid" in value else None,
    )


def _delay(value: Any, where: str) -> float:
    match = _DURATION.match(value) if isinstance(value, str) else None
    if not match or not _parses(match[1]):
        raise ConfigError(f'{where}: delay must be a number with a unit, like "0.12 s"')
    return float(match[1]) * _factor(match[2], "s", where)


def _condition(text: str, where: str) -> Condition:
    match = _CONDITION.match(text)
    if not match or not _parses(match[3]):
        raise ConfigError(f'{where}: valid must be a comparison like "AltitudeValid == 1"')
    return Condition(match[1], match[2], float(match[3]))


def _factor(unit: str, expected: str, where: str) -> float:
    try:
        return to_si(unit, expected)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def _known(name: str, choices: Any, problem: str) -> None:
    if name not in choices:
        raise ConfigError(f"{problem}. {near(name, choices)}")


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _parses(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
