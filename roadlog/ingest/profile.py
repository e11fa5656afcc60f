"""Profiles: how one source's names, units and axes become roadlog's signals (docs/ingest.md)."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from fnmatch import fnmatch
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np

from roadlog import toml
from roadlog.errors import ConfigError, near
from roadlog.ingest.frame import Frame
from roadlog.ingest.mount import rotation
from roadlog.signals import SECTIONS
from roadlog.types import Bools, Floats
from roadlog.units import CLOCK_FORMS, is_written, to_si

CLOCKS = ("log", "publish", "header")
TIME_KEYS = ("column", "unit", "clock", "zone")
ENTRY_KEYS = ("from", "file", "unit", "scale", "offset", "delay", "valid")

LONGEST_DELAY = 3600.0  # s; a clock that is off by more is what --time-offset is for
FITTING = 3  # signals that make a shipped profile fit, where it has more

_COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq,
    "!=": operator.ne,
    "<=": operator.le,
    ">=": operator.ge,
    "<": operator.lt,
    ">": operator.gt,
}
NUMBER = "+-.0123456789eE"  # letters of a number
COMPARISONS = ("==", "!=", "<=", ">=", "<", ">")


class AbsentError(ConfigError):
    """A signal of the profile is not in the source."""


@dataclass(frozen=True)
class Clock:
    """The `[time]` section: which column of a table, in which unit; which stamp of an MCAP.

    zone: of stamps that are in a local time.
    """

    column: str = ""
    unit: str = ""
    clock: str = "log"
    zone: str = ""

    @property
    def is_own(self) -> bool:
        """Whether it is another one than that of the recording."""
        return bool(self.column) or self.clock != "log"


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
    """One signal: SI value = (raw * scale + offset) * unit, at raw time - delay [s].

    sources: names in the source; the first one that is there counts.
    """

    role: str
    sources: tuple[str, ...]
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
    measured: the mount is an angle that somebody measured, not only which axis points where.
    clocks: file pattern -> clock, where files differ ([[time]]), the first that fits; clock: of
    all others. family: it comes with roadlog and describes a kind of source, whose members need
    not have all of its signals; a user's own file means every line of it. needs: names of which
    one must be there where the profile is found by itself, since others have its names too.
    """

    name: str
    text: str
    clock: Clock = Clock()
    entries: Mapping[str, Mapping[str, Entry]] = field(default_factory=dict)
    mounts: Mapping[str, Floats] = field(default_factory=dict)
    family: bool = False
    measured: bool = False
    clocks: tuple[tuple[str, Clock], ...] = ()
    needs: tuple[str, ...] = ()

    def for_file(self, name: str) -> Profile:
        """The same on the clock of one source file."""
        found = (clock for pattern, clock in self.clocks if fnmatch(name, pattern))
        return replace(self, clock=next(found, self.clock))

    def on_clock(self, which: str) -> Profile:
        """The same on another clock of messages (one of CLOCKS); itself for none."""
        if not which:
            return self
        _known(which, CLOCKS, f"unknown clock '{which}'")
        return replace(self, clock=replace(self.clock, clock=which, column=""), clocks=())

    @classmethod
    def load(cls, name_or_path: str | Path) -> Profile:
        """A profile file, or the shipped profile of that name. Raises ConfigError."""
        path = Path(name_or_path)
        if path.suffix != ".toml" and str(name_or_path) in shipped():
            text = files("roadlog").joinpath(f"profiles/{name_or_path}.toml").read_text("utf-8")
            return replace(cls.from_toml(text, str(name_or_path)), family=True)
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
        """Parse a profile's text. An unknown key, role or unit is a ConfigError that names it."""
        where = where or f"profile {name}"
        document = toml.loads(text, where)
        needs = document.pop("needs", [])
        if not isinstance(needs, list) or not all(isinstance(need, str) for need in needs):
            raise ConfigError(f"{where}: needs must be a list of names")
        clocks = _clocks(document.pop("time", {}), where)
        entries: dict[str, dict[str, Entry]] = {}
        mounts: dict[str, Floats] = {}
        measured = False
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
                measured = not {"matrix", "rpy_deg"}.isdisjoint(mount) and "drafted" not in mount
            fields = SECTIONS[section].fields
            for key in table:
                _known(key, fields, f"{here}: unknown signal '{key}'")
            entries[section] = {
                key: _entry(f"{section}.{key}", value, SECTIONS[section], f"{here} {key}")
                for key, value in table.items()
            }
        if not any(entries.values()):
            raise ConfigError(
                f"{where}: maps no signal; write at least one, as "
                '[speed] and below it v = { from = "NAME", unit = "km/h" }'
            )
        clock = dict(clocks).get("", Clock())
        per_file = tuple((pattern, clock) for pattern, clock in clocks if pattern)
        named = tuple(needs)
        return cls(name, text, clock, entries, mounts, False, measured, per_file, named)

    @property
    def names(self) -> set[str]:
        """Every source name that the profile reads."""
        found: set[str] = set()
        for entry in self:
            found.update(entry.sources)
            if entry.valid:
                found.add(entry.valid.name)
        return found

    def reads(self, column: str, *frames: str) -> bool:
        """Whether the profile names a column, alone or after one of its frame's names."""
        return column in self._wanted or any(f"{f}.{column}" in self._wanted for f in frames)

    @cached_property
    def _wanted(self) -> frozenset[str]:
        return frozenset(self.names | ({self.clock.column} if self.clock.column else set()))

    def __iter__(self) -> Iterator[Entry]:
        return (entry for table in self.entries.values() for entry in table.values())


@dataclass(frozen=True)
class Everything(Profile):
    """Reads all that a source has."""

    def reads(self, column: str, *frames: str) -> bool:
        """Whatever the name."""
        del column, frames
        return True


def shipped() -> list[str]:
    """Names of the profiles that come with roadlog."""
    folder = files("roadlog").joinpath("profiles")
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


def fitting(names: Set[str]) -> Profile | None:
    """The shipped profile of which most signals are among a source's names, where one stands out.

    A profile fits with all of its signals, or with three at least.
    """
    best: list[tuple[int, Profile]] = []
    for name in shipped():
        profile = Profile.load(name)
        entries = list(profile)
        if profile.needs and names.isdisjoint(profile.needs):
            continue
        found = sum(any(source in names for source in entry.sources) for entry in entries)
        if found >= min(len(entries), FITTING):
            best.append((found, profile))
    most = max((found for found, _ in best), default=0)
    fits = [profile for found, profile in best if found == most]
    return fits[0] if len(fits) == 1 else None


def find(entry: Entry, frames: Sequence[Frame]) -> tuple[Frame, str]:
    """The frame and column that an entry means: of its sources the first one that is there.

    A name is a column, or `FRAME.COLUMN` with a frame's name or kind where several have the
    column. Raises AbsentError with the near names, ConfigError for one that means several.
    """
    among = [f for f in frames if not entry.file or _any_match(f.file, entry.file)]
    if not among:
        names = ", ".join(sorted({f.file for f in frames}))
        raise AbsentError(f"{entry.role}: no source file matches '{entry.file}' (have: {names})")
    for source in entry.sources:
        found = [(f, c) for f in among for c in f.columns if source in (c, *f.full(c))]
        if len(found) > 1:
            places = ", ".join(f"{f.name or f.file}.{c}" for f, c in found)
            raise ConfigError(
                f"{entry.role}: '{source}' is in several places ({places}); "
                f'write one of them, or add file = "..."'
            )
        if found:
            return found[0]
    wanted = entry.sources[0]
    known = {c for f in among for c in f.columns}
    full = {f"{f.name}.{c}" for f in among for c in f.columns if f.name}
    choices = full if "." in wanted and full else known
    raise AbsentError(f"{entry.role}: the source has no '{wanted}'. {near(wanted, choices)}")


def _any_match(files_: str, pattern: str) -> bool:
    return any(fnmatch(name, pattern) for name in files_.split(", "))


def states_mounting(record: Mapping[str, str]) -> bool:
    """Whether the profile in a log's record gives measured angles of the IMU's mounting."""
    try:
        return Profile.from_toml(record["toml"], record.get("name", "")).measured
    except (KeyError, ConfigError):
        return False


def _clocks(time: Any, where: str) -> list[tuple[str, Clock]]:
    """File pattern, empty for all, and clock: `[time]`, or `[[time]]` with `file` each."""
    if not isinstance(time, list):
        return [("", _clock(time, where))]
    found = []
    for table in time:
        own = dict(table) if isinstance(table, dict) else {}
        pattern = own.pop("file", "")
        if not isinstance(pattern, str) or not isinstance(table, dict):
            raise ConfigError(f'{where}: each [[time]] needs file = "..." and its keys')
        found.append((pattern, _clock(own, where)))
    return found


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
    if clock.unit and clock.unit not in CLOCK_FORMS:
        _factor(clock.unit, "s", here)
    return clock


def _entry(role: str, value: Any, section: Any, where: str) -> Entry:
    if not isinstance(value, dict):
        raise ConfigError(f'{where}: must be {{ from = "NAME", unit = "UNIT" }}')
    for key in value:
        _known(key, ENTRY_KEYS, f"{where}: unknown key '{key}'")
    for key in ("file", "unit", "valid"):
        if key in value and not isinstance(value[key], str):
            raise ConfigError(f"{where}: {key} must be a text")
    sources = value.get("from")
    if isinstance(sources, str):
        sources = [sources]
    if sources is not None and not (
        isinstance(sources, list) and all(isinstance(name, str) for name in sources)
    ):
        raise ConfigError(
            f"{where}: from must be a text, or a list of which the first found counts"
        )
    for key in ("scale", "offset"):
        if key in value and not toml.is_number(value[key]):
            raise ConfigError(f"{where}: {key} must be a number")
    if not sources or not all(sources):
        raise ConfigError(f"{where}: from is missing")
    expected = next(s.unit for s in section.signals if s.role == role)
    unit = value.get("unit", "")
    if unit and not is_written(role, unit):
        _factor(unit, expected, where)
    elif not unit and expected != "-":
        raise ConfigError(f"{where}: unit is missing (roadlog keeps it in {expected})")
    return Entry(
        role,
        tuple(sources),
        value.get("file", ""),
        unit,
        float(value.get("scale", 1.0)),
        float(value.get("offset", 0.0)),
        _delay(value["delay"], where) if "delay" in value else 0.0,
        _condition(value["valid"], where) if "valid" in value else None,
    )


def _delay(value: Any, where: str) -> float:
    text = value.strip() if isinstance(value, str) else ""
    number = text.rstrip(ascii_lowercase)
    unit = text[len(number) :]
    if not unit or not _parses(number.rstrip()):
        raise ConfigError(f'{where}: delay must be a number with a unit, like "0.12 s"')
    seconds = float(number) * _factor(unit, "s", where)
    if abs(seconds) > LONGEST_DELAY:
        raise ConfigError(f"{where}: delay must be less than {LONGEST_DELAY:.0f} s")
    return seconds


def _condition(text: str, where: str) -> Condition:
    text = text.strip()
    head = text.rstrip(NUMBER)
    number, head = text[len(head) :], head.rstrip()
    sign = next((sign for sign in COMPARISONS if head.endswith(sign)), "")
    name = head.removesuffix(sign).rstrip()
    if not sign or not name or not _parses(number):
        raise ConfigError(f'{where}: valid must be a comparison like "AltitudeValid == 1"')
    return Condition(name, sign, float(number))


def _factor(unit: str, expected: str, where: str) -> float:
    try:
        return to_si(unit, expected)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def _known(name: str, choices: Any, problem: str) -> None:
    if name not in choices:
        raise ConfigError(f"{problem}. {near(name, choices)}")


def _parses(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
