"""Cross-correlation through the Fourier transform."""

from __future__ import annotations

import numpy as np

from roadlog.types import Bools, Floats


def correlate(a: Floats | Bools, b: Floats | Bools) -> Floats:
    """Sums of a[k + lag] b[k] for lag = -(len(b) - 1) ... len(a) - 1."""
    size = len(a) + len(b) - 1
    padded = 1 << (size - 1).bit_length()
    spectrum = np.fft.rfft(a, padded) * np.fft.rfft(b[::-1], padded)
    result: Floats = np.fft.irfft(spectrum, padded)[:size]
    return result
