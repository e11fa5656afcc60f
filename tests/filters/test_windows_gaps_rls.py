"""Windows, gaps and recursive least squares, each by a case that is counted by hand."""

import numpy as np
import pytest

from roadlog.filters.gaps import age, hold
from roadlog.filters.rls import Regression, rls
from roadlog.filters.windows import moving_count, moving_mean, moving_std, moving_sum

NAN = np.nan


def test_moving_sums_are_cut_off_at_the_ends_and_take_nan_for_nothing() -> None:
    values = np.array([1.0, 2.0, NAN, 4.0, 5.0])
    np.testing.assert_allclose(moving_sum(values, 3), [1, 3, 3, 6, 9])
    np.testing.assert_allclose(moving_sum(values, 3, centered=True), [3, 3, 6, 9, 9])
    np.testing.assert_allclose(moving_count(values, 3), [1, 2, 2, 2, 2])
    np.testing.assert_allclose(moving_mean(values, 3), [1, 1.5, 1.5, 3, 4.5])


def test_a_window_without_a_sample_has_no_mean() -> None:
    values = np.array([NAN, NAN, 3.0])
    np.testing.assert_allclose(moving_mean(values, 2), [NAN, NAN, 3.0])
    assert np.isnan(moving_std(np.full(4, NAN), 2)).all()


def test_moving_std_keeps_its_digits_on_a_large_offset() -> None:
    rng = np.random.default_rng(1)
    values = rng.normal(size=200)
    expected = [np.std(values[max(0, k - 19) : k + 1]) for k in range(200)]
    np.testing.assert_allclose(moving_std(1e6 + values, 20), expected, atol=1e-6)


def test_hold_fills_at_most_its_limit_and_nothing_before_the_first() -> None:
    values = np.array([NAN, 1.0, NAN, NAN, NAN, 2.0])
    filled, where = hold(values, 2)
    np.testing.assert_allclose(filled, [NAN, 1, 1, 1, NAN, 2])
    assert where.tolist() == [False, False, True, True, False, False]


def test_age_counts_from_the_last_known_sample() -> None:
    known = np.array([False, True, False, False, True])
    np.testing.assert_allclose(age(known), [np.inf, 0, 1, 2, 0])


@pytest.mark.parametrize("engine", ["compiled", "reference"])
def test_recursion_without_forgetting_is_least_squares(engine) -> None:
    rng = np.random.default_rng(2)
    a = rng.normal(size=(50, 2))
    y = a @ [0.3, -2.0] + 0.01 * rng.normal(size=50)
    update = np.ones(50, bool)
    update[10:20] = False  # a gap teaches nothing
    track = rls(Regression(a[:, 0], a[:, 1], y, update), 1.0, 1e8, np.inf, engine)
    expected = np.linalg.lstsq(a[update], y[update])[0]
    np.testing.assert_allclose(track.x[-1], expected, atol=1e-7)
    np.testing.assert_array_equal(track.x[10:20], np.tile(track.x[9], (10, 1)))
    assert np.isnan(track.error[10:20]).all()
    assert np.isfinite(track.error[update]).all()
    variance = np.linalg.inv(a[update].T @ a[update])[0, 0]
    assert track.p11[-1] == pytest.approx(variance, rel=1e-5)


def test_cap_on_the_trace_holds_without_excitation() -> None:
    zeros, ones = np.zeros(2000), np.ones(2000)
    track = rls(Regression(zeros, ones, ones, ones > 0), 0.99, 1.0, 50.0, "compiled")
    assert track.p11.max() <= 50.0
