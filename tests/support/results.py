"""Results put into a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.drives import EPOCH_NS

from roadlog.storage import Table, update_log

TOPIC = "/estimates/a/angles"


def result(size: int, value: float = 0.01, topic: str = TOPIC) -> Table:
    speed = np.full(size, value)
    time = EPOCH_NS + np.arange(size) * 10**7
    columns = {"grade": speed, "flags": np.zeros(size, np.uint32), "valid": speed > 0}
    return Table(topic, "roadlog.v1.RoadAngles", time, columns)


def put(path: Path, *tables: Table, record: str = "1", **options: object) -> None:
    """Replace the estimate `a`."""
    update_log(
        path,
        tables,
        {"estimate/a": {"n": record}},
        drop=lambda topic: topic.startswith("/estimates/a/"),
        drop_metadata=lambda name: name == "estimate/a",
        **options,  # type: ignore[arg-type]
    )
