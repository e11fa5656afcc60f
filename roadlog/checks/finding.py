"""What a check says."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

Level = Literal["fault", "note"]

# what makes angles wrong that are made of such signals; of all else a standard deviation tells
SPOILING = frozenset(
    {
        "axes",
        "clock_drift",
        "clock_jump",
        "clock_step",
        "clocks_differ",
        "course",
        "dead",
        "exchanged",
        "gravity",
        "sign",
        "slow",
        "unit",
    }
)
MAX_SCALE = 1.15  # of a speed; tires that are wrong by less move the grade by less than its sd


@dataclass(frozen=True)
class Finding:
    """One thing that a check found.

    check: its name, which stays. level: `fault` where something should be corrected before angles
    are believed, `note` for what is worth knowing. signals: roles or topics. at: s from the start
    of the log where there is one place. found, advice: sentences. value: the measured figure
    (factor, lag in s, share, ...), for programs.
    """

    check: str
    level: Level
    signals: tuple[str, ...]
    found: str
    advice: str = ""
    at: float | None = None
    value: float | None = None

    def spoils(self, roles: Collection[str], also: Collection[str] = ()) -> bool:
        """Whether who uses these roles as they are gets wrong angles from them.

        also: further checks that spoil these angles.
        Of two clocks that differ, only who uses both; of one that drifts, who uses it beside any
        other, because none says which of the two it is; of all else, who uses any.
        """
        if self.check == "speeds_disagree":
            wrong = self.value is not None and not 1 / MAX_SCALE < self.value < MAX_SCALE
            return wrong and any(_meets(signal, roles) for signal in self.signals)
        if self.check not in SPOILING and self.check not in also:
            return False
        sections = {_section(signal) for signal in self.signals}
        used = {_section(role) for role in roles}
        if self.check == "clock_drift":
            return bool(sections & used) and len(used) > 1
        if self.check in ("clocks_differ", "clock_step"):
            return sections <= used
        return any(_meets(signal, roles) for signal in self.signals)

    @property
    def harm(self) -> tuple[bool, bool, int]:
        """The larger the more it spoils: angles, what should be corrected, signals it meets."""
        return self.check in SPOILING, self.level == "fault", len(self.signals)

    @property
    def short(self) -> str:
        """What was found, without the advice."""
        at = "" if self.at is None else f" (from {self.at:.1f} s)"
        where = f"{', '.join(self.signals)}: " if self.signals else ""
        return f"{where}{self.found}{at}"

    def __str__(self) -> str:
        return f"{self.short}; {self.advice}" if self.advice else self.short


def _section(signal: str) -> str:
    """The section of a role, or of a topic."""
    return signal.strip("/").split(".")[0]


def _meets(signal: str, roles: Collection[str]) -> bool:
    """Whether a role, a group of roles (`imu.accel`) or a topic is among roles."""
    name = signal.strip("/")
    return any(role == name or role.startswith((f"{name}_", f"{name}.")) for role in roles)
