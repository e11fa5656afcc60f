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
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from roadlog import estimators
from roadlog.calibrate import calibrate
from roadlog.errors import RoadlogError
from roadlog.export import export
from roadlog.files import output, write
from roadlog.ingest import ingest
from roadlog.log import DriveLog, create
from roadlog.report.row import Options, run_log
from roadlog.report.sources import find
from roadlog.simulate import simulate

FOREIGN = b"precious bytes of another program"
OLD = bytes(3000)  # an output of an earlier run
NOTHING = "nothing was there to meddle with"  # no trial
PATIENCE = 3.0  # s
MOMENT = 0.02  # s that writing a small file takes
METHOD = "incl_kinematic"
ACTIONS = ("append", "truncate", "replace", "rename", "link", "chmod", "remove", "create")
LOG, SOURCE = "a.mcap", "t.csv"


class Way(NamedTuple):
    """A writing command. run: in a folder. target: what the other process meddles with."""

    run: Callable[[Path], None]
    target: str
    kept: str = ""  # an input that must stay as it is


def _estimate(folder: Path, *, in_place: bool = False, out: str = "") -> None:
    with output(folder / out if out else None, [folder / LOG], force=True):
        log = DriveLog(folder / LOG)
        made = estimators.run(METHOD, log.drive(), log.vehicle)
        log.write([made], in_place=in_place, out=folder / out if out else None)


def _export(folder: Path) -> None:
    with output(folder / "out.csv", [folder / LOG], force=True):
        export(folder / LOG, folder / "out.csv", every="10Hz")


def _ingest(folder: Path) -> None:
    with output(folder / "out.mcap", [folder / SOURCE], force=True):
        result = ingest([folder / SOURCE], str(folder / "t.toml"))
        create(folder / "out.mcap", result.tables, result.metadata)


def _calibrate(folder: Path) -> None:
    with output(folder / "car.toml", [folder / LOG], force=True):
        log = DriveLog(folder / LOG)
        found = calibrate({LOG: log.drive()}, log.vehicle)
        write(folder / "car.toml", found.vehicle.to_toml())


def _report(folder: Path) -> None:
    source = find([str(folder / LOG)])[0]
    row = run_log(source, Options((METHOD,), write_back=True)).row
    if row["status"] != "ok":
        raise RoadlogError(row["message"])


WAYS = {
    "estimate": Way(_estimate, LOG),
    "estimate --in-place": Way(lambda folder: _estimate(folder, in_place=True), LOG),
    "its journal": Way(lambda folder: _estimate(folder, in_place=True), f"{LOG}.undo"),
    "estimate -o": Way(lambda folder: _estimate(folder, out="out.mcap"), "out.mcap", LOG),
    "report --write-back": Way(_report, LOG),
    "export": Way(_export, "out.csv", LOG),
    "ingest": Way(_ingest, "out.mcap", SOURCE),
    "calibrate": Way(_calibrate, "car.toml", LOG),
}


def meddle(action: str, target: Path, other: Path, wait: float, *, writing: bool) -> None:
    """What the other process does; writing: not before something is being written."""
    deadline = time.monotonic() + PATIENCE
    while writing and not any(target.parent.glob("*.part")) and time.monotonic() < deadline:
        time.sleep(1e-4)
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


def trial(folder: Path, given: Path, way: Way, action: str, wait: float, writing: bool) -> str:
    """What came of it: refused or written, or which bytes were lost."""
    shutil.copytree(given, folder)
    target, strange = folder / way.target, (folder / "b.mcap").read_bytes()
    if way.kept and action != "create":
        target.write_bytes(OLD)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    process = multiprocessing.get_context("fork").Process(
        target=meddle,
        args=(action, target, folder / "b.mcap", wait),
        kwargs={"writing": writing},
    )
    process.start()
    try:
        way.run(folder)
        outcome = "written"
    except RoadlogError:
        outcome = "refused"
    process.join()
    if process.exitcode:
        return NOTHING
    there = target.read_bytes() if target.exists() else None
    is_journal = target.suffix == ".undo"  # it goes with the change, unless it is another's
    lost = {
        "append": there is None or not there.endswith(FOREIGN),
        "create": there != FOREIGN,
        "truncate": there is None or (len(there) > 1000 and outcome == "refused"),
        "replace": there != strange,
        "rename": there is not None and outcome == "refused",
        "link": there is None and not is_journal,
        "chmod": not is_journal and (there is None or bool(target.stat().st_mode & 0o200)),
        "remove": there is not None and outcome == "refused",
    }[action]
    lost = lost or any((folder / name).read_bytes() != before[name] for name in [way.kept] if name)
    return f"LOST ({outcome})" if lost else outcome


def prepare(folder: Path) -> None:
    """Two logs and a table of one drive each."""
    folder.mkdir()
    for name, seed in ((LOG, 1), ("b.mcap", 2)):
        made = simulate("luo2024-s1", seed=seed)
        create(folder / name, made.tables, made.metadata, made.vehicle)
    t = np.arange(20_000) / 100
    table = np.stack([t, np.sin(t), np.full(len(t), 9.8), 10 + t / 1e3], 1)
    np.savetxt(folder / SOURCE, table, "%.4f", ",", header="t,ax,az,v", comments="")
    (folder / "t.toml").write_text(
        '[time]\ncolumn = "t"\nunit = "s"\n[imu]\naccel_x = { from = "ax", unit = "m/s^2" }\n'
        'accel_z = { from = "az", unit = "m/s^2" }\n[speed]\nv = { from = "v", unit = "m/s" }\n'
    )


def main() -> None:
    """Print what came of each kind of meddling."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    chance = random.Random(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    logging.getLogger("roadlog").setLevel(logging.ERROR)
    counts: Counter[tuple[str, str, str]] = Counter()
    durations: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as top:
        given = Path(top, "given")
        prepare(given)
        for name, way in WAYS.items():  # how long each takes here and now
            for k in range(2):  # once for what is loaded and compiled
                shutil.copytree(given, folder := Path(top, f"{name} {k}"))
                started = time.monotonic()
                way.run(folder)
                durations[name] = time.monotonic() - started
        done = 0
        while done < trials:
            name, action = chance.choice(list(WAYS)), chance.choice(ACTIONS)
            writing = chance.random() < 0.5
            wait = chance.uniform(0, MOMENT if writing else durations[name])
            folder = Path(top, "trial")
            outcome = trial(folder, given, WAYS[name], action, wait, writing)
            shutil.rmtree(folder)
            done += outcome != NOTHING
            counts[name, action, outcome] += 1
    for (name, action, outcome), count in sorted(counts.items()):
        if outcome == NOTHING:
            continue
        print(f"{name:20s} {action:9s} {count:4d}  {outcome}")


if __name__ == "__main__":
    main()
