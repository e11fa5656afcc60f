"""Body pitch and road slope from dead reckoning at stops, forward and backward in time (KIM).

Kim 2023, corrected and extended: docs/methods/kim2023.md. The state of a standing car is known
best, so the strapdown equations are integrated forward into the acceleration and backward in time
into the deceleration. The accelerometer bias cancels in the pitch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, static_mask
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag
from roadlog.estimators.kim2023.gravity_bias import GravityBias, gravity_bias
from roadlog.estimators.kim2023.lever import rocking_lever
from roadlog.estimators.kim2023.stop_windows import Event, Windows, running_mean
from roadlog.estimators.kim2023.stops import StaticSlopeParameters, Stop, find_stops, vectors
from roadlog.filters import Engine
from roadlog.signals import ACCELERATION, DECELERATION, FLAGS
from roadlog.types import Floats

PITCH_PER_LEVER = np.radians(0.45)  # rad/m, what an error of the lever costs on the full car
LEVER_MODEL_SD = 0.05  # m: a body pitches about no fixed point
REASONS = {  # flags of a window in words, in the order in which they are told
    "missing": "gap in the signals",
    "standstill": "another stop too near",
    "excitation": "did not drive far enough in time",
    "model": "rolled back or did not stand still",
    "rejected": "path not straight (chord test)",
    "saturated": "gravity off: scale or axes of the accelerometer",
}


def static_slope(
    drive: Drive, vehicle: Vehicle, params: StaticSlopeParameters, engine: Engine
) -> Estimate:
    """Events at stops and the running mean of the pitch that they give.

    pitch: of the standing body relative to the road (load and mounting), held between stops;
    inclination, roll_total and grade = inclination - pitch only where the car stands. Details:
    `events` (StopEvent) and `windows` (StopWindow), the integrated paths.
    """
    static = static_mask(drive.speed, drive.rate, past=params.hold_off, future=params.hold_off)
    stops = find_stops(drive, static, params.align != "paper", params)
    mount = _mount(drive, vehicle, stops, params)
    if not mount.full and params.align != "paper":
        stops = find_stops(drive, static, False, params)
    biased = (
        gravity_bias(vectors(drive, "accel"), stops) if params.accel_bias == "gravity" else None
    )
    bias = biased.value if biased else 0.0
    windows = Windows(drive, static, mount.lever, bias, mount.full, params, engine)
    events = [event for stop in stops for event in windows.events(stop)]
    mean, mean_sd = running_mean(events, params)
    mean_sd = np.hypot(mean_sd, PITCH_PER_LEVER * mount.sd)
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
        "events": _event_detail(drive, events, mean, mean_sd, params),
        "windows": _window_detail(drive, events),
    }
    notes = [*mount.notes, *_of_bias(biased), *_notes(stops, events)]
    notes += _leveling(mean, mean_sd, params)
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


def _event_detail(
    drive: Drive, events: list[Event], mean: Floats, mean_sd: Floats, params: StaticSlopeParameters
) -> Detail:
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
        "leveling": params.aimed_pitch - mean,
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


@dataclass(frozen=True)
class _Mount:
    """lever: (3,) m from the pitch center to the IMU; sd: m, of its x; full: the alignment."""

    lever: Floats
    sd: float
    full: bool
    notes: list[str]


def _mount(
    drive: Drive, vehicle: Vehicle, stops: list[Stop], params: StaticSlopeParameters
) -> _Mount:
    """The lever of the vehicle file, or as the rocking after each stop shows it."""
    position = vehicle.imu_position
    lever = np.array(position if position is not None else (0.0, 0.0, 0.0))
    if params.align == "paper":
        return _Mount(lever, 0.0, False, [])
    found = rocking_lever(
        vectors(drive, "accel"), vectors(drive, "gyro"), stops, drive.dt, params.settle
    )
    if found is None:
        full = params.align == "full" or position is not None
        return _Mount(lever, 0.0, full, [])
    sd = float(np.hypot(found.sd, LEVER_MODEL_SD))
    told = f"rocking after {found.stops} stops shows the IMU {found.x:+.2f} +- {sd:.2f} m ahead"
    if position is None:
        lever[0] = found.x
        return _Mount(lever, sd, True, [f"{told} of the pitch center: taken for imu_position"])
    apart = abs(found.x - lever[0])
    if apart <= 2 * sd:
        return _Mount(lever, 0.0, True, [])
    said = f"{told}, imu_position says {lever[0]:+.2f} m: the sd of the pitch allows for it"
    return _Mount(lever, apart, True, [said])


def _leveling(mean: Floats, sd: Floats, params: StaticSlopeParameters) -> list[str]:
    """By how much a headlamp is to be turned at the end of the drive."""
    known = np.flatnonzero(np.isfinite(mean))
    if not len(known):
        return []
    angle, width = np.degrees(params.aimed_pitch - mean[known[-1]]), np.degrees(sd[known[-1]])
    said = f"headlamp leveling {angle:+.2f} +- {width:.2f} deg at the end (beam up +)"
    return [f"{said}, for one that is aimed at a pitch of {np.degrees(params.aimed_pitch):.2f} deg"]


def _of_bias(found: GravityBias | None) -> list[str]:
    if found is None:
        return []
    return [
        f"gravity at {found.stops} stops on different slopes shows {found.value:+.3f} +- "
        f"{found.sd:.3f} m/s2 of accelerometer bias along x: taken off"
    ]


def _notes(stops: list[Stop], events: list[Event]) -> list[str]:
    """How many windows were found and used, and why the others were not."""
    counts = [
        f"{sum(e.valid for e in own)} of {len(own)} {name}"
        for kind, name in ((ACCELERATION, "forward"), (DECELERATION, "reverse-time"))
        if (own := [event for event in events if event.kind == kind])
    ]
    used = sum(event.valid for event in events)
    note = f"{len(stops)} stops, {used} of {len(events)} windows used"
    note += f" ({', '.join(counts)})" if counts else ""
    why = [
        f"{count} {words}"
        for name, words in REASONS.items()
        if (count := sum(bool(event.flags & FLAGS[name]) for event in events))
    ]
    note += f"; rejected: {', '.join(why)}" if why else ""
    return [note if used else f"no usable stop: {note}"]


STATIC_SLOPE = Estimator(
    name="static_slope",
    run=static_slope,
    parameters=StaticSlopeParameters,
    needs=(*(f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"), ANY_SPEED),
    gives=("grade", "pitch", "inclination", "roll_total"),
    reference="Kim 2023, eqs. (7)-(17); docs/methods/kim2023.md#windows",
    summary="pitch of the standing body by dead reckoning at stops, with reverse-time integration",
    systematic_deg={"grade": 0.45, "pitch": 0.4, "inclination": 0.45, "roll_total": 0.45},
    tilted=("grade", "pitch", "inclination", "roll_total"),
)
