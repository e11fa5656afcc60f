"""Does each standard deviation say the truth: coverage and NEES over scenarios and seeds.

Writes docs/consistency.md. Run: python benchmarks/consistency.py [JOBS [SEEDS]]
"""

from __future__ import annotations

import sys
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.log import AngleTrack
from roadlog.metrics import angle_errors, angle_metrics
from roadlog.signals import ANGLES, TRUTH_TOPIC
from roadlog.simulate import simulate

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
HEAD = """# Consistency

Is a standard deviation what it says? Over {count} simulated drives with sensor errors ({seeds}
seeds of {scenarios} scenarios, the full car): the share of valid samples whose true angle lies
within 2 sd, and the mean squared error over the variance (NEES; 1 is exact). A normal error with an
exact sd gives 95 % and 1. Sensor biases are drawn once a drive, so a drive's whole error is often
one number: the last columns show the worst and the best drive. Made by
`benchmarks/consistency.py`.

| estimator | angle | within 2 sd | NEES | worst drive | best drive |
|---|---|---|---|---|---|
"""

Row = tuple[str, str, float, float, int]


def one_drive(job: tuple[tuple[str, bool], int]) -> list[Row]:
    """(estimator, angle, share within 2 sd, NEES, samples) of every estimator on one drive."""
    (name, full), seed = job
    simulation = simulate(name, seed=seed, full=full)
    drive = Drive.from_tables(simulation.tables)
    truth = AngleTrack.from_table(simulation.table(TRUTH_TOPIC))
    rows = []
    for estimator in estimators.all_estimators():
        if estimator.missing(drive):
            continue
        estimate = estimators.run(estimator.name, drive, simulation.vehicle)
        track = AngleTrack.from_table(estimate.tables(drive)[0])
        for angle in ANGLES:
            errors = angle_errors(track, truth, angle)
            if errors is None:
                continue
            found = angle_metrics(errors, angle)
            if found.within_2sd is not None and found.nees is not None:
                rows.append((estimator.name, angle, found.within_2sd, found.nees, found.n))
    return rows


def main() -> None:
    """Write the page."""
    jobs = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 3
    work = list(product(SCENARIOS, range(1, seeds + 1)))
    shares: dict[tuple[str, str], list[tuple[float, float, int]]] = defaultdict(list)
    with ProcessPoolExecutor(jobs) as pool:
        for rows in pool.map(one_drive, work):
            for name, angle, within, nees, n in rows:
                shares[name, angle].append((within, nees, n))
    lines, outside = [], []
    for name, angle in product(estimators.TABLE, ANGLES):
        found = np.array(shares.get((name, angle), []))
        if not len(found):
            continue
        within, nees = np.average(found[:, :2], axis=0, weights=found[:, 2])
        lines.append(
            f"| `{name}` | {angle} | {100 * within:.1f} % | {nees:.2f} "
            f"| {100 * found[:, 0].min():.0f} % | {100 * found[:, 0].max():.0f} % |"
        )
        if not LOW <= within <= HIGH:
            kind = "too careful" if within > HIGH else "too sure"
            outside.append(f"- `{name}` {angle}: {100 * within:.1f} %, {kind}.")
    text = HEAD.format(count=len(work), seeds=seeds, scenarios=len(SCENARIOS)) + "\n".join(lines)
    text += f"\n\nOutside {100 * LOW:.0f} to {100 * HIGH:.0f} %:\n\n" + "\n".join(outside) + "\n"
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
