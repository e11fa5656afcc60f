"""Two reports over the same logs: what got better, what got worse."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from roadlog.csv_text import csv_text
from roadlog.files import write
from roadlog.report.row import STATUSES
from roadlog.report.table import TableRow
from roadlog.signals import ANGLES

DEFAULT_THRESHOLD = 0.10  # of the RMSE before
FLOOR = 0.005  # deg; a smaller change of an RMSE is none
COMPARISON = "comparison.csv"


@dataclass(frozen=True)
class Change:
    """One figure that differs. before, now: RMSE in deg, None for a log as a whole."""

    name: str
    estimator: str
    angle: str
    before: float | None
    now: float | None
    worse: bool
    text: str


@dataclass(frozen=True)
class Comparison:
    """What changed since another report.

    logs: in both. compared: RMSEs in both. changes: beyond the threshold, the worst first.
    """

    other: str
    threshold: float
    logs: int
    compared: int
    changes: list[Change]

    @property
    def worse(self) -> int:
        """Number of changes for the worse."""
        return sum(change.worse for change in self.changes)

    @property
    def better(self) -> int:
        """Number of changes for the better."""
        return len(self.changes) - self.worse

    def write(self, folder: Path) -> None:
        """All changes as CSV."""
        columns = list(Change.__dataclass_fields__)
        write(folder / COMPARISON, csv_text(columns, map(asdict, self.changes)))


def compare(
    rows: Sequence[TableRow],
    others: Mapping[str, TableRow],
    other: str,
    threshold: float = DEFAULT_THRESHOLD,
) -> Comparison:
    """Compare the RMSE of every log, estimator and angle with another report's.

    A log is the same when its path is, or else when its name is and only one log in each report
    has it. An RMSE changed when it differs by more than `threshold` of what it was and by more
    than `FLOOR`; an estimate that is gone and a log that now fails are worse too.
    """
    matched = _matched(rows, others)
    changes: list[Change] = []
    compared = 0
    for row, before in matched:
        ranks = [STATUSES.index(r["status"]) for r in (before, row)]
        if ranks[0] != ranks[1]:
            text = f"{before['status']} before, now {row['status']}"
            message = f": {row['message']}" if row["message"] else ""
            changes.append(
                Change(row["name"], "", "", None, None, ranks[1] > ranks[0], text + message)
            )
        for estimator, angles in before["angles"].items():
            for angle in (a for a in ANGLES if a in angles):
                old = angles[angle].get("rmse_deg")
                new = row["angles"].get(estimator, {}).get(angle, {}).get("rmse_deg")
                if old is None:
                    continue
                change = _change(row["name"], estimator, angle, old, new, threshold)
                compared += new is not None
                changes += [change] if change is not None else []
    changes.sort(key=_badness, reverse=True)
    return Comparison(other, threshold, len(matched), compared, changes)


def _change(
    name: str, estimator: str, angle: str, old: float, new: float | None, threshold: float
) -> Change | None:
    if new is None:
        return Change(name, estimator, angle, old, None, True, "no estimate any more")
    difference = new - old
    if abs(difference) <= max(threshold * old, FLOOR):
        return None
    text = f"{difference:+.3f} deg" + (f", {100 * difference / old:+.0f} %" if old else "")
    return Change(name, estimator, angle, old, new, difference > 0, text)


def _badness(change: Change) -> tuple[bool, bool, float]:
    """The order of changes: worse ones, of them those without a figure, then by size."""
    known = change.before is not None and change.now is not None
    size = (change.now or 0.0) - (change.before or 0.0) if known else 0.0
    return change.worse, not known, size if change.worse else -size


def _matched(
    rows: Sequence[TableRow], others: Mapping[str, TableRow]
) -> list[tuple[TableRow, TableRow]]:
    here = Counter(row["name"] for row in rows)
    there = Counter(row["name"] for row in others.values())
    by_name = {row["name"]: row for row in others.values() if there[row["name"]] == 1}
    matched = []
    for row in rows:
        before = others.get(row["log"])
        if before is None and here[row["name"]] == 1:
            before = by_name.get(row["name"])
        if before is not None:
            matched.append((row, before))
    return matched
