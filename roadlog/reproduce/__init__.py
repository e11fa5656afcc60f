"""The papers' own tables, figures and claims, run again: `roadlog reproduce`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field, replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from roadlog.errors import ConfigError, near
from roadlog.processes import follow_parent
from roadlog.reproduce import documented

if TYPE_CHECKING:
    from roadlog.types import Floats

# paper -> the module and the function that run it
PAPERS: dict[str, str] = {
    "massel2004": "roadlog.reproduce.massel2004:reproduce",
    "ryu2004": "roadlog.reproduce.ryu2004:reproduce",
    "kim2023": "roadlog.reproduce.kim2023:reproduce",
    "luo2024": "roadlog.reproduce.luo2024:reproduce",
    "wang2025": "roadlog.reproduce.wang2025:reproduce",
}
# what is ours is run by name only
OWN: dict[str, str] = {
    "fusion": "roadlog.reproduce.fusion:fusion",
    "calibration": "roadlog.reproduce.calibration:calibration",
}
RUNS = PAPERS | OWN

Form = Literal["printed", "mended", ""]
R = TypeVar("R")


@dataclass(frozen=True)
class ResultRow:
    """One figure: of the paper, of this run, of the documentation; None where there is none.

    form: the method as the paper prints it or as it is mended here; empty where there is only one.
    spread: standard deviation of `now` over the seeds.
    """

    case: str
    form: Form
    metric: str
    unit: str
    paper: float | None
    now: float | None
    spread: float | None = None
    documented: float | None = None

    @property
    def ratio(self) -> float | None:
        """How many times the paper's figure this run's is."""
        return None if not self.paper or self.now is None else self.now / self.paper


@dataclass(frozen=True)
class ResultTable:
    """A table of a paper or of its method's page; settings: what is not the tool's default."""

    name: str
    rows: list[ResultRow]
    settings: str = "none"


@dataclass(frozen=True)
class Claim:
    """A qualitative claim, whether it holds, the figures that say so, and why."""

    claim: str
    holds: bool
    now: str
    why: str


@dataclass(frozen=True)
class Reproduction:
    """All of one paper. claims: the paper's own, in its own sense; also: what we add to them."""

    paper: str
    tables: list[ResultTable]
    claims: list[Claim]
    also: list[Claim] = field(default_factory=list)

    def to_json(self) -> dict[str, Any]:
        """The object that `roadlog reproduce --json` prints."""
        return asdict(self)


def known(paper: str) -> None:
    """Raises ConfigError with near names for an unknown paper."""
    if paper not in RUNS:
        raise ConfigError(f"no paper '{paper}'. {near(paper, RUNS)}")


def reproduce(paper: str, update: bool = False) -> Reproduction:
    """Run one paper's scenarios. Raises ConfigError with near names for an unknown paper.

    update: this run's figures become the documented ones.
    """
    known(paper)
    module, function = RUNS[paper].split(":")
    run: Callable[[], Reproduction] = getattr(import_module(module), function)
    result = run()
    if update:
        documented.write(paper, {t.name: {_key(r): r.now for r in t.rows} for t in result.tables})
    before = documented.read(paper)
    tables = [
        replace(
            table,
            rows=[
                replace(row, documented=before.get(table.name, {}).get(_key(row)))
                for row in table.rows
            ],
        )
        for table in result.tables
    ]
    return replace(result, tables=tables)


def over(function: Callable[..., R], *items: Iterable[Any]) -> list[R]:
    """`function` of every item (of each, as `map`), on every core; all must be picklable."""
    with ProcessPoolExecutor(initializer=follow_parent) as pool:
        return list(pool.map(function, *items))


def rms(values: Floats) -> float:
    """Root mean square of what is known; NaN where nothing is."""
    import numpy as np

    known = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else float("nan")


def over_seeds(
    case: str,
    form: Form,
    metric: str,
    unit: str,
    paper: float | None,
    values: Sequence[float],
) -> ResultRow:
    """Mean and spread of one value a seed."""
    import numpy as np

    found = np.asarray(values, np.float64)
    if not len(found) or not np.isfinite(found).all():
        return ResultRow(case, form, metric, unit, paper, None)
    spread = float(found.std(ddof=1)) if len(found) > 1 else None
    return ResultRow(case, form, metric, unit, paper, float(found.mean()), spread)


def _key(row: ResultRow) -> str:
    return " | ".join(part for part in (row.case, row.form, row.metric) if part)
