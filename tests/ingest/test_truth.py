"""The reference grade of a receiver's altitude says how far it can be trusted."""

import numpy as np
import pytest
from conftest import table

from roadlog.ingest.truth import from_gnss

SPEED = 15.0  # m/s


def reference(altitude: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Grade and its sd from altitudes of each second at constant speed, without the ends."""
    n = len(altitude)
    time = np.arange(n) * 1_000_000_000
    made = from_gnss([table("gnss", time, {"altitude": altitude, "speed": np.full(n, SPEED)})])
    inside = slice(15, n - 15)
    return made.columns["grade"][inside], made.columns["grade_sd"][inside]


def test_sd_holds_for_an_altitude_that_wanders() -> None:
    walk = np.cumsum(np.random.default_rng(1).normal(0.0, 0.5, 4000))
    grade, sd = reference(walk)
    assert np.mean(np.abs(grade) < 2 * sd) == pytest.approx(0.93, abs=0.03)
    assert np.mean((grade / sd) ** 2) == pytest.approx(1.2, abs=0.3)


def test_sd_covers_a_slope_that_begins_within_the_window() -> None:
    at = SPEED * np.arange(121)
    slope = np.where(at > SPEED * 60, 0.1, 0.0)
    grade, sd = reference(np.maximum(at - SPEED * 60, 0.0) * 0.1)
    near = np.abs(np.arange(121)[15:-15] - 60) < 8
    error = np.abs(np.tan(grade) - slope[15:-15])
    assert error[near].max() > 0.02
    assert np.all(error < 2 * sd + 1e-9)
