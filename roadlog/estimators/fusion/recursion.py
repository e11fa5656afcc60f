"""One step of the recursion of `fusion`, alike in both engines: prediction, rows, robust weight.

Source: docs/methods/fusion.md#process, docs/methods/fusion.md#smoother.
"""

from __future__ import annotations

import numpy as np

from roadlog.estimators.fusion.model import coupling, process_noise, propagate
from roadlog.estimators.fusion.rows import row
from roadlog.estimators.fusion.states import DECAYING, DRIVEN, MOVING_STATES, N
from roadlog.jit import compiled
from roadlog.types import Floats, Record

OWN_STATES = np.empty((0, N))  # linearise at the filter's own states


@compiled
def restart(x: Floats, P: Floats, x_start: Floats, P0: Floats) -> None:
    """Begin again after a gap of the IMU, in place: the constants carry over, all else does not."""
    for i in MOVING_STATES:
        x[i] = x_start[i]
        for j in range(N):
            P[i, j] = P[j, i] = 0.0
    for i in MOVING_STATES:
        for j in MOVING_STATES:
            P[i, j] = P0[i, j]


@compiled
def prediction(
    x: Floats, point: Floats, s: Record, noise: Record, A: Floats, q: Floats, y: Floats, d: Floats
) -> None:
    """States x (29,) a step later into y (29,), linearised at the states `point`.

    A (7, 13): see `coupling`. q (30,): diagonal of Q. d (29,): scratch.
    """
    coupling(point, s, A)
    process_noise(point, s, noise, q)
    propagate(point, s, noise, y, d)
    for i in range(N):
        d[i] = x[i] - point[i]
    for c in range(len(DECAYING)):
        d[DECAYING[c]] *= noise.decay[c]
    for i in range(N):
        y[i] += d[i]
    for c in range(len(DRIVEN)):
        for j in range(A.shape[1]):
            y[DRIVEN[c]] += A[c, j] * d[j]


@compiled
def residual_row(
    kind: int, x: Floats, point: Floats, s: Record, noise: Record, h: Floats
) -> tuple[float, float, float]:
    """`row` at the states x, linearised at `point`."""
    residual, sd, gate = row(kind, point, s, noise, h)
    for i in range(N):
        residual -= h[i] * (x[i] - point[i])
    return residual, sd, gate


@compiled
def soft_variance(residual: float, spread: float, sd: float, gate: float) -> float:
    """Measurement variance that grows with an outlier; docs/methods/fusion.md#robust-weighting.

    spread: variance h P h' of the prediction. A hard gate would lock out after gaps.
    """
    variance = sd * sd
    excess = abs(residual) / (gate * np.sqrt(spread + variance)) if gate > 0 else 0.0
    if excess <= 1.0:
        return variance
    return variance * excess**2 + spread * (excess - 1.0)
