"""Unscented Kalman filter: the steps that every nonlinear estimator here shares.

Merwe's scaled sigma points with alpha = 1, beta = 2, kappa = 0. The small alpha = 1e-3 of the
textbooks weights the center with -1e6 and costs ten digits:
docs/methods/common.md#unscented-filter.
The loop over samples is the estimator's own, so that its model is compiled into it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from roadlog.jit import compiled, reordered
from roadlog.types import Floats

ALPHA, BETA, KAPPA = 1.0, 2.0, 0.0
# the center weighs 0 in the mean and 1 - alpha^2 + beta in the covariance, the others 1 / (2 n)
CENTER_SCALE = np.sqrt(1.0 - ALPHA**2 + BETA)
FIRST_REPAIR, REPAIRS = 1e-12, 12  # added to the correlation's diagonal, times 10 each try


@compiled
def cholesky(P: Floats, L: Floats) -> bool:
    """Lower factor of P into L, by way of the correlation matrix; True when P was repaired.

    States as different as rad/s and kN would otherwise cost conditioning.
    """
    n = len(P)
    scale = np.empty(n)
    for i in range(n):
        scale[i] = np.sqrt(P[i, i]) if P[i, i] > 0.0 else 1e-150
    extra = 0.0
    for attempt in range(REPAIRS + 1):
        positive = True
        for i in range(n):
            for j in range(i + 1):
                s = P[i, j] / (scale[i] * scale[j])
                if i == j:
                    s += extra
                for k in range(j):
                    s -= L[i, k] * L[j, k]
                if i > j:
                    L[i, j] = s / L[j, j]
                elif s > 0.0:
                    L[i, i] = np.sqrt(s)
                else:
                    positive = False
                    break
            if not positive:
                break
        if positive:
            break
        extra = FIRST_REPAIR * 10.0**attempt
    for i in range(n):
        for j in range(n):
            L[i, j] = L[i, j] * scale[i] if j <= i else 0.0
    return extra > 0.0


@compiled
def sigma_points(x: Floats, P: Floats, X: Floats) -> bool:
    """The 2 n + 1 sigma points of (x, P) into X (2 n + 1, n); True when P was repaired."""
    n = len(x)
    L = np.empty((n, n))
    repaired = cholesky(P, L)
    spread = np.sqrt(float(n))
    for j in range(n):
        X[0, j] = x[j]
    for i in range(n):
        for j in range(n):
            X[1 + i, j] = x[j] + spread * L[j, i]
            X[1 + n + i, j] = x[j] - spread * L[j, i]
    return repaired


@reordered
def _dot(a: Floats, b: Floats) -> float:
    s = 0.0
    for i in range(len(a)):
        s += a[i] * b[i]
    return s


@compiled
def mean_and_covariance(X: Floats, Q: Floats, x: Floats, P: Floats) -> None:
    """Mean and covariance of propagated sigma points, with noise diag Q added, into x and P."""
    n = X.shape[1]
    for j in range(n):
        x[j] = 0.0
        for p in range(1, len(X)):
            x[j] += X[p, j]
        x[j] /= len(X) - 1
    D = np.empty((n, len(X)))
    for i in range(n):
        for p in range(len(X)):
            D[i, p] = X[p, i] - x[i]
        D[i, 0] *= CENTER_SCALE * np.sqrt(len(X) - 1.0)
    for i in range(n):
        for j in range(i + 1):
            P[i, j] = _dot(D[i], D[j]) / (len(X) - 1)
            P[j, i] = P[i, j]
        P[i, i] += Q[i]


@compiled
def correct(x: Floats, P: Floats, X: Floats, Z: Floats, z: Floats, R: Floats) -> None:
    """Correct x and P in place by the measurements z, noise diag R; NaN rows of z are left out.

    X (2 n + 1, n): sigma points of (x, P). Z (2 n + 1, m): what each point would measure.
    """
    points, n = X.shape
    rows, m = np.empty(len(z), np.int64), 0
    for i in range(len(z)):
        if np.isfinite(z[i]):
            rows[m] = i
            m += 1
    if m == 0:
        return
    center = CENTER_SCALE * np.sqrt(points - 1.0)
    D, residual = np.empty((m, points)), np.empty(m)
    for i in range(m):
        mean = 0.0
        for p in range(1, points):
            mean += Z[p, rows[i]]
        mean /= points - 1
        residual[i] = z[rows[i]] - mean
        for p in range(points):
            D[i, p] = Z[p, rows[i]] - mean
        D[i, 0] *= center
    S, A, d = np.empty((m, m)), np.empty((n, m)), np.empty(points)
    for i in range(m):
        for j in range(i + 1):
            S[i, j] = _dot(D[i], D[j]) / (points - 1)
            S[j, i] = S[i, j]
        S[i, i] += R[rows[i]]
    for i in range(n):
        for p in range(points):
            d[p] = X[p, i] - x[i]
        d[0] *= center
        for j in range(m):
            A[i, j] = _dot(d, D[j]) / (points - 1)
    L = np.empty((m, m))
    cholesky(S, L)
    # A, so far Pxz, becomes Pxz L^-T: then K S K' = A A' and K residual = A (L^-1 residual)
    for j in range(m):
        scale = 1.0 / L[j, j]
        residual[j] = (residual[j] - _dot(L[j, :j], residual[:j])) * scale
        for i in range(n):
            A[i, j] = (A[i, j] - _dot(L[j, :j], A[i, :j])) * scale
    for i in range(n):
        x[i] += _dot(A[i], residual)
        for j in range(i + 1):
            P[i, j] -= _dot(A[i], A[j])
            P[j, i] = P[i, j]


@compiled
def keep_upright(x: Floats, P: Floats, i: int, variance: float) -> None:
    """Start an angle anew that bad input drove beyond the vertical, where its sine folds back."""
    if abs(x[i]) > np.pi / 2:
        restart_state(x, P, i, 0.0, variance)


@compiled
def restart_state(x: Floats, P: Floats, i: int, value: float, variance: float) -> None:
    """Set one state anew: its value, its variance, and no correlation with the others."""
    for j in range(len(x)):
        P[i, j] = 0.0
        P[j, i] = 0.0
    x[i] = value
    P[i, i] = variance


def reference_ukf(x: Floats, P: Floats, Q: Floats) -> Any:
    """filterpy's UnscentedKalmanFilter at the same start, with the same sigma points.

    The process and measurement functions go to its `predict(fx=...)` and `update(hx=...)`.
    """
    from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

    n = len(x)
    points = MerweScaledSigmaPoints(n, ALPHA, BETA, KAPPA)
    ukf = UnscentedKalmanFilter(n, 1, 1.0, hx=None, fx=None, points=points)
    ukf.x, ukf.P, ukf.Q = x.copy(), P.copy(), np.diag(Q)
    ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
    return ukf
