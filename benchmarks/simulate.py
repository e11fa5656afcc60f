"""How much faster than real time the full car drives on one core, and what compiling costs.

Run: python benchmarks/simulate.py [--json]
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time

from roadlog.simulate import SCENARIOS, simulate
from roadlog.simulate.full import drive_full

DRIVES = ("luo2024-s3", "ryu2004-slalom", "mountain", "city")
ONE_DRIVE = (
    "import time; t = time.process_time();"
    "from roadlog.simulate import simulate; simulate('luo2024-road1');"
    "print(time.process_time() - t)"
)


def seconds(run: object, times: int = 3) -> float:
    """CPU s, the shortest of some runs."""
    durations = []
    for _ in range(times):
        started = time.process_time()
        run()  # type: ignore[operator]
        durations.append(time.process_time() - started)
    return min(durations)


def in_a_new_process(cache: str) -> float:
    """CPU s of one short drive, imports and compilation included."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    done = subprocess.run(
        [sys.executable, "-c", ONE_DRIVE],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    return float(done.stdout)


def main() -> None:
    """Print a table, or JSON."""
    with tempfile.TemporaryDirectory() as cache:
        first, later = in_a_new_process(cache), in_a_new_process(cache)
    rows = {}
    simulate("luo2024-road1")  # compiled or loaded
    for name in DRIVES:
        duration = drive_full(SCENARIOS[name], 1).time[-1]
        car = seconds(lambda name=name: drive_full(SCENARIOS[name], 1))
        whole = seconds(lambda name=name: simulate(name), 1)
        rows[name] = {
            "drive_s": round(float(duration), 1),
            "car_times_real_time": round(float(duration / car), 1),
            "with_sensors_times_real_time": round(float(duration / whole), 1),
        }
    result = {"first_run_s": round(first, 1), "cached_run_s": round(later, 1), "drives": rows}
    if "--json" in sys.argv:
        print(json.dumps(result))
        return
    print(f"first run, compiling: {first:.1f} s CPU; from the cache: {later:.1f} s")
    for name, row in rows.items():
        print(
            f"{name:16s} {row['drive_s']:7.1f} s  car {row['car_times_real_time']:6.1f}x real time,"
            f" with sensors {row['with_sensors_times_real_time']:6.1f}x"
        )


if __name__ == "__main__":
    main()
