"""Forward Kalman pass and fixed-interval smoother for the model of `fusion`, on both engines.

The compiled engine smooths by the modified Bryson-Frazier recursion (Bierman 1973, "Fixed interval
smoothing with discrete measurements"): the same result as Rauch-Tung-Striebel, but the adjoint
passes back through the scalar rows, so no covariance is inverted, and it needs the filter's
covariances only piece by piece: they are computed again from checkpoints. The reference engine is
filterpy's filter with the Rauch-Tung-Striebel recursion in NumPy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from roadlog.estimators.fusion.model import (
    COUPLED,
    DECAYING,
    MOVING,
    ROWS,
    N,
    Noise,
    Steps,
    process_noise,
    propagate,
    row,
    transition,
)
from roadlog.estimators.fusion.outputs import variances
from roadlog.filters import Engine
from roadlog.types import Floats

OWN_STATES = np.empty((0, N))  # linearise at the filter's own states
PIECE = 128  # steps between two checkpoints; covariances of one piece (0.7 MB) stay in the cache


@dataclass(frozen=True)
class Smoothed:
    """x (n, 29): smoothed states, or the filter's own; NaN where the IMU is missing.

    variance (n, 6): rad2, of the outputs, at every tenth of a second and the ends of a run of the
    IMU, NaN elsewhere. shape_variance (n, 2): of grade and bank if the OFFSETS were known. x_end,
    P_end: states and covariance after the last step; for the constants, of the whole drive.
    """

    x: Floats
    variance: Floats
    shape_variance: Floats
    x_end: Floats
    P_end: Floats


def smooth(
    steps: Steps,
    noise: Noise,
    P0: Floats,
    at: Floats = OWN_STATES,
    engine: Engine = "compiled",
    look_ahead: bool = True,
) -> Smoothed:
    """All states from all measurements. P0 (29, 29): before the first step.

    at (m, 29): states of an earlier run, at which the first m steps are linearised (iterated
    smoother); the others are at the filter's own. look_ahead: without it each step's states are
    the filter's, from the past alone.
    """
    if engine == "reference":
        from roadlog.estimators.fusion.rauch_tung_striebel import rauch_tung_striebel as run
    else:
        run = _bryson_frazier
    return Smoothed(*run(steps, noise, P0, at, look_ahead))


@njit(cache=True)
def restart(x: Floats, P: Floats, x_start: Floats, P0: Floats) -> None:
    """Begin again after a gap of the IMU, in place: the constants carry over, all else does not."""
    for i in MOVING:
        x[i] = x_start[i]
        for j in range(N):
            P[i, j] = P[j, i] = 0.0
    for i in MOVING:
        for j in MOVING:
            P[i, j] = P0[i, j]


@njit(cache=True)
def prediction(
    k: int, x: Floats, steps: Steps, noise: Noise, at: Floats, F: Floats, q: Floats
) -> Floats:
    """States predicted for k + 1 from those of k; F and the diagonal of Q go into F and q."""
    point = at[k] if k < len(at) else x
    force, rate, clone = steps.force[k], steps.rate[k], steps.clone[k + 1]
    transition(point, rate, steps.dt, noise, clone, F)
    process_noise(point, force, rate, steps.sway[k], steps.dt, noise, q)
    y = propagate(point, force, rate, steps.dt, noise, clone)
    if k < len(at):
        y += _times(F, x - point)
    return y


@njit(cache=True)
def residual_row(
    kind: int, k: int, x: Floats, steps: Steps, noise: Noise, at: Floats, h: Floats
) -> tuple[float, float, float]:
    """`row` at the filter's states, or linearised at those of the pass before."""
    if k >= len(at):
        residual, sd, gate = row(kind, k, x, steps, noise, h)
        return residual, sd * noise.scale[kind], gate
    residual, sd, gate = row(kind, k, at[k], steps, noise, h)
    if np.isfinite(residual):
        for i in range(N):
            residual -= h[i] * (x[i] - at[k, i])
    return residual, sd * noise.scale[kind], gate


@njit(cache=True)
def soft_variance(residual: float, spread: float, sd: float, gate: float) -> float:
    """Measurement variance that grows with an outlier (section 6, robust).

    spread: variance h P h' of the prediction. A hard gate would lock out after gaps.
    """
    variance = sd * sd
    excess = abs(residual) / (gate * np.sqrt(spread + variance)) if gate > 0 else 0.0
    if excess <= 1.0:
        return variance
    return variance * excess**2 + spread * (excess - 1.0)


@njit(cache=True)
def _times(F: Floats, x: Floats) -> Floats:
    """F x, where F is the identity but for COUPLED and DECAYING rows."""
    y = x.copy()
    for i in DECAYING:
        y[i] *= F[i, i]
    for i in COUPLED:
        y[i] = 0.0
        for j in range(N):
            y[i] += F[i, j] * x[j]
    return y


@njit(cache=True)
def _predict_covariance(P: Floats, F: Floats, q: Floats, scratch: Floats) -> None:
    """P <- F P F' + diag(q), in place; only COUPLED and DECAYING rows need work."""
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
    h, q, Ph = np.empty(N), np.empty(N), np.empty(N)
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
            m = k - first
            if steps.alive[k]:
                xs[k] = piece.x[m]
            for c in range(piece.used[m]):
                innovations[k, piece.kind[m, c]] = piece.residual[m, c] / np.sqrt(
                    piece.spread[m, c]
                )
    return xs, innovations


@njit(cache=True)
def _bryson_frazier(
    steps: Steps, noise: Noise, P0: Floats, at: Floats, look_ahead: bool
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Forward over all steps, then back piece by piece with the adjoint (l, L) (Bierman 1973).

    Smoothed x = x+ - P+ l and P = P+ - P+ L P+, with l = L = 0 after the last step.
    """
    n = len(steps.speed)
    pieces = (n + PIECE - 1) // PIECE
    piece = _empty_piece()
    x_at, P_at = np.empty((pieces, N)), np.empty((pieces, N, N))
    x, P = steps.starts[0].copy(), P0.copy()
    for c in range(pieces):
        x_at[c] = x
        P_at[c] = P
        x = _forward(c * PIECE, min(n, (c + 1) * PIECE), x, P, steps, noise, P0, at, piece)
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
    return xs, variance, shape_variance, x_end, P_end


@njit(cache=True)
def is_reported(k: int, steps: Steps, noise: Noise) -> bool:
    """Whether variances are given at a step: they change slowly and cost as much as the rest."""
    last = k + 1 == len(steps.alive) or not steps.alive[k + 1]
    return k % noise.every == 0 or steps.start[k] >= 0 or last


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
