"""How large the errors of `fusion`'s measurements are in this drive, by its own innovations.

The innovations of a filter whose noise is as assumed are white and of unit variance (Mehra 1970,
"On the identification of variances and adaptive Kalman filtering"). Where they are not, what counts
is their spectrum at low frequency: an error that lasts for m samples carries the information of
n / m of them.
"""

from __future__ import annotations

import numpy as np

from roadlog.estimators.fusion.states import ROWS, Row
from roadlog.types import Floats

# Rows whose error is slow: a car that slips otherwise than its tires say, altitudes that wander. A
# slow misfit of speed or contact with the road would cost the fast motion that they observe; a
# receiver's velocity and angles have twice their sd beforehand, and disagree for a constant.
ADAPTED = (Row.SLIP, Row.ALTITUDE, Row.BAROMETER)
MIN_SAMPLES = 50
UNCORRELATED = 0.05  # autocorrelation, below which the sum ends
MAX_CORRELATION = 20.0  # s, of correlation that is looked for
CHANGED = 1.5  # factor of an sd, below which the filter is not run again


def scales(innovations: Floats, dt: float) -> Floats:
    """(ROWS,), by which the sd of each ADAPTED row is too small for innovations (n, ROWS)."""
    result = np.ones(ROWS)
    rows = list(ADAPTED)
    result[rows] = np.maximum(misfit(innovations, dt)[rows], 1.0)
    return result


def misfit(innovations: Floats, dt: float) -> Floats:
    """(ROWS,), how far the innovations (n, ROWS) of each row are from white and of unit variance.

    The root of their mean square times the number of samples that count as one: 1 is as assumed;
    also where there are too few to tell.
    """
    result = np.ones(ROWS)
    for kind in range(ROWS):
        at = np.flatnonzero(np.isfinite(innovations[:, kind]))
        if len(at) >= MIN_SAMPLES:
            z = innovations[at, kind]
            lags = int(MAX_CORRELATION / dt / np.median(np.diff(at)))
            result[kind] = np.sqrt(np.mean(z**2) * correlated(z, max(lags, 1)))
    return result


def correlated(z: Floats, lags: int) -> float:
    """1 + 2 sum of the autocorrelation of z (n,), until it vanishes: samples that count as one."""
    n = len(z)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(z, size)) ** 2
    r = np.fft.irfft(spectrum, size)[: min(lags + 1, n)]
    r /= max(r[0], 1e-300)
    vanished = np.flatnonzero(r < UNCORRELATED)
    return float(1 + 2 * r[1 : vanished[0] if len(vanished) else len(r)].sum())
