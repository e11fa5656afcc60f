"""What accuracy a set of sensors gives: the table of `roadlog/outlook.py`, measured.

    python benchmarks/outlook.py

`fusion` on simulated drives of the full car with the errors of its sensors, with what a log may
lack left out. Printed: RMS error in deg over the valid samples of all drives, mean error included.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.outlook import SensorSet
from roadlog.signals import SECTIONS, SEPARATED, TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.storage import Table

# whether they turn: the mean of grade is seen in bends where nothing else tells it
DRIVES = {
    True: [("mountain", 1), ("mountain", 2), ("luo2024-s3", 1), ("luo2024-s3", 2)],
    False: [(name, seed) for name in ("luo2024-s1", "wang2025-up9") for seed in (1, 2, 3)],
}
YES_NO = (True, False)
SETS = [
    SensorSet(antennas=True, gnss=True, torque=True),
    SensorSet(gnss=True, torque=True),
    SensorSet(gnss=True),
    SensorSet(torque=True),
    SensorSet(),
]


def logged(tables: Iterable[Table], sensors: SensorSet) -> Iterator[Table]:
    """The inputs that a log with these sensors has."""
    lacking = {SECTIONS["barometer"].topic, TRUTH_TOPIC}
    if not sensors.gnss:
        lacking.add(SECTIONS["gnss"].topic)
    if not sensors.torque:
        lacking |= {SECTIONS[name].topic for name in ("wheel_torques", "powertrain")}
    for table in tables:
        if table.topic in lacking:
            continue
        by_antennas = () if sensors.antennas else ("roll", "heading")
        unknown = np.full(len(table), np.nan)
        hidden = {name: unknown for name in by_antennas if name in table.columns}
        yield replace(table, columns={**table.columns, **hidden})


def main() -> None:
    for turns in DRIVES:
        measure([replace(s, springs=springs, turns=turns) for s in SETS for springs in YES_NO])


def measure(cases: list[SensorSet]) -> None:
    """Print a line of the table for each case; all of them turn, or none."""
    errors: dict[SensorSet, dict[str, list[np.ndarray]]] = {
        c: {a: [] for a in SEPARATED} for c in cases
    }
    for scenario, seed in DRIVES[cases[0].turns]:
        made = simulate(scenario, seed=seed, full=True)
        truth = next(table for table in made.tables if table.topic == TRUTH_TOPIC)
        for case in cases:
            drive = Drive.from_tables(logged(made.tables, case))
            time = (truth.time - drive.start_ns) * 1e-9
            car = made.vehicle if case.springs else Vehicle()
            found = estimators.run("fusion", drive, car)
            for angle in SEPARATED:
                right = np.interp(found.time, time, truth.columns[angle])
                errors[case][angle].append((found.angles[angle] - right)[found.valid])
    for case, by_angle in errors.items():
        rms = {a: np.degrees(np.sqrt(np.mean(np.concatenate(e) ** 2))) for a, e in by_angle.items()}
        print(f"    {shown(case)}: ({', '.join(f'{rms[a]:.2f}' for a in SEPARATED)}),", flush=True)


def shown(case: SensorSet) -> str:
    """As it stands in the table."""
    there = (f"{name}=True" for name, value in vars(case).items() if value)
    return f"Sensors({', '.join(there)})"


if __name__ == "__main__":
    main()
