"""Compiled engine of `fusion`: forward Kalman pass and modified Bryson-Frazier smoother.

Bierman 1973, "Fixed interval smoothing with discrete measurements": the same result as
Rauch-Tung-Striebel, but the adjoint passes back through the scalar rows, so no covariance is
inverted, and it needs the filter's covariances only piece by piece: they are computed again from
checkpoints.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.outputs import variances
from roadlog.estimators.fusion.recursion import (
    OWN_STATES,
    is_reported,
    prediction,
    residual_row,
    restart,
    soft_variance,
)
from roadlog.estimators.fusion.states import COUPLED, DECAYING, MOVING, ROWS, W_THETA, N, State
from roadlog.estimators.fusion.steps import Steps
from roadlog.types import Floats

PIECE = 128  # steps between two checkpoints; covariances of one piece (0.7 MB) stay in the cache


@njit(cache=True)
def _predict_covariance(P: Floats, F: Floats, q: Floats, scratch: Floats) -> None:
    """P <- F P F' + Q, in place; only COUPLED and DECAYING rows need work."""
    m = len(COUPLED)
    scratch[:] = 0.0
    for c in range(m):
        for j in range(N):
            a = F[COUPLED[c], j]
            if a != 0.0:
                for i in range(N):
                    scratch[c, i] += a * P[j, i]
    for c in range(m):
        i = COUPLED[c]
        for j in range(N):
            P[i, j] = P[j, i] = scratch[c, j]
    for c in range(m):
        i = COUPLED[c]
        for d in range(c + 1):
            both = 0.0
            for j in range(N):
                both += F[COUPLED[d], j] * scratch[c, j]
            P[i, COUPLED[d]] = P[COUPLED[d], i] = both
    for i in DECAYING:
        for j in range(N):
            P[i, j] *= F[i, i]
        for j in range(N):
            P[j, i] *= F[i, i]
    for i in range(N):
        P[i, i] += q[i]
    P[State.W, State.THETA] += q[W_THETA]
    P[State.THETA, State.W] += q[W_THETA]


@njit(cache=True)
def _pull_back(L: Floats, F: Floats, scratch: Floats) -> None:
    """L <- F' L F, in place."""
    for side in range(2):
        for c in range(len(COUPLED)):
            for j in range(N):
                scratch[c, j] = L[COUPLED[c], j]
        for c in range(len(COUPLED)):
            i = COUPLED[c]
            for j in range(N):
                L[i, j] -= scratch[c, j]
        for i in DECAYING:
            for j in range(N):
                L[i, j] *= F[i, i]
        for c in range(len(COUPLED)):
            i = COUPLED[c]
            for m in range(N):
                a = F[i, m]
                if a != 0.0:
                    for j in range(N):
                        L[m, j] += a * scratch[c, j]
        if side == 0:
            for i in range(N):
                for j in range(i):
                    L[i, j], L[j, i] = L[j, i], L[i, j]
    for i in range(N):
        for j in range(i):
            L[i, j] = L[j, i] = 0.5 * (L[i, j] + L[j, i])


class Piece(NamedTuple):
    """What the filter did in a run of steps, for the way back.

    x (m, 29), P (m, 29, 29): after the rows of a step. F (m, 29, 29): into the step. used (m,):
    number of rows; kind, residual, spread (m, ROWS), h, gain (m, ROWS, 29): of each row, in their
    order.
    """

    x: Floats
    P: Floats
    F: Floats
    used: NDArray[np.int64]
    kind: NDArray[np.int64]
    h: Floats
    gain: Floats
    residual: Floats
    spread: Floats


@njit(cache=True)
def _forward(
    first: int,
    last: int,
    x: Floats,
    P: Floats,
    steps: Steps,
    noise: Noise,
    P0: Floats,
    at: Floats,
    piece: Piece,
) -> Floats:
    """Filter steps first .. last - 1 from (x, P) after the step before; P in place, x returned."""
    h, q, Ph = np.empty(N), np.empty(N + 1), np.empty(N)
    scratch = np.empty((len(COUPLED), N))
    for k in range(first, last):
        m = k - first
        piece.used[m] = 0
        if not steps.alive[k]:
            continue
        if steps.start[k] >= 0:
            restart(x, P, steps.starts[steps.start[k]], P0)
        else:
            x = prediction(k - 1, x, steps, noise, at, piece.F[m], q)
            _predict_covariance(P, piece.F[m], q, scratch)
        for kind in range(ROWS):
            residual, sd, gate = residual_row(kind, k, x, steps, noise, at, h)
            if not np.isfinite(residual):
                continue
            spread = 0.0
            Ph[:] = 0.0
            for j in range(N):
                if h[j] != 0.0:
                    for i in range(N):
                        Ph[i] += h[j] * P[j, i]
            for i in range(N):
                spread += h[i] * Ph[i]
            total = spread + soft_variance(residual, spread, sd, gate)
            c = piece.used[m]
            for i in range(N):
                gain = Ph[i] / total
                x[i] += gain * residual
                piece.h[m, c, i], piece.gain[m, c, i] = h[i], gain
                for j in range(N):
                    P[i, j] -= gain * Ph[j]
            piece.kind[m, c], piece.residual[m, c], piece.spread[m, c] = kind, residual, total
            piece.used[m] += 1
        piece.x[m] = x
        piece.P[m] = P
    return x


@njit(cache=True)
def _empty_piece() -> Piece:
    return Piece(
        np.empty((PIECE, N)),
        np.empty((PIECE, N, N)),
        np.empty((PIECE, N, N)),
        np.zeros(PIECE, np.int64),
        np.zeros((PIECE, ROWS), np.int64),
        np.empty((PIECE, ROWS, N)),
        np.empty((PIECE, ROWS, N)),
        np.empty((PIECE, ROWS)),
        np.empty((PIECE, ROWS)),
    )


@njit(cache=True)
def _put_innovations(piece: Piece, innovations: Floats) -> None:
    """Residuals over their sd as predicted, into (m, ROWS) for the first m steps of the piece."""
    for m in range(len(innovations)):
        for c in range(piece.used[m]):
            innovations[m, piece.kind[m, c]] = piece.residual[m, c] / np.sqrt(piece.spread[m, c])


@njit(cache=True)
def filtered(steps: Steps, noise: Noise, P0: Floats) -> tuple[Floats, Floats]:
    """Forward only: states (n, 29) after the rows of each step, and innovations (n, ROWS).

    An innovation is a residual over its sd as predicted; NaN where there is no row.
    """
    n = len(steps.speed)
    piece = _empty_piece()
    xs, innovations = np.full((n, N), np.nan), np.full((n, ROWS), np.nan)
    x, P = steps.starts[0].copy(), P0.copy()
    for first in range(0, n, PIECE):
        last = min(n, first + PIECE)
        x = _forward(first, last, x, P, steps, noise, P0, OWN_STATES, piece)
        for k in range(first, last):
            if steps.alive[k]:
                xs[k] = piece.x[k - first]
        _put_innovations(piece, innovations[first:last])
    return xs, innovations


@njit(cache=True)
def bryson_frazier(
    steps: Steps, noise: Noise, P0: Floats, at: Floats, look_ahead: bool
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """The fields of `Smoothed`: forward, then back piece by piece with the adjoint (l, L).

    Smoothed x = x+ - P+ l and P = P+ - P+ L P+, with l = L = 0 after the last step.
    """
    n = len(steps.speed)
    pieces = (n + PIECE - 1) // PIECE
    piece = _empty_piece()
    x_at, P_at = np.empty((pieces, N)), np.empty((pieces, N, N))
    innovations = np.full((n, ROWS), np.nan)
    x, P = steps.starts[0].copy(), P0.copy()
    for c in range(pieces):
        x_at[c] = x
        P_at[c] = P
        first, last = c * PIECE, min(n, (c + 1) * PIECE)
        x = _forward(first, last, x, P, steps, noise, P0, at, piece)
        _put_innovations(piece, innovations[first:last])
    x_end, P_end = x.copy(), P.copy()
    xs = np.full((n, N), np.nan)
    variance, shape_variance = np.full((n, 6), np.nan), np.full((n, 2), np.nan)
    adjoint, L = np.zeros(N), np.zeros((N, N))
    scratch = np.empty((len(COUPLED), N))
    for c in range(pieces - 1, -1, -1):
        first, last = c * PIECE, min(n, (c + 1) * PIECE)
        _forward(first, last, x_at[c].copy(), P_at[c].copy(), steps, noise, P0, at, piece)
        for k in range(last - 1, first - 1, -1):
            if not steps.alive[k]:
                continue
            m = k - first
            for i in range(N):
                xs[k, i] = piece.x[m, i]
                for j in range(N):
                    xs[k, i] -= piece.P[m, i, j] * adjoint[j]
            if is_reported(k, steps, noise):
                variances(piece.P[m], L, steps.sway[k], noise, variance[k], shape_variance[k])
            if not look_ahead:
                continue  # with l = L = 0 these are the filter's own
            for i in range(piece.used[m] - 1, -1, -1):
                _row_back(
                    adjoint,
                    L,
                    piece.h[m, i],
                    piece.gain[m, i],
                    piece.residual[m, i],
                    piece.spread[m, i],
                )
            if steps.start[k] >= 0:
                for i in MOVING:
                    adjoint[i] = 0.0
                    for j in range(N):
                        L[i, j] = L[j, i] = 0.0
            else:
                adjoint = _times_transposed(piece.F[m], adjoint)
                _pull_back(L, piece.F[m], scratch)
    return xs, variance, shape_variance, x_end, P_end, innovations


@njit(cache=True)
def _times_transposed(F: Floats, y: Floats) -> Floats:
    """F' y."""
    z = y.copy()
    for i in DECAYING:
        z[i] *= F[i, i]
    for i in COUPLED:
        z[i] -= y[i]
        for j in range(N):
            z[j] += F[i, j] * y[i]
    return z


@njit(cache=True)
def _row_back(
    adjoint: Floats, L: Floats, h: Floats, gain: Floats, residual: float, total: float
) -> None:
    """The adjoint before a row from that after it: l <- C'l - h nu/S, L <- C'LC + hh'/S, in place.

    C = I - K h', S = total innovation variance.
    """
    a = np.zeros(N)
    along, both = residual / total, 1.0 / total
    for i in range(N):
        along += gain[i] * adjoint[i]
        for j in range(N):
            a[j] += gain[i] * L[i, j]
    for i in range(N):
        both += gain[i] * a[i]
    for i in range(N):
        adjoint[i] -= h[i] * along
    for i in range(N):
        if h[i] != 0.0:
            for j in range(N):
                L[i, j] -= h[i] * a[j]
            for j in range(N):
                L[j, i] -= h[i] * (a[j] - both * h[j])
