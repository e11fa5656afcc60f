"""Covariance P of the states of `fusion` and the adjoint (l, L) of its smoother, in place.

P and L are symmetric, (29, WIDTH), zero behind the 29th column; only what a step changes is
computed, by rows, and one triangle of it.
Source: docs/methods/fusion.md#smoother.
"""

from __future__ import annotations

from roadlog.estimators.fusion.states import DECAYING, DRIVEN, MOVING_STATES, W_THETA, N, State
from roadlog.jit import compiled
from roadlog.types import Floats, Record

WIDTH = 32  # of a row: registers hold four numbers, and the last of 29 would go one by one


@compiled
def predict_covariance(P: Floats, A: Floats, q: Floats, noise: Record, D: Floats) -> None:
    """P <- F P F' + Q, F = I + A in the DRIVEN rows. D (7, WIDTH): scratch."""
    drivers, width = A.shape[1], P.shape[1]
    for c in range(len(DRIVEN)):
        for j in range(width):
            D[c, j] = P[DRIVEN[c], j]
        for i in range(drivers):
            a = A[c, i]
            if a != 0.0:
                for j in range(width):
                    D[c, j] += a * P[i, j]
    for c in range(len(DRIVEN)):
        for j in range(N):
            P[DRIVEN[c], j] = P[j, DRIVEN[c]] = D[c, j]
    for c in range(len(DRIVEN)):
        for d in range(c + 1):
            both = D[c, DRIVEN[d]]
            for j in range(drivers):
                both += A[d, j] * D[c, j]
            P[DRIVEN[c], DRIVEN[d]] = P[DRIVEN[d], DRIVEN[c]] = both
    _forget(P, noise)
    for i in range(N):
        P[i, i] += q[i]
    P[State.W, State.THETA] += q[W_THETA]
    P[State.THETA, State.W] += q[W_THETA]


@compiled
def _forget(P: Floats, noise: Record) -> None:
    """Rows and columns of DECAYING states times their decay."""
    for c in range(len(DECAYING)):
        i, decay = DECAYING[c], noise.decay[c]
        for j in range(P.shape[1]):
            P[i, j] *= decay
        for j in range(N):
            P[j, i] *= decay


@compiled
def keep_altitude(x: Floats, P: Floats) -> None:
    """The altitude becomes the one kept for the next visit of this place."""
    kept, altitude = State.KEPT_ALTITUDE, State.ALTITUDE
    x[kept] = x[altitude]
    for j in range(P.shape[1]):
        P[kept, j] = P[altitude, j]
    for j in range(N):
        P[j, kept] = P[j, altitude]


@compiled
def projected(P: Floats, h: Floats, Ph: Floats) -> float:
    """P h into Ph (WIDTH,), h (29,); returns h' P h."""
    for j in range(len(Ph)):
        Ph[j] = 0.0
    spread = 0.0
    for i in range(N):
        if h[i] != 0.0:
            for j in range(len(Ph)):
                Ph[j] += h[i] * P[i, j]
    for i in range(N):
        spread += h[i] * Ph[i]
    return spread


@compiled
def reduce(P: Floats, g: Floats) -> None:
    """P <- P - g g', g (WIDTH,)."""
    for i in range(len(P)):
        for j in range(P.shape[1]):
            P[i, j] -= g[i] * g[j]


@compiled
def row_back(
    y: Floats, L: Floats, h: Floats, gain: Floats, residual: float, total: float, a: Floats
) -> None:
    """The adjoint (y, L) before a row from that after it: C'y - h nu/S and C'LC + hh'/S.

    C = I - K h', S = total innovation variance. a (WIDTH,): scratch.
    """
    along, both = residual / total, 1.0 / total
    for j in range(len(a)):
        a[j] = 0.0
    for i in range(N):
        along += gain[i] * y[i]
        for j in range(len(a)):
            a[j] += gain[i] * L[i, j]
    for i in range(N):
        both += gain[i] * a[i]
    for i in range(N):
        if h[i] != 0.0:
            y[i] -= h[i] * along
            of_h = a[i] - both * h[i]
            for j in range(len(h)):
                L[i, j] -= h[i] * a[j] + of_h * h[j]
    for i in range(N):
        if h[i] != 0.0:
            for j in range(N):
                L[j, i] = L[i, j]


@compiled
def pull_back(y: Floats, L: Floats, A: Floats, noise: Record, D: Floats) -> None:
    """The adjoint before a prediction: F' y, F' L F. D (7, WIDTH): scratch."""
    drivers, width = A.shape[1], L.shape[1]
    for c in range(len(DRIVEN)):  # what is read below before it is written
        for j in range(width):
            D[c, j] = L[DRIVEN[c], j]
    for c in range(len(DRIVEN)):
        for i in range(drivers):
            a = A[c, i]
            if a != 0.0:
                for j in range(width):
                    L[i, j] += a * D[c, j]
    for c in range(len(DRIVEN)):
        for i in range(drivers):
            D[c, i] = L[i, DRIVEN[c]]
    for i in range(drivers):
        for c in range(len(DRIVEN)):
            a = D[c, i]
            for j in range(i + 1):
                L[i, j] += a * A[c, j]
    for i in range(drivers):
        for j in range(i):
            L[j, i] = L[i, j]
        for j in range(drivers, N):
            L[j, i] = L[i, j]
    _forget(L, noise)
    for c in range(len(DRIVEN)):
        D[c, 0] = y[DRIVEN[c]]
    for c in range(len(DRIVEN)):
        for i in range(drivers):
            y[i] += A[c, i] * D[c, 0]
    for c in range(len(DECAYING)):
        y[DECAYING[c]] *= noise.decay[c]


@compiled
def altitude_back(y: Floats, L: Floats) -> None:
    """The adjoint before `keep_altitude`."""
    kept, altitude = State.KEPT_ALTITUDE, State.ALTITUDE
    y[altitude] += y[kept]
    y[kept] = 0.0
    for j in range(L.shape[1]):
        L[altitude, j] += L[kept, j]
    for j in range(N):
        L[j, altitude] += L[j, kept]
    for j in range(N):
        L[kept, j] = L[j, kept] = 0.0


@compiled
def forget_moving(y: Floats, L: Floats) -> None:
    """The adjoint before a restart: no moving state before it matters behind it."""
    for i in MOVING_STATES:
        y[i] = 0.0
        for j in range(N):
            L[i, j] = L[j, i] = 0.0
