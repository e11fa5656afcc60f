"""`--truth-from gnss`: against known grades, and estimators against it on the public drives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import EPOCH_NS, simulated, table

from roadlog.errors import LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.reference import gnss as truth
from roadlog.log import DriveLog, create
from roadlog.signals import SECTIONS, TRUTH_TOPIC
from roadlog.types import Floats

SPEED = 15.0  # m/s
PERIOD = 40.0  # s, of the hills


def hills(accuracy: Floats | None = None, bump: Floats | None = None):
    """A receiver at 1 Hz over a sine of 2 deg, without noise; stamps, grade and its table."""
    t = np.arange(300.0)
    time = EPOCH_NS + (t * 1e9).astype(np.int64)
    turn = 2 * np.pi / PERIOD
    grade = np.radians(2.0) * np.sin(turn * t)
    altitude = 100 + SPEED * np.radians(2.0) / turn * (1 - np.cos(turn * t))
    unknown = np.full(len(t), np.nan)
    columns = dict.fromkeys(SECTIONS["gnss"].fields, unknown)
    columns |= {"altitude": altitude + (0 if bump is None else bump)}
    columns |= {"speed": np.full(len(t), SPEED)}
    columns |= {} if accuracy is None else {"vertical_accuracy": accuracy}
    return t, grade, table("gnss", time, columns)


def test_hills_lose_what_a_gaussian_window_takes():
    t, grade, gnss = hills()
    made = truth.from_gnss([gnss])
    # slope of a weighted line through a sine, of its own (but for a sample at the end of the
    # window, which rounding may leave out): with a window without end
    # exp(-(2 pi sd / period)^2 / 2) = 0.82
    k = np.arange(-truth.REACH * truth.KERNEL, truth.REACH * truth.KERNEL + 1)
    weight = np.exp(-0.5 * (k / truth.KERNEL) ** 2)
    turn = 2 * np.pi / PERIOD
    share = np.sum(weight * k * np.sin(turn * k)) / (turn * np.sum(weight * k**2))
    inside = (t > 20) & (t < 280)
    np.testing.assert_allclose(
        made.columns["grade"][inside], share * grade[inside], atol=np.radians(0.02)
    )


def test_fixes_of_an_outage_are_left_out():
    t = np.arange(300.0)
    tunnel = (t > 150) & (t < 160)
    bump = np.where(tunnel, -8.0, 0.0)
    _, _, clean = hills()
    _, _, told = hills(np.where(tunnel, 6.0, 2.0), bump)
    _, _, untold = hills(None, bump)
    exact = truth.from_gnss([clean])
    errors = {}
    for name, gnss in (("told", told), ("untold", untold)):
        made = truth.from_gnss([gnss])
        errors[name] = np.degrees(
            made.columns["grade"] - np.interp(made.time, exact.time, exact.columns["grade"])
        )
    assert len(errors["told"]) == 300 - tunnel.sum()
    assert np.abs(errors["told"]).max() < 1.2  # windows beside the hole see one side
    assert np.abs(errors["untold"]).max() > 2.0


@pytest.mark.parametrize(("scenario", "rmse_deg"), [("luo2024-s1", 0.55), ("mountain", 0.6)])
def test_the_reference_is_as_good_as_it_says_on_simulated_drives(scenario, rmse_deg):
    for seed in (1, 2, 3) if scenario != "mountain" else (1,):
        tables = simulated(scenario, seed=seed).tables
        known = next(t for t in tables if t.topic == TRUTH_TOPIC)
        made = truth.from_gnss(tables)
        error = np.degrees(
            made.columns["grade"] - np.interp(made.time, known.time, known.columns["grade"])
        )
        sd = np.degrees(made.columns["grade_sd"])
        assert np.sqrt(np.mean(error**2)) < rmse_deg
        assert abs(error.mean()) < 0.1
        assert np.mean(np.abs(error) < 2 * sd) > 0.85


def test_without_altitude_or_speed_it_says_so():
    _, _, gnss = hills()
    gnss.columns["altitude"][:] = np.nan
    with pytest.raises(LogReadError, match="needs gnss altitude and a speed"):
        truth.from_gnss([gnss])


def smoothed_error_deg(path: Path, name: str) -> float:
    """Sd of an estimate's grade, smoothed as the reference is, against the reference."""
    log = DriveLog(path)
    known = log.truth()
    track = log.estimate(name)
    grade = np.asarray(track.grade, np.float64)
    own, at = track.time, (known.time_ns - log.drive().start_ns) * 1e-9
    usable = np.isfinite(grade)
    own, grade = own[usable], grade[usable]
    errors = []
    for second, reference in zip(at, known.angles["grade"], strict=True):
        if not own[0] + 5 <= second <= own[-1]:  # the usual skip
            continue
        near = slice(*np.searchsorted(own, second + np.array([-3, 3]) * truth.KERNEL))
        weight = np.exp(-0.5 * ((own[near] - second) / truth.KERNEL) ** 2)
        errors.append(weight @ grade[near] / weight.sum() - reference)
    assert len(errors) > 0.9 * len(at)
    return float(np.degrees(np.std(errors)))


def public(shared: Path, folder: Path, *names: str) -> Path:
    path = folder / "drive.mcap"
    result = ingest([shared / name for name in names], truth_from="gnss")
    create(path, result.tables, result.metadata)
    return path


def test_grade_against_the_altitude_of_canmod(shared, tmp_path):
    pytest.importorskip("asammdf")
    log = public(shared, tmp_path, "canmod")
    # the goal of 0.46 deg is the best estimator's (below); the receiver's altitude is the rest:
    # 0.33 deg where it states 1 m, 0.43 at up to 2 m
    assert smoothed_error_deg(log, "kmbe") < 0.50


@pytest.mark.slow
def test_grade_of_fusion_against_the_altitude_of_canmod(shared, tmp_path):
    pytest.importorskip("asammdf")
    assert smoothed_error_deg(public(shared, tmp_path, "canmod"), "fusion") < 0.46


@pytest.mark.parametrize(
    "names",
    [
        ("iphone/sample_trip.csv",),
        ("iphone/trip2_with_obd.csv", "iphone/trip2_with_obd.txt"),
    ],
    ids=["trip-1", "trip-2"],
)
def test_grade_against_the_altitude_of_a_phone(shared, tmp_path, names):
    log = public(shared, tmp_path, *names)
    assert smoothed_error_deg(log, "kmbe") < 0.8
    assert smoothed_error_deg(log, "fusion") < 0.85
