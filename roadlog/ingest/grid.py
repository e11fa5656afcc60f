"""Accelerometer and gyro on stamps of their own brought onto those of the faster of the two."""

from __future__ import annotations

import numpy as np

from roadlog.drive import stale_limit
from roadlog.spool import Spool, blocks, release
from roadlog.types import Floats, Stamps

Signals = dict[str, tuple[Stamps, Floats]]  # role -> ns, SI values in vehicle axes

BURST = 2_000_000  # ns; messages of one measurement follow each other on a bus as fast as this

TOGETHER = 0.99  # share of samples that lie beside one of the others, of one device's messages


def one_grid(signals: Signals) -> tuple[Signals, list[str]]:
    """The same with one set of stamps for all of `imu`, and sentences on what was interpolated.

    Linear; NaN where the samples about a stamp lie further apart than a drive's stale limit.
    Messages of one burst are one measurement already and stay as they are.
    """
    roles = [role for role in signals if role.startswith("imu.") and len(signals[role][0]) > 1]
    if not roles:
        return signals, []
    densest = max(roles, key=lambda role: len(signals[role][0]))
    grid = np.sort(signals[densest][0], kind="stable")
    moved = [role for role in roles if not _beside(grid, signals[role][0])]
    if not moved:
        return signals, []
    result = {r: _interpolated(grid, *signals[r]) if r in moved else signals[r] for r in signals}
    return result, [f"{', '.join(moved)}: interpolated to the stamps of {densest}"]


def _beside(grid: Stamps, time: Stamps) -> bool:
    """Whether nearly every stamp lies as near to one of the grid's as messages of one burst."""
    if time is grid or (len(time) == len(grid) and np.array_equal(time, grid)):
        return True
    near = min(BURST, float(np.median(np.diff(grid))) / 4)
    count = 0
    for rows in blocks(len(time)):
        at = time[rows]
        after = np.searchsorted(grid, at)
        apart = np.minimum(
            np.abs(grid[np.minimum(after, len(grid) - 1)] - at),
            np.abs(at - grid[np.maximum(after - 1, 0)]),
        )
        count += int((apart <= near).sum())
    release([time])
    return count >= TOGETHER * len(time)


def _interpolated(grid: Stamps, time: Stamps, values: Floats) -> tuple[Stamps, Floats]:
    """Values at the stamps of the grid, block by block."""
    known = np.isfinite(values)
    time, values = time[known], values[known]
    order = np.argsort(time, kind="stable")
    time, values = time[order], values[order]
    limit = stale_limit(np.multiply(time[:100_000] - time[0], 1e-9)) * 1e9
    found = Spool(np.float64)
    for rows in blocks(len(grid)):
        at = grid[rows]
        part = slice(max(0, np.searchsorted(time, at[0]) - 1), np.searchsorted(time, at[-1]) + 1)
        own = time[part]
        here = np.full(len(at), np.nan)
        if len(own) > 1:
            after = np.clip(np.searchsorted(own, at), 1, len(own) - 1)
            there = (at >= own[0]) & (at <= own[-1]) & (own[after] - own[after - 1] <= limit)
            start = at[0]
            line = np.interp(at - start, own - start, values[part])
            here[there] = line[there]
        found.append(here)
    release([grid])
    return grid, found.column()
