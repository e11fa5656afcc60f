"""Power spectral density by Welch's method (1967), in numpy alone.

The same numbers as `scipy.signal.welch`, whose import takes longer than what a short estimate
computes.
"""

from __future__ import annotations

import numpy as np

from roadlog.types import Floats


def welch(values: Floats, rate: float, size: int) -> tuple[Floats, Floats]:
    """Frequencies in Hz and one-sided density in unit^2/Hz.

    Median over segments of `size` samples that overlap by half, each without its straight line and
    under a Hann window.
    """
    segments = np.lib.stride_tricks.sliding_window_view(values, size)[:: size - size // 2]
    window = np.hanning(size + 1)[:-1] if size > 1 else np.ones(1)
    spectra = np.abs(np.fft.rfft(_straightened(segments) * window)) ** 2
    density: Floats = np.median(spectra, axis=0) / (_bias(len(segments)) * rate * (window**2).sum())
    density[1 : (size + 1) // 2] *= 2  # the negative frequencies; neither 0 nor Nyquist has one
    return np.fft.rfftfreq(size, 1 / rate).astype(np.float64), density


def _straightened(segments: Floats) -> Floats:
    """Without the straight line that fits each one best."""
    size = segments.shape[1]
    line = np.arange(size) - (size - 1) / 2
    level = segments - segments.mean(axis=1, keepdims=True)
    power = float((line**2).sum())
    return level - np.outer(level @ line, line / power) if power else level


def _bias(count: int) -> float:
    """Median of `count` periodograms over their mean, for noise (Allen et al. 2012, appendix B)."""
    even = 2.0 * np.arange(1, (count - 1) // 2 + 1)
    return float(1 + np.sum(1 / (even + 1) - 1 / even))
