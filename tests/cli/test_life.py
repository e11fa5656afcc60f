"""Every command that takes long says so on a terminal, at once, and leaves nothing of it behind."""

from __future__ import annotations

import io
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.drives import PLAIN, ROOT

from roadlog.cli import life

pty = pytest.importorskip("pty", reason="no pseudo-terminals on this system")

SOON = 0.5  # s from the start of the command to the first sign of life
LOGS = ROOT / "sample_logs"
PROFILE = LOGS / "small_logger.toml"
COMMANDS = {
    "calibrate": ["calibrate", LOGS / "pass.mcap", "-o", "car.toml"],
    "estimate": ["estimate", LOGS / "pass.mcap", "-e", "fusion", "-o", "out.mcap"],
    "ingest": ["ingest", LOGS / "small_logger.csv", "-o", "o.mcap", "--profile", PROFILE],
    "evaluate": ["evaluate", ROOT / "tests" / "data" / "roadlog-0.1.0.mcap"],
    "simulate": ["simulate", "mountain", "-o", "m.mcap"],
    "view": ["view", LOGS / "hill.mcap", "--save", "hill.rrd"],
    "reproduce": ["reproduce", "luo2024"],
    "report": ["report", LOGS, "-o", "report", "-e", "kmbe", "--jobs", "1"],
    "export": ["export", LOGS / "pass.mcap", "-o", "pass.csv", "--every", "10m"],
    "plot": ["plot", ROOT / "tests" / "data" / "roadlog-0.1.0.mcap", "-o", "old.png"],
    "road": ["road", LOGS / "pass.mcap", "-o", "pass.csv"],
}


def first_sign(command: list[object], folder: Path, needle: bytes) -> tuple[float, bytes, int]:
    """s until `needle` is on the terminal, everything that was on it, the exit code.

    The command is stopped by Ctrl-C as soon as it has shown life.
    """
    # a shell's background job ignores Ctrl-C, and so would its children
    signal.signal(signal.SIGINT, signal.default_int_handler)
    here, there = pty.openpty()
    environment = {**os.environ, **PLAIN, "PYTHONPATH": str(ROOT)}
    started = time.monotonic()
    with subprocess.Popen(
        [sys.executable, "-m", "roadlog", *map(str, command)],
        stdin=there,
        stdout=subprocess.DEVNULL,
        stderr=there,
        cwd=folder,
        env=environment,
        start_new_session=True,
    ) as child:
        os.close(there)
        seen, at = b"", float("inf")
        while True:
            try:
                part = os.read(here, 4096)
            except OSError:  # the last one at the other end has gone
                break
            if not part:
                break
            seen += part
            if at == float("inf") and needle in seen:
                at = time.monotonic() - started
                child.send_signal(signal.SIGINT)
        code = child.wait()
    os.close(here)
    return at, seen, code


@pytest.mark.parametrize("name", COMMANDS)
def test_life_is_shown_at_once_and_ctrl_c_leaves_nothing(name: str, tmp_path: Path) -> None:
    began = time.monotonic()
    subprocess.run(  # what any start takes here and now
        [sys.executable, "-m", "roadlog", "config"], capture_output=True, check=True
    )
    start = time.monotonic() - began
    at, seen, code = first_sign(COMMANDS[name], tmp_path, b"0:0")
    assert at < start + SOON, seen
    assert code in (0, 130)
    assert seen.rstrip().splitlines()[-1].split(b"\r")[-1].startswith(b"roadlog: ") or code == 0
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith(".") or ".tmp" in p.name] == []


@pytest.mark.parametrize(
    ("command", "following"),
    [
        (["info", LOGS / "pass.mcap"], ["estimate", LOGS / "pass.mcap"]),
        (COMMANDS["ingest"], ["info", "o.mcap"]),
        (["simulate", "massel2004-quasi", "-o", "m.mcap"], ["estimate", "m.mcap"]),
        (COMMANDS["calibrate"], ["estimate", LOGS / "pass.mcap", "--vehicle", "car.toml"]),
    ],
)
def test_the_next_step_stands_last(
    command: list[object], following: list[object], tmp_path: Path
) -> None:
    _, seen, code = first_sign(command, tmp_path, b"nothing that is said")
    assert code == 0
    last = seen.decode().rpartition("\r\n")[0].split("\n")[-1].split("\r")[-1]  # not what moved
    assert last == f"roadlog: next: {shlex.join(['roadlog', *map(str, following)])}"


def test_the_line_stays_away_while_something_else_is_said(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However long that takes: it stood before the title of the table that followed."""
    screen = io.StringIO()
    monkeypatch.setattr(screen, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stderr", screen)
    with life.shown("evaluate"):
        time.sleep(3 * life.TICK)
        with life.aside():
            before = screen.getvalue()
            time.sleep(3 * life.TICK)
            assert screen.getvalue() == before
        time.sleep(3 * life.TICK)
    assert before.split("\r")[-1] == screen.getvalue().split("\r")[-1] == ""
    assert screen.getvalue().startswith("\r| evaluate 0:00")
    assert len(screen.getvalue()) > len(before)


def test_nothing_moves_where_nobody_looks(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "roadlog", *map(str, COMMANDS["simulate"])]
    environment = {**os.environ, **PLAIN, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=True
    )
    assert "\r" not in done.stderr
