"""Both engines on one drive: whether the compiled loops are the textbook's filters."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any, Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.checks.finding import Finding
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators import run
from roadlog.filters import Engine

EngineChoice = Engine | Literal["both"]


def run_on(
    engine: EngineChoice,
    name: str,
    drive: Drive,
    vehicle: Vehicle,
    settings: Mapping[str, Any] | None = None,
    faults: Collection[Finding] = (),
) -> Estimate:
    """One engine's estimate; of both, the compiled one's with a note of how far they differ.

    Raises what `estimators.run` raises.
    """
    if engine != "both":
        return run(name, drive, vehicle, settings, engine, faults)
    compiled = run(name, drive, vehicle, settings, "compiled", faults)
    reference = run(name, drive, vehicle, settings, "reference", faults)
    return dataclasses.replace(compiled, notes=[*compiled.notes, _apart(compiled, reference)])


def _apart(compiled: Estimate, reference: Estimate) -> str:
    """The largest difference of every angle in words."""
    parts = []
    for angle, values in compiled.angles.items():
        other = reference.angles[angle]
        known = np.isfinite(values)
        if (known != np.isfinite(other)).any():
            parts.append(f"{angle} is not known at the same samples")
        elif known.any():
            largest = np.degrees(np.abs(values[known] - other[known]).max())
            parts.append(f"{angle} {largest:.1e} deg")
    return f"engines compiled and reference differ by at most: {', '.join(parts) or 'no angle'}"
