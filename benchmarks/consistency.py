"""How far off is each estimator, and does its standard deviation say so: drives with a truth.

Writes docs/consistency.md. Run: python benchmarks/consistency.py [JOBS [SEEDS]]
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.ingest import ingest
from roadlog.ingest.profile import states_mounting
from roadlog.metrics import AngleMetrics, angle_errors, angle_metrics
from roadlog.signals import ANGLES, TRUTH_TOPIC
from roadlog.simulate import simulate

SHARED = Path(__file__).parent.parent.parent / "shared" / "data"
PAGE = Path(__file__).parent.parent / "docs" / "consistency.md"
SCENARIOS = (  # and whether with the full car where the paper has a simple truth
    ("massel2004-accel", True),
    ("kim2023-testroad", True),
    ("luo2024-s1", False),
    ("luo2024-s2", False),
    ("luo2024-s3", False),
    ("luo2024-s3b", False),
    ("luo2024-helix", False),
    ("ryu2004-laps", False),
    ("ryu2004-slalom", False),
    ("wang2025-up9", True),
    ("wang2025-down12", True),
    ("mountain", False),
    ("city", False),
)
LOW, HIGH = 0.90, 0.99  # share within 2 sd that an honest, useful sd should reach
PUBLIC = {  # ../shared/data: sources, profile, databases, what the true grade is made of
    "comma2k19": (["comma2k19"], None, [], None),
    "canmod": (["canmod/*.MF4"], "canmod", ["canmod/canmod-gps.dbc"], "gnss"),
    "iphone, trip 1": (["iphone/sample_trip.csv"], "iphone", [], "gnss"),
    "iphone, trip 2": (["iphone/trip2_with_obd.csv"], "iphone", [], "gnss"),
}
HEAD = """# Accuracy and consistency

How far off is each estimator, and is its standard deviation what it says? This page is made by
`benchmarks/consistency.py`.

## Simulated drives

{count} drives with sensor errors ({seeds} seeds of {scenarios} scenarios, the full car): the RMS
error over the valid samples of all drives; the share of these whose true angle lies within 2 sd;
and the mean squared error over the variance (NEES; 1 is exact). A normal error with an exact sd
gives 95 % and 1. Sensor biases are drawn once a drive, so a drive's whole error is often one
number: the last columns show the worst and the best drive.

| estimator | angle | RMS, deg | within 2 sd | NEES | worst drive | best drive |
|---|---|---|---|---|---|---|
"""
REAL = """
## Real drives

Grade of the public drives: the standard deviation of its error in degrees, the mean (the unknown
mounting's, for the most part) taken off, and the share within 2 sd of the error as it is. The
minute of comma2k19 has a reference of its own; for the others it is the slope of the receiver's
altitude (`--truth-from gnss`), whose own error is counted in.

| estimator | {names} |
|---|{rules}|
"""

Row = tuple[str, str, float, float, float, int]


def compared(
    drive: Drive, truth: Estimate, vehicle: Vehicle
) -> Iterator[tuple[str, str, AngleMetrics]]:
    """Estimator, angle and how they compare, of all that can run."""
    for estimator in estimators.all_estimators():
        if estimator.missing(drive):
            continue
        estimate = estimators.run(estimator.name, drive, vehicle)
        for angle in ANGLES:
            errors = angle_errors(estimate, truth, angle)
            if errors is not None:
                yield estimator.name, angle, angle_metrics(errors, angle)


def simulated(job: tuple[tuple[str, bool], int]) -> list[Row]:
    """(estimator, angle, RMS deg, share within 2 sd, NEES, samples) on one drive."""
    (name, full), seed = job
    simulation = simulate(name, seed=seed, full=full)
    drive = Drive.from_tables(simulation.tables)
    truth = Estimate.from_table(simulation.table(TRUTH_TOPIC))
    return [
        (estimator, angle, found.rmse_deg, found.within_2sd, found.nees, found.n)
        for estimator, angle, found in compared(drive, truth, simulation.vehicle)
        if found.rmse_deg is not None and found.within_2sd is not None and found.nees is not None
    ]


def real(name: str) -> dict[str, str]:
    """Estimator -> cell of its grade on one public drive."""
    patterns, profile, databases, truth_from = PUBLIC[name]
    sources = [path for pattern in patterns for path in sorted(SHARED.glob(pattern))]
    result = ingest(
        sources, profile, [SHARED / database for database in databases], truth_from=truth_from
    )
    truth = Estimate.from_table(next(t for t in result.tables if t.topic == TRUTH_TOPIC))
    vehicle = Vehicle()
    if states_mounting(result.metadata["profile"]):
        vehicle = vehicle.with_stated_mounting()
    cells = {}
    for estimator, angle, found in compared(Drive.from_tables(result.tables), truth, vehicle):
        if angle == "grade" and found.std_deg is not None:
            within = "" if found.within_2sd is None else f" ({100 * found.within_2sd:.0f} %)"
            cells[estimator] = f"{found.std_deg:.2f}{within}"
    return cells


def main() -> None:
    """Write the page."""
    jobs = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    work = list(product(SCENARIOS, range(1, seeds + 1)))
    shares: dict[tuple[str, str], list[tuple[float, float, float, int]]] = defaultdict(list)
    with ProcessPoolExecutor(jobs) as pool:
        for rows in pool.map(simulated, work):
            for name, angle, *figures in rows:
                shares[name, angle].append(tuple(figures))
        on_public = dict(zip(PUBLIC, pool.map(real, PUBLIC), strict=True))
    lines, outside = [], []
    for name, angle in product(estimators.TABLE, ANGLES):
        found = np.array(shares.get((name, angle), []))
        if not len(found):
            continue
        square, within, nees = np.average(
            found[:, :3] ** np.array([2, 1, 1]), axis=0, weights=found[:, 3]
        )
        lines.append(
            f"| `{name}` | {angle} | {np.sqrt(square):.3g} | {100 * within:.1f} % | {nees:.2f} "
            f"| {100 * found[:, 1].min():.0f} % | {100 * found[:, 1].max():.0f} % |"
        )
        if not LOW <= within <= HIGH:
            kind = "too careful" if within > HIGH else "too sure"
            outside.append(f"- `{name}` {angle}: {100 * within:.1f} %, {kind}.")
    text = HEAD.format(count=len(work), seeds=seeds, scenarios=len(SCENARIOS)) + "\n".join(lines)
    text += f"\n\nOutside {100 * LOW:.0f} to {100 * HIGH:.0f} %:\n\n" + "\n".join(outside) + "\n"
    text += REAL.format(names=" | ".join(PUBLIC), rules="|".join(["---"] * len(PUBLIC)))
    for name in estimators.TABLE:
        cells = [on_public[drive].get(name, "-") for drive in PUBLIC]
        if set(cells) != {"-"}:
            text += f"| `{name}` | {' | '.join(cells)} |\n"
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
