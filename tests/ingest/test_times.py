"""Time columns: numbers in a unit, texts in the forms that loggers write."""

import numpy as np
import pytest

from roadlog.errors import ConfigError
from roadlog.ingest.formats.times import (
    bracketed,
    guess_unit,
    of_text,
    time_column,
    without_unit,
)

NOON = 1732968000_000_000_000  # 2024-11-30 12:00:00 UTC


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2024-11-30T12:00:00Z", NOON),
        ("2024-11-30 12:00:00.5", NOON + 5 * 10**8),
        ("2024-11-30T13:00:00+01:00", NOON),
        ("30-Nov-2024 12:00:00.000", NOON),
        ("11/30/2024 12:00:00.001", NOON + 10**6),
        ("Nov 30, 2024 12:00:00 PM", NOON),
        ("30.11.2024 12:00:00", NOON),
        ("noon", None),
        ("", None),
    ],
)
def test_texts_of_loggers(text: str, expected: int | None) -> None:
    assert of_text(text) == expected


@pytest.mark.parametrize(
    ("first", "step", "unit"),
    [(0.0, 0.01, "s"), (1.7e9, 0.01, "s"), (1.7e12, 10.0, "ms"), (1.7e18, 1e7, "ns")],
)
def test_unit_of_numbers_by_their_size(first: float, step: float, unit: str) -> None:
    assert guess_unit(first + step * np.arange(100)) == unit


def test_names_with_units() -> None:
    assert without_unit("Time (s)") == "Time"
    assert bracketed("Time [ms]") == "ms"
    assert bracketed("Time") == ""


def test_time_column_is_found_by_its_usual_name_or_asked_for() -> None:
    assert time_column(["v", "Time (s)"], "", "here") == "Time (s)"
    assert time_column(["v", "clock"], "clock", "here") == "clock"
    with pytest.raises(ConfigError, match=r"here: which column is the time"):
        time_column(["v", "a"], "", "here")
    with pytest.raises(ConfigError, match=r"here: no time column 'clok'.*clock"):
        time_column(["v", "clock"], "clok", "here")
