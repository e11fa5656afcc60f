"""Roads out of drives: accuracy and coverage by number of drives, and what merging costs.

Run: PYTHONPATH=tests python benchmarks/roads.py [--cost]
"""

from __future__ import annotations

import resource
import sys
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from support.mountain_road import drive_over, driven, errors, mountain_road

from roadlog.roads.merge import roads
from roadlog.roads.model import RoadModel
from roadlog.roads.passes import Pass

PAIRS = 10  # of drives each way
ONE_WAY = 20


def rms(values: np.ndarray) -> float:
    """deg."""
    return float(np.degrees(np.sqrt(np.mean(values**2))))


def row(label: str, sets: Sequence[Sequence[Pass]], road: RoadModel) -> str:
    """One line of the table: medians and worst over several sets of drives, shares over all."""
    grade, bank, mean, within, aside, height = [], [], [], [], [], []
    for passes in sets:
        model = max(roads(passes), key=lambda m: m.length)
        off = errors(model, road)
        grade.append(rms(off["grade"]))
        bank.append(rms(off["bank"]))
        mean.append(float(np.degrees(off["bank"].mean())))
        aside.append(float(np.sqrt(np.mean(off["offset"] ** 2))))
        height.append(float(np.std(off["z"])))
        sds = [getattr(model, f"{a}_sd")[: len(off[a])] for a in ("grade", "bank")]
        within.append(
            [
                float(np.mean(np.abs(off[a]) < k * sd))
                for k in (1, 2)
                for a, sd in zip(("grade", "bank"), sds, strict=True)
            ]
        )
    share = np.mean(within, axis=0)
    worst = np.argmax(np.abs(mean))
    return (
        f"{label:24} {len(sets):3} {np.median(grade):6.3f} {max(grade):6.3f} "
        f"{np.median(bank):6.3f} {max(bank):6.3f} {mean[worst]:+7.3f} "
        + " ".join(f"{100 * part:4.0f}" for part in share)
        + f"  {np.median(aside):5.2f} {np.median(height):5.2f}"
    )


def accuracy(seed: int = 0) -> None:
    """The table of docs/roads.md, on the road of a seed."""
    road = mountain_road(3000.0, seed)
    there = [drive_over(road, k, True) for k in range(ONE_WAY)]
    back = [drive_over(road, 100 + k, False) for k in range(PAIRS)]
    others = [drive_over(road, 200 + k, True, car=k) for k in range(1, 9)]
    print(
        f"road of seed {seed}; deg; shares in % within 1 and 2 sd of grade and bank; the line and"
    )
    print("the elevation without its mean in m rms")
    print(
        f"{'drives':24} {'n':>3} {'grade':>6} {'max':>6} {'bank':>6} {'max':>6} {'mean':>7}", end=""
    )
    print("  g 1  b 1  g 2  b 2   line     z")
    print(row("1", [[one] for one in there[:PAIRS]], road))
    print(row("5, one direction", [there[k : k + 5] for k in range(0, ONE_WAY, 5)], road))
    print(row("20, one direction", [there], road))
    print(row("1 each way", [[there[k], back[k]] for k in range(PAIRS)], road))
    print(row("2 each way", [[*there[k : k + 2], *back[k : k + 2]] for k in range(0, 10, 2)], road))
    print(row("4 each way", [[*there[k : k + 4], *back[k : k + 4]] for k in (0, 4)], road))
    print(row("1 of 8 cars", [[one] for one in others], road))
    fours = [[others[(k + j) % 8] for j in (0, 1, 3, 6)] for k in range(8)]
    print(row("4 cars, one direction", fours, road), flush=True)


def cost() -> None:
    """CPU s and peak memory of merging drives of 10 km."""
    road = mountain_road(10_000.0)
    passes = [driven(road, k, forward=k % 2 == 0) for k in range(100)]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    for count in (1, 5, 20, 100):
        began = time.process_time()
        models = roads([replace(own) for own in passes[:count]])
        took = time.process_time() - began
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{count:4} drives of 10 km: {took:6.2f} s of CPU, {1000 * took / count:5.0f} ms a "
            f"drive; peak {peak:.0f} MB, {before:.0f} of them before; {len(models)} road(s)"
        )


if __name__ == "__main__":
    cost()
    if "--cost" not in sys.argv:
        for road_seed in range(3):
            accuracy(road_seed)
