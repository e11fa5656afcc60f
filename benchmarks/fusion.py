"""Engines of `fusion` on the same minute in the same run, and the cost of an hour.

Run: python benchmarks/fusion.py
"""

from __future__ import annotations

import json
import resource
import sys
import time

import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.simulate import simulate
from roadlog.storage import Table

MINUTE, HOUR = 60.0, 3600.0  # s
BREAK_NS = 10_000_000  # ns between two repetitions of a drive


def cut(table: Table, duration: float) -> Table:
    """The first seconds of a channel."""
    keep = (table.time - table.time[0]) * 1e-9 <= duration
    columns = {name: values[keep] for name, values in table.columns.items()}
    return Table(table.topic, table.schema, table.time[keep], columns)


def repeated(table: Table, times: int, duration_ns: int) -> Table:
    """The channel again and again: the smoother's cost does not depend on what is in it."""
    stamps = np.concatenate([table.time + k * (duration_ns + BREAK_NS) for k in range(times)])
    columns = {name: np.tile(values, times) for name, values in table.columns.items()}
    return Table(table.topic, table.schema, stamps, columns)


def seconds(drive: Drive, vehicle: object, engine: str = "compiled") -> float:
    """CPU time of one run: what else the machine does is not counted."""
    started = time.process_time()
    estimators.run("fusion", drive, vehicle, engine=engine)  # type: ignore[arg-type]
    return time.process_time() - started


def main() -> None:
    """Print a ratio, seconds and megabytes as JSON."""
    simulation = simulate("mountain")
    inputs = [table for table in simulation.tables if not table.topic.startswith("/truth")]
    minute = Drive.from_tables([cut(table, MINUTE) for table in inputs])
    seconds(minute, simulation.vehicle)  # compiles
    compiled = min(seconds(minute, simulation.vehicle) for _ in range(3))
    reference = seconds(minute, simulation.vehicle, "reference")
    duration = max(int(np.ptp(table.time)) for table in inputs)
    times = int(HOUR * 1e9 // duration) + 1
    hour = Drive.from_tables([cut(repeated(table, times, duration), HOUR) for table in inputs])
    half = Drive.from_tables([cut(repeated(table, times, duration), HOUR / 2) for table in inputs])
    half_s, hour_s = (seconds(drive, simulation.vehicle) for drive in (half, hour))
    unit = 1 if sys.platform == "darwin" else 1024
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
    result = {
        "minute_compiled_s": round(compiled, 3),
        "minute_reference_s": round(reference, 1),
        "times_reference": round(reference / compiled, 1),
        "half_hour_s": round(half_s, 2),
        "hour_s": round(hour_s, 2),
        "peak_mb": round(peak / 1e6),
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
