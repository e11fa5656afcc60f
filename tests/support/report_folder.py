"""A folder of small drives for reports: good ones, corrupt ones, and one that kills its worker."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

from support.drives import hill_tables

from roadlog.car.vehicle import Vehicle
from roadlog.log import create


def fill_folder(folder: Path, good: int = 35) -> Path:
    """`good` drives, four corrupt logs, and one whose car the estimator `level` dies of."""
    folder.mkdir()
    create(folder / "good00.mcap", hill_tables(duration=8.0, rate=20.0))
    content = (folder / "good00.mcap").read_bytes()
    for k in range(1, good):
        (folder / f"good{k:02d}.mcap").write_bytes(content)
    (folder / "bad0.mcap").write_bytes(b"")
    (folder / "bad1.mcap").write_bytes(b"this was never a drive log\n")
    (folder / "bad2.mcap").write_bytes(content[:20])
    (folder / "bad3.mcap").write_bytes(content[:8] + bytes(1000))
    killer = Vehicle().with_values(name="killer")
    create(folder / "killer.mcap", hill_tables(duration=8.0, rate=20.0), vehicle=killer)
    return folder


def read_rows(report: Path) -> list[dict[str, Any]]:
    """Rows that a report's folder holds, finished lines only."""
    path = report / "rows.jsonl"
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text().splitlines(True) if line.endswith("\n")]


def statuses(rows: list[dict[str, Any]]) -> Counter:
    """How many rows of each status."""
    return Counter(row["status"] for row in rows)
