"""How noisy an inertial sensor is, by its own spectrum and its own codes.

A sensor that hands out instantaneous samples folds all vibration above half its rate into white
noise, many times that of its data sheet. White noise cannot exceed the lowest part of a spectrum.
A coarse sensor that rests on one code is quiet in the spectrum and wrong all the same: its error
lasts until the code changes.
Source: docs/methods/fusion.md#process-noise.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import Samples
from roadlog.filters.spectrum import welch
from roadlog.once import once
from roadlog.types import Floats

SEGMENT, LEAST = 2.56, 256  # s and samples of a segment of the spectrum
LOWEST = 0.3  # Hz; below it lies what the car does
AVERAGED = 12  # parts of the band that the floor is the least of
MAX_FORCE = 50.0  # m/s2; no car on its wheels reaches it, a broken message does
MAX_RATE = 8.0  # rad/s, likewise
ENOUGH = 600.0  # s of a drive that tell it
CODES = 2000  # distinct values; a sensor with more is not coarse
JITTER = 3.0  # median intervals; a longer one is a gap, and no segment reaches across it


@dataclass(frozen=True)
class ImuNoise:
    """White noise of each axis (3,): accel m/s2/sqrt(Hz), gyro rad/sqrt(s); 0 where not known."""

    accel: Floats
    gyro: Floats

    @staticmethod
    def of(imu: Samples) -> ImuNoise:
        """Of the samples as they were taken, without those that no car makes."""
        return _noise(imu)


@once
def _noise(imu: Samples) -> ImuNoise:
    accel, gyro = (
        np.array([_white(imu, f"{kind}_{axis}", limit) for axis in "xyz"])
        for kind, limit in (("accel", MAX_FORCE), ("gyro", MAX_RATE))
    )
    return ImuNoise(accel, gyro)


def _white(imu: Samples, name: str, limit: float) -> float:
    """unit/sqrt(Hz): floor of the spectrum, and what quantisation adds to it."""
    values = imu.columns.get(name, np.full(len(imu.time), np.nan))
    with np.errstate(invalid="ignore"):
        known = (np.abs(values) < limit) & (imu.time - imu.time[:1] < ENOUGH)
    time, values = imu.time[known], values[known]
    if len(values) < LEAST // 2:
        return 0.0
    step = float(np.median(np.diff(time)))
    return float(np.hypot(_floor(time, values, step), _quantisation(time, values)))


def _floor(time: Floats, values: Floats, step: float) -> float:
    """Root of half the lowest part of the one-sided spectrum."""
    if not step > 0:
        return 0.0
    parts = np.split(values, np.flatnonzero(np.diff(time) > JITTER * step) + 1)
    size = min(max(round(SEGMENT / step), LEAST), max(map(len, parts)))
    parts = [part for part in parts if len(part) >= size]
    spectra = [welch(part, 1 / step, size)[1] for part in parts]
    whole = np.average(spectra, axis=0, weights=[len(part) for part in parts])
    psd = whole[np.fft.rfftfreq(size, step) >= LOWEST]
    width = max(len(psd) // AVERAGED, 1)
    averaged = np.convolve(psd, np.full(width, 1 / width), mode="valid") if len(psd) else [0.0]
    return float(np.sqrt(np.min(averaged) / 2))


def _quantisation(time: Floats, values: Floats) -> float:
    """Error of half a code, white over the time that a code lasts."""
    codes = np.unique(values)
    changes = int((np.diff(values) != 0).sum())
    if not 1 < len(codes) < CODES or not changes:
        return 0.0
    lasts = float(time[-1] - time[0]) / changes
    return float(np.median(np.diff(codes))) / np.sqrt(12) * np.sqrt(lasts)
