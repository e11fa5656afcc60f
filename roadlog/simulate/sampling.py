"""What every sensor does to a signal: sample, filter, round, and add what drifts."""

from __future__ import annotations

import zlib
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from roadlog.simulate.motion import Motion
from roadlog.types import Floats

Columns = dict[str, tuple[Floats, dict[str, Floats]]]  # section -> times, fields
Sensor = TypeVar("Sensor")


def stream(seed: int, name: str) -> np.random.Generator:
    """The random stream of one part of the simulation."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def without_errors(sensor: Sensor, names: str, **others: Any) -> Sensor:
    """A copy whose named errors (in one text) are zero, and others as given."""
    values: dict[str, Any] = dict.fromkeys(names.split(), 0.0) | others
    return replace(sensor, **values)  # type: ignore[type-var]


def clock(motion: Motion, rate: float) -> Floats:
    """s, times of the samples; the first at 0."""
    first = max(0.0, motion.time[0])
    count = int(np.floor((motion.time[-1] - first) * rate + 1e-6)) + 1
    return first + np.arange(count) / rate


def at(motion: Motion, values: Floats, time: Floats) -> Floats:
    """Values of a fine signal (columns) at given times; the ends are held."""
    position = np.clip((time - motion.time[0]) / motion.dt, 0.0, len(motion.time) - 1.0)
    left = np.minimum(np.floor(position + 1e-6).astype(np.int64), len(motion.time) - 2)
    share = np.clip(position - left, 0.0, 1.0)
    share[share < 1e-5] = 0.0  # a sample on the grid is that sample
    if values.ndim > 1:
        share = share[:, None]
    result: Floats = values[left] + share * (values[left + 1] - values[left])
    return result


def mounting(roll: float, pitch: float, yaw: float) -> Floats:
    """(3, 3) vehicle axes from axes turned by yaw, then pitch (nose up +), then roll; rad."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(-pitch), np.sin(-pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    about_z = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    result: Floats = about_z @ about_y @ about_x
    return result


def gauss_markov(rng: np.random.Generator, n: int, columns: int, time: float) -> Floats:
    """(n, columns) first-order process of unit variance; time constant in samples."""
    from scipy.signal import lfilter

    keep = np.exp(-1.0 / time)
    white = rng.standard_normal((n, columns)) * np.sqrt(1 - keep**2)
    white[0] /= np.sqrt(1 - keep**2)
    result: Floats = lfilter([1.0], [1.0, -keep], white, axis=0)
    return result


def quantized(values: Floats, lsb: float) -> Floats:
    """Rounded to multiples of `lsb`; 0 = not at all."""
    return np.round(values / lsb) * lsb if lsb else values


def wrapped(angle: Floats) -> Floats:
    """rad, in -pi..pi."""
    result: Floats = np.mod(angle + np.pi, 2 * np.pi) - np.pi
    return result
