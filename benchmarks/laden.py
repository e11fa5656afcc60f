"""Pitch, roll and bank of laden cars: load, mounting, springs and heights varied, both engines.

Prints one table. Run: python benchmarks/laden.py FIRST COUNT [JOBS]

FIRST, COUNT: seeds. The wagon drives `city` and the stops of `kim2023-testroad` as the full car;
the second engine is the simple truth of `wang2025-up9`, without bank and heights. A stated mounting
is drawn with 0.3 deg (1 sd), a loose one with 1 deg (yaw 2).
"""

from __future__ import annotations

import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from unseen import LOOSE_SD, STATED_SD

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.metrics import angle_errors, angle_metrics
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import LOADS, Simulation, simulate
from roadlog.storage import Table

# m/s2, of the accelerometer: the sensor of kim2023 itself is at three sd of the prior
ORDINARY = {"imu.accel_bias": (0.0, 0.0, 0.0), "imu.accel_bias_sd": 0.03}
DRIVES = (  # scenario, overrides, angles of the full car or of the simple truth
    ("city", {"duration": 120.0}, ("grade", "pitch", "inclination", "bank", "roll")),
    ("kim2023-testroad", {"speed.motions": 5}, ("grade", "pitch", "inclination", "bank", "roll")),
    ("wang2025-up9", {}, ("grade", "pitch", "inclination")),
)
ANGLES = DRIVES[0][2]
HEIGHTS = ("altitude", "climb", "vertical_accuracy", "climb_accuracy")


class Case(NamedTuple):
    """What is varied. load: of LOADS, or "none"."""

    load: str
    stated: bool
    springs: bool
    heights: bool

    def words(self) -> tuple[str, ...]:
        said = ("stated", "known", "yes")
        return self.load, *(w if on else "-" for w, on in zip(said, self[1:], strict=True))


class Found(NamedTuple):
    """One angle of one drive: square error in deg2, share within 2 sd, NEES."""

    case: Case
    angle: str
    figures: tuple[float, float, float]


def made(drive: int, load: str, stated: bool, seed: int) -> Simulation:
    """A drive with an IMU turned by chance."""
    scenario, overrides, angles = DRIVES[drive]
    rng = np.random.default_rng([seed, drive])
    turn = rng.standard_normal(3) * (STATED_SD if stated else LOOSE_SD)
    own = {**ORDINARY, **overrides, "imu.misalignment_deg": tuple(np.degrees(turn))}
    full, load_name = angles == ANGLES, None if load == "none" else load
    return simulate(scenario, seed=seed, full=full, load=load_name, overrides=own)


def told(sheet: Vehicle, case: Case) -> Vehicle:
    """What the estimator knows of the car."""
    vehicle = sheet if case.springs else Vehicle().with_values(imu_position=sheet.imu_position)
    if case.stated:
        return vehicle.with_stated_mounting(STATED_SD)
    sources = {name: source for name, source in vehicle.sources.items() if name != "imu_mount"}
    return replace(vehicle, sources=sources)


def without_heights(table: Table) -> Table:
    """The receiver's, as one that gives none."""
    return replace(table, columns={k: v for k, v in table.columns.items() if k not in HEIGHTS})


def estimated(job: tuple[int, str, bool, int]) -> list[Found]:
    """All that can be told of one simulated drive."""
    number, load, stated, _ = job
    simulation, angles = made(*job), DRIVES[number][2]
    truth = Estimate.from_table(simulation.table(TRUTH_TOPIC))
    found = []
    for springs, heights in product((True, False), (True, False) if angles == ANGLES else (False,)):
        case = Case(load, stated, springs, heights)
        tables = [
            t if heights or t.topic != "/gnss" else without_heights(t) for t in simulation.tables
        ]
        drive, vehicle = Drive.from_tables(tables), told(simulation.vehicle, case)
        estimate = estimators.run("fusion", drive, vehicle)
        for angle in angles:
            errors = angle_errors(estimate, truth, angle)
            if errors is not None and errors.valid.any():
                m = angle_metrics(errors, angle)
                square, near, nees = (m.rmse_deg or 0.0) ** 2, m.within_2sd or 0.0, m.nees or 0.0
                found.append(Found(case, angle, (square, near, nees)))
    return found


def main() -> None:
    """Print the table."""
    first, count = int(sys.argv[1]), int(sys.argv[2])
    jobs = int(sys.argv[3]) if len(sys.argv) > 3 else 2
    loads, both = ("none", *LOADS), (True, False)
    work = list(product(range(len(DRIVES)), loads, both, range(first, first + count)))
    groups: dict[tuple[Case, str], list[tuple[float, float, float]]] = defaultdict(list)
    with ProcessPoolExecutor(jobs) as pool:
        for of_one in pool.map(estimated, work):
            for case, angle, figures in of_one:
                groups[case, angle].append(figures)
    print("RMSE in deg, share within 2 sd, NEES\n")
    print(f"| load | mounting | springs | heights | {' | '.join(ANGLES)} |")
    print("|---" * (4 + len(ANGLES)) + "|")
    for case in (Case(*varied) for varied in product(loads, both, both, both)):
        cells = []
        for angle in ANGLES:
            square, within, nees = np.mean(groups[case, angle], axis=0)
            cells.append(f"{np.sqrt(square):.2f}, {100 * within:.0f} %, {nees:.2f}")
        print(f"| {' | '.join((*case.words(), *cells))} |")


if __name__ == "__main__":
    main()
