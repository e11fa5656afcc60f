"""The compiled filter against filterpy, and the smoother against one big least squares."""

import numpy as np
import pytest

from roadlog.filters.kalman import LinearModel, kalman_filter, rts_smoother, solve_spd
from roadlog.filters.kernels import odd_window, parabolic_mean, slope


@pytest.fixture
def model() -> LinearModel:
    """A time-varying three-state model with input, two measurements and holes in both."""
    rng = np.random.default_rng(4)
    steps = 200
    F = np.eye(3) + 0.05 * rng.normal(size=(steps, 3, 3))
    z = rng.normal(size=(steps, 2))
    z[rng.random((steps, 2)) < 0.3] = np.nan
    return LinearModel(
        x0=np.array([1.0, -1.0, 0.5]),
        P0=np.diag([1.0, 2.0, 0.1]),
        F=F,
        Q=np.diag([0.01, 0.02, 0.001])[None],
        H=rng.normal(size=(1, 2, 3)),
        R=np.array([[0.1, 0.5]]),
        u=0.1 * rng.normal(size=(steps, 3)),
        z=z,
    )


def test_filter_equals_filterpy(model: LinearModel) -> None:
    ours, theirs = kalman_filter(model), kalman_filter(model, "reference")
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-9)
    np.testing.assert_allclose(ours.P, theirs.P, atol=1e-9)


def test_smoother_equals_plain_numpy(model: LinearModel) -> None:
    ours = rts_smoother(model, kalman_filter(model))
    theirs = rts_smoother(model, kalman_filter(model, "reference"), "reference")
    np.testing.assert_allclose(ours.x, theirs.x, atol=1e-9)
    np.testing.assert_allclose(ours.P, theirs.P, atol=1e-9)


def test_smoother_is_the_least_squares_solution(model: LinearModel) -> None:
    """RTS of a linear model = the minimum of the sum of all weighted squares at once."""
    steps, n = len(model.z), 3
    rows, right = [], []

    def add(blocks: dict[int, np.ndarray], value: np.ndarray, covariance: np.ndarray) -> None:
        weight = np.linalg.inv(np.linalg.cholesky(covariance))
        row = np.zeros((len(value), steps * n))
        for k, block in blocks.items():
            row[:, k * n : (k + 1) * n] = block
        rows.append(weight @ row)
        right.append(weight @ value)

    add({0: np.eye(n)}, model.x0, model.P0)
    for k in range(steps):
        if k:
            add({k: np.eye(n), k - 1: -model.F[k]}, model.u[k], model.Q[0])
        for i in np.flatnonzero(np.isfinite(model.z[k])):
            add({k: model.H[0, [i]]}, model.z[k, [i]], model.R[0, [[i]]])
    A, b = np.vstack(rows), np.concatenate(right)
    batch = np.linalg.solve(A.T @ A, A.T @ b).reshape(steps, n)
    smoothed = rts_smoother(model, kalman_filter(model))
    np.testing.assert_allclose(smoothed.x, batch, atol=1e-7)
    variance = np.diag(np.linalg.inv(A.T @ A)).reshape(steps, n)
    np.testing.assert_allclose(np.diagonal(smoothed.P, axis1=1, axis2=2), variance, rtol=1e-6)


def test_solve_spd_survives_mixed_units() -> None:
    rng = np.random.default_rng(0)
    scale = np.diag([1.0, 1e-4, 1e4])
    root = rng.normal(size=(3, 3))
    A = scale @ (root @ root.T + np.eye(3)) @ scale
    wanted = np.linalg.inv(scale) @ rng.normal(size=(3, 2))
    found = A @ wanted
    solve_spd(A, found, np.empty(3))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


@pytest.mark.parametrize(("rate", "limit"), [(1000.0, 1e-5), (100.0, 1e-3)])
@pytest.mark.parametrize("frequency", [0.1, 0.5, 1.0, 2.0])
def test_slope_is_the_derivative_averaged_by_the_parabola(
    rate: float, limit: float, frequency: float
) -> None:
    """The kernels match from 0.1 to 2 Hz; docs/methods/common.md#matched-kernel."""
    dt = 1 / rate
    n = odd_window(0.3, dt)
    t = np.arange(0, 20, dt)
    omega = 2 * np.pi * frequency
    difference = slope(np.sin(omega * t), n, dt) - parabolic_mean(omega * np.cos(omega * t), n)
    inside = slice(n, -n)
    assert np.abs(difference[inside]).max() < limit * omega
