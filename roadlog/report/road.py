"""The roads of a report: every drive's pass, merged by `roadlog.roads`, as one table."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from roadlog.files import write
from roadlog.roads.formats import table
from roadlog.roads.merge import roads
from roadlog.roads.model import RoadModel
from roadlog.roads.passes import Pass

MOST_POINTS = 4_000_000  # of all passes: 20,000 km, and some 400 MB while they are merged


@dataclass(frozen=True, eq=False)
class RoadProfile:
    """Every stretch of road that the drives went over, the longest first.

    drives: how many have a pass. left_out: of them, not merged, for they are more than memory is
    meant to hold.
    """

    models: tuple[RoadModel, ...] = ()
    drives: int = 0
    left_out: int = 0

    @property
    def length(self) -> float:
        """m, of all stretches."""
        return sum(model.length for model in self.models)

    def columns(self) -> dict[str, NDArray]:
        """As the table has them: that of one road, with the number of the stretch before."""
        parts = [table.columns(model) for model in self.models]
        count = [len(model) for model in self.models]
        numbers = {"stretch": np.repeat(np.arange(1, len(count) + 1), count)}
        names = parts[0] if parts else ()
        return numbers | {name: np.concatenate([part[name] for part in parts]) for name in names}

    def write(self, stem: Path) -> None:
        """Write the table as CSV and Parquet."""
        for ending in (".csv", ".parquet"):
            write(stem.with_suffix(ending), table.content(self.columns(), ending))


def merged(passes: Iterable[Pass]) -> RoadProfile:
    """The roads of all passes; one pass after the other is taken until memory ends."""
    taken: list[Pass] = []
    points = drives = 0
    for own in passes:
        drives += 1
        points += len(own)
        if points <= MOST_POINTS:
            taken.append(own)
    return RoadProfile(tuple(roads(taken, "stretch")), drives, drives - len(taken))
