"""No cell of a table is run by a spreadsheet, whatever a log calls its things."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables

from roadlog.car.vehicle import Vehicle
from roadlog.csv_text import STARTS_FORMULA, cell, csv_text
from roadlog.export import export
from roadlog.log import create
from roadlog.report import table
from roadlog.report.row import Options, run_log
from roadlog.report.sources import find
from roadlog.storage import Table

FORMULA = '=HYPERLINK("http://127.0.0.1/x","a")'


@pytest.mark.parametrize(
    "text", [FORMULA, "+1", "-1", "@SUM(x)", " =1", "\t=1", "\r=1", "\uff1d1", "\x1b[2J=1"]
)
def test_a_formula_is_text(text: str) -> None:
    shown = cell(text)
    assert shown.isprintable()
    assert shown.lstrip()[0] not in STARTS_FORMULA


@pytest.mark.parametrize("text", ["", "kmbe", "a=b", "1", "Grüße, Ünïcode", "x-1"])
def test_other_text_stays(text: str) -> None:
    assert cell(text) == text


def test_numbers_stay_numbers() -> None:
    assert csv_text(["a", "=b"], [{"a": -1.5, "=b": None}]) == "a,'=b\r\n-1.5,\r\n"


def test_names_of_a_log_are_no_formula_in_an_export(tmp_path: Path) -> None:
    """Neither is an escape sequence one of the terminal's."""
    time = EPOCH_NS + np.arange(10) * 10**7
    topics = ["=1+1", "\x1b[31m/red"]
    odd = [Table(t, "roadlog.v1.FuelLevel", time, {"sender": np.ones(10)}) for t in topics]
    create(tmp_path / "a.mcap", [*hill_tables(1.0), *odd])
    export(tmp_path / "a.mcap", tmp_path / "a.csv")
    header = next(csv.reader((tmp_path / "a.csv").open()))
    assert "'=1+1.sender [m]" in header
    assert all(name.isprintable() for name in header)


def test_a_vehicles_name_is_no_formula_in_a_report(tmp_path: Path) -> None:
    log = tmp_path / "a.mcap"
    create(log, hill_tables(12.0, rate=50.0), vehicle=Vehicle().with_values(name=FORMULA))
    row = run_log(find([str(log)])[0], Options(("kmbe",))).row
    table.write_tables(tmp_path, [row])
    rows = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert [row["vehicle"] for row in rows] == [f"'{FORMULA}"]
