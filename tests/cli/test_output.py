"""One rule for every output: never an input, nothing that is there without --force."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from support.drives import ROOT
from typer.testing import CliRunner, Result

from roadlog.cli import app
from roadlog.errors import LogWriteError

FOREIGN = b"precious"
SAMPLES = ROOT / "sample_logs"
TABLE, PROFILE = SAMPLES / "small_logger.csv", SAMPLES / "small_logger.toml"

# each command with an output, whose name stands for OUT
COMMANDS = {
    "ingest": ["ingest", "s.csv", "--profile", "s.toml", "-o", "OUT.mcap"],
    "simulate": ["simulate", "luo2024-s1", "-o", "OUT.mcap"],
    "estimate": ["estimate", "hill.mcap", "-e", "incl_kinematic", "-o", "OUT.mcap"],
    "calibrate": ["calibrate", "hill.mcap", "-o", "OUT.toml"],
    "evaluate": ["evaluate", "hill.mcap", "--csv", "OUT.csv"],
    "export": ["export", "hill.mcap", "--every", "1s", "-o", "OUT.csv"],
    "plot": ["plot", "hill.mcap", "-o", "OUT.png"],
    "view": ["view", "hill.mcap", "--save", "OUT.rrd"],
    "profile": ["profile", "new", "s.csv", "-o", "OUT.toml"],
    "vehicle": ["vehicle", "new", "Honda Civic 2016-18", "-o", "OUT.toml"],
}


@pytest.fixture
def folder(hill_log: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A drive as a log and as a table with its profile, in the current folder."""
    monkeypatch.chdir(hill_log.parent)
    (hill_log.parent / "s.csv").write_bytes(TABLE.read_bytes())
    (hill_log.parent / "s.toml").write_bytes(PROFILE.read_bytes())
    return hill_log.parent


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def refused(result: Result, match: str) -> None:
    assert isinstance(result.exception, LogWriteError), result.output
    assert match in str(result.exception)


@pytest.mark.parametrize("command", COMMANDS)
def test_what_is_there_stays(folder: Path, command: str) -> None:
    words = COMMANDS[command]
    out = folder / next(word for word in words if word.startswith("OUT"))
    out.write_bytes(FOREIGN)
    refused(run(*words), "--force")
    assert out.read_bytes() == FOREIGN


@pytest.mark.parametrize("command", [name for name in COMMANDS if name != "vehicle"])
@pytest.mark.parametrize("alias", ["itself", "symlink", "hard link"])
def test_an_input_is_never_the_output(folder: Path, command: str, alias: str) -> None:
    words = COMMANDS[command]
    if command == "simulate":
        source = folder / "car.toml"
        source.write_text('[vehicle]\nname = "a"\n')
        words = [*words, "--vehicle", "car.toml"]
    else:
        source = folder / ("s.csv" if "s.csv" in words else "hill.mcap")
    suffix = next(Path(word).suffix for word in words if word.startswith("OUT"))
    out = folder / f"alias{suffix}"
    if alias == "symlink":
        out.symlink_to(source)
    elif alias == "hard link":
        os.link(source, out)
    elif source.suffix == suffix:
        out = source
    else:
        source.rename(out)
        words = [out.name if word == source.name else word for word in words]
        source = out
    before = source.read_bytes()
    words = [out.name if word.startswith("OUT") else word for word in words]
    refused(run(*words, "--force"), "one of the inputs")
    assert source.read_bytes() == before


def test_a_profile_is_an_input(folder: Path) -> None:
    refused(run("ingest", "s.csv", "--profile", "s.toml", "-o", "s.toml", "--force"), "inputs")
    assert (folder / "s.toml").read_bytes() == PROFILE.read_bytes()


def test_a_folder_is_made_and_force_replaces(folder: Path) -> None:
    words = ["export", "hill.mcap", "--every", "1s", "-o", "new/folder/out.csv"]
    assert run(*words).exit_code == 0
    first = (folder / "new/folder/out.csv").read_bytes()
    refused(run(*words), "--force")
    assert run(*words, "--force").exit_code == 0
    assert (folder / "new/folder/out.csv").read_bytes() == first


def test_a_failed_run_leaves_no_folder(folder: Path) -> None:
    assert run("export", "hill.mcap", "--topics", "/no", "-o", "new/out.csv").exit_code == 1
    assert not (folder / "new").exists()


def test_a_neighbour_of_the_output_stays(folder: Path) -> None:
    """The journal's name beside an export, as a file and as a folder."""
    (folder / "out.csv.undo").write_bytes(FOREIGN)
    (folder / "more.csv.undo").mkdir()
    for name in ("out.csv", "more.csv"):
        assert run("export", "hill.mcap", "--every", "1s", "-o", name).exit_code == 0
    assert (folder / "out.csv.undo").read_bytes() == FOREIGN
    assert (folder / "more.csv.undo").is_dir()
