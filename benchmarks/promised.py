"""Whether `info`'s expected accuracy holds, on drives that its figures are not of.

    python benchmarks/promised.py > promised.csv

`fusion` on drives of every scenario with what people bring: see `CASES`; an IMU that nobody says
how it lies leans by a normal 1.5 deg. Printed: RMS error expected and found, deg; at the end, on
stderr, the share of drives within it, and within twice.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from outlook import LEAN, known_car, logged

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.outlook import Manner, SensorSet, outlook
from roadlog.rotation import from_rpy
from roadlog.signals import AXES, IMU_TOPIC, SEPARATED, TRUTH_TOPIC
from roadlog.simulate import Simulation, simulate
from roadlog.storage import Table

DRIVES = {
    "mountain": (11, 12, 13),
    "city": (1, 2),
    "kim2023-urban": (1, 2),
    "kim2023-testroad": (1,),
    "luo2024-s1": (5,),
    "luo2024-s2": (1, 2),
    "luo2024-s3": (5,),
    "luo2024-s3b": (1, 2),
    "luo2024-road1": (1, 2),
    "luo2024-road2": (1,),
    "luo2024-helix": (1, 2),
    "luo2024-stopgo": (1, 2),
    "ryu2004-laps": (1, 2),
    "ryu2004-laps-var": (1,),
    "ryu2004-slalom": (1, 2),
    "wang2025-up9": (5,),
    "wang2025-down12": (1, 2),
    "massel2004-quasi": (1,),
    "massel2004-accel": (1, 2),
}
CASES = {
    "receiver": SensorSet(gnss=True, steady=True),
    "speed": SensorSet(steady=True),
    "phone": SensorSet(gnss=True),
    "mounted": SensorSet(gnss=True, steady=True, mounted=True),
    "all": SensorSet(
        antennas=True, gnss=True, torque=True, springs=True, steady=True, mounted=True
    ),
}


def main() -> None:
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(
        ["scenario", "seed", "case", *(f"{a}_{w}" for w in ("exp", "rms") for a in SEPARATED)]
    )
    ratios = []
    for name, seeds in DRIVES.items():
        for seed in seeds:
            made = _drive(name, seed)
            for case, sensors in CASES.items():
                expected, found = compared(made, sensors, seed)
                out.writerow([name, seed, case, *(f"{x:.3f}" for x in (*expected, *found))])
                ratios.append(found / expected)
    shares = (
        f"{np.mean(np.array(ratios) <= limit):.0%} within {limit:g} times" for limit in (1, 1.5, 2)
    )
    print(", ".join(shares), file=sys.stderr)


def _drive(name: str, seed: int) -> Simulation:
    """With the full car where there is one."""
    try:
        return simulate(name, seed=seed, full=True)
    except RoadlogError:
        return simulate(name, seed=seed)


def compared(made: Simulation, sensors: SensorSet, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """RMS errors of grade, bank, pitch and roll, deg: expected, found."""
    truth = next(table for table in made.tables if table.topic == TRUTH_TOPIC)
    tables = logged(made.tables, replace(sensors, mounted=True), seed)
    if not sensors.mounted:
        tables = leaning(
            tables, LEAN * np.random.default_rng([seed, len(made.tables)]).normal(size=2)
        )
    drive = Drive.from_tables(tables)
    car = known_car(made.vehicle, sensors)
    promised = outlook(SensorSet.of(drive, car), ["fusion"], manner=Manner.of(drive))
    estimate = estimators.run("fusion", drive, car)
    time = (truth.time - drive.start_ns) * 1e-9
    found = [
        np.sqrt(
            np.mean(
                (estimate.angles[a] - np.interp(estimate.time, time, truth.columns[a]))[
                    estimate.valid
                ]
                ** 2
            )
        )
        for a in SEPARATED
    ]
    return np.array([one.accuracy_deg for one in promised]), np.degrees(found)


def leaning(tables: Iterator[Table], lean: np.ndarray) -> Iterator[Table]:
    """With an IMU that leans in roll and pitch, deg."""
    turned = from_rpy(*np.radians((*lean, 0.0)))
    for table in tables:
        columns = dict(table.columns)
        for kind in ("accel", "gyro") if table.topic == IMU_TOPIC else ():
            rows = turned @ np.stack([columns[f"{kind}_{axis}"] for axis in AXES])
            columns |= {f"{kind}_{axis}": row for axis, row in zip(AXES, rows, strict=True)}
        yield replace(table, columns=columns)


if __name__ == "__main__":
    main()
