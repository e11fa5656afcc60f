"""Another process at work on the same files at random instants: is any foreign byte lost.

Run: python benchmarks/neighbours.py [TRIALS [SEED]]
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import random
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from roadlog import estimators
from roadlog.errors import RoadlogError
from roadlog.export import export
from roadlog.files import output
from roadlog.log import DriveLog, create
from roadlog.simulate import simulate

FOREIGN = b"precious bytes of another program"
METHOD = "incl_kinematic"
WAYS = ("copy", "in place", "export")
ACTIONS = ("append", "truncate", "replace", "rename", "link", "chmod", "remove", "create")


def meddle(action: str, target: Path, other: Path, wait: float) -> None:
    """What the other process does."""
    time.sleep(wait)
    moved = target.with_name("moved")
    try:
        if action in ("append", "create"):
            with target.open("ab" if action == "append" else "xb") as file:
                file.write(FOREIGN)
        elif action == "truncate":
            os.truncate(target, 1000)
        elif action == "replace":
            other.replace(target)
        elif action == "rename":
            target.rename(moved)
        elif action == "link":
            os.link(target, moved)
        elif action == "chmod":
            target.chmod(0o444)
        else:
            target.unlink()
    except OSError:
        os._exit(1)  # there was nothing to meddle with


def trial(folder: Path, source: Path, strange: Path, way: str, action: str, wait: float) -> str:
    log, other, out = folder / "a.mcap", folder / "b.mcap", folder / "out.csv"
    shutil.copy(source, log)
    shutil.copy(strange, other)
    target = out if way == "export" else log
    process = multiprocessing.get_context("fork").Process(
        target=meddle, args=(action, target, other, wait)
    )
    process.start()
    try:
        opened = DriveLog(log)
        drive = opened.drive()
        if way == "export":
            with output(out, [log]):
                export(log, out, rate=10.0)
        else:
            made = estimators.run(METHOD, drive, opened.vehicle)
            opened.write([made], in_place=way == "in place")
        outcome = "written"
    except RoadlogError:
        outcome = "refused"
    process.join()
    if process.exitcode:
        return "nothing to do"
    there = target.read_bytes() if target.exists() else None
    original, foreign = source.read_bytes(), strange.read_bytes()
    lost = {
        "append": there is None or not there.endswith(FOREIGN),
        "create": there != FOREIGN,
        "truncate": there is None or (len(there) > 1000 and outcome == "refused"),
        "replace": there != foreign,
        "rename": there is not None and outcome == "refused",
        "link": there is None,
        "chmod": there is None or bool(target.stat().st_mode & 0o200),
        "remove": there is not None and outcome == "refused",
    }[action]
    if way == "export":
        lost = lost or log.read_bytes() != original
    return f"LOST ({way}, {outcome})" if lost else outcome


def main() -> None:
    """Print what came of each kind of meddling."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    chance = random.Random(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    logging.getLogger("roadlog").setLevel(logging.ERROR)
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as top:
        source, strange = Path(top, "source.mcap"), Path(top, "strange.mcap")
        for path, seed in ((source, 1), (strange, 2)):
            made = simulate("luo2024-s1", seed=seed)
            create(path, made.tables, made.metadata, made.vehicle)
        for k in range(trials):
            way, action = WAYS[k % len(WAYS)], chance.choice(ACTIONS)
            folder = Path(top, str(k))
            folder.mkdir()
            counts[action, trial(folder, source, strange, way, action, chance.uniform(0, 0.4))] += 1
            shutil.rmtree(folder)
    for (action, outcome), count in sorted(counts.items()):
        print(f"{action:9s} {count:4d}  {outcome}")


if __name__ == "__main__":
    main()
