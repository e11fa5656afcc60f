"""What `fusion` gives back: angles as functions of its states, and their variances.

Source: docs/methods/fusion.md#outputs.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numba import njit

from roadlog.estimators.fusion.body import body_pitch_row, body_roll_row
from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.states import N, State
from roadlog.estimators.fusion.steps import Sway
from roadlog.filters.kalman import solve_spd
from roadlog.types import Floats


class Output(IntEnum):
    """What is asked of the states; rad."""

    GRADE = 0
    BANK = 1
    PITCH = 2
    ROLL = 3
    INCLINATION = 4
    ROLL_TOTAL = 5


OUTPUTS = len(Output)
# what shifts a whole grade or bank profile
OFFSETS = np.array(
    [State.ACCEL_BIAS_X, State.ACCEL_BIAS_Y, State.MOUNTING_ROLL, State.MOUNTING_PITCH]
)


@njit(cache=True)
def output_rows(s: Floats, noise: Noise) -> Floats:
    """(10, 29): the outputs as functions of the states, then the OFFSETS.

    At the prior gradients: a covariance must not depend on what the drive said of them.
    """
    rows = np.zeros((OUTPUTS + len(OFFSETS), N))
    body_pitch_row(noise.pitch_gradient, s[Sway.FORWARD], s, rows[Output.PITCH])
    body_roll_row(noise.roll_gradient, s[Sway.LATERAL], rows[Output.ROLL])
    rows[Output.INCLINATION, State.THETA] = 1.0
    rows[Output.INCLINATION, State.MOUNTING_PITCH] = -1.0
    rows[Output.ROLL_TOTAL, State.PHI], rows[Output.ROLL_TOTAL, State.MOUNTING_ROLL] = 1.0, -1.0
    rows[Output.GRADE] = rows[Output.INCLINATION] - rows[Output.PITCH]
    rows[Output.BANK] = rows[Output.ROLL_TOTAL] - rows[Output.ROLL]
    for i in range(len(OFFSETS)):
        rows[OUTPUTS + i, OFFSETS[i]] = 1.0
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
