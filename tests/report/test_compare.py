"""What got better and worse between two reports."""

import csv
from pathlib import Path
from typing import Any

import pytest

from roadlog.report.compare import FLOOR, compare
from roadlog.report.row import Options, empty_row
from roadlog.report.sources import FoundLog


def row(log: str, status: str = "ok", **rmse: float) -> dict[str, Any]:
    """A row with RMSEs of the grade, by estimator."""
    made = empty_row(FoundLog(log, Path(log).name, 1, "1"), Options()) | {"status": status}
    return made | {"angles": {name: {"grade": {"rmse_deg": v}} for name, v in rmse.items()}}


def compared(now: list[dict], before: list[dict], threshold: float = 0.1) -> Any:
    return compare(now, {r["log"]: r for r in before}, "other", threshold)


def test_changes_beyond_the_threshold_count() -> None:
    before = [row("a/1.mcap", fusion=0.20, kmbe=0.50), row("a/2.mcap", fusion=0.20)]
    now = [row("a/1.mcap", fusion=0.23, kmbe=0.40), row("a/2.mcap", fusion=0.215)]
    found = compared(now, before)
    assert (found.logs, found.compared, found.worse, found.better) == (2, 3, 1, 1)
    worse, better = found.changes
    assert (worse.name, worse.estimator, worse.worse) == ("1.mcap", "fusion", True)
    assert worse.text == "+0.030 deg, +15 %"
    assert (better.estimator, better.worse) == ("kmbe", False)
    assert compared(now, before, threshold=0.2).changes == []


def test_tiny_changes_of_tiny_errors_are_none() -> None:
    assert not compared([row("1", fusion=0.001 + FLOOR)], [row("1", fusion=0.001)]).changes
    assert compared([row("1", fusion=0.003 + FLOOR)], [row("1", fusion=0.001)]).worse == 1


def test_what_is_gone_is_worse() -> None:
    before = [row("1", fusion=0.1, kmbe=0.1), row("2", fusion=0.1), row("3", "failed")]
    now = [row("1", fusion=0.1), row("2", "failed"), row("3", fusion=0.1)]
    found = compared(now, before)
    assert [(c.name, c.text, c.worse) for c in found.changes] == [
        ("1", "no estimate any more", True),
        ("2", "ok before, now failed", True),
        ("2", "no estimate any more", True),
        ("3", "failed before, now ok", False),
    ]


@pytest.mark.parametrize(
    ("now", "before", "logs"),
    [
        (["/x/a.mcap"], ["/y/a.mcap"], 1),  # the same folder on another machine
        (["/x/1/a.mcap", "/x/2/a.mcap"], ["/y/1/a.mcap"], 0),  # which of them?
        (["/x/a.mcap"], ["/y/b.mcap"], 0),
    ],
)
def test_logs_are_matched_by_path_or_by_unique_name(
    now: list[str], before: list[str], logs: int
) -> None:
    assert compared([row(n) for n in now], [row(n) for n in before]).logs == logs


def test_all_changes_are_in_the_file(tmp_path: Path) -> None:
    before, now = ([row(f"{k}", fusion=v) for k in range(300)] for v in (0.1, 0.2))
    compared(now, before).write(tmp_path)
    with (tmp_path / "comparison.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 300
    assert rows[0]["worse"] == "True"
