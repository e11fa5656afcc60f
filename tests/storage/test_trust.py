"""Nobody's file is lost: forged journals, logs that change while results are made, odd files."""

from __future__ import annotations

import os
import shutil
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from support.drives import hill_tables
from support.results import put, result

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.errors import LogReadError, LogWriteError
from roadlog.estimate import Estimate
from roadlog.log import DriveLog, create
from roadlog.storage import LogReader, journal, write_log

FOREIGN = b"precious"
METHOD = "incl_kinematic"


@pytest.fixture
def interrupted(tmp_path: Path) -> tuple[Path, bytes]:
    """A log whose change in place was cut off, and what it was before."""
    log = tmp_path / "x.mcap"
    write_log(log, hill_tables(2.0), {})
    before = log.read_bytes()
    saved = tmp_path / "saved"

    def stopped() -> Iterator:
        yield result(100_000)
        shutil.copy(log, tmp_path / "half")
        assert log.stat().st_size > len(before)
        shutil.copy(journal.path_of(log), saved)
        yield result(300, topic="/estimates/a/events")

    put(log, *[], in_place=True)
    write_log(log, hill_tables(2.0), {})
    from roadlog.storage import update_log

    update_log(
        log, stopped(), {}, drop=lambda _: False, drop_metadata=lambda _: False, in_place=True
    )
    (tmp_path / "half").replace(log)
    saved.replace(journal.path_of(log))
    return log, before


def test_a_change_that_was_interrupted_is_undone(
    interrupted: tuple[Path, bytes], caplog: pytest.LogCaptureFixture
) -> None:
    log, before = interrupted
    half = log.read_bytes()
    with LogReader(log, recover=False) as reader:
        assert len(reader.read(["/imu"])["/imu"]) == 201
        assert not reader.losses
    assert log.read_bytes() == half
    assert "shown as it was before" in caplog.text
    with LogReader(log):
        assert log.read_bytes() == before
    assert "was put back" in caplog.text
    assert not journal.path_of(log).exists()


def test_what_was_appended_after_a_kill_stays(interrupted: tuple[Path, bytes]) -> None:
    log, before = interrupted
    appended(log)
    with LogReader(log) as reader:
        assert reader.contents.behind
    assert log.read_bytes() == before + b"MORE DATA OF ANOTHER PROGRAM" * 100
    assert not journal.path_of(log).exists()


@pytest.mark.parametrize("link", ["soft", "hard", "none"])
def test_a_forged_journal_changes_nothing(tmp_path: Path, link: str) -> None:
    """A folder of somebody else: a link to the user's file, and a journal made to fit."""
    victim, log = tmp_path / "rc", tmp_path / "drop" / "x.mcap"
    log.parent.mkdir()
    victim.write_bytes(FOREIGN)
    if link == "soft":
        log.symlink_to(victim)
    else:
        os.link(victim, log) if link == "hard" else shutil.copy(victim, log)
    payload = b"echo owned\n"
    head = struct.pack("<QQII", 0, len(payload), zlib.crc32(payload), 0)
    for magic, more in ((b"roadlog undo 1\n", b""), (journal.MAGIC, bytes(28))):
        for place in (log, victim):
            journal.path_of(place).write_bytes(magic + head + more + payload)
        with pytest.raises(LogReadError, match="no MCAP file"):
            DriveLog(log)
        assert victim.read_bytes() == log.read_bytes() == FOREIGN


@pytest.mark.parametrize("what", ["link to the journal", "hard link to the log", "other log"])
def test_a_journal_must_prove_that_it_belongs_here(
    interrupted: tuple[Path, bytes], what: str
) -> None:
    log, _ = interrupted
    undo = journal.path_of(log)
    if what == "link to the journal":
        undo.rename(undo.with_name("elsewhere"))
        undo.symlink_to("elsewhere")
    elif what == "hard link to the log":
        os.link(log, log.with_name("another name"))
    else:
        write_log(log.with_name("y.mcap"), hill_tables(1.0), {})
        log.with_name("y.mcap").replace(log)
    there = log.read_bytes()
    with pytest.raises(LogReadError, match="delete it to go on"):
        LogReader(log)
    assert log.read_bytes() == there
    assert undo.exists()


@pytest.mark.parametrize("name", ["x.mcap.undo", "x.mcap.undo.part"])
@pytest.mark.parametrize("in_place", [False, True])
def test_a_foreign_neighbour_stays(tmp_path: Path, name: str, in_place: bool) -> None:
    log, victim, neighbour = tmp_path / "x.mcap", tmp_path / "victim", tmp_path / name
    write_log(log, hill_tables(1.0), {})
    victim.write_bytes(FOREIGN)
    neighbour.symlink_to(victim)
    try:
        put(log, result(50), in_place=in_place)
    except (LogReadError, LogWriteError):
        assert name == "x.mcap.undo"
    write_log(log, hill_tables(1.0), {})
    assert victim.read_bytes() == FOREIGN
    assert neighbour.is_symlink()


Change = Callable[[Path], object]


def replaced(log: Path) -> None:
    """By another drive of the same length."""
    other = log.with_name("other.mcap")
    create(other, [t for t in hill_tables(30.0) if t.topic != "/speed"])
    other.replace(log)


def appended(log: Path) -> None:
    with log.open("ab") as file:
        file.write(b"MORE DATA OF ANOTHER PROGRAM" * 100)


def cut(log: Path) -> None:
    os.truncate(log, 1000)


@pytest.mark.parametrize("in_place", [False, True])
@pytest.mark.parametrize("change", [replaced, appended, cut, os.remove])
def test_only_the_drive_that_was_read_gets_its_results(
    hill_log: Path, hill_drive: Drive, change: Change, in_place: bool
) -> None:
    log = DriveLog(hill_log)
    estimate = estimators.run(METHOD, hill_drive, log.vehicle)
    change(hill_log)
    there = hill_log.read_bytes() if hill_log.exists() else None
    with pytest.raises((LogWriteError, LogReadError)):
        log.write([estimate], in_place=in_place)
    assert (hill_log.read_bytes() if hill_log.exists() else None) == there
    assert len(list(hill_log.parent.iterdir())) == (there is not None)


@pytest.mark.parametrize("change", [replaced, appended, cut, os.remove])
def test_what_changes_while_it_is_written(
    hill_log: Path, hill_drive: Drive, change: Change
) -> None:
    """The same once the lock is held and the first results are on their way."""
    log = DriveLog(hill_log)
    estimate = estimators.run(METHOD, hill_drive, log.vehicle)
    there = None

    def made() -> Iterator[Estimate]:
        nonlocal there
        change(hill_log)
        there = hill_log.read_bytes() if hill_log.exists() else None
        yield estimate

    with pytest.raises(LogWriteError):
        log.write(made(), names=[METHOD])
    assert (hill_log.read_bytes() if hill_log.exists() else None) == there


def test_bytes_that_come_while_the_file_itself_is_changed(tmp_path: Path) -> None:
    log = tmp_path / "x.mcap"
    write_log(log, hill_tables(2.0), {})
    before = log.read_bytes()

    def made() -> Iterator:
        yield result(200_000)  # so many that some are on disk
        appended(log)
        yield result(200_000, topic="/estimates/a/events")

    from roadlog.storage import update_log

    with pytest.raises(LogWriteError, match="appended"):
        update_log(
            log, made(), {}, drop=lambda _: False, drop_metadata=lambda _: False, in_place=True
        )
    assert log.read_bytes() == before + b"MORE DATA OF ANOTHER PROGRAM" * 100
    assert not journal.path_of(log).exists()


@pytest.mark.parametrize("in_place", [False, True])
def test_results_of_another_run_do_not_make_it_another_drive(
    hill_log: Path, hill_drive: Drive, in_place: bool
) -> None:
    log, other = DriveLog(hill_log), DriveLog(hill_log)
    for which, name in ((other, "ls_window"), (log, METHOD)):
        estimate = estimators.run(name, hill_drive, log.vehicle)
        which.write([estimate], in_place=in_place)
    assert DriveLog(hill_log).estimators == [METHOD, "ls_window"]


@pytest.mark.parametrize("in_place", [False, True])
def test_what_lies_behind_the_end_is_not_dropped(tmp_path: Path, in_place: bool) -> None:
    log = tmp_path / "x.mcap"
    write_log(log, hill_tables(1.0), {})
    appended(log)
    there = log.read_bytes()
    with pytest.raises(LogWriteError, match="behind its end"):
        put(log, result(50), in_place=in_place)
    assert log.read_bytes() == there
    with LogReader(log) as reader:
        assert reader.losses == ["2800 bytes lie behind its end and were not read"]


@pytest.mark.parametrize("in_place", [False, True])
def test_a_link_gives_its_target_the_results(tmp_path: Path, in_place: bool) -> None:
    log, link = tmp_path / "x.mcap", tmp_path / "link.mcap"
    write_log(log, hill_tables(1.0), {})
    link.symlink_to(log.name)
    put(link, result(50), in_place=in_place)
    assert link.is_symlink()
    with LogReader(log) as reader:
        assert len(reader.read()["/estimates/a/angles"]) == 50


def test_a_hard_link_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    log = tmp_path / "x.mcap"
    write_log(log, hill_tables(1.0), {})
    os.link(log, tmp_path / "other.mcap")
    put(log, result(50))
    assert "hard links" in caplog.text


@pytest.mark.parametrize("in_place", [False, True])
def test_a_protected_log_stays(tmp_path: Path, in_place: bool) -> None:
    log = tmp_path / "x.mcap"
    write_log(log, hill_tables(1.0), {})
    there = log.read_bytes()
    log.chmod(0o444)
    with pytest.raises(LogWriteError, match=r"-o.*chmod u\+w"):
        put(log, result(50), in_place=in_place)
    put(log, result(50), out=tmp_path / "out.mcap")
    assert log.read_bytes() == there


def test_a_pipe_is_no_log(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "x.mcap")
    with pytest.raises(LogReadError, match="no plain file"):
        DriveLog(tmp_path / "x.mcap")


def test_fingerprints_tell_drives_of_the_same_stamps_apart(tmp_path: Path) -> None:
    """Not compressed, of the same stamps and sizes: only the samples differ."""
    seen = set()
    for k in range(2):
        tables = hill_tables(2.0)
        tables[0].columns["accel_x" if "accel_x" in tables[0].columns else "v"][:] += k
        write_log(tmp_path / f"{k}.mcap", tables, {}, compression="none")
        with LogReader(tmp_path / f"{k}.mcap") as reader:
            seen.add(reader.fingerprint(lambda _: False))
    assert len(seen) == 2
    assert np.all([(tmp_path / f"{k}.mcap").stat().st_size > 0 for k in range(2)])
