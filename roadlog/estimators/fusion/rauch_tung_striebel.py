"""Reference engine of `fusion`: filterpy's filter, Rauch-Tung-Striebel recursion in NumPy."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import KalmanFilter

from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.outputs import given_variances, output_rows
from roadlog.estimators.fusion.recursion import (
    is_reported,
    prediction,
    residual_row,
    restart,
    soft_variance,
)
from roadlog.estimators.fusion.states import MOVING, ROWS, W_THETA, N, State
from roadlog.estimators.fusion.steps import Steps
from roadlog.types import Floats


def noise_matrix(q: Floats) -> Floats:
    """Q (29, 29) from what `process_noise` writes."""
    Q = np.diag(q[:N])
    Q[State.W, State.THETA] = Q[State.THETA, State.W] = q[W_THETA]
    return Q


def rauch_tung_striebel(
    steps: Steps, noise: Noise, P0: Floats, at: Floats, look_ahead: bool
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """The fields of `Smoothed`; the arguments are those of the compiled engine."""

    n = len(steps.speed)
    kf = KalmanFilter(N, 1, dim_u=N)
    kf.x, kf.P, kf.B = steps.starts[0].reshape(N, 1).copy(), P0.copy(), np.eye(N)
    runs = np.flatnonzero(steps.alive)
    xs, variance, shape = np.full((n, N), np.nan), np.full((n, 6), np.nan), np.full((n, 2), np.nan)
    innovations = np.full((n, ROWS), np.nan)
    filtered, priors, transitions = [], [], []
    for k in runs:
        F, q = np.zeros((N, N)), np.zeros(N + 1)
        x = kf.x[:, 0].copy()
        if steps.start[k] >= 0:
            restart(x, kf.P, steps.starts[steps.start[k]], P0)
            kf.x = x.reshape(N, 1)
            F[np.diag_indices(N)] = ~np.isin(np.arange(N), MOVING)
        else:
            y = prediction(k - 1, x, steps, noise, at, F, q)
            kf.predict(u=(y - F @ x).reshape(N, 1), F=F, Q=noise_matrix(q))
        transitions.append(F)
        priors.append((kf.x[:, 0].copy(), kf.P.copy()))
        for kind in range(ROWS):
            h = np.zeros(N)
            x = kf.x[:, 0]
            residual, sd, gate = residual_row(kind, k, x, steps, noise, at, h)
            if np.isfinite(residual):
                spread = float(h @ kf.P @ h)
                variance_of_row = soft_variance(residual, spread, sd, gate)
                innovations[k, kind] = residual / np.sqrt(spread + variance_of_row)
                kf.update(residual + h @ x, R=variance_of_row, H=h.reshape(1, N))
        filtered.append((kf.x[:, 0].copy(), kf.P.copy()))
    x, P = filtered[-1]
    for i in range(len(runs) - 1, -1, -1):
        if not look_ahead:
            x, P = filtered[i]
        elif i < len(runs) - 1:
            (x_filtered, P_filtered), (x_prior, P_prior) = filtered[i], priors[i + 1]
            scale = 1 / np.sqrt(np.diag(P_prior))
            scaled = P_prior * scale[:, None] * scale
            FP = transitions[i + 1] @ P_filtered
            C = (scale[:, None] * np.linalg.solve(scaled, scale[:, None] * FP)).T
            x = x_filtered + C @ (x - x_prior)
            P = P_filtered + C @ (P - P_prior) @ C.T
        k = runs[i]
        xs[k] = x
        if is_reported(k, steps, noise):
            rows = output_rows(steps.sway[k], noise)
            given_variances(rows @ P @ rows.T, variance[k], shape[k])
    return xs, variance, shape, *filtered[-1], innovations
