"""What the smoother of `fusion` is fed: one row a step, on a grid of its own.

Source: docs/methods/fusion.md#inputs.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog.drive import Drive
from roadlog.types import Bools, Floats, Records

STEP_RATE = 50.0  # Hz, of the smoother's steps; 25 Hz gives the same
LEARNING = 600.0  # s of driving in which noise and mounting are observable; more costs time
OF_THE_DRIVE = ("dt", "starts", "antenna", "height")  # what `Steps` has not one of at each step


class Fix(IntEnum):
    """Columns of `Steps.fixes`."""

    EAST = 0  # m/s, velocity of the antenna
    NORTH = 1  # m/s
    UP = 2  # m/s
    ALTITUDE = 3  # m, of the receiver
    HEADING = 4  # rad, of two antennas
    ROLL = 5  # rad, of two antennas
    BAROMETER = 6  # m, altitude of the barometer
    CLOSURE = 7  # m, altitude less that of an earlier visit of the place: 0


HEIGHTS = (
    Fix.UP,
    Fix.ALTITUDE,
    Fix.BAROMETER,
)  # by which the grade is observable without the accelerometer


class Sway(IntEnum):
    """Columns of `Steps.sway`: what moves the body on its springs and the rear axle sideways."""

    FORWARD = 0  # m/s2, longitudinal specific force behind the lag of body pitch
    LATERAL = 1  # m/s2, lateral specific force behind the lag of body roll
    TIRE = 2  # m/s2, lateral specific force behind the lag of the rear slip
    FORWARD_MAGNITUDE = 3  # m/s2, as FORWARD, of the force without its sign
    PITCH_INERTIA = 4  # rad, body pitch by the body's own inertia
    ROLL_INERTIA = 5  # rad, body roll by the body's own inertia


class Steps(NamedTuple):
    """What the smoother is fed, on its own grid of k = 0 .. n-1.

    dt: s. force, rate: (n, 3) mean over [k, k+1) of specific force (m/s2) and rate (rad/s) of the
    reference point. force_at, rate_at: (n, 3) at k. sway: (n, 6) `Sway`. speed, speed_sd: (n,) m/s,
    NaN where there is no sample. still: (n,). fixes, fixes_sd: (n, 8) `Fix`, NaN where there is
    none. clone: (n,) where the altitude is kept for a later visit. alive: (n,) the IMU is there.
    start: (n,) row of `starts` where a run of the IMU begins, else -1. starts: (m, 29) states to
    begin with. antenna: (3,) m from the reference point. height: m, of that point over the ground.
    """

    dt: float
    force: Floats
    rate: Floats
    force_at: Floats
    rate_at: Floats
    sway: Floats
    speed: Floats
    speed_sd: Floats
    still: Bools
    fixes: Floats
    fixes_sd: Floats
    clone: Bools
    alive: Bools
    start: NDArray[np.int64]
    starts: Floats
    antenna: Floats
    height: float


# one step as the kernels see it: its row of `Steps`, and what all steps share
STEP = np.dtype(
    [
        *[(name, np.float64, 3) for name in ("force", "rate", "force_at", "rate_at", "antenna")],
        ("sway", np.float64, len(Sway)),
        *[(name, np.float64, len(Fix)) for name in ("fixes", "fixes_sd")],
        *[(name, np.float64) for name in ("dt", "height", "speed", "speed_sd")],
        ("start", np.int64),
        *[(name, np.bool_) for name in ("still", "clone", "alive", "due", "reported")],
    ],
    align=True,
)


def table(steps: Steps, first: int, last: int, every: int) -> Records:
    """Step first - 1, if there is one, and steps first .. last - 1 as records (last - first + 1,).

    due: the road, axle and standstill rows are used, at each `every`-th step. reported: variances
    are given, there and at both ends of a run of the IMU: they change slowly and cost as much as
    the rest.
    """
    records = np.empty(last - first + 1, STEP)
    begin = max(first - 1, 0)
    known = records[begin - first + 1 :]
    for name in steps._fields:
        if name not in OF_THE_DRIVE:
            known[name] = getattr(steps, name)[begin:last]
    for name in ("dt", "antenna", "height"):
        known[name] = getattr(steps, name)
    known["due"] = np.arange(begin, last) % every == 0
    follows = np.zeros(last - begin, np.bool_)
    alive = steps.alive[begin + 1 : last + 1]
    follows[: len(alive)] = alive
    known["reported"] = known["due"] | (known["start"] >= 0) | ~follows
    return records


def grid(drive: Drive) -> Floats:
    """s, times of the smoother's steps over the drive."""
    return np.arange(int(np.floor(drive.time[-1] * STEP_RATE + 1e-6)) + 1) / STEP_RATE


def beginning(steps: Steps) -> Steps:
    """The steps of the first LEARNING seconds that the IMU is there."""
    end = int(np.searchsorted(np.cumsum(steps.alive), LEARNING / steps.dt)) + 1
    if end >= len(steps.alive):
        return steps
    parts = steps._asdict().items()
    return steps._replace(**{k: part[:end] for k, part in parts if k not in OF_THE_DRIVE})


def last(steps: Steps) -> int:
    """The last step that the IMU is there."""
    return int(np.flatnonzero(steps.alive)[-1])


def has(steps: Steps, *fixes: Fix) -> bool:
    """Whether the drive has any of these."""
    return bool(np.isfinite(steps.fixes[:, list(fixes)]).any())
