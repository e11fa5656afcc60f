"""Linear Kalman filter and Rauch-Tung-Striebel smoother over whole records.

The model is data: matrices per step. The compiled engine and filterpy run the same model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.filters import Engine
from roadlog.jit import argument, compiled
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
class StateTrack:
    """States x (N, n) and covariances P (N, n, n)."""

    x: Floats
    P: Floats

    def sd(self, state: int) -> Floats:
        """Standard deviation of one state, (N,)."""
        return np.sqrt(self.P[:, state, state])


def kalman_filter(model: LinearModel, engine: Engine = "compiled") -> StateTrack:
    """Filtered states: each step from all measurements up to it."""
    if engine == "reference":
        return _filter_reference(model)
    n = len(model.x0)
    track = StateTrack(np.empty((len(model.z), n)), np.empty((len(model.z), n, n)))
    _filter(*_arrays(model), track.x, track.P, np.empty((n, n)))
    return track


def rts_smoother(
    model: LinearModel, filtered: StateTrack, engine: Engine = "compiled"
) -> StateTrack:
    """Smoothed states: each step from all measurements (Rauch, Tung, Striebel 1965).

    They take the place of `filtered`, which is used up: hours of covariances need room once.
    """
    if engine == "reference":
        return _smooth_reference(model, filtered)
    _, _, F, Q, _, _, u, _ = _arrays(model)
    n = len(model.x0)
    _smooth(filtered.x, filtered.P, F, Q, u, np.empty((2, n)), np.empty((4, n, n)))
    return filtered


def _arrays(model: LinearModel) -> tuple[Floats, ...]:
    parts = (model.x0, model.P0, model.F, model.Q, model.H, model.R, model.u, model.z)
    return tuple(argument(part) for part in parts)


@compiled
def predict_covariance(P: Floats, F: Floats, Q: Floats, FP: Floats, S: Floats) -> None:
    """S <- F P F' + Q, symmetric, and F P into FP; S may be P."""
    n = len(P)
    for i in range(n):
        for j in range(n):
            FP[i, j] = 0.0
            for k in range(n):
                FP[i, j] += F[i, k] * P[k, j]
    for i in range(n):
        for j in range(i + 1):
            s = Q[i, j]
            for k in range(n):
                s += FP[i, k] * F[j, k]
            S[i, j] = S[j, i] = s


@compiled
def correct_scalar(x: Floats, P: Floats, residual: float, h: Floats, r: float, Ph: Floats) -> None:
    """One scalar measurement in place: residual = z - h(x), h the row of H, r its variance.

    P stays symmetric; only one triangle is computed. Ph (n,): scratch.
    """
    n = len(x)
    s = r
    for i in range(n):
        Ph[i] = 0.0
        for j in range(n):
            Ph[i] += P[i, j] * h[j]
    for i in range(n):
        s += h[i] * Ph[i]
    for i in range(n):
        x[i] += Ph[i] / s * residual
        for j in range(i + 1):
            P[i, j] -= Ph[i] * Ph[j] / s
            P[j, i] = P[i, j]


@compiled
def _predict_mean(x: Floats, F: Floats, u: Floats, y: Floats) -> None:
    """y <- F x + u."""
    for i in range(len(x)):
        y[i] = u[i]
        for j in range(len(x)):
            y[i] += F[i, j] * x[j]


@compiled
def _filter(
    x0: Floats,
    P0: Floats,
    F: Floats,
    Q: Floats,
    H: Floats,
    R: Floats,
    u: Floats,
    z: Floats,
    xs: Floats,
    Ps: Floats,
    FP: Floats,
) -> None:
    n = len(x0)
    for k in range(len(z)):
        x, P = xs[k], Ps[k]
        if k > 0:
            _predict_mean(xs[k - 1], F[k % len(F)], u[k], x)
            predict_covariance(Ps[k - 1], F[k % len(F)], Q[k % len(Q)], FP, P)
        else:
            for i in range(n):
                x[i] = x0[i]
                for j in range(n):
                    P[i, j] = P0[i, j]
        for i in range(z.shape[1]):
            if np.isfinite(z[k, i]):
                h = H[k % len(H), i]
                residual = z[k, i]
                for j in range(n):
                    residual -= h[j] * x[j]
                correct_scalar(x, P, residual, h, R[k % len(R), i], FP[0])


@compiled
def solve_spd(A: Floats, B: Floats, scale: Floats) -> None:
    """B <- A^-1 B for a symmetric positive definite A, which is used up. scale (n,): scratch.

    Factored after scaling to unit diagonal: states with units as different as rad and m/s would
    otherwise cost half the digits.
    """
    n, m = B.shape
    for i in range(n):
        scale[i] = 1.0 / np.sqrt(A[i, i]) if A[i, i] > 0 else 1.0
    for i in range(n):
        for j in range(i + 1):
            s = A[i, j] * scale[i] * scale[j]
            if i == j:
                s += 1e-12
            for k in range(j):
                s -= A[i, k] * A[j, k]
            if i == j:
                A[i, i] = np.sqrt(max(s, 1e-15))
            else:
                A[i, j] = s / A[j, j]
    for c in range(m):
        for i in range(n):
            s = B[i, c] * scale[i]
            for k in range(i):
                s -= A[i, k] * B[k, c]
            B[i, c] = s / A[i, i]
        for i in range(n - 1, -1, -1):
            s = B[i, c]
            for k in range(i + 1, n):
                s -= A[k, i] * B[k, c]
            B[i, c] = s / A[i, i]
        for i in range(n):
            B[i, c] *= scale[i]


@compiled
def smooth_step(
    x: Floats, P: Floats, x_next: Floats, P_next: Floats, prior: Floats, work: Floats
) -> None:
    """One RTS step back: filtered (x, P) and the smoothed next state -> smoothed (x, P), in place.

    prior (2, n): prediction of the next state from x, then scratch. work (4, n, n): its covariance
    and F P, as `predict_covariance` gives them, then scratch.
    """
    n = len(x)
    x_prior, scale = prior[0], prior[1]
    P_prior, Ct, D, CD = work[0], work[1], work[2], work[3]
    for i in range(n):
        for j in range(n):
            D[i, j] = P_next[i, j] - P_prior[i, j]
    solve_spd(P_prior, Ct, scale)  # C' with C = P F' P_prior^-1
    for i in range(n):
        for j in range(n):
            x[i] += Ct[j, i] * (x_next[j] - x_prior[j])
            CD[i, j] = 0.0
            for k in range(n):
                CD[i, j] += Ct[k, i] * D[k, j]
    for i in range(n):
        for j in range(i + 1):
            for k in range(n):
                P[i, j] += CD[i, k] * Ct[k, j]
            P[j, i] = P[i, j]


@compiled
def _smooth(
    xs: Floats, Ps: Floats, F: Floats, Q: Floats, u: Floats, prior: Floats, work: Floats
) -> None:
    for k in range(len(xs) - 2, -1, -1):
        Fk = F[(k + 1) % len(F)]
        _predict_mean(xs[k], Fk, u[k + 1], prior[0])
        predict_covariance(Ps[k], Fk, Q[(k + 1) % len(Q)], work[1], work[0])
        smooth_step(xs[k], Ps[k], xs[k + 1], Ps[k + 1], prior, work)


def _filter_reference(model: LinearModel) -> StateTrack:
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
    return StateTrack(xs, Ps)


def _smooth_reference(model: LinearModel, filtered: StateTrack) -> StateTrack:
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
    return StateTrack(xs, Ps)
