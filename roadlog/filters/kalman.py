"""Linear Kalman filter and Rauch-Tung-Striebel smoother over whole records.

The model is data: matrices per step. The compiled engine and filterpy run the same model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from roadlog.filters import Engine
from roadlog.types import Floats


@dataclass(frozen=True)
class LinearModel:
    """x_k = F_k x_{k-1} + u_k + noise(Q_k), z_k = H_k x_k + noise(diag R_k), k = 0 .. N-1.

    x0 (n,), P0 (n, n): before the first measurement. F, Q (N or 1, n, n); H (N or 1, m, n);
    R (N or 1, m); u (N, n); z (N, m), NaN where there is no measurement. Step 0 has no
    prediction. A first axis of length 1 means the same at every step.
    """

    x0: Floats
    P0: Floats
    F: Floats
    Q: Floats
    H: Floats
    R: Floats
    u: Floats
    z: Floats


@dataclass(frozen=True)
class Track:
    """States x (N, n) and covariances P (N, n, n)."""

    x: Floats
    P: Floats

    def sd(self, state: int) -> Floats:
        """Standard deviation of one state, (N,)."""
        return np.sqrt(self.P[:, state, state])


def kalman_filter(model: LinearModel, engine: Engine = "compiled") -> Track:
    """Filtered states: each step from all measurements up to it."""
    if engine == "reference":
        return _filter_reference(model)
    return Track(*_filter(*_arrays(model)))


def rts_smoother(model: LinearModel, filtered: Track, engine: Engine = "compiled") -> Track:
    """Smoothed states: each step from all measurements (Rauch, Tung, Striebel 1965).

    They take the place of `filtered`, which is used up: hours of covariances need room once.
    """
    if engine == "reference":
        return _smooth_reference(model, filtered)
    _, _, F, Q, _, _, u, _ = _arrays(model)
    _smooth(filtered.x, filtered.P, F, Q, u)
    return filtered


def _arrays(model: LinearModel) -> tuple[Floats, ...]:
    parts = (model.x0, model.P0, model.F, model.Q, model.H, model.R, model.u, model.z)
    return tuple(np.ascontiguousarray(part, np.float64) for part in parts)


@njit(cache=True)
def predict(x: Floats, P: Floats, F: Floats, u: Floats, Q: Floats) -> tuple[Floats, Floats]:
    """x <- F x + u, P <- F P F' + Q; returns new arrays, P symmetric."""
    n = len(x)
    y = u.copy()
    FP = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            y[i] += F[i, j] * x[j]
            for k in range(n):
                FP[i, j] += F[i, k] * P[k, j]
    S = Q.copy()
    for i in range(n):
        for j in range(i + 1):
            for k in range(n):
                S[i, j] += FP[i, k] * F[j, k]
            S[j, i] = S[i, j]
    return y, S


@njit(cache=True)
def correct_scalar(x: Floats, P: Floats, residual: float, h: Floats, r: float) -> float:
    """One scalar measurement in place: residual = z - h(x), h the row of H, r its variance.

    Returns the innovation variance. P stays symmetric; only one triangle is computed.
    """
    n = len(x)
    Ph = np.zeros(n)
    for i in range(n):
        for j in range(n):
            Ph[i] += P[i, j] * h[j]
    s = r
    for i in range(n):
        s += h[i] * Ph[i]
    for i in range(n):
        x[i] += Ph[i] / s * residual
        for j in range(i + 1):
            P[i, j] -= Ph[i] * Ph[j] / s
            P[j, i] = P[i, j]
    return s


@njit(cache=True)
def _filter(
    x0: Floats, P0: Floats, F: Floats, Q: Floats, H: Floats, R: Floats, u: Floats, z: Floats
) -> tuple[Floats, Floats]:
    steps, m = z.shape
    n = len(x0)
    xs = np.empty((steps, n))
    Ps = np.empty((steps, n, n))
    x, P = x0.copy(), P0.copy()
    for k in range(steps):
        if k > 0:
            x, P = predict(x, P, F[k % len(F)], u[k], Q[k % len(Q)])
        for i in range(m):
            if np.isfinite(z[k, i]):
                h = H[k % len(H), i]
                residual = z[k, i]
                for j in range(n):
                    residual -= h[j] * x[j]
                correct_scalar(x, P, residual, h, R[k % len(R), i])
        xs[k] = x
        Ps[k] = P
    return xs, Ps


@njit(cache=True)
def solve_spd(A: Floats, B: Floats) -> Floats:
    """A^-1 B for a symmetric positive definite A, factored after scaling to unit diagonal.

    States with units as different as rad and m/s would otherwise cost half the digits.
    """
    n, m = B.shape
    d = np.empty(n)
    for i in range(n):
        d[i] = 1.0 / np.sqrt(A[i, i]) if A[i, i] > 0 else 1.0
    L = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            s = A[i, j] * d[i] * d[j]
            if i == j:
                s += 1e-12
            for k in range(j):
                s -= L[i, k] * L[j, k]
            if i == j:
                L[i, i] = np.sqrt(max(s, 1e-15))
            else:
                L[i, j] = s / L[j, j]
    X = np.empty((n, m))
    for c in range(m):
        for i in range(n):
            s = B[i, c] * d[i]
            for k in range(i):
                s -= L[i, k] * X[k, c]
            X[i, c] = s / L[i, i]
        for i in range(n - 1, -1, -1):
            s = X[i, c]
            for k in range(i + 1, n):
                s -= L[k, i] * X[k, c]
            X[i, c] = s / L[i, i]
        for i in range(n):
            X[i, c] *= d[i]
    return X


@njit(cache=True)
def smooth_step(
    x: Floats,
    P: Floats,
    F: Floats,
    x_prior: Floats,
    P_prior: Floats,
    x_next: Floats,
    P_next: Floats,
) -> tuple[Floats, Floats]:
    """One RTS step back: filtered (x, P) and the smoothed next state -> smoothed (x, P).

    x_prior, P_prior: prediction of the next state from (x, P) with transition F.
    """
    n = len(x)
    FP = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            for k in range(n):
                FP[i, j] += F[i, k] * P[k, j]
    Ct = solve_spd(P_prior, FP)  # C' with C = P F' P_prior^-1
    y = x.copy()
    D = P_next - P_prior
    CD = np.zeros((n, n))
    for i in range(n):
        for j in range(n):
            y[i] += Ct[j, i] * (x_next[j] - x_prior[j])
            for k in range(n):
                CD[i, j] += Ct[k, i] * D[k, j]
    S = P.copy()
    for i in range(n):
        for j in range(i + 1):
            for k in range(n):
                S[i, j] += CD[i, k] * Ct[k, j]
            S[j, i] = S[i, j]
    return y, S


@njit(cache=True)
def _smooth(xs: Floats, Ps: Floats, F: Floats, Q: Floats, u: Floats) -> None:
    for k in range(len(xs) - 2, -1, -1):
        Fk = F[(k + 1) % len(F)]
        x_prior, P_prior = predict(xs[k], Ps[k], Fk, u[k + 1], Q[(k + 1) % len(Q)])
        xs[k], Ps[k] = smooth_step(xs[k], Ps[k], Fk, x_prior, P_prior, xs[k + 1], Ps[k + 1])


def _filter_reference(model: LinearModel) -> Track:
    from filterpy.kalman import KalmanFilter

    x0, P0, F, Q, H, R, u, z = _arrays(model)
    n, m = len(x0), z.shape[1]
    kf = KalmanFilter(n, m, dim_u=n)
    kf.x, kf.P, kf.B = x0.reshape(n, 1).copy(), P0.copy(), np.eye(n)
    xs, Ps = np.empty((len(z), n)), np.empty((len(z), n, n))
    for k in range(len(z)):
        if k > 0:
            kf.predict(u=u[k].reshape(n, 1), F=F[k % len(F)], Q=Q[k % len(Q)])
        known = np.isfinite(z[k])
        if known.any():
            Hk, Rk = H[k % len(H)][known], np.diag(R[k % len(R)][known])
            kf.dim_z = int(known.sum())
            kf.update(z[k][known].reshape(-1, 1), R=Rk, H=Hk)
        xs[k], Ps[k] = kf.x[:, 0], kf.P
    return Track(xs, Ps)


def _smooth_reference(model: LinearModel, filtered: Track) -> Track:
    # filterpy's rts_smoother knows no input u, hence plain NumPy
    _, _, F, Q, _, _, u, _ = _arrays(model)
    xs, Ps = filtered.x.copy(), filtered.P.copy()
    for k in range(len(xs) - 2, -1, -1):
        Fk = F[(k + 1) % len(F)]
        x_prior = Fk @ filtered.x[k] + u[k + 1]
        P_prior = Fk @ filtered.P[k] @ Fk.T + Q[(k + 1) % len(Q)]
        C = filtered.P[k] @ Fk.T @ np.linalg.inv(P_prior)
        xs[k] += C @ (xs[k + 1] - x_prior)
        Ps[k] += C @ (Ps[k + 1] - P_prior) @ C.T
    return Track(xs, Ps)
