"""Reference engine of `fusion`: filterpy's filter, Rauch-Tung-Striebel recursion in NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from filterpy.kalman import KalmanFilter

from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.outputs import OUTPUTS, given_variances, output_rows
from roadlog.estimators.fusion.recursion import prediction, residual_row, restart, soft_variance
from roadlog.estimators.fusion.rows import is_there
from roadlog.estimators.fusion.states import (
    DECAYING,
    DRIVEN,
    DRIVERS,
    MOVING_STATES,
    ROWS,
    W_THETA,
    N,
    State,
)
from roadlog.estimators.fusion.steps import Steps, table
from roadlog.types import Floats, Record


def noise_matrix(q: Floats) -> Floats:
    """Q (29, 29) from what `process_noise` writes."""
    Q = np.diag(q[:N])
    Q[State.W, State.THETA] = Q[State.THETA, State.W] = q[W_THETA]
    return Q


def transition(A: Floats, noise: Record, clone: bool = False) -> Floats:
    """F (29, 29) of a step from its `coupling`; clone: the altitude is kept before it."""
    F, first = np.eye(N), np.eye(N)
    F[DECAYING, DECAYING] = noise.decay
    F[DRIVEN, :DRIVERS] += A
    if clone:
        first[State.KEPT_ALTITUDE] = first[State.ALTITUDE]
    return F @ first


def rauch_tung_striebel(
    steps: Steps, noise: Noise, P0: Floats, at: Floats, look_ahead: bool, states: Sequence[int]
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """The fields of `Smoothed`; the arguments are those of the compiled engine."""

    n = len(steps.speed)
    records = table(steps, 0, n, noise.every).view(np.recarray)
    of_drive = noise.record(steps.dt)
    kf = KalmanFilter(N, 1, dim_u=N)
    kf.x, kf.P, kf.B = steps.starts[0].reshape(N, 1).copy(), P0.copy(), np.eye(N)
    runs = np.flatnonzero(steps.alive)
    xs, variance, shape = np.full((n, N), np.nan), np.full((n, 6), np.nan), np.full((n, 2), np.nan)
    innovations = np.full((n, ROWS), np.nan)
    filtered, priors, transitions = [], [], []
    A, q, y, d = np.zeros((len(DRIVEN), DRIVERS)), np.empty(N + 1), np.empty(N), np.empty(N)
    for k in runs:
        s, x = records[k + 1], kf.x[:, 0].copy()
        if s.start >= 0:
            restart(x, kf.P, steps.starts[s.start], P0)
            kf.x = x.reshape(N, 1)
            F = np.diag(~np.isin(np.arange(N), MOVING_STATES)).astype(np.float64)
        else:
            if s.clone:
                x[State.KEPT_ALTITUDE] = x[State.ALTITUDE]
            prediction(x, at[k - 1] if k <= len(at) else x, records[k], of_drive, A, q, y, d)
            F = transition(A, of_drive, s.clone)
            kf.predict(u=(y - F @ kf.x[:, 0]).reshape(N, 1), F=F, Q=noise_matrix(q))
        transitions.append(F)
        priors.append((kf.x[:, 0].copy(), kf.P.copy()))
        for kind in range(ROWS):
            if not is_there(kind, s):
                continue
            h, x = np.empty(N), kf.x[:, 0].copy()
            point = at[k] if k < len(at) else x
            residual, sd, gate = residual_row(kind, x, point, s, of_drive, h)
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
        if records[k + 1].reported:
            rows = np.empty((OUTPUTS, N))
            output_rows(steps.sway[k], of_drive, rows)
            given_variances(rows @ P @ rows.T, variance[k], shape[k])
    return xs[:, states], variance, shape, *filtered[-1], innovations
