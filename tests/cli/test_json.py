"""`--json` is JSON: every parameter and figure, infinite ones as null."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.drives import Run


def strict(text: str) -> object:
    """Parsed; NaN and Infinity are refused."""

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


@pytest.mark.parametrize("command", ["estimators", "scenarios", "doctor"])
def test_lists_are_json(roadlog: Run, command: str) -> None:
    done = roadlog(command, "--json")
    assert done.returncode == 0, done.stderr
    assert strict(done.stdout)


def test_an_estimate_is_json(roadlog: Run, hill_log: Path) -> None:
    done = roadlog("estimate", hill_log, "-e", "ekf_suspension", "-e", "kmbe", "--json")
    assert done.returncode == 0, done.stderr
    report = strict(done.stdout)
    assert isinstance(report, dict)
    assert report["estimates"]["ekf_suspension"]["parameters"]["gate"] is None
