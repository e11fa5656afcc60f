"""Everything that numba compiles, compiled before anyone waits for it: for containers and CI.

Each task runs in a process of its own: numba compiles under one lock. What it leaves are plain
files in the cache, which every later process reads.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

import numpy as np

from roadlog import processes
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.signals import SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

PROCESSES = 2
# task -> estimators; in the order in which they are begun, the longest first
ESTIMATORS = {
    "fusion": ("fusion",),
    "unscented filters": ("tfobe", "debe"),
    "other estimators": (
        "kmbe",
        "ekf_suspension",
        "roll_bank_obs",
        "static_slope",
        "grade_pitch_ekf",
        "rls_forget",
    ),
}
TASKS = (*ESTIMATORS, "simulator", "text files")


def warm() -> Iterator[Callable[[], None]]:
    """Begin all tasks; for each of them what waits until one more is done.

    Raises RoadlogError naming a task that did not compile.
    """
    pool = ThreadPoolExecutor(PROCESSES)
    try:
        ended = as_completed([pool.submit(_run, task) for task in TASKS])
        for _ in TASKS:
            yield lambda: next(ended).result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _run(task: str) -> None:
    command = [sys.executable, "-m", "roadlog.warmup", task]
    with processes.child(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as child:
        _, said = child.communicate()
    if child.returncode:
        last = said.decode(errors="replace").strip().rpartition("\n")[2]
        raise RoadlogError(f"{task}: did not compile: {last}")


def exercise(task: str) -> None:
    """Call every kernel of a task once."""
    if task == "simulator":
        from roadlog.simulate import simulate

        simulate("luo2024-road1")
        simulate("ryu2004-slalom", full=True)
    elif task == "text files":
        from roadlog.ingest.sources import ingest

        with tempfile.TemporaryDirectory() as folder:
            source = Path(folder, "speed.csv")
            source.write_text("time,v\n" + "".join(f"{k / 10},{k % 7}\n" for k in range(99)))
            profile = Path(folder, "speed.toml")
            profile.write_text(
                '[time]\ncolumn = "time"\n[speed]\nv = { from = "v", unit = "m/s" }\n'
            )
            ingest([source], profile)
    else:
        from roadlog import estimators
        from roadlog.car.vehicle import Vehicle

        drive = short_drive()
        for name in ESTIMATORS[task]:
            estimators.run(name, drive, Vehicle(imu_position=(0.3, 0.0, -0.2)))


def short_drive() -> Drive:
    """Forty seconds with every signal that an estimator takes: a stop, a start, a bend, a stop."""
    t = np.arange(4001) / 100.0
    v = np.interp(t, [0.0, 8.0, 16.0, 24.0, 32.0, 40.0], [0.0, 0.0, 12.0, 12.0, 0.0, 0.0])
    forward, turning = np.gradient(v, t), 0.1 * np.sin(0.5 * t) * (v > 0)
    still = np.zeros(len(t))
    wheels = ("fl", "fr", "rl", "rr")
    torque = 1600.0 * 0.31 * forward
    position = np.cumsum(v) / 100.0 / 6.4e6
    columns: dict[str, dict[str, Floats]] = {
        "imu": {
            "accel_x": forward,
            "accel_y": v * turning,
            "accel_z": still + G,
            **dict.fromkeys(("gyro_x", "gyro_y"), still),
            "gyro_z": turning,
        },
        "wheel_speeds": dict.fromkeys(wheels, v),
        "steering": {"road_wheel_angle": turning * 2.7 / np.maximum(v, 1.0)},
        "wheel_torques": {
            **{f"drive_{w}": np.maximum(torque, 0.0) / 4 for w in wheels},
            **{f"brake_{w}": np.maximum(-torque, 0.0) / 4 for w in wheels},
        },
        "gnss": {
            "latitude": np.degrees(position),
            "longitude": still,
            **dict.fromkeys(("altitude", "climb", "course", "heading", "roll"), still),
            "speed": v,
        },
        "barometer": {"altitude": still},
    }
    time = np.round(t * 1e9).astype(np.int64)
    tables = []
    for name, values in columns.items():
        section = SECTIONS[name]
        tables.append(Table(section.topic, section.schema, time, values))
    return Drive.from_tables(tables)


if __name__ == "__main__":
    exercise(sys.argv[1])
