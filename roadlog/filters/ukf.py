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


def padded(n: int) -> int:
    """Length of a row of n numbers in this module: registers hold four, and work four at a time."""
    return -(-n // 16) * 16


@compiled
def cholesky(P: Floats, U: Floats) -> bool:
    """Upper factor of P = U' U into U, by way of the correlation matrix; True when P was repaired.

    States as different as rad/s and kN would otherwise cost conditioning. P, U (n, padded).
    """
    n, width = len(P), U.shape[1]
    scale = np.zeros(width)
    for i in range(n):
        scale[i] = 1.0 / np.sqrt(P[i, i]) if P[i, i] > 0.0 else 1e150
    extra = 0.0
    for attempt in range(REPAIRS + 1):
        for i in range(n):
            for j in range(width):
                U[i, j] = P[i, j] * (scale[i] * scale[j])
            U[i, i] += extra
        positive = True
        for j in range(n):
            if not U[j, j] > 0.0:
                positive = False
                break
            root = 1.0 / np.sqrt(U[j, j])
            for k in range(width):
                U[j, k] *= root
            for i in range(j + 1, n):
                factor = U[j, i]
                for k in range(width):
                    U[i, k] -= factor * U[j, k]
        if positive:
            break
        extra = FIRST_REPAIR * 10.0**attempt
    for i in range(n):
        for j in range(i):
            U[i, j] = 0.0
        for j in range(i, n):
            U[i, j] /= scale[j]
    return extra > 0.0


@compiled
def sigma_points(x: Floats, P: Floats, U: Floats, X: Floats) -> bool:
    """The 2 n + 1 sigma points of (x, P) into X (2 n + 1, n); True when P was repaired.

    P, U (n, padded): the factor of P goes into U.
    """
    n = len(x)
    repaired = cholesky(P, U)
    spread = np.sqrt(float(n))
    for j in range(n):
        X[0, j] = x[j]
    for i in range(n):
        for j in range(n):
            X[1 + i, j] = x[j] + spread * U[i, j]
            X[1 + n + i, j] = x[j] - spread * U[i, j]
    return repaired


@reordered
def _dot(a: Floats, b: Floats) -> float:
    s = 0.0
    for i in range(len(a)):
        s += a[i] * b[i]
    return s


@compiled
def _deviations(Z: Floats, column: int, d: Floats) -> float:
    """Mean of a column of sigma points; deviations, of the center weighed, into d (padded,)."""
    points, mean = len(Z), 0.0
    for p in range(1, points):
        mean += Z[p, column]
    mean /= points - 1
    for p in range(points):
        d[p] = Z[p, column] - mean
    d[0] *= CENTER_SCALE * np.sqrt(points - 1.0)
    return mean


@compiled
def mean_and_covariance(X: Floats, Q: Floats, x: Floats, P: Floats, D: Floats) -> None:
    """Mean and covariance of propagated sigma points, with noise diag Q added, into x and P.

    D (n or more, padded), 0 behind the points: scratch.
    """
    for i in range(len(x)):
        x[i] = _deviations(X, i, D[i])
    for i in range(len(x)):
        for j in range(i + 1):
            P[i, j] = P[j, i] = _dot(D[i], D[j]) / (len(X) - 1)
        P[i, i] += Q[i]


@compiled
def correct(
    x: Floats, P: Floats, U: Floats, Z: Floats, z: Floats, R: Floats, D: Floats, work: Floats
) -> None:
    """Correct x and P in place by the measurements z, noise diag R; NaN rows of z are left out.

    U: factor of P. Z (2 n + 1, m): what each sigma point would measure. D (m or more, padded), 0
    behind the points, and work (3, m, padded): scratch.
    """
    n, width = len(x), P.shape[1]
    S, V, C = work[0], work[1], work[2]
    residual = np.empty(len(z))
    m = 0
    for row in range(len(z)):
        if np.isfinite(z[row]):
            residual[m] = z[row] - _deviations(Z, row, D[m])
            for j in range(m + 1):
                S[m, j] = S[j, m] = _dot(D[m], D[j]) / (2 * n)
            S[m, m] += R[row]
            m += 1
    if m == 0:
        return
    # C, the covariance with the state: its deviations are the rows of U, to either side
    share = np.sqrt(float(n)) / (2 * n)
    for j in range(m):
        for i in range(width):
            C[j, i] = 0.0
        for k in range(n):
            both = share * (D[j, 1 + k] - D[j, 1 + n + k])
            for i in range(width):
                C[j, i] += both * U[k, i]
    cholesky(S[:m], V[:m])
    # C becomes V'^-1 C: then K S K' = C' C and K residual = C' (V'^-1 residual)
    for j in range(m):
        scale = 1.0 / V[j, j]
        residual[j] *= scale
        for i in range(width):
            C[j, i] *= scale
        for k in range(j + 1, m):
            factor = V[j, k]
            residual[k] -= factor * residual[j]
            for i in range(width):
                C[k, i] -= factor * C[j, i]
    for j in range(m):
        for i in range(n):
            x[i] += C[j, i] * residual[j]
            factor = C[j, i]
            for k in range(width):
                P[i, k] -= factor * C[j, k]


@compiled
def correct_linear(
    x: Floats, P: Floats, z: Floats, predicted: Floats, H: Floats, R: Floats, work: Floats
) -> None:
    """The same where no measurement is curved in the state, one after the other, without points.

    predicted (m,): what x would measure. H (m, padded): its derivative. R as of `correct`. work
    (2 or more, padded): scratch, whose second row must begin with x.
    """
    n, width = len(x), P.shape[1]
    Ph, before = work[0], work[1]
    for row in range(len(z)):
        if not np.isfinite(z[row]):
            continue
        residual, s = z[row] - predicted[row], R[row]
        for k in range(width):
            Ph[k] = 0.0
        for i in range(n):
            h = H[row, i]
            if h != 0.0:
                residual -= h * (x[i] - before[i])
                for k in range(width):
                    Ph[k] += h * P[i, k]
        for i in range(n):
            s += H[row, i] * Ph[i]
        for i in range(n):
            gain = Ph[i] / s
            x[i] += gain * residual
            for k in range(width):
                P[i, k] -= gain * Ph[k]


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
