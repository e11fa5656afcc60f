"""What accuracy a log's sensors give: roadlog/outlook.csv, measured.

    python benchmarks/outlook.py > roadlog/outlook.csv

`fusion` on simulated drives of the full car with the errors of its sensors, with what a log may
lack left out: receivers and torques, a steady IMU (else shaken, as a phone's is), the knowledge of
the springs and of how the IMU lies (else leaning by 1.5 deg in roll and pitch, to either side).
Printed: RMS error in deg over the valid samples of all drives, mean error included.
"""

from __future__ import annotations

import csv
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import astuple, fields, replace
from itertools import product

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.outlook import SensorSet
from roadlog.rotation import from_rpy
from roadlog.signals import AXES, IMU_TOPIC, SECTIONS, SEPARATED, TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.storage import Table

# whether they turn: the mean of grade is seen in bends where nothing else tells it
DRIVES = {
    True: [("mountain", 1), ("mountain", 2), ("luo2024-s3", 1)],
    False: [(name, seed) for name in ("luo2024-s1", "wang2025-up9") for seed in (1, 2)],
}
YES_NO = (True, False)
SETS = [
    SensorSet(antennas=True, gnss=True, torque=True),
    SensorSet(gnss=True, torque=True),
    SensorSet(gnss=True),
    SensorSet(torque=True),
    SensorSet(),
]
SHAKE = {"accel": 0.06, "gyro": 0.0015}  # per sqrt(Hz), of phones in driving cars
STANDING = 0.05  # of it in a car that stands
LEAN = 1.5  # deg


def logged(tables: Iterable[Table], sensors: SensorSet, seed: int) -> Iterator[Table]:
    """The inputs that a log with these sensors has."""
    tables = list(tables)
    lacking = {SECTIONS["barometer"].topic, TRUTH_TOPIC}
    if not sensors.gnss:
        lacking.add(SECTIONS["gnss"].topic)
    if not sensors.torque:
        lacking |= {SECTIONS[name].topic for name in ("wheel_torques", "powertrain")}
    wheels = next(t for t in tables if t.topic == SECTIONS["wheel_speeds"].topic)
    for table in tables:
        if table.topic in lacking:
            continue
        by_antennas = () if sensors.antennas else ("roll", "heading")
        unknown = np.full(len(table), np.nan)
        hidden = {name: unknown for name in by_antennas if name in table.columns}
        if table.topic == IMU_TOPIC:
            moving = np.interp(table.time, wheels.time, wheels.columns["rl"]) > 0.5
            hidden |= dict(_as_worn(table, moving, sensors, seed))
        yield replace(table, columns={**table.columns, **hidden})


def _as_worn(
    imu: Table, moving: np.ndarray, sensors: SensorSet, seed: int
) -> Iterator[tuple[str, np.ndarray]]:
    """Leaning and shaken as it is with these sensors."""
    sides = np.random.default_rng(seed).choice([-1.0, 1.0], 2)
    lean = (0.0, 0.0) if sensors.mounted else LEAN * sides
    turned = from_rpy(*np.radians((*lean, 0.0)))
    rng = np.random.default_rng(seed)
    rate = 1e9 / np.median(np.diff(imu.time))
    for kind, density in SHAKE.items():
        own = turned @ np.stack([imu.columns[f"{kind}_{axis}"] for axis in AXES])
        if not sensors.steady:
            size = density * np.sqrt(rate) * np.where(moving, 1.0, STANDING)
            own = own + size * rng.normal(size=own.shape)
        yield from ((f"{kind}_{axis}", row) for axis, row in zip(AXES, own, strict=True))


def known_car(sheet: Vehicle, sensors: SensorSet) -> Vehicle:
    """The vehicle file of a log with these sensors."""
    car = sheet if sensors.springs else Vehicle()
    sources = {name: source for name, source in car.sources.items() if name != "imu_mount"}
    car = replace(car, sources=sources)
    return car.with_stated_mounting() if sensors.mounted else car


def main() -> None:
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow([*(field.name for field in fields(SensorSet)), *SEPARATED])
    for turns, drives in DRIVES.items():
        squares = sum((sums(scenario, seed, turns) for scenario, seed in drives), Counter())
        for case in cases(turns):
            rms = (np.sqrt(squares[case, a] / squares[case, "count"]) for a in SEPARATED)
            out.writerow([*map(int, astuple(case)), *(f"{np.degrees(r):.2f}" for r in rms)])


def cases(turns: bool) -> Iterator[SensorSet]:
    """What a log of drives that turn, or do not, may have."""
    for steady, mounted, sensors, springs in product(YES_NO, YES_NO, SETS, YES_NO):
        same = {"springs": springs, "steady": steady, "mounted": mounted, "turns": turns}
        yield replace(sensors, **same)


def sums(scenario: str, seed: int, turns: bool) -> Counter:
    """(case, angle) -> squared errors of a drive in rad2, (case, "count") -> how many."""
    made = simulate(scenario, seed=seed, full=True)
    truth = next(table for table in made.tables if table.topic == TRUTH_TOPIC)
    found: Counter = Counter()
    for case in cases(turns):
        drive = Drive.from_tables(logged(made.tables, case, seed))
        time = (truth.time - drive.start_ns) * 1e-9
        estimate = estimators.run("fusion", drive, known_car(made.vehicle, case))
        valid = estimate.valid
        found[case, "count"] += int(valid.sum())
        for angle in SEPARATED:
            true = np.interp(estimate.time, time, truth.columns[angle])
            found[case, angle] += float(np.sum((estimate.angles[angle] - true)[valid] ** 2))
        if not valid.any():
            print(f"{scenario} {seed} {case}: not one valid sample", file=sys.stderr)
    return found


if __name__ == "__main__":
    main()
