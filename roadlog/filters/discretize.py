"""Exact discretization, held input; docs/methods/common.md#exact-discretization."""

from __future__ import annotations

import numpy as np
from numba import njit

from roadlog.types import Floats

TAYLOR_ORDER = 8
MAX_NORM = 0.125  # of the system matrix times the sub-step; Simpson is then right to 2e-8


@njit(cache=True)
def multiply(A: Floats, B: Floats) -> Floats:
    """A B by plain loops: small matrices compile in a fraction of BLAS's time."""
    n, m, inner = A.shape[0], B.shape[1], A.shape[1]
    C = np.zeros((n, m))
    for i in range(n):
        for k in range(inner):
            a = A[i, k]
            if a != 0.0:
                for j in range(m):
                    C[i, j] += a * B[k, j]
    return C


@njit(cache=True)
def _exponential(A: Floats, step: float) -> Floats:
    """exp(A step) by its Taylor series; |A step| must be small."""
    n = len(A)
    term = np.eye(n)
    total = np.eye(n)
    for order in range(1, TAYLOR_ORDER + 1):
        term = multiply(term, A) * (step / order)
        total += term
    return total


@njit(cache=True)
def zero_order_hold(F: Floats, G: Floats, Qc: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """dx/dt = F x + G u + noise of spectral density diag Qc -> Phi (n, n), Gamma (n,), Qd (n, n).

    F (n, n), G (n,): one input, held over dt seconds. The series runs on dt / 2^q and is squared
    q times; Qd is Simpson's rule on the sub-step, doubled with Qd <- Qd + Phi Qd Phi'.
    """
    n = len(F)
    A = np.zeros((n + 1, n + 1))
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
    half = _exponential(A, 0.5 * step)
    E = multiply(half, half)
    Phi = E[:n, :n].copy()
    middle = half[:n, :n].copy()
    Qd = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            for k in range(n):
                Qd[i, j] += 4.0 * middle[i, k] * Qc[k] * middle[j, k]
                Qd[i, j] += Phi[i, k] * Qc[k] * Phi[j, k]
            if i == j:
                Qd[i, i] += Qc[i]
            Qd[i, j] *= step / 6.0
            Qd[j, i] = Qd[i, j]
    for _ in range(doublings):
        Qd = Qd + multiply(multiply(Phi, Qd), Phi.T.copy())
        E = multiply(E, E)
        Phi = E[:n, :n].copy()
    return Phi, E[:n, n].copy(), Qd
