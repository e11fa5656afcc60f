"""CPU time of this tree against an earlier commit, in turn, in the same run; and its growth.

The commit is checked out into a folder of its own; both trees read the same logs, each with a cache
of compiled code of its own. What is printed is a ratio: below 1 is faster, beside the goal.

Run: python benchmarks/against.py [--commit C] [--hours 1] [--only first steps long jobs]
[--estimators kmbe fusion all] [--growth [H ...]] [--peers]
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COMMIT = "7eb4060"
LENGTHS = (1.0, 2.0, 5.0, 10.0)  # h
FIRST = {"kmbe": 0.2, "fusion": 0.3, "all": 0.3}  # estimators from an empty cache, and the goal
# of a log: estimators, how often they run, and CPU s of the last time and peak MB on stdout
RUN = """
import resource, sys, time
from roadlog import estimators
from roadlog.errors import RoadlogError
from roadlog.log import DriveLog
log, names, times = DriveLog(sys.argv[1]), sys.argv[2], int(sys.argv[3])
for _ in range(times):
    drive, vehicle = log.drive(), log.vehicle
    begun = time.process_time()
    for name in estimators.TABLE if names == "all" else names.split(","):
        try:
            estimators.run(name, drive, vehicle)
        except RoadlogError:
            pass
print(time.process_time() - begun, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""
# us a step of the smoother of fusion: forward alone, and all of it
STEPS = """
import sys, time
from roadlog.log import DriveLog
log = DriveLog(sys.argv[1])
drive, vehicle = log.drive(), log.vehicle
try:
    from roadlog.estimators.fusion.bryson_frazier import filtered
    from roadlog.estimators.fusion.fit import fitted
    from roadlog.estimators.fusion.parameters import FusionParameters
    from roadlog.estimators.fusion.smoother import smooth
    fit = fitted(drive, vehicle, FusionParameters())
except ImportError:  # as it was called at 7eb4060
    from roadlog.estimators.fusion import _given
    from roadlog.estimators.fusion_priors import FusionParameters, mounting_prior
    from roadlog.estimators.fusion_smoother import filtered, smooth
    params = FusionParameters()
    fit = _given(drive, vehicle, params, mounting_prior(vehicle, params))
for _ in range(3):
    begun = time.process_time()
    filtered(fit.steps, fit.noise, fit.P0)
    forward = time.process_time() - begun
    smooth(fit.steps, fit.noise, fit.P0)
    whole = time.process_time() - begun - forward
print(1e6 * forward / len(fit.steps.speed), 1e6 * whole / len(fit.steps.speed))
"""


@dataclass(frozen=True)
class Tree:
    """Sources, and a cache of what they compile."""

    sources: Path
    cache: Path

    def measured(self, script: str, *arguments: object) -> tuple[float, ...]:
        """The numbers that a script prints last."""
        done = subprocess.run(
            [sys.executable, "-c", script, *map(str, arguments)],
            env=self.environment,
            cwd=self.cache,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise SystemExit(f"{self.sources}: {done.stderr.strip()[-500:]}")
        return tuple(map(float, done.stdout.split("\n")[-2].split()))

    def wall(self, *arguments: object) -> float:
        """s of the command line."""
        line = [sys.executable, "-m", "roadlog", *map(str, arguments)]
        begun = time.perf_counter()
        subprocess.run(line, env=self.environment, cwd=self.cache, capture_output=True, check=True)
        return time.perf_counter() - begun

    @property
    def environment(self) -> dict[str, str]:
        own = {"PYTHONPATH": str(self.sources), "NUMBA_CACHE_DIR": str(self.cache / "numba")}
        # modules are kept compiled, as installed ones are
        kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        return {**kept, **own, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

    def forget(self) -> None:
        """Begin with an empty cache."""
        shutil.rmtree(self.cache / "numba", ignore_errors=True)


@contextmanager
def trees(commit: str) -> Iterator[tuple[Tree, Tree]]:
    """The earlier tree and this one."""
    with tempfile.TemporaryDirectory() as top:
        earlier, caches = Path(top, "earlier"), (Path(top, "a"), Path(top, "b"))
        add = ["git", "-C", str(ROOT), "worktree", "add", "-q", "--detach", str(earlier), commit]
        subprocess.run(add, check=True)
        try:
            for cache in caches:
                cache.mkdir()
            subprocess.run([sys.executable, "hatch_build.py"], cwd=earlier, check=True)
            yield Tree(earlier, caches[0]), Tree(ROOT, caches[1])
        finally:
            remove = ["git", "-C", str(ROOT), "worktree", "remove", "--force", str(earlier)]
            subprocess.run(remove, check=True)


def drive(folder: Path, tree: Tree, hours: float) -> Path:
    """A log of the mountain again and again; the earlier tree writes it, so that both can read."""
    path = folder / f"{hours:g}h.mcap"
    if path.exists():
        return path
    script = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[3])
from long import tiled
from roadlog.log import create
from roadlog.simulate import simulate
simulation = simulate("mountain")
inputs = [table for table in simulation.tables if not table.topic.startswith("/truth/")]
period = max(int(table.time[-1] - table.time[0]) for table in inputs) + 10_000_000
times = max(1, round(float(sys.argv[2]) * 3600e9 / period))
create(Path(sys.argv[1]), [tiled(t, times, period) for t in inputs], {}, simulation.vehicle)
print(times)
"""
    tree.measured(script, path, hours, tree.sources / "benchmarks")
    return path


Ratios = Iterator[tuple[str, float, float]]


def first_results(old: Tree, new: Tree, folder: Path, given: argparse.Namespace) -> Ratios:
    """From an empty cache."""
    short = drive(folder, old, 0.1)
    for names in given.estimators:
        spent = []
        for tree in (old, new):
            tree.forget()
            spent.append(tree.measured(RUN, short, names, 1)[0])
        yield f"empty cache to first result, {names}", spent[1] / spent[0], FIRST[names]


def steps(old: Tree, new: Tree, folder: Path, given: argparse.Namespace) -> Ratios:
    """The recursion of `fusion`."""
    del given
    short = drive(folder, old, 0.1)
    before, after = (tree.measured(STEPS, short) for tree in (old, new))
    yield "fusion, forward a step", after[0] / before[0], 0.3
    yield "fusion, forward and back a step", after[1] / before[1], 0.35


def long_drive(old: Tree, new: Tree, folder: Path, given: argparse.Namespace) -> Ratios:
    """Hours at 100 Hz, compiled before."""
    hours, long = given.hours, drive(folder, old, given.hours)
    for names in (name for name in given.estimators if name != "kmbe"):
        before, after = (tree.measured(RUN, long, names, 2) for tree in (old, new))
        yield f"{names}, {hours:g} h", after[0] / before[0], 0.35
        if names == "fusion":
            yield f"{names}, {hours:g} h, memory", after[1] / before[1], 0.6


def side_by_side(old: Tree, new: Tree, folder: Path, given: argparse.Namespace) -> Ratios:
    """The command on two cores."""
    hours, long, copy = given.hours, drive(folder, old, given.hours), folder / "copy.mcap"
    walls = []
    for tree, options in ((old, ()), (new, ("--jobs", 2))):
        for _ in range(2):  # the first one compiles
            shutil.copy(long, copy)
            wall = tree.wall("estimate", copy, *options)
        walls.append(wall)
    yield f"estimate --jobs 2, {hours:g} h, wall", walls[1] / walls[0], 0.22


PARTS = {"first": first_results, "steps": steps, "long": long_drive, "jobs": side_by_side}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--commit", default=COMMIT)
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--only", choices=PARTS, nargs="*", default=list(PARTS))
    parser.add_argument("--estimators", choices=FIRST, nargs="+", default=list(FIRST))
    parser.add_argument("--growth", type=float, nargs="*", metavar="H", help="h; 1 2 5 10")
    parser.add_argument("--peers", action="store_true", help="also fusion beside other libraries")
    given = parser.parse_args()
    with trees(given.commit) as (old, new), tempfile.TemporaryDirectory() as top:
        print(f"{'ratio of CPU time to ' + given.commit:40} {'ratio':>6} {'goal':>6}")
        for part in given.only:
            for what, ratio, goal in PARTS[part](old, new, Path(top), given):
                print(f"{what:40} {ratio:6.2f} {goal:6.2f}", flush=True)
        growth = () if given.growth is None else given.growth or LENGTHS
        for hours in growth:
            seconds, memory = new.measured(RUN, drive(Path(top), old, hours), "all", 1)
            print(f"all estimators, {hours:g} h: {seconds:.1f} CPU s, {memory:.0f} MB", flush=True)
    if given.peers:
        subprocess.run([sys.executable, str(ROOT / "benchmarks" / "peers.py")], check=True)


if __name__ == "__main__":
    main()
