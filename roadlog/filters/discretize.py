"""Exact discretization, held input; docs/methods/common.md#exact-discretization."""

from __future__ import annotations

import numpy as np

from roadlog.jit import compiled
from roadlog.types import Floats

TAYLOR_ORDER = 8
MAX_NORM = 0.125  # of the system matrix times the sub-step; Simpson is then right to 2e-8


@compiled
def multiply(A: Floats, B: Floats, C: Floats) -> None:
    """A B into C, by plain loops: small matrices compile in a fraction of BLAS's time."""
    n, m, inner = A.shape[0], B.shape[1], A.shape[1]
    for i in range(n):
        for j in range(m):
            C[i, j] = 0.0
        for k in range(inner):
            a = A[i, k]
            if a != 0.0:
                for j in range(m):
                    C[i, j] += a * B[k, j]


@compiled
def _exponential(A: Floats, step: float, total: Floats, term: Floats, work: Floats) -> None:
    """exp(A step) into `total` by its Taylor series; |A step| must be small. Others: scratch."""
    n = len(A)
    for i in range(n):
        for j in range(n):
            term[i, j] = total[i, j] = 1.0 if i == j else 0.0
    for order in range(1, TAYLOR_ORDER + 1):
        multiply(term, A, work)
        for i in range(n):
            for j in range(n):
                term[i, j] = work[i, j] * (step / order)
                total[i, j] += term[i, j]


@compiled
def _simpson(half: Floats, whole: Floats, Qc: Floats, step: float, Qd: Floats) -> None:
    """Qd (n, n) over a step, from the transitions over its half and the whole."""
    n = len(Qd)
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += 4.0 * half[i, k] * Qc[k] * half[j, k]
                total += whole[i, k] * Qc[k] * whole[j, k]
            if i == j:
                total += Qc[i]
            Qd[i, j] = Qd[j, i] = total * (step / 6.0)


@compiled
def _doubled(E: Floats, Qd: Floats, work: Floats, turned: Floats) -> None:
    """E <- E E and Qd <- Qd + Phi Qd Phi', Phi the part of E (n + 1, n + 1) without the input."""
    n = len(Qd)
    for i in range(n):
        for j in range(n):
            work[i, j] = 0.0
            for k in range(n):
                work[i, j] += E[i, k] * Qd[k, j]
    for i in range(n):
        for j in range(n):
            for k in range(n):
                Qd[i, j] += work[i, k] * E[j, k]
    multiply(E, E, turned)
    for i in range(n + 1):
        for j in range(n + 1):
            E[i, j] = turned[i, j]


@compiled
def zero_order_hold(F: Floats, G: Floats, Qc: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """dx/dt = F x + G u + noise of spectral density diag Qc -> Phi (n, n), Gamma (n,), Qd (n, n).

    F (n, n), G (n,): one input, held over dt seconds. The series runs on dt / 2^q and is squared
    q times; Qd is Simpson's rule on the sub-step, doubled with Qd <- Qd + Phi Qd Phi'.
    """
    n = len(F)
    A, half, E = np.zeros((n + 1, n + 1)), np.empty((n + 1, n + 1)), np.empty((n + 1, n + 1))
    work, other = np.empty((n + 1, n + 1)), np.empty((n + 1, n + 1))
    Phi, Gamma, Qd = np.empty((n, n)), np.empty(n), np.empty((n, n))
    norm = 0.0
    for i in range(n):
        row = abs(G[i])
        A[i, n] = G[i]
        for j in range(n):
            A[i, j] = F[i, j]
            row += abs(F[i, j])
        norm = max(norm, row)
    doublings, step = 0, dt
    while norm * step > MAX_NORM:
        step *= 0.5
        doublings += 1
    _exponential(A, 0.5 * step, half, work, other)
    multiply(half, half, E)
    _simpson(half, E, Qc, step, Qd)
    for _ in range(doublings):
        _doubled(E, Qd, work, other)
    for i in range(n):
        Gamma[i] = E[i, n]
        for j in range(n):
            Phi[i, j] = E[i, j]
    return Phi, Gamma, Qd
