"""Moving sums and means on a uniform grid; NaN counts as absent."""

from __future__ import annotations

import numpy as np

from roadlog.types import Floats


def moving_sum(values: Floats, n: int, centered: bool = False) -> Floats:
    """Sum over the last n samples, or over n around each; NaN counts as 0.

    At the ends of the record the window is cut off.
    """
    total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(values))])
    last = np.arange(1, len(values) + 1) + (n // 2 if centered else 0)
    first = np.maximum(last - n, 0)
    return total[np.minimum(last, len(values))] - total[np.minimum(first, len(values))]


def moving_count(values: Floats, n: int, centered: bool = False) -> Floats:
    """Number of known samples in the windows of `moving_sum`."""
    return np.rint(moving_sum(np.isfinite(values).astype(np.float64), n, centered))


def moving_mean(values: Floats, n: int, centered: bool = False) -> Floats:
    """Mean of the known samples in the windows of `moving_sum`; NaN where there is none."""
    count = moving_count(values, n, centered)
    mean = moving_sum(values, n, centered) / np.maximum(count, 1)
    return np.where(count > 0, mean, np.nan)


def moving_std(values: Floats, n: int, centered: bool = False) -> Floats:
    """Standard deviation (of n, not n - 1) of the known samples in the windows."""
    offset = np.nanmean(values) if np.isfinite(values).any() else 0.0  # saves digits
    centered_values = values - offset
    mean = moving_mean(centered_values, n, centered)
    return np.sqrt(np.maximum(moving_mean(centered_values**2, n, centered) - mean**2, 0.0))
