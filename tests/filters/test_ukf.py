import numpy as np
import pytest

from roadlog.filters.ukf import cholesky, correct, mean_and_covariance, sigma_points


def covariance(n: int, seed: int = 0) -> np.ndarray:
    """Positive definite, with states from 1e-3 to 1e3."""
    A = np.random.default_rng(seed).standard_normal((n, 2 * n))
    scale = np.logspace(-3, 3, n)
    return A @ A.T * np.outer(scale, scale)


def test_cholesky_factors_badly_scaled_covariances() -> None:
    P, L = covariance(15), np.empty((15, 15))
    assert not cholesky(P, L)
    np.testing.assert_allclose(L @ L.T, P, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(L, np.linalg.cholesky(P), rtol=1e-9, atol=1e-12)


def test_cholesky_repairs_a_singular_covariance_and_says_so() -> None:
    P = np.array([[1.0, 1.0 + 1e-13], [1.0 + 1e-13, 1.0]])  # eigenvalue -1e-13
    L = np.empty((2, 2))
    assert cholesky(P, L)
    np.testing.assert_allclose(L @ L.T, P, atol=1e-11)


def test_sigma_points_carry_mean_and_covariance() -> None:
    n = 6
    x, P, X = np.arange(6.0), covariance(n), np.empty((2 * n + 1, n))
    assert not sigma_points(x, P, X)
    mean, spread = np.empty(n), np.empty((n, n))
    mean_and_covariance(X, np.zeros(n), mean, spread)
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
    X = np.empty((2 * n + 1, n))
    sigma_points(x, P, X)
    y, S = x.copy(), P.copy()
    correct(y, S, X, X @ H.T, z, R)
    known = np.isfinite(z)
    Hk = H[known]
    K = P @ Hk.T @ np.linalg.inv(Hk @ P @ Hk.T + np.diag(R[known]))
    np.testing.assert_allclose(y, x + K @ (z[known] - Hk @ x), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(S, P - K @ Hk @ P, rtol=1e-6, atol=1e-9 * P.max())
