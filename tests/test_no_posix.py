"""The main line where POSIX is absent, as on Windows: no flock, no fchmod, no folders to open."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from support.drives import ROOT

COMMANDS = """
from support import no_posix  # before anything else
import sys
from roadlog.cli import main

def run(line):
    sys.argv = ["roadlog", *line.split()]
    try:
        main()
    except SystemExit as end:
        assert not end.code, line

run("ingest {logs}/small_logger.csv -o a.mcap --profile {logs}/small_logger.toml")
run("info a.mcap")
run("estimate a.mcap -e kmbe -e ti")
run("estimate a.mcap -e kmbe")  # replaces a result in place
run("evaluate a.mcap")
run("export a.mcap -o a.csv --every 1s")
run("plot a.mcap -o a.png")
run("calibrate a.mcap -o car.toml")
"""


def test_the_main_line_runs_without_posix(tmp_path: Path) -> None:
    code = COMMANDS.format(logs=ROOT / "sample_logs")
    paths = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"a.mcap", "a.csv", "a.png", "car.toml"}
