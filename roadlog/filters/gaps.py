"""What filters do about gaps: hold a little, then stop and start again."""

from __future__ import annotations

import numpy as np

from roadlog.types import Bools, Floats


def hold(values: Floats, limit: int) -> tuple[Floats, Bools]:
    """Fill NaN by the last known value for at most `limit` samples.

    Returns the filled signal and where it was filled.
    """
    known = np.isfinite(values)
    k = np.arange(len(values))
    last = np.maximum.accumulate(np.where(known, k, -1))
    filled = ~known & (last >= 0) & (k - last <= limit)
    return np.where(filled, values[np.maximum(last, 0)], values), filled


def age(known: Bools) -> Floats:
    """Samples since the last True, 0 where True, infinite before the first."""
    k = np.arange(len(known))
    last = np.maximum.accumulate(np.where(known, k, -1))
    return np.where(last >= 0, k - last, np.inf)
