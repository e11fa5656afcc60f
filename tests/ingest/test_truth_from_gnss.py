"""The grade that a receiver's altitudes tell: honest on flat tracks, coarse and held altitudes."""

from __future__ import annotations

import numpy as np
import pytest
from support.drives import table

from roadlog.errors import LogReadError
from roadlog.ingest.reference.gnss import from_gnss


def drive(seed: int, flat: bool, rate: float = 1.0, duration: float = 900.0):
    """Times, speed and grade of a drive with stops, on hills or on the level."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, duration, 1 / rate)
    phase = rng.uniform(0, 2 * np.pi, 4)
    v = np.clip(14 + 12 * np.sin(2 * np.pi * t / 110 + phase[0]), 0, 30)
    hills = 0.03 * np.sin(2 * np.pi * t / 97 + phase[1]) + 0.02 * np.sin(
        2 * np.pi * t / 61 + phase[2]
    )
    return t, v, np.zeros(len(t)) if flat else hills


def wandering(rng: np.random.Generator, count: int, sd: float, time: float) -> np.ndarray:
    """A Gauss-Markov error at 1 Hz."""
    keep = np.exp(-1 / time)
    error = np.empty(count)
    error[0] = rng.normal(0, sd)
    for k in range(1, count):
        error[k] = keep * error[k - 1] + rng.normal(0, sd * np.sqrt(1 - keep**2))
    return error


def tables(t, v, grade, error, accuracy: float | None = 3.0, step: float = 0.0, hold: int = 1):
    height = 300 + np.concatenate([[0], np.cumsum((v * np.sin(grade))[:-1] * np.diff(t))]) + error
    height = np.repeat(height[::hold], hold)[: len(t)]
    height = np.round(height / step) * step if step else height
    columns = {"altitude": height, "speed": v}
    stated = np.nan if accuracy is None else accuracy
    known = dict.fromkeys(("latitude", "longitude", "course", "climb"), np.full(len(t), np.nan))
    columns |= known | {"vertical_accuracy": np.full(len(t), stated)}
    return [table("gnss", np.round(t * 1e9).astype(np.int64), columns)]


@pytest.mark.parametrize(
    ("sd", "time", "step", "accuracy"),
    [(2, 60, 0, 3), (3, 100, 0.1, 4), (1, 30, 1.0, None), (0, 1, 1.0, 3), (0.5, 200, 0, None)],
)
@pytest.mark.parametrize("flat", [True, False])
def test_the_sd_holds_for_receivers_of_many_kinds(sd, time, step, accuracy, flat):
    inside, worst = [], 0.0
    for seed in range(6):
        t, v, grade = drive(seed, flat)
        error = wandering(np.random.default_rng(seed), len(t), sd, time)
        truth = from_gnss(tables(t, v, grade, error, accuracy, step))
        apart = truth.columns["grade"] - np.interp(truth.time * 1e-9, t, grade)
        inside.append(np.mean(np.abs(apart) < 2 * truth.columns["grade_sd"]))
        worst = max(worst, float(np.degrees(np.abs(apart)).max()))
    assert 0.90 <= np.mean(inside) <= 1.0
    assert worst < 6.0


def test_altitudes_that_repeat_are_no_flat_road_known_exactly():
    t, v, grade = drive(1, flat=False)
    truth = from_gnss(tables(t, v, grade, 0 * t, step=1.0, hold=5))
    apart = truth.columns["grade"] - np.interp(truth.time * 1e-9, t, grade)
    assert np.mean(np.abs(apart) < 2 * truth.columns["grade_sd"]) > 0.9
    assert truth.columns["grade_sd"].min() > np.radians(0.05)


def test_a_crawl_on_a_flat_track_is_left_out():
    t = np.arange(0, 300.0)
    v = np.where(t % 60 < 4, 2.5, 0.0)
    steps = 10 * (np.random.default_rng(2).uniform(size=len(t)) > 0.5)
    with pytest.raises(LogReadError, match="no stretch has altitudes fine enough"):
        from_gnss(tables(t, v, 0 * t, steps, step=1.0))
