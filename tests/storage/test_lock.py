"""Two writers on one log: neither loses what the other wrote."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.errors import LogWriteError
from roadlog.estimate import Estimate
from roadlog.log import DriveLog
from roadlog.storage import lock
from roadlog.storage.lock import exclusive


def test_a_writer_waits_for_the_other(hill_log: Path, hill_drive: Drive) -> None:
    log = DriveLog(hill_log)
    estimate = estimators.run("incl_kinematic", hill_drive, log.vehicle)
    writer = threading.Thread(target=log.write, args=([estimate],))
    before = hill_log.read_bytes()
    with exclusive(hill_log):
        writer.start()
        writer.join(0.3)
        assert writer.is_alive()
        assert hill_log.read_bytes() == before
    writer.join(30)
    assert not writer.is_alive()
    assert DriveLog(hill_log).estimators == ["incl_kinematic"]


def test_who_writes_elsewhere_waits_for_nobody(hill_log: Path, hill_drive: Drive) -> None:
    log, out = DriveLog(hill_log), hill_log.with_name("out.mcap")
    estimate = estimators.run("incl_kinematic", hill_drive, log.vehicle)
    writer = threading.Thread(target=log.write, args=([estimate],), kwargs={"out": out})
    with exclusive(hill_log):
        writer.start()
        writer.join(30)
        assert DriveLog(out).estimators == ["incl_kinematic"]


def test_a_log_that_changes_while_it_is_copied_is_refused(hill_log: Path) -> None:
    log, out = DriveLog(hill_log), hill_log.with_name("out.mcap")

    def late() -> Iterator[Estimate]:
        yield log.estimate("incl_kinematic")
        with hill_log.open("ab") as file:
            file.write(b"more")

    with pytest.raises(LogWriteError, match="by another program"):
        log.write(late(), names=["incl_kinematic"], out=out)
    assert not out.exists()


def test_processes_that_write_at_once_keep_each_others_results(hill_log: Path) -> None:
    names = ["incl_kinematic", "ls_attitude", "lowpass_attitude", "ls_window"]
    command = [sys.executable, "-m", "roadlog", "estimate", str(hill_log), "-e"]
    runs = [subprocess.Popen([*command, name], stdout=subprocess.DEVNULL) for name in names]
    assert [run.wait(120) for run in runs] == [0] * len(names)
    assert DriveLog(hill_log).estimators == sorted(names)


def test_the_lock_is_on_the_file_that_is_there_now(tmp_path: Path) -> None:
    path, other = tmp_path / "x.mcap", tmp_path / "new"
    path.write_text("old")
    order = []

    def second() -> None:
        with exclusive(path):
            order.append(path.read_text())

    with exclusive(path):
        waiter = threading.Thread(target=second)
        waiter.start()
        other.write_text("new")
        other.replace(path)
    waiter.join(30)
    assert order == ["new"]


def test_a_log_that_is_removed_while_it_is_waited_for(tmp_path: Path) -> None:
    path, said = tmp_path / "x.mcap", []
    path.write_text("old")

    def second() -> None:
        try:
            with exclusive(path):
                said.append("locked")
        except LogWriteError as error:
            said.append(str(error))

    with exclusive(path):
        waiter = threading.Thread(target=second)
        waiter.start()
        path.unlink()
    waiter.join(30)
    assert said == [f"{path}: cannot be opened: No such file or directory"]
    assert not list(tmp_path.iterdir())


def test_a_lock_of_another_program_is_said_and_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A shared one too, as of a backup."""
    fcntl = pytest.importorskip("fcntl", reason="locks of POSIX")
    path = tmp_path / "x.mcap"
    path.write_text("old")
    monkeypatch.setattr(lock, "SAID_AFTER", 0.05)
    monkeypatch.setattr(lock, "LIMIT", 0.2)
    with path.open() as file:
        fcntl.flock(file, fcntl.LOCK_SH)
        with pytest.raises(LogWriteError, match="stayed locked"), exclusive(path):
            pass
    assert "is locked by another program; waiting" in caplog.text


def test_a_log_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LogWriteError, match="cannot be opened"), exclusive(tmp_path / "no.mcap"):
        pass
