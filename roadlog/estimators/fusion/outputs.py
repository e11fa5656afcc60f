"""What `fusion` gives back: angles as functions of its states, and their variances.

Rows and variances of the fusion chapter, sections 4 (body) and 7 (outputs).
"""

from __future__ import annotations

import numpy as np
from numba import njit

from roadlog.estimators.fusion.model import (
    BA,
    EP,
    ER,
    FORWARD,
    KPHI,
    KSIDE,
    KTHETA,
    LATERAL,
    MPHI,
    MTHETA,
    PHI,
    THETA,
    UNSIGNED,
    N,
    Noise,
)
from roadlog.filters.kalman import solve_spd
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

GRADE, BANK, PITCH, ROLL_ANGLE, INCLINATION, ROLL_TOTAL = range(6)  # outputs
OFFSETS = np.array([BA, BA + 1, MPHI, MTHETA])  # what shifts a whole grade or bank profile


@njit(cache=True)
def output_rows(s: Floats, noise: Noise) -> Floats:
    """(10, 29): the outputs as functions of the states, then the OFFSETS."""
    rows = np.zeros((10, N))
    rows[PITCH, KTHETA], rows[PITCH, KSIDE], rows[PITCH, EP] = s[FORWARD], s[UNSIGNED], 1.0
    rows[PITCH, BA], rows[PITCH, MTHETA] = -noise.pitch_gain, -G * noise.pitch_gain
    rows[ROLL_ANGLE, KPHI], rows[ROLL_ANGLE, ER] = s[LATERAL], 1.0
    rows[ROLL_ANGLE, BA + 1], rows[ROLL_ANGLE, MPHI] = -noise.roll_gain, -G * noise.roll_gain
    rows[INCLINATION, THETA], rows[INCLINATION, MTHETA] = 1.0, -1.0
    rows[ROLL_TOTAL, PHI], rows[ROLL_TOTAL, MPHI] = 1.0, -1.0
    rows[GRADE] = rows[INCLINATION] - rows[PITCH]
    rows[BANK] = rows[ROLL_TOTAL] - rows[ROLL_ANGLE]
    for i in range(4):
        rows[6 + i, OFFSETS[i]] = 1.0
    return rows


@njit(cache=True)
def variances(
    P: Floats, L: Floats, s: Floats, noise: Noise, variance: Floats, shape: Floats
) -> None:
    """Variances of the outputs under P - P L P, and of grade and bank given the OFFSETS."""
    rows = output_rows(s, noise)
    m = len(rows)
    B, LB = np.zeros((m, N)), np.zeros((m, N))
    for a in range(m):
        for i in range(N):
            if rows[a, i] != 0.0:
                for j in range(N):
                    B[a, j] += rows[a, i] * P[i, j]
        for i in range(N):
            for j in range(N):
                LB[a, i] += L[i, j] * B[a, j]
    M = np.zeros((m, m))
    for a in range(m):
        for b in range(m):
            for i in range(N):
                M[a, b] += rows[a, i] * B[b, i] - B[a, i] * LB[b, i]
    given_variances(M, variance, shape)


@njit(cache=True)
def given_variances(M: Floats, variance: Floats, shape: Floats) -> None:
    """Diagonal of M (10, 10), and that of its first two given the last four (Schur complement)."""
    given = solve_spd(M[6:, 6:].copy(), M[6:, :2].copy())
    for a in range(6):
        variance[a] = max(M[a, a], 0.0)
    for a in range(2):
        shape[a] = variance[a]
        for i in range(4):
            shape[a] -= M[a, 6 + i] * given[i, a]
        shape[a] = max(shape[a], 0.0)
