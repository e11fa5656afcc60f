"""Ctrl-C and SIGTERM: one line, the right exit code, nothing half written, no child left."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support.drives import ROOT

DEADLINE = 60.0  # s, on a busy machine


def start(*arguments: object, **options: object) -> subprocess.Popen[str]:
    # a shell's background job ignores Ctrl-C, and so would its children
    signal.signal(signal.SIGINT, signal.default_int_handler)
    return subprocess.Popen(
        [sys.executable, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,  # type: ignore[call-overload]
    )


def listening(process: subprocess.Popen[str]) -> None:
    """Wait until the process has taken its signals: then it has a second thread."""
    deadline = time.monotonic() + DEADLINE
    while len(list(Path(f"/proc/{process.pid}/task").iterdir())) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("wait", [0.0, 0.3, 1.0])
def test_one_line_and_nothing_written(hill_log: Path, number: int, code: int, wait: float) -> None:
    log = hill_log
    before = log.read_bytes()
    process = start("-m", "roadlog", "estimate", log, "-e", "kmbe", "-e", "fusion")
    listening(process)
    time.sleep(wait)
    process.send_signal(number)
    output, errors = process.communicate(timeout=DEADLINE)
    if process.returncode == 0:  # a fast machine was done
        return
    assert process.returncode == code, errors
    assert errors == "roadlog: stopped; nothing written\n", output
    assert log.read_bytes() == before
    assert list(log.parent.iterdir()) == [log]


# what swallows the exception, and holds neither the interpreter's lock nor a child back
STUBBORN = """
import ctypes, subprocess, sys, time
from pathlib import Path
from roadlog import files, interrupt, processes
interrupt.install()
with files.replacing(Path(sys.argv[1])) as file, processes.child(["sleep", "100"]) as child:
    file.write(b"half"); file.flush()
    while True:
        try:
            print(child.pid, flush=True)
            ctypes.CDLL(None).usleep(100_000_000)
        except KeyboardInterrupt:
            pass
"""


# a compiled loop as every estimator has them, that would go on for an hour
COMPILED = """
import sys
from pathlib import Path
from roadlog import files, interrupt
from roadlog.jit import compiled

@compiled
def count(start, end):
    total = start
    while total < end:
        total += total * 1e-12
    return total

interrupt.install()
with files.replacing(Path(sys.argv[1])) as file:
    file.write(b"half"); file.flush()
    count(1.0, 1.0)
    print("compiled", flush=True)
    count(1.0, 1e9)
"""


def test_a_compiled_loop_ends(tmp_path: Path) -> None:
    script, out = tmp_path / "long.py", tmp_path / "out"
    script.write_text(COMPILED)
    out.mkdir()
    process = start(script, out / "out.csv")
    assert process.stdout is not None
    assert process.stdout.readline() == "compiled\n"
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=DEADLINE)
    assert (process.returncode, errors) == (130, "roadlog: stopped; nothing written\n")
    assert not list(out.iterdir())


def test_what_swallows_the_signal_ends_too(tmp_path: Path) -> None:
    process = start("-c", STUBBORN, tmp_path / "out.csv")
    assert process.stdout is not None
    child = int(process.stdout.readline())
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=DEADLINE)
    assert (process.returncode, errors) == (130, "roadlog: stopped; nothing written\n")
    assert not list(tmp_path.iterdir())
    with pytest.raises(ProcessLookupError):
        os.kill(child, 0)


SLOW = """
import atexit, os, signal, sys, time
from roadlog import __main__

atexit.register(time.sleep, 4.0)  # longer than an interrupted run may take to end
sys.argv = ["roadlog", "--version"]
import roadlog.cli
roadlog.cli.main = lambda: os.kill(os.getpid(), signal.SIGINT) or time.sleep(600)
__main__.main()
"""


def test_an_end_that_takes_long_is_said_once() -> None:
    process = start("-c", SLOW)
    _, errors = process.communicate(timeout=DEADLINE)
    assert (process.returncode, errors) == (130, "roadlog: stopped; nothing written\n")


POOL = """
import os, time
from roadlog.reproduce import over

def work(_):
    os.write(1, b"at work\\n")  # at once, where print would write the line's end apart
    time.sleep(600)

over(work, range(2))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the script's pool is of forked processes")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_do_not_outlive_the_run(tmp_path: Path, number: int) -> None:
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    process = start(script)
    assert process.stdout is not None
    assert [process.stdout.readline() for _ in range(2)] == ["at work\n"] * 2
    process.send_signal(number)
    process.communicate(timeout=DEADLINE)  # ends when the last of them lets go of the output
    assert process.returncode == -number
