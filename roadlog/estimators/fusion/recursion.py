"""One step of the recursion of `fusion`, alike in both engines: prediction, rows, robust weight.

Source: docs/methods/fusion.md#process, docs/methods/fusion.md#smoother.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from roadlog.estimators.fusion.model import process_noise, propagate, transition
from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.rows import row
from roadlog.estimators.fusion.states import COUPLED, DECAYING, MOVING, N
from roadlog.estimators.fusion.steps import Steps
from roadlog.types import Floats

OWN_STATES = np.empty((0, N))  # linearise at the filter's own states


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
    """Measurement variance that grows with an outlier; docs/methods/fusion.md#robust-weighting.

    spread: variance h P h' of the prediction. A hard gate would lock out after gaps.
    """
    variance = sd * sd
    excess = abs(residual) / (gate * np.sqrt(spread + variance)) if gate > 0 else 0.0
    if excess <= 1.0:
        return variance
    return variance * excess**2 + spread * (excess - 1.0)


@njit(cache=True)
def is_reported(k: int, steps: Steps, noise: Noise) -> bool:
    """Whether variances are given at a step: they change slowly and cost as much as the rest."""
    last = k + 1 == len(steps.alive) or not steps.alive[k + 1]
    return k % noise.every == 0 or steps.start[k] >= 0 or last
