"""Parameters of a vehicle file that are rows of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np

from roadlog import toml
from roadlog.errors import ConfigError
from roadlog.rotation import is_rotation

Axis = tuple[float, float, float]


def rotation_rows(value: Any, where: str) -> tuple[Axis, ...]:
    """Three rows of a rotation. Raises ConfigError."""
    rows = _rows(value, where, "three rows")
    if not is_rotation(np.array(rows, np.float64)):
        raise ConfigError(f"{where}: is no rotation of right-handed axes")
    return rows


def consumption_map(value: Any, where: str) -> tuple[Axis, ...]:
    """Rows of speed, force and consumption that fill a grid. Raises ConfigError."""
    rows = _rows(value, where, "rows")
    speeds, forces = ({row[k] for row in rows} for k in range(2))
    places = {row[:2] for row in rows}
    if min(len(speeds), len(forces)) < 2 or not len(speeds) * len(forces) == len(places) == len(
        rows
    ):
        raise ConfigError(
            f"{where}: {len(rows)} rows of {len(speeds)} speeds and {len(forces)} forces: must "
            f"hold every speed with every force once, two of each and more"
        )
    if any(row[0] < 0 or row[2] < 0 for row in rows):
        raise ConfigError(f"{where}: speed and consumption must not be negative")
    return rows


def _rows(value: Any, where: str, wanted: str) -> tuple[Axis, ...]:
    rows = value if isinstance(value, list) else []
    if (
        not rows
        or (wanted == "three rows" and len(rows) != 3)
        or not all(
            isinstance(row, list) and len(row) == 3 and all(map(toml.is_number, row))
            for row in rows
        )
    ):
        raise ConfigError(f"{where} = {value!r}: must be {wanted} of three numbers")
    return tuple((float(a), float(b), float(c)) for a, b, c in rows)
