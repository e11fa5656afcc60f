"""Low- and band-passes on a uniform grid. `rate`: samples per second."""

from __future__ import annotations

import numpy as np

from roadlog.types import Floats

STEADY = 20  # samples, mean of which the causal filters begin with


def first_order(values: Floats, lag: float, rate: float) -> Floats:
    """Causal, unit gain, time constant `lag` s (bilinear); begins at the mean of its start."""
    return _causal(values, [1.0], [lag, 1.0], rate)


def second_order(values: Floats, frequency: float, damping: float, rate: float) -> Floats:
    """Causal, unit gain, natural frequency in Hz, damping ratio (bilinear); begins likewise."""
    w = 2 * np.pi * frequency
    return _causal(values, [w * w], [1, 2 * damping * w, w * w], rate)


def zero_phase(values: Floats, cutoff: float, rate: float) -> Floats:
    """Butterworth of order 2 up to `cutoff` Hz, forward and back."""
    from scipy.signal import butter, sosfiltfilt

    result: Floats = sosfiltfilt(butter(2, cutoff, fs=rate, output="sos"), values)
    return result


def gaussian(values: Floats, cutoff: float, rate: float) -> Floats:
    """Zero-phase Gaussian that halves the power at `cutoff` Hz; holds the end values."""
    from scipy.ndimage import gaussian_filter1d

    width = rate * np.sqrt(np.log(2) / 2) / (np.pi * cutoff)
    result: Floats = gaussian_filter1d(values, width, mode="nearest")
    return result


def _causal(
    values: Floats, numerator: list[float], denominator: list[float], rate: float
) -> Floats:
    from scipy.signal import bilinear, lfilter, lfilter_zi

    b, a = bilinear(numerator, denominator, rate)
    result: Floats = lfilter(b, a, values, zi=lfilter_zi(b, a) * values[:STEADY].mean())[0]
    return result
