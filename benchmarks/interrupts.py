"""Ctrl-C at random instants of the commands that take time: does each end at once and cleanly.

Run: python benchmarks/interrupts.py [TRIALS [SEED]]
"""

from __future__ import annotations

import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from roadlog.log import create
from roadlog.simulate import simulate

ROADLOG = [sys.executable, "-m", "roadlog"]
FINE = ("stopped", "was done before")
LIMIT = 2.0  # s from the signal to the end of the process and of its children
# command line, and what it may have written when it was stopped too late
COMMANDS = {
    "ingest": (["ingest", "t.csv", "-o", "out.mcap", "--profile", "t.toml"], {"out.mcap"}),
    "calibrate": (["calibrate", "drive.mcap", "-o", "car.toml"], {"car.toml"}),
    "estimate": (["estimate", "drive.mcap", "-e", "fusion", "-e", "kmbe"], set()),
    "report": (["report", "drive.mcap", "-e", "kmbe", "-o", "report", "--jobs", "1"], {"report"}),
    "view": (["view", "drive.mcap", "--save", "out.rrd"], {"out.rrd"}),
}


def family(session: int) -> list[int]:
    """Processes of a session that are alive, by /proc."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = entry.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session and fields[0] != "Z":
            found.append(int(entry.parent.name))
    return found


def start(folder: Path, command: str) -> subprocess.Popen[str]:
    """The command, once it hears signals: then it has a second thread."""
    process = subprocess.Popen(
        [*ROADLOG, *COMMANDS[command][0]],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    while process.poll() is None and len(list(Path(f"/proc/{process.pid}/task").iterdir())) < 2:
        time.sleep(0.001)  # the interpreter itself is not there yet
    return process


def duration(folder: Path, source: Path, command: str) -> float:
    """s that it takes here and now from then on; the first time loads and compiles more."""
    for _ in range(2):
        shutil.copytree(source, folder)
        process = start(folder, command)
        started = time.monotonic()
        process.communicate()
        took = time.monotonic() - started
        shutil.rmtree(folder)
    return took


def trial(folder: Path, source: Path, command: str, wait: float) -> str:
    _, outputs = COMMANDS[command]
    for path in source.iterdir():
        shutil.copy(path, folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    process = start(folder, command)
    time.sleep(wait)
    process.send_signal(signal.SIGINT)
    started = time.monotonic()
    try:
        _, errors = process.communicate(timeout=60)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return "not stopped within 60 s"
    took = time.monotonic() - started
    if process.returncode == 0 and "stopped" not in errors:
        return "was done before"
    if process.returncode != 130 or "stopped" not in errors or "Traceback" in errors:
        return f"exit {process.returncode}: {errors[-300:]}"
    while family(process.pid):
        if time.monotonic() - started > max(took, LIMIT):
            return f"children live: {family(process.pid)}"
        time.sleep(0.05)
    for name, content in before.items():
        if (folder / name).read_bytes() != content and "written" not in errors:
            return f"{name} changed, and it said: {errors[-200:]}"
    more = {path.name for path in folder.iterdir()} - before.keys()
    if more - outputs or (more and command != "report" and "written" not in errors):
        return f"left: {sorted(more)}, and it said: {errors[-200:]}"
    return "stopped" if took <= LIMIT else f"stopped after more than {LIMIT:.0f} s"


def main() -> None:
    """Print how the runs ended."""
    # a shell's background job ignores Ctrl-C, and so would its children
    signal.signal(signal.SIGINT, signal.default_int_handler)
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    chance = random.Random(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    with tempfile.TemporaryDirectory() as top:
        source = Path(top, "source")
        source.mkdir()
        simulation = simulate("luo2024-s1")
        create(source / "drive.mcap", simulation.tables, simulation.metadata, simulation.vehicle)
        t = np.arange(100_000) / 100
        columns = [t, np.sin(t), np.full(len(t), 9.8), 10 + t / 1e3]
        header = "t,ax,az,v"
        np.savetxt(source / "t.csv", np.stack(columns, 1), "%.4f", ",", header=header, comments="")
        (source / "t.toml").write_text(
            '[time]\ncolumn = "t"\nunit = "s"\n[imu]\naccel_x = { from = "ax", unit = "m/s^2" }\n'
            'accel_z = { from = "az", unit = "m/s^2" }\n[speed]\nv = { from = "v", unit = "m/s" }\n'
        )
        counts: Counter[tuple[str, str]] = Counter()
        durations = {}
        for k in range(trials):
            command = list(COMMANDS)[k % len(COMMANDS)]
            folder = Path(top, f"{k}")
            if command not in durations:
                durations[command] = duration(folder, source, command)
            folder.mkdir()
            wait = chance.uniform(0, durations[command])
            outcome = trial(folder, source, command, wait)
            if outcome not in FINE:
                print(f"{command} after {wait:.3f} s: {outcome}", flush=True)
            counts[command, outcome] += 1
            shutil.rmtree(folder)
    for (command, outcome), count in sorted(counts.items()):
        print(f"{command:10s} {count:4d}  {outcome}")


if __name__ == "__main__":
    main()
