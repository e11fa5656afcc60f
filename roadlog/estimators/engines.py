"""Estimators as they are asked for: on both engines, to compare them, and several at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any, Literal

import numpy as np

from roadlog import jit
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


def side_by_side(
    make: Callable[[str], Estimate], names: Sequence[str], jobs: int
) -> Iterator[Callable[[], Estimate]]:
    """For each name, in their order, what waits for its estimate; `jobs` are made at a time.

    In threads: compiled loops do not hold Python's lock. With one job each is made when it is
    waited for.
    """
    if jobs == 1:
        yield from (partial(make, name) for name in names)
        return
    jit.loaded()  # once, before the threads
    pool = ThreadPoolExecutor(jobs)
    try:
        yield from (made.result for made in [pool.submit(make, name) for name in names])
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


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
