from pathlib import Path

import numpy as np
import pytest
from conftest import EPOCH_NS, hill_tables

from roadlog.errors import LogReadError
from roadlog.log import AngleTrack, create
from roadlog.metrics import angle_errors, angle_metrics, evaluate


def track(t: np.ndarray, grade: np.ndarray, sd: float = np.nan, valid=None) -> AngleTrack:
    return AngleTrack(
        EPOCH_NS + np.round(t * 1e9).astype(np.int64),
        {"grade": grade},
        {"grade": np.full(len(t), sd)},
        np.ones(len(t), np.bool_) if valid is None else valid,
        np.zeros(len(t), np.uint32),
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
    assert m.valid_share == 1.0
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
