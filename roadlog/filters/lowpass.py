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


def zero_phase(values: Floats, cutoff: float, rate: float, padding: int | None = None) -> Floats:
    """Butterworth of order 2 up to `cutoff` Hz, forward and back.

    padding: samples by which the ends are continued; None: as few as scipy takes.
    """
    from scipy.signal import butter, sosfiltfilt

    sos = butter(2, cutoff, fs=rate, output="sos")
    result: Floats = sosfiltfilt(sos, values, padlen=padding)
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


def band_pass(values: Floats, band: tuple[float, float], rate: float) -> Floats:
    """Zero-phase Butterworth of order 2 in a band in Hz, along the first axis."""
    from scipy.signal import butter, sosfiltfilt

    sos = butter(2, band, "bandpass", fs=rate, output="sos")
    pad = min(len(values) - 1, round(2 * rate / band[0]))
    result: Floats = sosfiltfilt(sos, values, axis=0, padlen=pad)
    return result


def butterworth(values: Floats, cutoff: float, rate: float) -> Floats:
    """Causal Butterworth of order 2 up to `cutoff` Hz, along the first axis; starts settled."""
    from scipy.signal import butter, sosfilt, sosfilt_zi

    sos = butter(2, cutoff, fs=rate, output="sos")
    start = sosfilt_zi(sos)[:, :, None] * values[0]
    result: Floats = sosfilt(sos, values, axis=0, zi=start)[0]
    return result


def exponential(values: Floats, alpha: float, start: float | Floats) -> Floats:
    """y_k = y_{k-1} + alpha (x_k - y_{k-1}) from y_{-1} = `start`, along the first axis."""
    from scipy.signal import lfilter

    before = np.atleast_1d(np.asarray((1 - alpha) * start))
    zi = before if values.ndim == 1 else before[None, :]
    result: Floats = lfilter([alpha], [1, alpha - 1], values, axis=0, zi=zi)[0]
    return result


def gaussian_mean(values: Floats, width: float, truncate: float = 4.0) -> tuple[Floats, Floats]:
    """Mean of what is known around each sample, and the share of the window that is; `width`: sd in
    samples, `truncate`: half a window in sds. What is unknown counts as absent."""
    known = np.isfinite(values)
    if not len(values):  # np.convolve takes none
        return np.empty(0), np.empty(0)
    reach = int(truncate * width + 0.5)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    window /= window.sum()
    # every command that looks at a log comes through here; scipy would be half of its start
    weight, total = (
        np.convolve(part, window)[reach : reach + len(part)]
        for part in (known.astype(np.float64), np.where(known, values, 0.0))
    )
    return total / np.maximum(weight, 1e-9), weight
