"""Recursive least squares with exponential forgetting for two parameters.

Source: docs/methods/common.md#recursive-least-squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.filters import Engine
from roadlog.jit import compiled
from roadlog.types import Bools, Floats


@dataclass(frozen=True)
class Regression:
    """y = a1 x1 + a2 x2 per sample, (N,) each; update: False where the sample is to be skipped."""

    a1: Floats
    a2: Floats
    y: Floats
    update: Bools


@dataclass(frozen=True)
class RlsTrack:
    """x (N, 2): parameters; p11 (N,): variance of the first one for unit noise; error (N,):
    prediction error before each update, NaN where there was none."""

    x: Floats
    p11: Floats
    error: Floats


def rls(
    regression: Regression, forgetting: float, p0: float, trace_max: float, engine: Engine
) -> RlsTrack:
    """Parameters after every sample, started at 0 with covariance p0 I.

    forgetting: lambda per sample. trace_max: cap on the covariance's trace, against windup.
    """
    data = (regression.a1, regression.a2, regression.y, regression.update)
    if engine == "reference":
        return _rls_reference(regression, forgetting, p0, trace_max)
    return RlsTrack(*_rls(*data, forgetting, p0, trace_max))


@compiled
def _rls(
    a1: Floats, a2: Floats, y: Floats, update: Bools, lam: float, p0: float, trace_max: float
) -> tuple[Floats, Floats, Floats]:
    n = len(y)
    xs, p11s, errors = np.empty((n, 2)), np.empty(n), np.empty(n)
    x1 = x2 = p12 = 0.0
    p11 = p22 = p0
    for k in range(n):
        errors[k] = np.nan
        if update[k]:
            # three scalars: on a full matrix the antisymmetric rounding grows by 1/lambda a step
            u1 = p11 * a1[k] + p12 * a2[k]
            u2 = p12 * a1[k] + p22 * a2[k]
            s = lam + a1[k] * u1 + a2[k] * u2
            g1, g2 = u1 / s, u2 / s
            e = y[k] - a1[k] * x1 - a2[k] * x2
            x1 += g1 * e
            x2 += g2 * e
            p11 = (p11 - g1 * u1) / lam
            p12 = (p12 - g1 * u2) / lam
            p22 = (p22 - g2 * u2) / lam
            trace = p11 + p22
            if trace > trace_max:
                scale = trace_max / trace
                p11 *= scale
                p12 *= scale
                p22 *= scale
            errors[k] = e
        xs[k, 0] = x1
        xs[k, 1] = x2
        p11s[k] = p11
    return xs, p11s, errors


def _rls_reference(
    regression: Regression, forgetting: float, p0: float, trace_max: float
) -> RlsTrack:
    from filterpy.kalman import KalmanFilter

    kf = KalmanFilter(2, 1)
    kf.x, kf.P = np.zeros((2, 1)), np.eye(2) * p0
    kf.F, kf.Q, kf.R = np.eye(2), np.zeros((2, 2)), np.eye(1)
    kf.alpha = forgetting**-0.5
    n = len(regression.y)
    xs, p11s, errors = np.empty((n, 2)), np.empty(n), np.full(n, np.nan)
    rows = np.stack([regression.a1, regression.a2], axis=1)
    posterior = kf.P
    for k in range(n):
        if regression.update[k]:
            kf.P = posterior
            kf.predict()
            kf.update(np.array([[regression.y[k]]]), H=rows[k : k + 1])
            posterior = kf.P * min(1.0, trace_max / np.trace(kf.P))
            errors[k] = kf.y[0, 0]
        xs[k] = kf.x[:, 0]
        p11s[k] = posterior[0, 0]
    return RlsTrack(xs, p11s, errors)
