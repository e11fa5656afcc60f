"""How a sensor sits in the car: the `mount` of a profile as a rotation matrix."""

from __future__ import annotations

import re
import tomllib
from typing import Any

import numpy as np

from roadlog import toml
from roadlog.errors import ConfigError
from roadlog.rotation import from_rpy, is_rotation
from roadlog.signals import AXES
from roadlog.types import Floats

_MOUNT = re.compile(r"mount = \{[^}]*\}")


def rotation(mount: Any, where: str) -> Floats:
    """Rotation matrix (vehicle = R @ sensor) of a mount: axes, matrix or rpy_deg.

    Axes: `{forward = "+x", left = "-z"}` says which sensor axis points where; up follows.
    rpy_deg: roll, pitch and yaw of the sensor in the vehicle, R = Rz(yaw) Ry(pitch) Rx(roll).
    drafted: beside a matrix, by `profile new` from a drive, good to a degree or two. Raises
    ConfigError.
    """
    if not isinstance(mount, dict):
        raise ConfigError(f"{where}: mount must be a table {{ forward = ..., left = ... }}")
    keys = set(mount) - {"drafted"}
    if keys == {"matrix"}:
        try:
            matrix = np.array(mount["matrix"], np.float64)
        except (TypeError, ValueError, OverflowError):
            matrix = np.empty(0)
        if matrix.shape != (3, 3):
            raise ConfigError(f"{where}: mount matrix must have three rows of three numbers")
    elif keys == {"rpy_deg"}:
        angles = mount["rpy_deg"]
        if not (isinstance(angles, list) and len(angles) == 3 and all(map(toml.is_number, angles))):
            raise ConfigError(f"{where}: mount rpy_deg must be [roll, pitch, yaw]")
        matrix = from_rpy(*np.radians(angles))
    elif keys <= {"forward", "left", "up"} and len(keys) >= 2:
        rows = {way: _axis(axis, f"{where}: mount {way}") for way, axis in mount.items()}
        if "forward" not in rows:
            rows["forward"] = np.cross(rows["left"], rows["up"])
        if "left" not in rows:
            rows["left"] = np.cross(rows["up"], rows["forward"])
        rows.setdefault("up", np.cross(rows["forward"], rows["left"]))
        matrix = np.stack([rows["forward"], rows["left"], rows["up"]])
    else:
        raise ConfigError(
            f"{where}: mount needs two of forward, left, up; or matrix; or rpy_deg "
            f"(found: {', '.join(sorted(keys)) or 'nothing'})"
        )
    if not is_rotation(matrix):
        raise ConfigError(f"{where}: mount is no rotation of right-handed axes")
    return matrix


def through(advice: str, mount: Floats) -> str:
    """Advice on axes that a profile's mount turned already, as one on the sensor's own axes."""

    def own(match: re.Match[str]) -> str:
        found = rotation(tomllib.loads(match[0])["mount"], "advice") @ mount
        return f"mount = {written(found)}"

    return _MOUNT.sub(own, advice)


def written(matrix: Floats) -> str:
    """A mount as a profile says it: by axes where it is one of right angles, else the matrix."""
    rows = np.rint(matrix).astype(int)
    if not np.allclose(rows, matrix, atol=1e-6):
        return f"{{ matrix = {np.round(matrix, 4).tolist()} }}"
    names = ["+-"[int(row.sum() < 0)] + AXES[int(np.argmax(np.abs(row)))] for row in rows[:2]]
    return f'{{ forward = "{names[0]}", left = "{names[1]}" }}'


def _axis(text: Any, where: str) -> Floats:
    match = re.fullmatch(r"([+-]?)([xyzXYZ])", text.strip()) if isinstance(text, str) else None
    if not match:
        raise ConfigError(f"{where}: '{text}' is no axis; write +x, -x, +y, -y, +z or -z")
    row = np.zeros(3)
    row[AXES.index(match[2].lower())] = -1.0 if match[1] == "-" else 1.0
    return row
