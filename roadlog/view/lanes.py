"""What the car does, and what the log lacks, as lanes of named intervals under the plots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.drive import runs
from roadlog.signals import ACCELERATION, DECELERATION, estimate_topic
from roadlog.types import Bools, Floats
from roadlog.view.runs import EVENTS, Run

SHORT = 0.5  # s, of a gap that is not worth a mark
NOTHING = ""  # state of a lane in which nothing is to say


@dataclass(frozen=True)
class Lane:
    """States that hold from one time (s) to the next; NOTHING ends one. distance in m or None."""

    time: Floats
    states: tuple[str, ...]
    distance: Floats | None = None


# state -> 0xRRGGBB
STATES = {
    "standing": 0x999999,
    "straight": 0x56B4E9,
    "turning": 0xE69F00,
    "into the stop, reverse time": 0xD55E00,
    "out of the stop": 0x009E73,
    "no IMU": 0xCC3311,
    "no speed": 0xCC3311,
}


def drive_lanes(run: Run) -> dict[str, Lane]:
    """Lane name -> lane: motion, gaps of the main inputs, windows of `static_slope`."""
    drive = run.drive
    lanes = {}
    if drive.has_speed:
        turning = ~drive.straight & ~drive.standstill
        straight = drive.straight & ~drive.standstill & np.isfinite(drive.speed)
        masks = {"standing": drive.standstill, "turning": turning, "straight": straight}
        lanes[run.labeled("motion")] = _lane(run, masks)
        missing = _missing(drive.speed, drive.dt)
        if missing.any():
            lanes[run.labeled("speed_gaps")] = _lane(run, {"no speed": missing})
    if (missing := _missing(drive.get("imu.accel_x"), drive.dt)).any() and "imu.accel_x" in drive:
        lanes[run.labeled("imu_gaps")] = _lane(run, {"no IMU": missing})
    for label in run.estimates:
        lane = _stop_lane(run, label)
        if lane is not None:
            lanes[label] = lane
    return lanes


def _missing(values: Floats, dt: float) -> Bools:
    """True in gaps; channels start and end a little apart, which is none."""
    missing = ~np.isfinite(values)
    for gap in runs(missing):
        if (gap.stop - gap.start) * dt < SHORT:
            missing[gap] = False
    return missing


def _lane(run: Run, masks: dict[str, Bools]) -> Lane:
    state = np.zeros(len(run.drive), np.int64)
    names = (NOTHING, *masks)
    for k, mask in enumerate(masks.values(), 1):
        state[mask] = k
    changes = np.flatnonzero(np.diff(state, prepend=-1))
    time = run.drive.time[changes]
    return Lane(time, tuple(names[k] for k in state[changes]), run.distance_at(time))


def _stop_lane(run: Run, label: str) -> Lane | None:
    table = run.tables.get(estimate_topic(label.partition("@")[0], EVENTS))
    if table is None or not len(table):
        return None
    start = np.multiply(table.time - run.drive.start_ns, 1e-9)
    length = np.nan_to_num(np.asarray(table.columns["duration"], np.float64))
    kind = np.asarray(table.columns["kind"])
    masks = {}
    for code, name in (
        (DECELERATION, "into the stop, reverse time"),
        (ACCELERATION, "out of the stop"),
    ):
        mask = np.zeros(len(run.drive), np.bool_)
        for t, d in zip(start[kind == code], length[kind == code], strict=True):
            first, last = (t - d, t) if code == DECELERATION else (t, t + d)
            mask |= (run.drive.time >= first) & (run.drive.time <= last)
        masks[name] = mask
    return _lane(run, masks)
