"""Unscented Kalman filter: the steps that every nonlinear estimator here shares.

Merwe's scaled sigma points with alpha = 1, beta = 2, kappa = 0. The small alpha = 1e-3 of the
textbooks weights the center with -1e6 and costs ten digits (Ryu/Luo chapter, section 4.4.5).
The loop over samples is the estimator's own, so that its model is compiled into it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from roadlog.types import Floats

ALPHA, BETA, KAPPA = 1.0, 2.0, 0.0
CENTER_COVARIANCE_WEIGHT = 1.0 - ALPHA**2 + BETA  # the center's weight in the mean is 0
FIRST_REPAIR, REPAIRS = 1e-12, 12  # added to the correlation's diagonal, times 10 each try


@njit(cache=True)
def cholesky(P: Floats, L: Floats) -> bool:
    """Lower factor of P into L, by way of the correlation matrix; True when P was repaired.

    States as different as rad/s and kN would otherwise cost conditioning (section 4.4.6).
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


@njit(cache=True)
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


@njit(cache=True)
def mean_and_covariance(X: Floats, Q: Floats, x: Floats, P: Floats) -> None:
    """Mean and covariance of propagated sigma points, with noise diag Q added, into x and P."""
    points, n = X.shape
    weight = 1.0 / (points - 1)
    for j in range(n):
        x[j] = 0.0
        for p in range(1, points):
            x[j] += X[p, j]
        x[j] *= weight
    D = X - x
    for i in range(n):
        for j in range(i + 1):
            s = 0.0
            for p in range(1, points):
                s += D[p, i] * D[p, j]
            P[i, j] = s * weight + CENTER_COVARIANCE_WEIGHT * D[0, i] * D[0, j]
            P[j, i] = P[i, j]
        P[i, i] += Q[i]


@njit(cache=True)
def correct(x: Floats, P: Floats, X: Floats, Z: Floats, z: Floats, R: Floats) -> None:
    """Correct x and P in place by the measurements z, noise diag R; NaN rows of z are left out.

    X (2 n + 1, n): sigma points of (x, P). Z (2 n + 1, m): what each point would measure.
    """
    points, n = X.shape
    weight = 1.0 / (points - 1)
    rows = np.flatnonzero(np.isfinite(z))
    m = len(rows)
    if m == 0:
        return
    D = np.empty((points, m))
    residual = np.empty(m)
    for i in range(m):
        mean = 0.0
        for p in range(1, points):
            mean += Z[p, rows[i]]
        mean *= weight
        residual[i] = z[rows[i]] - mean
        for p in range(points):
            D[p, i] = Z[p, rows[i]] - mean
    S = np.empty((m, m))
    for i in range(m):
        for j in range(i + 1):
            s = 0.0
            for p in range(1, points):
                s += D[p, i] * D[p, j]
            S[i, j] = s * weight + CENTER_COVARIANCE_WEIGHT * D[0, i] * D[0, j]
            S[j, i] = S[i, j]
        S[i, i] += R[rows[i]]
    L = np.empty((m, m))
    cholesky(S, L)
    # A = Pxz L^-T: then K S K' = A A' and K residual = A (L^-1 residual)
    A = np.empty((n, m))
    for i in range(n):
        for j in range(m):
            s = 0.0
            for p in range(1, points):
                s += (X[p, i] - x[i]) * D[p, j]
            s = s * weight + CENTER_COVARIANCE_WEIGHT * (X[0, i] - x[i]) * D[0, j]
            for k in range(j):
                s -= L[j, k] * A[i, k]
            A[i, j] = s / L[j, j]
    for j in range(m):
        for k in range(j):
            residual[j] -= L[j, k] * residual[k]
        residual[j] /= L[j, j]
    for i in range(n):
        for j in range(m):
            x[i] += A[i, j] * residual[j]
    for i in range(n):
        for j in range(i + 1):
            for k in range(m):
                P[i, j] -= A[i, k] * A[j, k]
            P[j, i] = P[i, j]


@njit(cache=True)
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
