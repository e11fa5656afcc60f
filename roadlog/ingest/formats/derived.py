"""Columns that a profile may name beside a message's own fields: made of these.

orientation.roll, .pitch, .yaw     of a quaternion (x, y, z, w) [rad]; ZYX, as ROS names them:
                                   with REP 103 axes pitch is positive nose down
hypot(a, b)                        length of two components
atan2(a, b)                        angle [rad] of two components, counterclockwise from b
sd(a), sd(a, b)                    standard deviation, of variances; of two their mean
velocity[2]                        as velocity.2
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.types import Floats

_CALL = re.compile(r"(hypot|atan2|sd)\(([^()]+)\)")
_INDEX = re.compile(r"\[(\d+)\]")


@dataclass(frozen=True)
class Derived:
    """A column and the fields it is made of."""

    fields: tuple[str, ...]
    function: Callable[..., Floats]

    def of(self, columns: Mapping[str, NDArray]) -> Floats:
        """Its values; NaN where a field is unknown."""
        with np.errstate(invalid="ignore", over="ignore"):
            return self.function(*(np.asarray(columns[f], np.float64) for f in self.fields))


def derived(name: str, fields: Collection[str]) -> Derived | None:
    """What a name means that is no field; None where it means nothing."""
    plain = _INDEX.sub(r".\1", name)
    if plain in fields:
        return Derived((plain,), lambda values: values)
    call = _CALL.fullmatch(name)
    if call:
        inner = tuple(part.strip() for part in call[2].split(","))
        counts = (1, 2) if call[1] == "sd" else (2,)
        known = all(part in fields for part in inner) and len(inner) in counts
        return Derived(inner, _CALLS[call[1]]) if known else None
    head, _, angle = name.rpartition(".")
    quaternion = tuple(f"{head}.{axis}" for axis in "xyzw")
    if angle in _ANGLES and all(field in fields for field in quaternion):
        return Derived(quaternion, _ANGLES[angle])
    return None


def named(
    names: Iterable[str], frames: Sequence[str], fields: Collection[str]
) -> dict[str, Derived]:
    """The columns among some full names (`FRAME.column`) that are none of a frame's fields.

    frames: names of the frame.
    """
    found = {}
    for full in names:
        for prefix in (*(f"{frame}." for frame in frames), ""):
            name = full[len(prefix) :]
            if full.startswith(prefix) and name not in fields:
                made = derived(name, fields)
                if made is not None:
                    found[name] = made
    return found


def _deviation(*variances: Floats) -> Floats:
    mean = sum(variances, np.zeros_like(variances[0])) / len(variances)
    return np.sqrt(np.where(mean >= 0, mean, np.nan))


def _unit(x: Floats, y: Floats, z: Floats, w: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Of length 1; NaN for all zero, as where a driver knows no orientation."""
    size = np.sqrt(x * x + y * y + z * z + w * w)
    size = np.where(size > 0, size, np.nan)
    return x / size, y / size, z / size, w / size


def _roll(*quaternion: Floats) -> Floats:
    x, y, z, w = _unit(*quaternion)
    return np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))


def _pitch(*quaternion: Floats) -> Floats:
    x, y, z, w = _unit(*quaternion)
    return np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))


def _yaw(*quaternion: Floats) -> Floats:
    x, y, z, w = _unit(*quaternion)
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


_CALLS: dict[str, Callable[..., Floats]] = {
    "hypot": np.hypot,
    "atan2": np.arctan2,
    "sd": _deviation,
}
_ANGLES: dict[str, Callable[..., Floats]] = {"roll": _roll, "pitch": _pitch, "yaw": _yaw}
