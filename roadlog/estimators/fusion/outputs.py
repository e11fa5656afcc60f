"""What `fusion` gives back: angles as functions of its states, and their variances.

Source: docs/methods/fusion.md#outputs.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from roadlog.estimators.fusion.body import body_pitch_row, body_roll_row
from roadlog.estimators.fusion.states import N, State
from roadlog.estimators.fusion.steps import Sway
from roadlog.filters.kalman import solve_spd
from roadlog.jit import compiled, reordered
from roadlog.types import Floats, Record


class Output(IntEnum):
    """What is asked of the states; rad."""

    GRADE = 0
    BANK = 1
    PITCH = 2
    ROLL = 3
    INCLINATION = 4
    ROLL_TOTAL = 5


ANGLES = len(Output)
# what shifts a whole grade or bank profile
OFFSETS = np.array(
    [State.ACCEL_BIAS_X, State.ACCEL_BIAS_Y, State.MOUNTING_ROLL, State.MOUNTING_PITCH]
)
OUTPUTS = ANGLES + len(OFFSETS)


@compiled
def output_rows(s: Floats, noise: Record, rows: Floats) -> None:
    """The outputs as functions of the states, then the OFFSETS, into rows (10, 29).

    At the prior gradients: a covariance must not depend on what the drive said of them.
    """
    for a in range(len(rows)):
        for i in range(N):
            rows[a, i] = 0.0
    body_pitch_row(noise.pitch_gradient, s[Sway.FORWARD], s, rows[Output.PITCH])
    body_roll_row(noise.roll_gradient, s[Sway.LATERAL], rows[Output.ROLL])
    rows[Output.INCLINATION, State.THETA] = 1.0
    rows[Output.INCLINATION, State.MOUNTING_PITCH] = -1.0
    rows[Output.ROLL_TOTAL, State.PHI], rows[Output.ROLL_TOTAL, State.MOUNTING_ROLL] = 1.0, -1.0
    for i in range(N):
        rows[Output.GRADE, i] = rows[Output.INCLINATION, i] - rows[Output.PITCH, i]
        rows[Output.BANK, i] = rows[Output.ROLL_TOTAL, i] - rows[Output.ROLL, i]
    for i in range(len(OFFSETS)):
        rows[ANGLES + i, OFFSETS[i]] = 1.0


@reordered
def covariance_of_outputs(
    P: Floats, L: Floats, rows: Floats, B: Floats, LB: Floats, M: Floats
) -> None:
    """rows (P - P L P) rows' into M (10, 10); P, L (29, WIDTH). B, LB (10, WIDTH): scratch."""
    m, width = len(rows), P.shape[1]
    for a in range(m):
        for j in range(width):
            B[a, j] = LB[a, j] = 0.0
        for i in range(N):
            if rows[a, i] != 0.0:
                for j in range(width):
                    B[a, j] += rows[a, i] * P[i, j]
        for i in range(N):
            for j in range(width):
                LB[a, j] += B[a, i] * L[i, j]
    for a in range(m):
        for b in range(a + 1):
            total = 0.0
            for i in range(width):
                total -= B[a, i] * LB[b, i]
            for i in range(N):
                total += rows[a, i] * B[b, i]
            M[a, b] = M[b, a] = total


@compiled
def given_variances(M: Floats, variance: Floats, shape: Floats) -> None:
    """Diagonal of M (10, 10), and that of its first two given the last four (Schur complement)."""
    m, offsets = len(variance), len(OFFSETS)
    A, given = np.empty((offsets, offsets)), np.empty((offsets, len(shape)))
    scale = np.empty(offsets)
    for i in range(offsets):
        for j in range(offsets):
            A[i, j] = M[m + i, m + j]
        for a in range(len(shape)):
            given[i, a] = M[m + i, a]
    solve_spd(A, given, scale)
    for a in range(m):
        variance[a] = max(M[a, a], 0.0)
    for a in range(len(shape)):
        shape[a] = variance[a]
        for i in range(offsets):
            shape[a] -= M[a, m + i] * given[i, a]
        shape[a] = max(shape[a], 0.0)
