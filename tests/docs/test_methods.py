"""The pages of the methods: every tuning parameter and systematic sd with the value of the code."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from support.drives import ROOT

from roadlog import estimators
from roadlog.estimators.base import Estimator
from roadlog.estimators.fusion.states import State
from roadlog.reproduce import PAPERS
from roadlog.reproduce.drawings import drawings

METHODS = ROOT / "docs" / "methods"
HEADING = re.compile(r"^#+ Parameters of (.*)$", re.MULTILINE)
FIRST_CELLS = 5  # parameter, default, unit, meaning, effect


def tables() -> Iterator[tuple[set[str], str]]:
    """Estimators that a table of parameters is of, and its text up to the next heading."""
    for page in METHODS.glob("*.md"):
        text = page.read_text(encoding="utf-8")
        for found in HEADING.finditer(text):
            body = text[found.end() :].split("\n#", 1)[0]
            names = found[1] if "`" in found[1] else body.split("\n\n")[1]
            yield set(re.findall(r"`(\w+)`", names)), body


def documented(name: str) -> dict[str, list[str]]:
    """Parameter -> the cells of its row, for one estimator."""
    rows = {}
    for names, body in tables():
        if name in names:
            for line in body.splitlines():
                cells = [cell.strip() for cell in line.strip("|").split("|")]
                if len(cells) == FIRST_CELLS and cells[0].startswith("`"):
                    rows[cells[0].strip("`")] = cells
    return rows


def value(cell: str, default: Any) -> Any:
    """A default as the table has it, in the type of the code's; degrees become radians."""
    word, _, unit = cell.partition(" ")
    if isinstance(default, bool) or default is None or isinstance(default, str):
        return word
    return float(word) * (np.pi / 180 if unit.startswith("deg") else 1.0)


@pytest.mark.parametrize("estimator", estimators.all_estimators(), ids=lambda e: e.name)
def test_every_parameter_has_an_entry_with_its_default(estimator: Estimator) -> None:
    rows = documented(estimator.name)
    fields = {field.name: field.default for field in dataclasses.fields(estimator.parameters)}
    assert set(rows) == set(fields)
    for name, default in fields.items():
        _, shown, _, meaning, _ = rows[name]
        found = value(shown, default)
        if isinstance(found, float):
            assert found == pytest.approx(default, rel=1e-9), name
        else:
            assert found == str(default).lower(), name
        assert len(meaning) > 3, name


def test_systematic_sds_are_those_of_the_code() -> None:
    page = (METHODS / "common.md").read_text(encoding="utf-8")
    table = page.split("## Systematic standard deviations", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in table.splitlines() if line.startswith("|")]
    head = [cell.strip() for cell in lines[0].strip("|").split("|")]
    shown = {}
    for line in lines[2:]:
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        shown[name.strip("`")] = {a: float(c) for a, c in zip(head[1:], cells, strict=True) if c}
    assert shown == {
        e.name: dict(e.systematic_deg) for e in estimators.all_estimators() if e.systematic_deg
    }


def test_the_states_of_fusion_are_those_of_the_code() -> None:
    page = (METHODS / "fusion.md").read_text(encoding="utf-8")
    table = page.split("## States", 1)[1].split("\n## ", 1)[0]
    rows = [line.split("|") for line in table.splitlines() if re.match(r"\| \d", line)]
    shown = [
        (name, int(number))
        for _, numbers, _, names, *_ in rows
        for name, number in zip(re.findall(r"`(\w+)`", names), numbers.split(","), strict=True)
    ]
    assert shown == [(state.name, state.value) for state in State]


@pytest.mark.parametrize("paper", PAPERS)
def test_every_figure_is_shown_with_what_differs_from_the_papers(paper: str) -> None:
    text = (METHODS / f"{paper}.md").read_text(encoding="utf-8")
    for drawing in drawings(paper):
        picture = f"pictures/papers/{drawing.name}.png"
        assert (ROOT / "docs" / picture).is_file()
        said = f"**{drawing.of[0].upper()}{drawing.of[1:]}.** {drawing.caption}\n\n"
        assert f"{said}![{drawing.name}](../{picture})\n" in text
