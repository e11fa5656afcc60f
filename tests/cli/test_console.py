"""What the terminal shows: levels, tables at any width, one sentence a thing."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from support.drives import Run

from roadlog.cli import console
from roadlog.filters.compiling import compiling
from roadlog.jit import Kernel


@pytest.mark.parametrize("width", [20, 40, 60, 80, 140])
def test_no_figure_is_cut_at_any_width(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], width: int
) -> None:
    monkeypatch.setattr(console, "PIPE_WIDTH", width)
    figures = [f"{value:.5f}" for value in np.linspace(-29.5, 11.25, 7)]
    headings = ["angle", *(f"figure {k}" for k in range(7))]
    console.print_table(headings, [["grade", *figures], ["a long name of a thing", *figures]], "x")
    out = capsys.readouterr().out
    assert "…" not in out
    for figure in figures:
        assert out.count(figure) == 2
    for heading in headings[1:]:
        assert heading in out


def test_a_narrow_terminal_goes_without_what_can_be_spared(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    headings, row = ["topic", "message", "count", "jitter"], ["/imu", "x" * 30, "10", "0.1"]
    for width, said in (
        (60, headings),
        (30, ["topic", "count", "jitter"]),
        (13, ["topic", "count"]),
    ):
        monkeypatch.setattr(console, "PIPE_WIDTH", width)
        console.print_table(headings, [row], left=2, spare=("message", "jitter"))
        lines = capsys.readouterr().out.splitlines()
        assert lines[0].split() == said
        assert len(lines) == (2 if said == headings else 3)
    assert lines[2] == "(a wider terminal shows message, jitter too)"


def test_notes_are_few_unless_asked_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    texts = [f"thing {k}" for k in range(5)]
    console.notes(texts)
    said = capsys.readouterr().err
    assert "thing 2" in said
    assert "thing 3" not in said
    assert "2 more notes with -v" in said
    monkeypatch.setattr(console, "verbose", True)
    console.notes(texts)
    assert "thing 4" in capsys.readouterr().err
    monkeypatch.setattr(console, "quiet", True)
    console.notes(texts)
    assert capsys.readouterr().err == ""


def test_the_next_step_can_be_typed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    step = ["evaluate", Path("Run 3 (wet).mcap")], ["view", "a.mcap"]
    console.next_step(*step)
    assert capsys.readouterr().err == ""  # no person reads it
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    console.next_step(*step)
    said = capsys.readouterr().err
    assert "next: roadlog evaluate 'Run 3 (wet).mcap', or roadlog view a.mcap" in said
    monkeypatch.setattr(console, "quiet", True)
    console.next_step(*step)
    assert capsys.readouterr().err == ""


def test_one_and_many() -> None:
    assert console.plural(1, "estimate") == "1 estimate"
    assert console.plural(2, "estimate") == "2 estimates"


def test_quiet_says_results_alone(roadlog: Run, hill_log: Path) -> None:
    loud = roadlog("estimate", hill_log, "-e", "ti", "-e", "incl_kinematic", "-e", "ls_attitude")
    quiet = roadlog("estimate", hill_log, "-e", "ti", "-q")
    assert loud.returncode == quiet.returncode == 0
    assert "note: " not in quiet.stderr
    assert "ti" in quiet.stdout


def test_compiling_is_said_once_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    def double(x: float) -> float:
        return 2 * x

    twice = Kernel(double, {})  # kept nowhere

    with caplog.at_level(logging.WARNING, "roadlog"):
        with compiling("it") as first:
            twice(1.0)
        with compiling("it") as second:
            twice(2.0)
    assert first.seconds > 0
    assert second.seconds == 0
    assert caplog.messages == ["compiling it, once per installation"]
