"""The documentation: it builds, its quick start runs, and what it names exists."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from support.drives import ROOT

PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)


def commands(page: Path) -> Iterator[list[str]]:
    """The words of every `roadlog` line of a page's shell blocks."""
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            if words and words[0] == "roadlog":
                yield words[1:]


def test_site_builds_without_a_warning(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-d", tmp_path]  # --quiet hides
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "index.html").stat().st_size > 5000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_command_of_a_page_can_be_given(page: Path) -> None:
    """Subcommand and options exist; what the commands do is the quick start's and others' test."""
    from roadlog.cli import app

    group = typer.main.get_command(app)
    for words in commands(page):
        if words[0] in ("--help", "--version"):
            continue
        command = group
        for word in words[:2]:
            command = getattr(command, "commands", {word: command})[word]
        options = {
            option
            for parameter in command.params
            for option in (*parameter.opts, *parameter.secondary_opts)
        } | {"--help", "-h"}
        unknown = {w.partition("=")[0] for w in words[1:] if w.startswith("-")} - options
        assert not unknown, words


def test_quick_start_runs_as_it_is_written(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NO_COLOR": "1"}
    ran = 0
    for words in commands(ROOT / "docs" / "index.md"):
        command = [sys.executable, "-m", "roadlog", *words]
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, (words, done.stderr)
        ran += 1
    assert ran >= 6
    assert (tmp_path / "drive.rrd").stat().st_size > 100_000
    assert "fusion" in (tmp_path / "errors.csv").read_text()
