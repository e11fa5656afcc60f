"""What a check says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["fault", "note"]


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

    def __str__(self) -> str:
        at = "" if self.at is None else f" (from {self.at:.1f} s)"
        return f"{', '.join(self.signals)}: {self.found}{at}" + (
            f"; {self.advice}" if self.advice else ""
        )
