"""Smoothing and differentiating kernels; docs/methods/common.md#matched-kernel."""

from __future__ import annotations

import numpy as np

from roadlog.types import Floats


def odd_window(duration: float, dt: float) -> int:
    """Odd number of samples nearest to `duration` seconds, at least 3."""
    return max(3, 2 * round((duration / dt - 1) / 2) + 1)


def slope(values: Floats, n: int, dt: float) -> Floats:
    """Derivative of `values`: least-squares straight line over n samples, centered.

    The same as a Savitzky-Golay filter of order 2, derivative 1, padded with the end values.
    NaN inside a window gives NaN.
    """
    m = n // 2
    weights = np.arange(-m, m + 1) / (dt * m * (m + 1) * (2 * m + 1) / 3)
    return _convolve(values, weights, n)


def parabolic_mean(values: Floats, n: int) -> Floats:
    """Mean with parabolic weights w_j ~ m (m + 1) - j^2: the kernel that matches `slope`.

    A least-squares slope is the true derivative averaged with these weights (summation by
    parts), so whatever is combined with it must be smoothed by exactly this kernel.
    """
    weights = parabola(n)
    return _convolve(values, weights, n)


def parabola(n: int) -> Floats:
    """The n weights of `parabolic_mean`; their sum is 1."""
    m = n // 2
    j = np.arange(-m, m + 1)
    weights = (m * (m + 1) - j**2).astype(np.float64)
    return weights / weights.sum()


def causal(centered: Floats, n: int) -> Floats:
    """What a centered kernel over n samples gives when it may only look back: a delay of n // 2.

    The first n // 2 results repeat the first one.
    """
    m = n // 2
    if len(centered) <= m:
        return np.full(len(centered), centered[0] if len(centered) else np.nan)
    return np.concatenate([np.full(m, centered[0]), centered[: len(centered) - m]])


def _convolve(values: Floats, weights: Floats, n: int) -> Floats:
    if len(values) == 0:
        return values
    padded = np.pad(values, n // 2, mode="edge")
    return np.convolve(padded, weights[::-1], mode="valid")
