"""The papers' own tables and claims, run again: `roadlog reproduce`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import import_module
from typing import Any

from roadlog.errors import ConfigError, near

# paper -> the module and the function that run it
PAPERS: dict[str, str] = {
    "massel2004": "roadlog.reproduce.massel2004:reproduce",
    "ryu2004": "roadlog.reproduce.ryu2004:ryu2004",
    "kim2023": "roadlog.reproduce.kim2023:run",
    "luo2024": "roadlog.reproduce.luo2024:luo2024",
    "wang2025": "roadlog.reproduce.wang2025:reproduce",
    "fusion": "roadlog.reproduce.fusion:fusion",
    "calibration": "roadlog.reproduce.calibration:calibration",
}


@dataclass(frozen=True)
class Row:
    """One figure: of the paper, of our method documents, of this run; None where there is none."""

    case: str
    metric: str
    unit: str
    paper: float | None
    documented: float | None
    now: float | None


@dataclass(frozen=True)
class ResultTable:
    """A table of a paper or of its method's page."""

    name: str
    rows: list[Row]


@dataclass(frozen=True)
class Claim:
    """A qualitative claim, whether it holds, and the figures that say so."""

    claim: str
    holds: bool
    now: str


@dataclass(frozen=True)
class Reproduction:
    """All of one paper."""

    paper: str
    tables: list[ResultTable]
    claims: list[Claim]

    def to_json(self) -> dict[str, Any]:
        """The object that `roadlog reproduce --json` prints."""
        return asdict(self)


def reproduce(paper: str) -> Reproduction:
    """Run one paper's scenarios. Raises ConfigError with near names for an unknown paper."""
    if paper not in PAPERS:
        raise ConfigError(f"no paper '{paper}'. {near(paper, PAPERS)}")
    module, function = PAPERS[paper].split(":")
    run: Callable[[], Reproduction] = getattr(import_module(module), function)
    return run()
