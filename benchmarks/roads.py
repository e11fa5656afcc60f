"""Roads out of drives: accuracy and coverage by number of drives, and what merging costs.

Run: PYTHONPATH=tests python benchmarks/roads.py [--cost] [--kept FOLDER] [SEED ...]

A seed's 38 drives take 3 minutes to simulate and estimate. In FOLDER their passes are kept, so that
a run that was ended goes on; they are of the code that made them.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

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


COLUMNS = (
    f"{'drives':24} {'n':>3} {'grade':>6} {'max':>6} {'bank':>6} {'max':>6} {'mean':>7}"
    "  g 1  b 1  g 2  b 2  grade   bank   line     z"
)


def row(label: str, sets: Sequence[Sequence[Pass]], road: RoadModel) -> str:
    """One line of the table: medians and worst over several sets of drives, shares over all."""
    found, mean, within = [], [], []
    for passes in sets:
        model = max(roads(passes), key=lambda m: m.length)
        off = errors(model, road)
        angles = [rms(off[a]) for a in ("grade", "bank", "grade_there", "bank_there")]
        found.append(
            [*angles, float(np.sqrt(np.mean(off["offset"] ** 2))), float(np.std(off["z"]))]
        )
        mean.append(float(np.degrees(off["bank"].mean())))
        sds = [getattr(model, f"{a}_sd")[: len(off[a])] for a in ("grade", "bank")]
        within.append(
            [
                float(np.mean(np.abs(off[a]) < k * sd))
                for k in (1, 2)
                for a, sd in zip(("grade", "bank"), sds, strict=True)
            ]
        )
    middle, most = np.median(found, axis=0), np.max(found, axis=0)
    return (
        f"{label:24} {len(sets):3} {middle[0]:6.3f} {most[0]:6.3f} {middle[1]:6.3f} {most[1]:6.3f} "
        f"{mean[np.argmax(np.abs(mean))]:+7.3f} "
        + " ".join(f"{100 * part:4.0f}" for part in np.mean(within, axis=0))
        + f" {middle[2]:6.3f} {middle[3]:6.3f}  {middle[4]:5.2f} {middle[5]:5.2f}"
    )


def drive(
    seed: int, road: RoadModel, number: int, forward: bool, car: int, kept: Path | None
) -> Pass:
    """One drive over the road of a seed, out of `kept` where it is there."""
    path = kept / f"{seed}-{number}-{forward}-{car}.npz" if kept else None
    if path is not None and path.exists():
        return Pass.from_bytes(path.read_bytes())
    own = drive_over(road, number, forward, car)
    if path is not None:
        path.write_bytes(own.to_bytes())
    return own


def accuracy(seed: int, kept: Path | None) -> None:
    """The table of docs/roads.md, on the road of a seed."""
    road = mountain_road(3000.0, seed)
    there = [drive(seed, road, k, True, 0, kept) for k in range(ONE_WAY)]
    back = [drive(seed, road, 100 + k, False, 0, kept) for k in range(PAIRS)]
    others = [drive(seed, road, 200 + k, True, k, kept) for k in range(1, 9)]
    print(f"road of seed {seed}; deg rms, against the road's table; shares in % within 1 and 2 sd")
    print("of grade and bank; both against the surface below the merged line; the line and the")
    print("elevation without its mean, in m rms")
    print(COLUMNS)
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cost", action="store_true", help="only what merging costs")
    parser.add_argument("--kept", type=Path, metavar="FOLDER")
    parser.add_argument("seeds", type=int, nargs="*", metavar="SEED")
    given = parser.parse_args()
    if given.cost or not given.seeds:
        cost()
    if not given.cost:
        for seed in given.seeds or range(3):
            accuracy(seed, given.kept)


if __name__ == "__main__":
    main()
