"""A disk that is full or may not be written, and a log that others write to: nothing is lost."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from support.drives import Run, hill_tables

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.errors import LogWriteError
from roadlog.estimate import Estimate
from roadlog.log import DriveLog, create

COMMANDS = {
    "estimate": ["estimate", "LOG"],
    "in place": ["estimate", "LOG", "--in-place"],
    "elsewhere": ["estimate", "LOG", "--out", "HERE/new.mcap"],
    "simulate": ["simulate", "luo2024-s1", "-o", "HERE/new.mcap"],
    "export": ["export", "LOG", "-o", "HERE/new.csv"],
    "calibrate": ["calibrate", "LOG", "-o", "HERE/new.toml"],
    "plot": ["plot", "LOG", "-o", "HERE/new.png"],
    "view": ["view", "LOG", "--save", "HERE/new.rrd"],
    "report": ["report", "LOG", "-e", "kmbe", "-o", "HERE/report"],
}


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A folder on a disk of 2 MB of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("a small disk: this user may not mount one")
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def check_refused(roadlog: Run, log: Path, command: str) -> None:
    """One line of error, the log as it was, and nothing half written beside it."""
    before = log.read_bytes()
    names = {"LOG": str(log), "HERE": str(log.parent)}
    arguments = [part.replace("HERE", names["HERE"]) for part in COMMANDS[command]]
    done = roadlog(*(names.get(part, part) for part in arguments))
    assert done.returncode == 1, done.stderr
    last = done.stderr.splitlines()[-1]
    assert last.startswith(f"roadlog: {log.parent}"), done.stderr
    assert "Traceback" not in done.stderr
    assert log.read_bytes() == before
    assert {path.name for path in log.parent.iterdir()} <= {log.name, "full", "report"}


@pytest.mark.parametrize("command", ["estimate", "in place", "export", "view", "report"])
def test_a_full_disk(small_disk: Path, roadlog: Run, command: str) -> None:
    log = small_disk / "hill.mcap"
    create(log, hill_tables(20.0))
    with suppress(OSError), (small_disk / "full").open("wb", buffering=0) as full:
        while full.write(bytes(4096)):
            pass
    check_refused(roadlog, log, command)


@pytest.mark.parametrize(
    "command", ["estimate", "in place", "elsewhere", "simulate", "calibrate", "plot"]
)
def test_a_disk_that_may_not_be_written(small_disk: Path, roadlog: Run, command: str) -> None:
    log = small_disk / "hill.mcap"
    create(log, hill_tables(20.0))
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    check_refused(roadlog, log, command)


def test_a_log_that_another_program_writes_to(hill_log: Path, hill_drive: Drive) -> None:
    """What was appended while results were made stays; the results are refused."""
    log = DriveLog(hill_log)
    estimate = estimators.run("incl_kinematic", hill_drive, log.vehicle)

    def appended() -> Iterator[Estimate]:
        with hill_log.open("ab") as file:
            file.write(b"more")
        yield estimate

    before = hill_log.read_bytes()
    with pytest.raises(LogWriteError, match="another program"):
        log.write(appended(), names=["incl_kinematic"])
    assert hill_log.read_bytes() == before + b"more"
    assert [path.name for path in hill_log.parent.iterdir()] == [hill_log.name]
