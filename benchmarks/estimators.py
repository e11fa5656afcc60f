"""Speed of the compiled engine against filterpy on the same data in the same run, and of an hour.

Run: python benchmarks/estimators.py
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable

import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.estimators.wang2025.ekf_suspension import (
    EkfSuspensionParameters,
    drive_force,
    suspension_model,
)
from roadlog.estimators.wang2025.suspension_ekf import filter_suspension
from roadlog.filters.rls import Regression, rls
from roadlog.simulate import simulate

HOUR = 360_000  # samples at 100 Hz
SHARED = 10_000  # samples that both engines run
METHODS = (
    "incl_kinematic",
    "ls_window",
    "rls_forget",
    "ti",
    "pn",
    "ti_rls",
    "ekf_suspension",
    "lowpass_attitude",
    "ls_attitude",
    "fuel_level",
)
CITY_METHODS = ("static_slope", "kasaba", "grade_pitch_ekf")  # on a drive with stops, best of 3


def best(run: Callable[[], object], times: int = 3) -> float:
    """s, the shortest of some runs; the first one compiles and does not count."""
    run()
    durations = []
    for _ in range(times):
        started = time.perf_counter()
        run()
        durations.append(time.perf_counter() - started)
    return min(durations)


def hour_of(drive: Drive) -> Drive:
    """An hour of the same again and again."""
    copies = -(-HOUR // len(drive))
    signals = {role: np.tile(values, copies)[:HOUR] for role, values in drive.signals.items()}
    return Drive(np.arange(HOUR) / 100.0, 0, 100.0, signals, {})


def main() -> None:
    """Print ratios and seconds as JSON."""
    simulation = simulate("wang2025-up9")
    short = Drive.from_tables(simulation.tables)
    signals = {role: values[:SHARED] for role, values in short.signals.items()}
    short = Drive(short.time[:SHARED], 0, 100.0, signals, {})
    u = np.sin(np.arange(SHARED) / 50)
    regression = Regression(-u, np.full(SHARED, -4.9), 0.01 * u, np.ones(SHARED, np.bool_))
    n = min(SHARED, len(short.speed))
    model = suspension_model(
        simulation.vehicle,
        EkfSuspensionParameters(),
        0.01,
        short.speed[:n],
        short["imu.accel_x"][:n],
        drive_force(short, simulation.vehicle)[:n],
    )
    ratios = {}
    for name, run in (
        ("rls", lambda engine: rls(regression, 0.97, 1e4, 1e2, engine)),
        ("ekf", lambda engine: filter_suspension(model, engine)),
    ):
        compiled, reference = (best(lambda e=e, r=run: r(e)) for e in ("compiled", "reference"))
        ratios[name] = round(reference / compiled, 1)
    hour = hour_of(short)
    seconds = {}
    for method in METHODS:
        estimators.run(method, short, simulation.vehicle)  # compiles
        started = time.perf_counter()
        estimators.run(method, hour, simulation.vehicle)
        seconds[method] = round(time.perf_counter() - started, 3)
    city = simulate("city")
    streets = hour_of(Drive.from_tables(city.tables))
    for method in CITY_METHODS:
        run = lambda m=method: estimators.run(m, streets, city.vehicle)  # noqa: E731
        seconds[method] = round(best(run), 3)
    total = round(sum(seconds.values()), 2)
    result = {"times_filterpy": ratios, "hour_s": seconds, "hour_total_s": total}
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
