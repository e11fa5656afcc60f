from pathlib import Path

import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables

from roadlog.errors import LogReadError
from roadlog.estimate import Estimate
from roadlog.log import DriveLog, create
from roadlog.metrics import (
    STOP_EVENT,
    angle_errors,
    angle_metrics,
    evaluate,
    stop_metrics,
    to_json,
)
from roadlog.signals import ANGLES, ANGLES_SCHEMA, DECELERATION, TRUTH_TOPIC
from roadlog.storage import Table


def track(t: np.ndarray, grade: np.ndarray, sd: float = np.nan, valid=None) -> Estimate:
    return Estimate(
        t,
        {"grade": grade},
        {"grade": np.full(len(t), sd)},
        np.ones(len(t), np.bool_) if valid is None else valid,
        start_ns=EPOCH_NS,
    )


def test_figures_of_a_known_error() -> None:
    t = np.arange(0, 20, 0.01)
    truth = track(t[::5], np.zeros(len(t[::5])))
    error = np.radians(np.where(np.arange(len(t)) % 10 < 5, 1.0, 3.0))
    m = angle_metrics(angle_errors(track(t, error, np.radians(1.0)), truth, "grade", 5.0), "grade")
    assert m.n == 300
    assert m.bias_deg == pytest.approx(2.0)
    assert m.rmse_deg == pytest.approx(np.sqrt(5))
    assert m.mae_deg == pytest.approx(2.0)
    assert m.max_deg == pytest.approx(3.0)
    assert m.std_deg == pytest.approx(1.0)
    assert m.within_2sd == pytest.approx(0.5)
    assert m.nees == pytest.approx(5.0)
    assert m.mae_percent == pytest.approx(50 * (np.tan(np.radians(1)) + np.tan(np.radians(3))))
    assert m.max_percent == pytest.approx(100 * np.tan(np.radians(3)))
    assert m.bias_percent == pytest.approx(m.mae_percent)
    m = angle_metrics(
        angle_errors(track(t, error), truth, "grade", 5.0), "grade", remove_offset=True
    )
    assert m.rmse_deg == pytest.approx(1.0)
    assert m.within_2sd is None
    assert m.nees is None


def test_errors_wrap() -> None:
    t = np.arange(0, 10, 0.01)
    truth = track(t, np.full(len(t), np.pi - 0.01))
    errors = angle_errors(track(t, np.full(len(t), -np.pi + 0.01)), truth, "grade", 0.0)
    np.testing.assert_allclose(errors.error, 0.02, atol=1e-12)


def test_no_comparison_across_a_gap_or_beyond_the_ends() -> None:
    t = np.arange(0, 20, 0.01)
    truth = track(t, np.zeros(len(t)))
    own = t[((t < 8) | (t > 12)) & (t < 16)]
    errors = angle_errors(track(own, np.zeros(len(own))), truth, "grade", 0.0)
    m = angle_metrics(errors, "grade")
    assert m.matched_share == pytest.approx(12 / 20, abs=0.002)
    assert m.valid_share == m.matched_share
    assert not errors.matched[(errors.time > 8.01) & (errors.time < 12)].any()


def test_only_valid_samples_count() -> None:
    t = np.arange(0, 10, 0.01)
    wrong = np.where(t < 5, 1.0, 0.0)
    m = angle_metrics(
        angle_errors(track(t, wrong, valid=t > 5), track(t, 0 * t), "grade", 0.0), "grade"
    )
    assert m.rmse_deg == 0.0
    assert m.matched_share == pytest.approx(1.0)
    assert m.valid_share == pytest.approx(0.5, abs=0.01)


def test_nothing_valid_gives_none_not_zero() -> None:
    t = np.arange(0, 10, 0.01)
    none = np.zeros(len(t), np.bool_)
    m = angle_metrics(
        angle_errors(track(t, 0 * t, valid=none), track(t, 0 * t), "grade", 0.0), "grade"
    )
    assert (m.n, m.valid_share, m.rmse_deg, m.nees) == (0, 0.0, None, None)


def test_log_without_truth_or_estimate_is_explained(tmp_path: Path) -> None:
    log = create(tmp_path / "no_truth.mcap", hill_tables(5.0)[:2])
    with pytest.raises(LogReadError, match=r"has no truth on /truth/angles"):
        evaluate(log)
    log = create(tmp_path / "no_estimate.mcap", hill_tables(5.0))
    with pytest.raises(LogReadError, match="run `roadlog estimate"):
        evaluate(log)


def stops_log(path: Path, pitch_deg: list[float]) -> DriveLog:
    """Events every 10 s of a body at 1 deg that still rocks when it has just stopped."""
    t = np.arange(0, 10 * len(pitch_deg) + 20, 0.1)
    time = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    rocking = np.radians(1.0 + np.where(t % 10 < 1, 0.7, 0.0))
    angles = {f"{a}{end}": np.full(len(t), np.nan) for a in ANGLES for end in ("", "_sd")}
    angles |= {"flags": np.zeros(len(t), np.uint32), "valid": np.ones(len(t), np.bool_)}
    n = len(pitch_deg)
    pitch = np.radians(pitch_deg)
    events = {
        "kind": np.full(n, DECELERATION, np.int32),
        "pitch": pitch,
        "pitch_mean": np.cumsum(pitch) / np.arange(1, n + 1),
        "standstill": np.full(n, 5.0),
        "flags": np.zeros(n, np.uint32),
        "valid": np.arange(n) != 1,  # the second one does not count
    }
    at = EPOCH_NS + np.arange(n) * 10 * 10**9
    tables = [
        Table(TRUTH_TOPIC, ANGLES_SCHEMA, time, angles | {"pitch": rocking}),
        Table("/estimates/static_slope/angles", ANGLES_SCHEMA, time, angles),
        Table("/estimates/static_slope/events", STOP_EVENT, at, events),
    ]
    return create(path, tables)


def test_events_at_stops_are_held_to_the_body_at_rest(tmp_path: Path) -> None:
    log = stops_log(tmp_path / "stops.mcap", [1.6, 9.0, 1.3, 1.0, 0.9])
    found = stop_metrics(log)["static_slope"]
    assert (found.events, found.compared) == (5, 4)
    assert found.bias_deg == pytest.approx(0.2)
    assert found.within_02_deg == pytest.approx(0.5)
    assert found.within_05_deg == pytest.approx(0.75)
    assert found.converged_after is None  # the mean is still 1.8 deg off
    near = stops_log(tmp_path / "near.mcap", [1.6, 1.0, 0.9, 1.0])
    assert stop_metrics(near)["static_slope"].converged_after == 2
    without = stop_metrics(near, remove_offset=True)["static_slope"]
    assert without.within_05_deg == 1.0
    assert to_json(near, {}, stops={"static_slope": found})["stops"]["static_slope"]["events"] == 5
