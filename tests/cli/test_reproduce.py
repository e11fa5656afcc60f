"""`roadlog reproduce` as a user meets it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from roadlog.cli.reproduce import reproduce as command
from roadlog.reproduce import kim2023
from roadlog.reproduce.fusion import fusion

KEYS = {"case", "metric", "unit", "paper", "documented", "now"}


def only_paper(text: str) -> dict[str, Any]:
    """The one paper of a `--json`, after a look at every key and type."""
    (paper,) = json.loads(text)
    assert set(paper) == {"paper", "tables", "claims"}
    assert paper["tables"]
    for table in paper["tables"]:
        assert set(table) == {"name", "rows"}
        assert table["rows"], table["name"]
        for row in table["rows"]:
            assert set(row) == KEYS
            assert all(isinstance(row[key], str) for key in ("case", "metric", "unit"))
            figures = [row[key] for key in ("paper", "documented", "now")]
            assert all(f is None or isinstance(f, int | float) for f in figures)
    for claim in paper["claims"]:
        assert set(claim) == {"claim", "holds", "now"}
        assert isinstance(claim["holds"], bool)
    return paper


def test_wang_as_json_has_stable_keys_and_figures(roadlog) -> None:
    result = roadlog("reproduce", "wang2025", "--json")
    assert result.returncode == 0, result.stderr
    paper = only_paper(result.stdout)
    rows = [row for table in paper["tables"] for row in table["rows"]]
    first = paper["tables"][0]["rows"][0]
    assert first["paper"] == 0.371
    names = [table["name"] for table in paper["tables"]]
    assert sum("full car" in name for name in names) == 4
    for row in rows:
        if row["documented"] is not None and row["unit"] == "deg":
            assert row["now"] < 1.15 * row["documented"], row
    verdicts = {claim["claim"]: claim["holds"] for claim in paper["claims"]}
    assert list(verdicts.values()) == [True, False, True]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["massel2004", "ryu2004", "luo2024", "calibration"])
def test_each_paper_as_json(roadlog, name: str) -> None:
    result = roadlog("reproduce", name, "--json")
    assert result.returncode == 0, result.stderr
    assert only_paper(result.stdout)["paper"] == name


@pytest.mark.slow
def test_the_long_papers_as_json(monkeypatch, capsys) -> None:
    """kim2023 with a drive of each kind, fusion with one scenario: whole they take minutes."""
    monkeypatch.setattr(kim2023, "SEEDS", 1)
    monkeypatch.setattr(kim2023, "DRIVES", 1)
    monkeypatch.setattr(kim2023, "FULL_DRIVES", kim2023.FULL_DRIVES[:1])
    short = {"kim2023": kim2023.run, "fusion": lambda: fusion((1,), ["luo2024-road2"])}
    monkeypatch.setattr("roadlog.reproduce.reproduce", lambda name: short[name]())
    for name in short:
        command([name], as_json=True)
        assert only_paper(capsys.readouterr().out)["paper"] == name


@pytest.mark.slow
def test_massel_prints_its_tables(roadlog) -> None:
    result = roadlog("reproduce", "massel2004")
    assert result.returncode == 0, result.stderr
    assert "quasi at 1000 Hz, 20 seeds" in result.stdout
    assert "accel on the full car, 5 seeds" in result.stdout
    assert result.stdout.count("holds  ") == 6


def test_unknown_paper_is_an_error_that_names_the_near_ones(roadlog) -> None:
    result = roadlog("reproduce", "wang2024")
    assert result.returncode == 1
    assert "wang2025" in result.stderr
    assert not result.stdout
