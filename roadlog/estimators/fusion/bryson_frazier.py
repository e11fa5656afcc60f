"""Compiled engine of `fusion`: forward Kalman pass and modified Bryson-Frazier smoother.

Bierman 1973, "Fixed interval smoothing with discrete measurements": the same result as
Rauch-Tung-Striebel, but the adjoint passes back through the scalar rows, so no covariance is
inverted, and it needs the filter's covariances only piece by piece: they are computed again from
checkpoints. Python goes from piece to piece, so that Ctrl-C is heard between two.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog.estimators.fusion.covariance import (
    WIDTH,
    altitude_back,
    forget_moving,
    keep_altitude,
    predict_covariance,
    projected,
    pull_back,
    reduce,
    row_back,
)
from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.outputs import (
    OUTPUTS,
    covariance_of_outputs,
    given_variances,
    output_rows,
)
from roadlog.estimators.fusion.recursion import (
    OWN_STATES,
    prediction,
    residual_row,
    restart,
    soft_variance,
)
from roadlog.estimators.fusion.rows import is_there
from roadlog.estimators.fusion.states import DRIVEN, DRIVERS, ROWS, W_THETA, N
from roadlog.estimators.fusion.steps import STEP, Steps, table
from roadlog.jit import argument, compiled
from roadlog.types import Floats, Record, Records

TABLE = 4096  # steps whose records are made at once (1.5 MB); whole pieces
PIECE = 128  # steps between two checkpoints; covariances of one piece (1 MB) stay in the cache


class Piece(NamedTuple):
    """What the filter did in a run of steps, for the way back.

    x (m, 29): after the rows of a step. P (m, 29, WIDTH): likewise, or none. A (m, 7, 13):
    `coupling` into the step. end (m + 1,): behind the last row of the step before. h, gain (r, 29),
    residual, spread (r,): of each row, in their order.
    """

    x: Floats
    P: Floats
    A: Floats
    end: NDArray[np.int64]
    h: Floats
    gain: Floats
    residual: Floats
    spread: Floats

    @classmethod
    def empty(cls) -> Piece:
        rows = PIECE * ROWS
        return cls(
            np.empty((PIECE, N)),
            np.empty((PIECE, N, WIDTH)),
            np.zeros((PIECE, len(DRIVEN), DRIVERS)),
            np.zeros(PIECE + 1, np.int64),
            np.empty((rows, N)),
            np.empty((rows, N)),
            np.empty(rows),
            np.empty(rows),
        )


@compiled
def _forward(
    first: int,
    records: Records,
    noise: Record,
    starts: Floats,
    P0: Floats,
    at: Floats,
    x: Floats,
    P: Floats,
    piece: Piece,
    innovations: Floats,
) -> None:
    """Filter a piece from (x, P) after the step before, in place.

    records: the step before, then those of the piece, of which the first has the number `first`.
    innovations (m, ROWS): residual over its sd as predicted.
    """
    q, y, d = np.empty(W_THETA + 1), np.empty(N), np.empty(N)
    g, D = np.empty(WIDTH), np.empty((len(DRIVEN), WIDTH))
    r = 0
    for m in range(len(records) - 1):
        s, k = records[m + 1], first + m
        piece.end[m + 1] = r
        if not s.alive:
            continue
        if s.start >= 0:
            restart(x, P, starts[s.start], P0)
        else:
            if s.clone:
                keep_altitude(x, P)
            point = at[k - 1] if k <= len(at) else x
            prediction(x, point, records[m], noise, piece.A[m], q, y, d)
            predict_covariance(P, piece.A[m], q, noise, D)
            for i in range(N):
                x[i] = y[i]
        point = at[k] if k < len(at) else x
        for kind in range(ROWS):
            if not is_there(kind, s):
                continue
            h = piece.h[r]
            residual, sd, gate = residual_row(kind, x, point, s, noise, h)
            spread = projected(P, h, g)
            total = spread + soft_variance(residual, spread, sd, gate)
            root = 1.0 / np.sqrt(total)
            for j in range(len(g)):
                g[j] *= root
            reduce(P, g)
            for i in range(N):
                piece.gain[r, i] = g[i] * root
                x[i] += piece.gain[r, i] * residual
            piece.residual[r], piece.spread[r] = residual, total
            innovations[m, kind] = residual * root
            r += 1
        piece.end[m + 1] = r
        for i in range(N):
            piece.x[m, i] = x[i]
        if len(piece.P):
            for i in range(N):
                for j in range(P.shape[1]):
                    piece.P[m, i, j] = P[i, j]


@compiled
def _back(
    records: Records,
    noise: Record,
    piece: Piece,
    look_ahead: bool,
    adjoint: Floats,
    L: Floats,
    x: Floats,
    variance: Floats,
    shape: Floats,
) -> None:
    """Smooth a piece from the adjoint (l, L) after it, in place; the records as in `_forward`.

    Smoothed x = x+ - P+ l and P = P+ - P+ L P+, into x (m, 29) and the variances of the outputs.
    """
    a, D = np.empty(WIDTH), np.empty((len(DRIVEN), WIDTH))
    rows, M = np.empty((OUTPUTS, N)), np.empty((OUTPUTS, OUTPUTS))
    B, LB = np.empty((OUTPUTS, WIDTH)), np.empty((OUTPUTS, WIDTH))
    for m in range(len(records) - 2, -1, -1):
        s = records[m + 1]
        if not s.alive:
            continue
        projected(piece.P[m], adjoint, a)
        for i in range(N):
            x[m, i] = piece.x[m, i] - a[i]
        if s.reported:
            output_rows(s.sway, noise, rows)
            covariance_of_outputs(piece.P[m], L, rows, B, LB, M)
            given_variances(M, variance[m], shape[m])
        if not look_ahead:
            continue  # with l = L = 0 these are the filter's own
        for r in range(piece.end[m + 1] - 1, piece.end[m] - 1, -1):
            h, gain = piece.h[r], piece.gain[r]
            row_back(adjoint, L, h, gain, piece.residual[r], piece.spread[r], a)
        if s.start >= 0:
            forget_moving(adjoint, L)
        else:
            pull_back(adjoint, L, piece.A[m], noise, D)
            if s.clone:
                altitude_back(adjoint, L)


class _Filter:
    """The filter at work, from piece to piece."""

    def __init__(self, steps: Steps, noise: Noise, P0: Floats, at: Floats) -> None:
        self.steps, self.every, self.noise = steps, noise.every, noise.record(steps.dt)
        self.P0, self.at = P0, argument(at)
        self.x, self.P = steps.starts[0].copy(), np.zeros((N, WIDTH))
        self.P[:, :N] = P0
        self.piece = Piece.empty()
        self.passing = self.piece._replace(P=np.empty((0, N, WIDTH)))
        self.innovations = np.full((len(steps.speed), ROWS), np.nan)
        self.first, self.table = -1, np.empty(0, STEP)

    def records(self, piece: slice) -> Records:
        """Of the step before a piece, and of its own."""
        first = piece.start // TABLE * TABLE
        if first != self.first:
            last = min(first + TABLE, len(self.steps.speed))
            self.first, self.table = first, table(self.steps, first, last, self.every)
        return self.table[piece.start - first : piece.stop - first + 1]

    def forward(self, piece: slice, back: bool = False) -> Records:
        """Filter these steps; their records, the step before them first.

        back: the way back comes next; it needs the covariances, which else only cost time.
        """
        records = self.records(piece)
        _forward(
            piece.start,
            records,
            self.noise,
            self.steps.starts,
            self.P0,
            self.at,
            self.x,
            self.P,
            self.piece if back else self.passing,
            self.innovations[piece],
        )
        return records


def _pieces(steps: Steps) -> list[slice]:
    n = len(steps.speed)
    return [slice(first, min(n, first + PIECE)) for first in range(0, n, PIECE)]


def filtered(steps: Steps, noise: Noise, P0: Floats) -> tuple[Floats, Floats]:
    """Forward only: states (n, 29) after the rows of each step, and innovations (n, ROWS).

    An innovation is a residual over its sd as predicted; NaN where there is no row.
    """
    run = _Filter(steps, noise, P0, OWN_STATES)
    xs = np.full((len(steps.speed), N), np.nan)
    for piece in _pieces(steps):
        run.forward(piece)
        xs[piece] = run.piece.x[: piece.stop - piece.start]
    xs[~steps.alive] = np.nan
    return xs, run.innovations


def bryson_frazier(
    steps: Steps, noise: Noise, P0: Floats, at: Floats, look_ahead: bool, states: Sequence[int]
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
    """The fields of `Smoothed`: forward, then back piece by piece from l = L = 0."""
    n, run, checkpoints = len(steps.speed), _Filter(steps, noise, P0, at), []
    for piece in _pieces(steps):
        checkpoints.append((piece, run.x.copy(), run.P.copy()))
        run.forward(piece)
    x_end, P_end = run.x.copy(), run.P[:, :N].copy()
    smoothed, xs = np.empty((PIECE, N)), np.full((n, len(states)), np.nan)
    variance, shape = np.full((n, 6), np.nan), np.full((n, 2), np.nan)
    adjoint, L = np.zeros(N), np.zeros((N, WIDTH))
    for piece, x, P in reversed(checkpoints):
        run.x, run.P = x, P
        records = run.forward(piece, back=True)
        _back(
            records,
            run.noise,
            run.piece,
            look_ahead,
            adjoint,
            L,
            smoothed,
            variance[piece],
            shape[piece],
        )
        alive = steps.alive[piece]
        xs[piece][alive] = smoothed[: len(alive)][np.ix_(alive, states)]
    return xs, variance, shape, x_end, P_end, run.innovations
