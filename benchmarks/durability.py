"""kill -9 at random instants of ingest, estimate and report: is any data lost.

Run: python benchmarks/durability.py [TRIALS [JOBS]]
"""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.log import DriveLog, create
from roadlog.simulate import simulate

ROADLOG = [sys.executable, "-m", "roadlog"]
ESTIMATORS = ["-e", "incl_kinematic", "-e", "lowpass_attitude"]
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
SHARES = {"estimate": 0.6, "ingest": 0.3, "report": 0.1}


def killed(command: list[str], folder: Path, chance: random.Random, duration: float) -> bool:
    """Start a command and kill it: anywhere, or just after its temporary file appears."""
    process = subprocess.Popen(command, **QUIET)  # type: ignore[call-overload]
    if chance.random() < 0.5:
        time.sleep(chance.uniform(0.0, duration))
    else:
        while process.poll() is None and not any(folder.glob(".*.part")):
            time.sleep(0.0005)
        time.sleep(chance.uniform(0.0, 0.02))
    process.kill()
    return process.wait() != 0


def whole(path: Path, topics: set[str]) -> bool:
    """The log opens, loses nothing and has the topics with their messages."""
    log = DriveLog(path)
    tables = log.tables(topics)
    return not log.losses and set(tables) == topics and all(len(t) for t in tables.values())


def estimate_trial(folder: Path, source: Path, chance: random.Random, duration: float) -> str:
    path = folder / "drive.mcap"
    shutil.copy(source, path)
    before = path.read_bytes()
    killed([*ROADLOG, "estimate", str(path), *ESTIMATORS], folder, chance, duration)
    if path.read_bytes() == before:
        return "old"
    inputs = {channel.topic for channel in DriveLog(source).channels}
    results = {f"/estimates/{name}/angles" for name in ESTIMATORS[1::2]}
    return "new" if whole(path, inputs | results) else "LOST"


def ingest_trial(folder: Path, source: Path, chance: random.Random, duration: float) -> str:
    out = folder / "out.mcap"
    profile = source.with_suffix(".toml")
    command = [*ROADLOG, "ingest", str(source), "-o", str(out), "--profile", str(profile)]
    killed(command, folder, chance, duration)
    if not out.exists():
        return "old"
    try:
        return "new" if whole(out, {"/imu", "/speed"}) else "LOST"
    except LogReadError:
        return "LOST"


def report_trial(folder: Path, source: Path, chance: random.Random, duration: float) -> str:
    logs, out = folder / "logs", folder / "report"
    logs.mkdir()
    for k in range(4):
        shutil.copy(source, logs / f"{k}.mcap")
    command = [*ROADLOG, "report", str(logs), "-o", str(out), *ESTIMATORS[:2], "--jobs", "1"]
    process = subprocess.Popen(command, start_new_session=True, **QUIET)  # type: ignore[call-overload]
    time.sleep(chance.uniform(0.0, duration))
    os.killpg(process.pid, 9)
    process.wait()
    done = subprocess.run([*command, "--resume"], check=False, **QUIET)  # type: ignore[call-overload]
    rows = [json.loads(line) for line in (out / "rows.jsonl").read_text().splitlines()]
    good = done.returncode == 0 and len(rows) == 4 and all(r["status"] == "ok" for r in rows)
    return "new" if good else "LOST"


def seconds(command: list[str]) -> float:
    started = time.perf_counter()
    subprocess.run(command, check=False, **QUIET)  # type: ignore[call-overload]
    return time.perf_counter() - started


def main() -> None:
    """Print how often the old file, the new one, or neither was there after the kill.

    Kills fall into one and a half times what the command takes alone, times the jobs beside it.
    """
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    with tempfile.TemporaryDirectory() as top:
        base = Path(top)
        simulation = simulate("luo2024-s1")
        log = base / "source.mcap"
        create(log, simulation.tables, simulation.metadata, simulation.vehicle)
        table = base / "source.csv"
        t = np.arange(6000) / 100
        np.savetxt(
            table,
            np.stack([t, np.sin(t), np.full(6000, 9.8), 10 + t / 10], axis=1),
            delimiter=",",
            header="t,ax,az,v",
            comments="",
        )
        table.with_suffix(".toml").write_text(
            '[time]\ncolumn = "t"\nunit = "s"\n[imu]\naccel_x = { from = "ax", unit = "m/s^2" }\n'
            'accel_z = { from = "az", unit = "m/s^2" }\n[speed]\nv = { from = "v", unit = "m/s" }\n'
        )
        first = base / "first.mcap"
        shutil.copy(log, first)
        profile = ["--profile", str(table.with_suffix(".toml"))]
        report = [*ROADLOG, "report", str(first), "-o", str(base / "r"), *ESTIMATORS[:2]]
        durations = {
            "estimate": seconds([*ROADLOG, "estimate", str(first), *ESTIMATORS]),
            "ingest": seconds([*ROADLOG, "ingest", str(table), "-o", str(base / "x"), *profile]),
            "report": seconds(report),
        }
        kinds = {"estimate": estimate_trial, "ingest": ingest_trial, "report": report_trial}
        sources = {"estimate": log, "ingest": table, "report": log}

        def trial(job: tuple[str, int]) -> tuple[str, str]:
            kind, seed = job
            folder = base / f"{kind}{seed}"
            folder.mkdir()
            chance = random.Random(seed)
            outcome = kinds[kind](folder, sources[kind], chance, 1.5 * jobs * durations[kind])
            shutil.rmtree(folder)
            return kind, outcome

        work = [(k, i) for k, share in SHARES.items() for i in range(round(share * trials))]
        with ThreadPoolExecutor(jobs) as pool:
            counts = Counter(pool.map(trial, work))
    for (kind, outcome), count in sorted(counts.items()):
        print(f"{kind:10s} {outcome:5s} {count}")


if __name__ == "__main__":
    main()
