"""Clocks that jump while a log is written."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from roadlog.checks.finding import Finding
from roadlog.signals import INPUTS
from roadlog.storage import Table

JUMP = 1.0  # s; no jitter of stamps is that large


def jumps(tables: Mapping[str, Table]) -> list[Finding]:
    """Clocks that were set back while driving, one finding for all channels that jump at once.

    What lies on both sides of such a jump is mixed in time, and no check of the motion can be
    believed.
    """
    there = [tables[s.topic] for s in INPUTS if s.topic in tables and len(tables[s.topic]) > 1]
    start = min((int(table.time[0]) for table in there), default=0)
    found: dict[tuple[int, int], list[str]] = {}
    for table in there:
        steps = np.diff(table.time)
        back = int(np.argmin(steps))
        if steps[back] < -JUMP * 1e9:
            size, at = -steps[back] * 1e-9, (table.time[back] - start) * 1e-9
            found.setdefault((round(size), round(at)), []).append(table.topic)
    return [
        Finding(
            "clock_jump",
            "fault",
            tuple(topics),
            f"the clock jumps back by {size} s",
            'cut the log there, or use another stamp ([time] clock = "header" or "publish")',
            float(at),
            float(size),
        )
        for (size, at), topics in found.items()
    ]
