"""Body pitch and road slope from dead reckoning at stops, forward and backward in time (KIM).

Kim 2023, corrected and extended: docs/methods/kim2023.md. The state of a standing car is known
best, so the strapdown equations are integrated forward into the acceleration and backward in time
into the deceleration. The accelerometer bias cancels in the pitch.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, static_mask
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag
from roadlog.estimators.kim2023.stop_windows import Event, Windows, running_mean
from roadlog.estimators.kim2023.stops import StaticSlopeParameters, Stop, find_stops
from roadlog.filters import Engine
from roadlog.signals import ACCELERATION, DECELERATION
from roadlog.types import Floats

ROCKING = np.radians(0.5)  # rad/s, gyro spread after a stop that calls for `full`
ROCKING_TIME = 0.5  # s


def static_slope(
    drive: Drive, vehicle: Vehicle, params: StaticSlopeParameters, engine: Engine
) -> Estimate:
    """Events at stops and the running mean of the pitch that they give.

    pitch: of the standing body relative to the road (load and mounting), held between stops;
    inclination, roll_total and grade = inclination - pitch only where the car stands. Details:
    `events` (StopEvent) and `windows` (StopWindow), the integrated paths.
    """
    static = static_mask(drive.speed, drive.rate, past=params.hold_off, future=params.hold_off)
    position = vehicle.imu_position
    full = params.align == "full" or (params.align == "auto" and position is not None)
    lever = np.array(position if position is not None else (0.0, 0.0, 0.0))
    stops = find_stops(drive, static, full, params)
    windows = Windows(drive, static, lever, full, params)
    events = [event for stop in stops for event in windows.events(stop, engine)]
    mean, mean_sd = running_mean(events, params)
    angles, sd = _held(drive, events, mean, mean_sd)
    known = np.isfinite(angles["pitch"])
    standing = np.zeros(len(drive), np.bool_)
    for stop in stops:
        standing[stop.first : stop.last + 1] = True
    flags = (
        flag(~windows.known, "missing")
        | flag(standing, "standstill")
        | flag(known & ~standing, "held")
        | flag(~known, "converging")
    )
    details = {
        "events": _event_detail(drive, events, mean, mean_sd),
        "windows": _window_detail(drive, events),
    }
    notes = _notes(drive, stops, events, full)
    return Estimate(drive.time, angles, sd, known, flags, details, notes)


def _held(
    drive: Drive, events: list[Event], mean: Floats, mean_sd: Floats
) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Angles on the drive's clock: the mean held from event to event, the rest while standing."""
    names = ("grade", "pitch", "inclination", "roll_total")
    angles = {name: np.full(len(drive), np.nan) for name in names}
    sd = {name: np.full(len(drive), np.nan) for name in names}
    for k, event in enumerate(events):
        angles["pitch"][event.sample :] = mean[k]
        sd["pitch"][event.sample :] = mean_sd[k]
        stop = event.stop
        shared = stop.starts and stop.ends  # the deceleration has the first half of the stop
        first = (
            (stop.first + stop.last) // 2 if shared and event.kind == ACCELERATION else stop.first
        )
        held = slice(first, stop.last + 1)
        angles["inclination"][held] = event.statics.inclination
        angles["roll_total"][held] = event.statics.roll_total
        sd["inclination"][held] = sd["roll_total"][held] = event.statics.sd
    angles["grade"] = angles["inclination"] - angles["pitch"]
    sd["grade"] = np.hypot(sd["inclination"], sd["pitch"])
    return angles, sd


def _event_detail(drive: Drive, events: list[Event], mean: Floats, mean_sd: Floats) -> Detail:
    bias = np.array([event.stop.gyro_bias for event in events]).reshape(len(events), 3)

    def column(values: list[float]) -> Floats:
        return np.array(values, np.float64)

    columns: dict[str, NDArray] = {
        "kind": np.array([e.kind for e in events], np.int32),
        "inclination": column([e.statics.inclination for e in events]),
        "roll_total": column([e.statics.roll_total for e in events]),
        "grade": column([e.grade for e in events]),
        "pitch": column([e.pitch for e in events]),
        "pitch_sd": column([e.pitch_sd for e in events]),
        "pitch_mean": mean,
        "pitch_mean_sd": mean_sd,
        "chord_deviation": column([e.path.chord_deviation for e in events]),
        "duration": column([e.duration for e in events]),
        "standstill": column([(e.stop.last + 1 - e.stop.first) * drive.dt for e in events]),
        "gravity": column([e.statics.gravity for e in events]),
        "gyro_bias_x": bias[:, 0],
        "gyro_bias_y": bias[:, 1],
        "gyro_bias_z": bias[:, 2],
        "flags": np.array([e.flags for e in events], np.uint32),
        "valid": np.array([e.valid for e in events], np.bool_),
    }
    time = drive.time[[event.sample for event in events]]
    return Detail("roadlog.v1.StopEvent", time, columns)


def _window_detail(drive: Drive, events: list[Event]) -> Detail:
    """The integrated paths, sample by sample in time order."""
    lengths = [len(event.path) for event in events]
    index = np.repeat(np.arange(len(events)), lengths)
    samples = [_samples(event) for event in events]
    time = drive.time[np.concatenate([*samples, np.empty(0, np.int64)])]
    order = np.argsort(time, kind="stable")
    columns: dict[str, NDArray] = {
        "window": index.astype(np.uint32)[order],
        "kind": np.array([e.kind for e in events], np.int32)[index][order],
    }
    for name in ("s", "x", "y", "z", "inclination"):
        parts = [getattr(event.path, name) for event in events]
        columns[name] = np.concatenate([*parts, np.empty(0)])[order]
    return Detail("roadlog.v1.StopWindow", time[order], columns)


def _samples(event: Event) -> np.ndarray:
    """Grid indices of an event's path, in the order of integration."""
    steps = np.arange(len(event.path), dtype=np.int64)
    return event.sample - steps if event.kind == DECELERATION else event.sample + steps


def _notes(drive: Drive, stops: list[Stop], events: list[Event], full: bool) -> list[str]:
    notes = []
    if not any(event.valid for event in events):
        notes.append(f"no usable stop: {len(stops)} stops, {len(events)} windows, none unflagged")
    count = round(ROCKING_TIME * drive.rate)
    starts = [stop.first for stop in stops if stop.starts]
    rocks = any(np.nanstd(drive["imu.gyro_y"][k : k + count]) > ROCKING for k in starts)
    if rocks and not full:
        notes.append(
            "the body still rocks when the car stands: give imu_position in the vehicle file "
            "or set static_slope.align=full"
        )
    return notes


STATIC_SLOPE = Estimator(
    name="static_slope",
    run=static_slope,
    parameters=StaticSlopeParameters,
    needs=(*(f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"), ANY_SPEED),
    gives=("grade", "pitch", "inclination", "roll_total"),
    reference="Kim 2023, eqs. (7)-(17); docs/methods/kim2023.md#windows",
    summary="pitch of the standing body from dead reckoning at stops, in reverse time too",
    systematic_deg={"grade": 0.45, "pitch": 0.4, "inclination": 0.45, "roll_total": 0.45},
    tilted=("grade", "pitch", "inclination", "roll_total"),
)
