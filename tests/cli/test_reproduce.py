"""`roadlog reproduce` as a user meets it."""

from __future__ import annotations

import json
from typing import Any

import pytest

from roadlog import reproduce
from roadlog.cli.reproduce import reproduce as command
from roadlog.reproduce import kim2023, wang2025
from roadlog.reproduce.fusion import fusion

TEXTS = ("case", "form", "metric", "unit")
FIGURES = ("paper", "now", "spread", "documented")


def only_paper(text: str) -> dict[str, Any]:
    """The one paper of a `--json`, after a look at every key and type."""
    (paper,) = json.loads(text)
    assert set(paper) == {"paper", "tables", "claims", "also"}
    assert paper["tables"]
    for table in paper["tables"]:
        assert set(table) == {"name", "rows", "settings"}
        assert table["rows"], table["name"]
        for row in table["rows"]:
            assert set(row) == {*TEXTS, *FIGURES}
            assert all(isinstance(row[key], str) for key in TEXTS)
            assert row["form"] in ("printed", "mended", "")
            figures = [row[key] for key in FIGURES]
            assert all(f is None or isinstance(f, int | float) for f in figures)
    for claim in [*paper["claims"], *paper["also"]]:
        assert set(claim) == {"claim", "holds", "now", "why"}
        assert isinstance(claim["holds"], bool)
    return paper


def test_the_printed_filter_misses_what_the_mended_one_reaches() -> None:
    found = wang2025.run(wang2025.Job("up9", 1, full=False)).errors
    printed = [wang2025.rms(found[n]) for n, v in wang2025.VARIANTS.items() if v.form == "printed"]
    assert wang2025.rms(found["ekf_suspension, causal"]) < 0.31
    assert printed[0] > 2.0
    assert printed[1] > 2.0


@pytest.mark.slow
def test_wang_as_json_has_stable_keys_and_figures(roadlog) -> None:
    result = roadlog("reproduce", "wang2025", "--json")
    assert result.returncode == 0, result.stderr
    paper = only_paper(result.stdout)
    first = paper["tables"][0]["rows"]
    # like with like: the paper's figure stands at the printed filter and at the mended one
    forms = {row["form"] for row in first if row["paper"] == 0.371}
    assert forms == {"printed", "mended"}
    causal = next(row for row in first if row["case"] == "ekf_suspension, causal")
    assert causal["now"] < 0.31
    assert causal["spread"] > 0
    assert sum("full car" in table["name"] for table in paper["tables"]) == 4
    # the printed filter is not ahead, the full car is not within 1.5 deg, the fuel agrees
    assert [claim["holds"] for claim in paper["claims"]] == [False, False, False, True]
    assert all(claim["why"] for claim in paper["claims"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["massel2004", "ryu2004", "luo2024", "calibration"])
def test_each_paper_as_json(roadlog, name: str) -> None:
    result = roadlog("reproduce", name, "--json")
    assert result.returncode == 0, result.stderr
    assert only_paper(result.stdout)["paper"] == name


@pytest.mark.slow
def test_the_long_runs_as_json(monkeypatch, capsys) -> None:
    """kim2023 with a drive of each kind, fusion with one scenario: whole they take minutes."""
    monkeypatch.setattr(kim2023.motions, "SEEDS", (1, 2))
    monkeypatch.setattr(kim2023.road, "SEEDS", (1, 2))
    monkeypatch.setattr(kim2023.urban, "DRIVES", (1, 2))
    monkeypatch.setattr(kim2023.urban, "FULL_DRIVES", kim2023.urban.FULL_DRIVES[:1])
    short = {
        "kim2023": lambda _: kim2023.reproduce(),
        "fusion": lambda _: fusion((1,), ["luo2024-road2"]),
    }
    monkeypatch.setattr("roadlog.reproduce.reproduce", lambda name, update: short[name](update))
    for name in short:
        command([name], as_json=True)
        assert only_paper(capsys.readouterr().out)["paper"] == name


@pytest.mark.slow
def test_massel_prints_its_tables(roadlog) -> None:
    result = roadlog("reproduce", "massel2004")
    assert result.returncode == 0, result.stderr
    assert "quasi at 1000 Hz, 10 seeds" in result.stdout
    assert "accel on the full car, 5 seeds" in result.stdout
    assert "not the defaults: printed: preset=paper" in result.stdout
    assert "FAILS  in the acceleration the combination is ti all the time" in result.stdout


def test_documented_figures_are_those_of_a_run_that_updates(monkeypatch, tmp_path) -> None:
    """And of no hand: a later run shows them beside its own."""
    row = reproduce.ResultRow("case", "printed", "RMSE", "deg", 2.0, 1.23456789)
    table = reproduce.ResultTable("table", [row])
    own = reproduce.Reproduction("wang2025", [table], [])
    monkeypatch.setattr("roadlog.reproduce.documented.FOLDER", tmp_path / "figures")
    monkeypatch.setattr("roadlog.reproduce.wang2025.reproduce", lambda: own)
    assert reproduce.reproduce("wang2025").tables[0].rows[0].documented is None
    reproduce.reproduce("wang2025", update=True)
    (again,) = reproduce.reproduce("wang2025").tables[0].rows
    assert again.documented == 1.235
    assert again.ratio == pytest.approx(0.617, abs=1e-3)


def test_figures_stand_beside_their_tables_on_one_page(tmp_path) -> None:
    from roadlog.reproduce import page

    row = reproduce.ResultRow("case", "printed", "RMSE", "deg", 2.0, 4.0)
    claim = reproduce.Claim("it <holds>", False, "no", "because")
    table = reproduce.ResultTable("Table 1", [row], "a=b")
    written = page.write(
        tmp_path / "drawn", [reproduce.Reproduction("massel2004", [table], [claim])]
    )
    text = written.read_text(encoding="utf-8")
    assert "FAILS" in text
    assert "it &lt;holds&gt;" in text
    assert "2.000</td><td class=n>4.000" in text
    for name in ("massel2004-quasi", "massel2004-accel"):
        assert f"{name}.svg" in text
        assert (tmp_path / "drawn" / f"{name}.svg").read_bytes().startswith(b"<?xml")
        assert (tmp_path / "drawn" / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_both_engines_say_how_far_they_differ() -> None:
    from roadlog.drive import Drive
    from roadlog.estimators.engines import run_on
    from roadlog.simulate import simulate

    simulation = simulate("wang2025-up9", overrides={"duration": 10.0})
    drive = Drive.from_tables(simulation.tables)
    (note,) = [
        note
        for note in run_on("both", "ekf_suspension", drive, simulation.vehicle).notes
        if "engines" in note
    ]
    assert "grade" in note
    assert "not known" not in note


def test_unknown_paper_is_an_error_that_names_the_near_ones(roadlog) -> None:
    result = roadlog("reproduce", "wang2024")
    assert result.returncode == 1
    assert "wang2025" in result.stderr
    assert not result.stdout
