"""`roadlog reproduce` as a user meets it."""

from __future__ import annotations

import json

import pytest

KEYS = {"case", "metric", "unit", "paper", "documented", "now"}


def test_wang_as_json_has_stable_keys_and_figures(roadlog) -> None:
    result = roadlog("reproduce", "wang2025", "--json")
    assert result.returncode == 0, result.stderr
    (paper,) = json.loads(result.stdout)
    assert set(paper) == {"paper", "tables", "claims"}
    rows = [row for table in paper["tables"] for row in table["rows"]]
    assert all(set(row) == KEYS for row in rows)
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
