"""What numpy does where importing scipy would take longer gives what scipy gives."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from roadlog.filters.correlate import correlate
from roadlog.filters.lowpass import gaussian_mean
from roadlog.filters.spectrum import welch
from roadlog.motion.lag import SpeedTrack, Spline

RNG = np.random.default_rng(4)


@pytest.mark.parametrize(("samples", "size"), [(5000, 256), (1000, 255), (300, 300), (9, 1)])
def test_welch_is_scipys(samples: int, size: int) -> None:
    values = np.cumsum(RNG.normal(size=samples)) + 3
    frequency, density = welch(values, 50.0, size)
    theirs = signal.welch(values, 50.0, nperseg=size, detrend="linear", average="median")
    np.testing.assert_allclose(frequency, theirs[0])
    np.testing.assert_allclose(density, theirs[1], rtol=1e-10, atol=1e-25)


def test_correlate_is_scipys() -> None:
    a, b = RNG.normal(size=300), RNG.normal(size=77)
    np.testing.assert_allclose(correlate(a, b), signal.correlate(a, b), atol=1e-12)


@pytest.mark.parametrize("width", [3.0, 400.0])
def test_gaussian_mean_is_scipys_of_what_is_known(width: float) -> None:
    from scipy.ndimage import gaussian_filter1d

    values = np.where(RNG.random(500) < 0.2, np.nan, RNG.normal(size=500))
    known = np.isfinite(values)
    weight = gaussian_filter1d(known.astype(float), width, mode="constant")
    total = gaussian_filter1d(np.where(known, values, 0.0), width, mode="constant")
    mean, share = gaussian_mean(values, width)
    np.testing.assert_allclose(share, weight, atol=1e-14)
    np.testing.assert_allclose(mean, total / weight, atol=1e-12)


def test_the_spline_is_scipys() -> None:
    from scipy.interpolate import CubicSpline

    time = np.cumsum(RNG.uniform(0.01, 0.2, 400))
    value = np.cumsum(RNG.normal(size=400))
    at = np.linspace(time[0], time[-1], 3000)[:-1]
    place = np.searchsorted(time, at, side="right") - 1
    ours = Spline.through(SpeedTrack(time, value))(at, place)
    np.testing.assert_allclose(ours, CubicSpline(time, value, bc_type="natural")(at), atol=1e-10)
