import numpy as np
import pytest

from roadlog.filters.ukf import (
    cholesky,
    correct,
    correct_linear,
    mean_and_covariance,
    padded,
    sigma_points,
)


def covariance(n: int, seed: int = 0) -> np.ndarray:
    """Positive definite, with states from 1e-3 to 1e3."""
    A = np.random.default_rng(seed).standard_normal((n, 2 * n))
    scale = np.logspace(-3, 3, n)
    return A @ A.T * np.outer(scale, scale)


def wide(P: np.ndarray) -> np.ndarray:
    """With rows as long as the filter has them."""
    return np.pad(P, ((0, 0), (0, padded(len(P)) - len(P))))


def test_cholesky_factors_badly_scaled_covariances() -> None:
    P, U = covariance(15), np.empty((15, padded(15)))
    assert not cholesky(wide(P), U)
    U = U[:, :15]
    np.testing.assert_allclose(U.T @ U, P, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(U.T, np.linalg.cholesky(P), rtol=1e-9, atol=1e-12)


def test_cholesky_repairs_a_singular_covariance_and_says_so() -> None:
    P = np.array([[1.0, 1.0 + 1e-13], [1.0 + 1e-13, 1.0]])  # eigenvalue -1e-13
    U = np.empty((2, padded(2)))
    assert cholesky(wide(P), U)
    np.testing.assert_allclose((U.T @ U)[:2, :2], P, atol=1e-11)


def test_sigma_points_carry_mean_and_covariance() -> None:
    n = 6
    x, P, X = np.arange(6.0), covariance(n), np.empty((2 * n + 1, n))
    assert not sigma_points(x, wide(P), np.empty((n, padded(n))), X)
    mean, spread = np.empty(n), np.empty((n, n))
    mean_and_covariance(X, np.zeros(n), mean, spread, np.zeros((n, padded(2 * n + 1))))
    np.testing.assert_allclose(mean, x, atol=1e-11)
    np.testing.assert_allclose(spread, P, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("missing", [(), (1,), (0, 2)])
def test_correction_of_a_linear_model_is_kalmans(missing: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    n, m = 4, 3
    x, P, H, R = (
        np.ones(n),
        covariance(n, 2),
        rng.standard_normal((m, n)),
        np.array([0.1, 1.0, 10.0]),
    )
    z = rng.standard_normal(m)
    z[list(missing)] = np.nan
    X, U = np.empty((2 * n + 1, n)), np.empty((n, padded(n)))
    y, S = x.copy(), wide(P)
    sigma_points(x, S, U, X)
    D, work = np.zeros((m, padded(2 * n + 1))), np.zeros((3, m, padded(n)))
    correct(y, S, U, X @ H.T, z, R, D, work)
    S = S[:, :n]
    known = np.isfinite(z)
    Hk = H[known]
    K = P @ Hk.T @ np.linalg.inv(Hk @ P @ Hk.T + np.diag(R[known]))
    np.testing.assert_allclose(y, x + K @ (z[known] - Hk @ x), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(S, P - K @ Hk @ P, rtol=1e-6, atol=1e-9 * P.max())


@pytest.mark.parametrize("missing", [(), (1,), (0, 2)])
def test_linear_rows_one_after_the_other_correct_as_points_do(missing: tuple[int, ...]) -> None:
    """The filters take the former where no row is curved, the latter where one is."""
    rng = np.random.default_rng(5)
    n, m = 4, 3
    P, H, R = covariance(n, 6), rng.standard_normal((m, n)), np.array([0.1, 1.0, 10.0])
    H[0, 2] = H[2, 1] = 0.0
    x, z, offset = np.ones(n), rng.standard_normal(m), np.array([0.0, 3.0, -1.0])
    z[list(missing)] = np.nan
    X, U = np.empty((2 * n + 1, n)), np.empty((n, padded(n)))
    by_points, by_rows = (x.copy(), wide(P)), (x.copy(), wide(P))
    sigma_points(*by_points, U, X)
    D, work = np.zeros((m, padded(2 * n + 1))), np.zeros((3, m, padded(n)))
    correct(*by_points, U, X @ H.T + offset, z, R, D, work)
    scratch = np.zeros((2, padded(n)))
    scratch[1, :n] = x
    correct_linear(*by_rows, z, H @ x + offset, H, R, scratch)
    np.testing.assert_allclose(by_rows[0], by_points[0], rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(by_rows[1], by_points[1], rtol=1e-6, atol=1e-9 * P.max())
