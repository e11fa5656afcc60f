"""What a command imports: nothing heavy that it does not use. In a process each, as users do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from support.drives import ROOT

HEAVY = "scipy.linalg scipy.signal scipy.stats rerun matplotlib pyarrow pandas numba roadlog.ingest"
# command -> which of them it may load
COMMANDS = {
    "--help": "",
    "config": "",
    "info LOG": "",
    "evaluate ESTIMATES": "",
    "export LOG -o OUT.csv": "",
    "estimate LOG -e lowpass_attitude -o OUT.mcap": "scipy.linalg scipy.signal scipy.stats",
    "estimate LOG -e kmbe -o OUT.mcap": "numba",
    "ingest TABLE -o OUT.mcap --profile PROFILE": "numba roadlog.ingest",
    "plot LOG -o OUT.png": "matplotlib",
}
RUN = f"""
import runpy, sys
try:
    runpy.run_module("roadlog", run_name="__main__")
except SystemExit as error:
    assert not error.code, error.code
print("loaded:", *[name for name in {HEAVY.split()} if name in sys.modules])
"""


def test_help_reads_the_options_of_no_command() -> None:
    from typer.testing import CliRunner

    from roadlog.cli import app
    from roadlog.cli.lazy import MODULES

    root = typer.main.get_command(app)
    listed = CliRunner().invoke(app, ["--help"]).stdout
    assert not root.commands.made  # type: ignore[attr-defined]
    for name, command in root.commands.items():  # type: ignore[attr-defined]
        assert f"  {name} " in listed
        assert command.get_short_help_str(40).removesuffix("...") in listed
    assert set(root.commands.made) == set(MODULES)  # type: ignore[attr-defined]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_loads_nothing_heavy_that_it_does_not_use(command: str, tmp_path: Path) -> None:
    places = {
        "LOG": ROOT / "sample_logs/hill.mcap",
        "TABLE": ROOT / "sample_logs/small_logger.csv",
        "PROFILE": ROOT / "sample_logs/small_logger.toml",
        "ESTIMATES": ROOT / "tests/data/roadlog-0.1.0.mcap",
    }
    words = [str(places.get(word, word)) for word in command.split()]
    done = subprocess.run(
        [sys.executable, "-c", RUN, *words],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    loaded = done.stdout.rpartition("loaded:")[2].split()
    assert set(loaded) <= set(COMMANDS[command].split())
