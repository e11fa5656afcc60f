"""Hours of driving: time and memory of `roadlog estimate` with every estimator, and how they grow.

A five-minute pass with sensors is driven again and again. Run: python benchmarks/long.py [HOURS]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from roadlog.log import create
from roadlog.simulate import simulate
from roadlog.storage import Table

HOURS = (1.0, 2.0, 5.0, 10.0)


def tiled(table: Table, times: int, period_ns: int) -> Table:
    """The same rows over and over, each time a drive later."""
    shifts = np.repeat(np.arange(times) * period_ns, len(table))
    columns = {name: np.tile(values, times) for name, values in table.columns.items()}
    return replace(table, time=np.tile(table.time, times) + shifts, columns=columns)


def measured(command: list[str]) -> tuple[float, float]:
    """Wall s and peak resident MB of a command."""
    started = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{' '.join(command)} ended with status {status}")
    return time.perf_counter() - started, usage.ru_maxrss / 1024


def main() -> None:
    """Print a table: hours, size of the log, seconds, memory."""
    hours = [float(text) for text in sys.argv[1:]] or HOURS
    simulation = simulate("mountain")
    inputs = [table for table in simulation.tables if not table.topic.startswith("/truth/")]
    period = max(int(table.time[-1] - table.time[0]) for table in inputs) + 10_000_000
    print(f"{'hours':>6} {'log MB':>8} {'estimate s':>11} {'peak MB':>8} {'result MB':>10}")
    for duration in hours:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "long.mcap"
            times = max(1, round(duration * 3600e9 / period))
            create(path, [tiled(t, times, period) for t in inputs], {}, simulation.vehicle)
            size = path.stat().st_size / 1e6
            command = [sys.executable, "-m", "roadlog", "estimate", str(path)]
            seconds, memory = measured(command)
            result = path.stat().st_size / 1e6
        print(
            f"{duration:6.1f} {size:8.0f} {seconds:11.1f} {memory:8.0f} {result:10.0f}", flush=True
        )


if __name__ == "__main__":
    main()
