"""Which column is which signal, by names; of several the one that the drive bears out."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from roadlog.checks.speeds import SPEED_UNITS
from roadlog.geo import EARTH_RADIUS, of_degrees_minutes
from roadlog.ingest.drafting.draft import Draft, Guess
from roadlog.ingest.drafting.inference import gravity_unit
from roadlog.ingest.drafting.names import (
    MINUTES,
    POWER,
    any_unit,
    folded,
    is_worded,
    roles_of,
    stated_unit,
)
from roadlog.ingest.drafting.vocabulary import SATELLITE
from roadlog.ingest.frame import Frame
from roadlog.signals import AXES
from roadlog.types import Floats
from roadlog.units import DEGREES_MINUTES, UNITS

POSITIONS = ("gnss.latitude", "gnss.longitude")
SPEEDS = ("speed.v", "gnss.speed")


def match(draft: Draft, typed: Collection[int] = ()) -> None:
    """Fill the draft with guesses; none of frames (by their id) whose type says what they are."""
    known = {guess.role for guess in draft.guesses if not guess.off}
    used = {(id(guess.frame), guess.column) for guess in draft.guesses}
    found: dict[str, list[Guess]] = {}
    for frame in draft.frames:
        if id(frame) in typed:
            continue
        for column, values in frame.columns.items():
            if values.dtype.kind not in "bifu" or not np.isfinite(values).any():
                continue
            if (id(frame), column) in used:
                continue
            for role in [role for role in roles_of(frame, column) if role not in known]:
                if guess := _guess(frame, column, role):
                    found.setdefault(role, []).append(guess)
    for kind in ("accel", "gyro"):
        _triad(draft, [found.pop(f"imu.{kind}_{axis}", []) for axis in AXES])
    _degrees_minutes(found)
    _hemispheres(found)
    track = _track(found)
    for guesses in found.values():
        best = max(guesses, key=lambda g: (_bears_out(g, track), g.stated, _rate(g.frame)))
        others = [_full_name(g) for g in guesses if g is not best]
        doubts = (f"or: {', '.join(others)}",) if others else ()
        draft.guesses.append(replace(best, doubts=(*best.doubts, *doubts)))


def _guess(frame: Frame, column: str, role: str) -> Guess | None:
    words = folded(column).split("_")
    satellite = any(map(SATELLITE.fullmatch, words))
    if role.startswith("imu.") and satellite and is_worded(column):
        return None  # what a receiver calculates of its speed has no gravity
    if (
        role == "gnss.course"
        and not {"heading", "hdg"}.isdisjoint(words)
        and not _has_positions(frame)
    ):
        return None
    unit, stated = stated_unit(frame, column, role)
    doubts: tuple[str, ...] = ()
    scale = 1.0
    if role in POSITIONS:
        scale, doubts = _position_scale(frame, column)
    if role.startswith("truth."):
        doubts = ("taken for a reference by its name; it is not used by estimators",)
    return Guess(
        role, frame, column, unit, stated, scale, valid=_flag(frame, column), doubts=doubts
    )


def _has_positions(frame: Frame) -> bool:
    return any("gnss.latitude" in roles_of(frame, column) for column in frame.columns)


def _position_scale(frame: Frame, column: str) -> tuple[float, tuple[str, ...]]:
    """Degrees for a unit of one's source, and why."""
    largest = float(np.nanmax(np.abs(frame.columns[column])))
    if any_unit(frame, column) in MINUTES:
        return 1 / 60, ("the source states minutes of arc",)
    if power := POWER.search(folded(column)):
        return 10.0 ** -int(power[1]), (f"by its name in 1e-{power[1]} degrees",)
    if largest > 1e6:
        return 1e-7, ("by its size in 1e-7 degrees",)
    if largest > 180:
        text = "by its size in minutes of arc; a longitude may count positive to the west"
        return 1 / 60, (f"{text} (scale = -1/60)",)
    return 1.0, ()


def _degrees_minutes(found: dict[str, list[Guess]]) -> None:
    """Positions that may be `ddmm.mmmm` as well as minutes: what the speeds bear out, else that."""
    both = [found[role][0] for role in POSITIONS if role in found]
    values = [guess.frame.columns[guess.column] for guess in both]
    if not both or any(g.scale != 1 / 60 or any_unit(g.frame, g.column) in MINUTES for g in both):
        return
    if any((np.abs(v[np.isfinite(v)]) % 100 >= 60).any() for v in values):
        return  # no such minutes
    speeds = [guess for role in SPEEDS for guess in found.get(role, ())]
    as_minutes, as_both = (
        min((_misfit(guess, _track(reading)) for guess in speeds), default=0.0)
        for reading in (found, {**found, **_read(both)})
    )
    if as_both > as_minutes:
        return
    for guess in both:
        doubt = "by its size degrees and minutes in one number (minutes of arc: scale = 1/60)"
        found[guess.role][0] = replace(guess, unit=DEGREES_MINUTES, scale=1.0, doubts=(doubt,))


def _hemispheres(found: dict[str, list[Guess]]) -> None:
    """Turn positions without sign beside whose column another says S or W."""
    for role, away in zip(POSITIONS, "SW", strict=True):
        for guess in found.get(role, ())[:1]:
            columns = guess.frame.columns
            # a column of texts is known by its first
            texts = {str(v[0]).strip().upper() for v in columns.values() if v.dtype.kind == "O"}
            if away in texts and np.nanmin(columns[guess.column]) >= 0:
                doubts = (*guess.doubts, f"a column says {away}")
                found[role][0] = replace(guess, scale=-guess.scale, doubts=doubts)


def _read(both: Sequence[Guess]) -> dict[str, list[Guess]]:
    """The positions in degrees, of `ddmm.mmmm`."""
    frame = both[0].frame
    columns = {g.column: of_degrees_minutes(g.frame.columns[g.column]) for g in both}
    turned = replace(frame, columns={**frame.columns, **columns})
    return {g.role: [replace(g, frame=turned, scale=1.0)] for g in both}


def _misfit(guess: Guess, track: tuple[Floats, Floats] | None) -> float:
    """How far a speed, in the unit that fits best, is from that of the positions, as a share."""
    pair = _beside(guess, track)
    if pair is None:
        return 0.0
    own, other = pair
    factors = [UNITS[unit][1] for unit in ("m/s", *SPEED_UNITS)]
    return min(float(np.median(np.abs(own * f - other))) for f in factors) / float(np.median(other))


def _track(found: dict[str, list[Guess]]) -> tuple[Floats, Floats] | None:
    """Time [s] and speed by the positions [m/s] between those that change; None without."""
    both = [found[role][0] for role in POSITIONS if role in found]
    if len(both) < 2 or both[0].frame is not both[1].frame:
        return None
    north, east = (np.radians(g.frame.columns[g.column] * g.scale) for g in both)
    time = both[0].frame.time * 1e-9
    moved = np.isfinite(north) & np.isfinite(east)
    moved[1:] &= (np.diff(north) != 0) | (np.diff(east) != 0)
    if moved.sum() < 10:
        return None
    north, east, time = north[moved], east[moved] * np.cos(north[moved]), time[moved]
    with np.errstate(divide="ignore", invalid="ignore"):
        speed = EARTH_RADIUS * np.hypot(np.diff(north), np.diff(east)) / np.diff(time)
    return (time[1:] + time[:-1]) / 2, speed


def _bears_out(guess: Guess, track: tuple[Floats, Floats] | None) -> float:
    """How well a speed follows that of the positions, in tenths; 0 for other signals."""
    pair = _beside(guess, track) if guess.role in SPEEDS else None
    return 0.0 if pair is None else round(float(np.corrcoef(*pair)[0, 1]), 1)


def _beside(guess: Guess, track: tuple[Floats, Floats] | None) -> tuple[Floats, Floats] | None:
    """A speed, and that by the positions at the same moments; None where one never changes."""
    if track is None:
        return None
    time, speed = track
    values = guess.frame.columns[guess.column]
    known = np.isfinite(values)
    at = np.interp(time, guess.frame.time[known] * 1e-9, values[known])
    usable = np.isfinite(speed)
    if usable.sum() < 10 or np.ptp(at[usable]) == 0 or np.ptp(speed[usable]) == 0:
        return None
    return at[usable], speed[usable]


def _triad(draft: Draft, found: Sequence[Sequence[Guess]]) -> None:
    """Three axes of one device: those of one frame and one stem, with gravity where there is."""
    groups: dict[tuple[int, str], list[Guess]] = {}
    for guess in (g for axis in found for g in axis):
        groups.setdefault((id(guess.frame), _stem(guess)), []).append(guess)
    if not groups:
        return
    single = [_one_each(group) for group in groups.values()]
    ranked = sorted(single, key=lambda g: (len(g), gravity_unit(g) != ""), reverse=True)
    draft.guesses += ranked[0]
    for other in ranked[1:]:
        draft.put([ranked[0][0].role], doubt=f"or: {', '.join(map(_full_name, other))}")


def _full_name(guess: Guess) -> str:
    return f"{guess.frame.name}.{guess.column}" if guess.frame.name else guess.column


def _one_each(group: Sequence[Guess]) -> list[Guess]:
    """The first guess of each role."""
    return list({guess.role: guess for guess in reversed(group)}.values())[::-1]


def _stem(guess: Guess) -> str:
    """What the names of three axes have in common."""
    if is_worded(guess.column):
        return ""
    axis = guess.role[-1]
    return re.sub(
        rf"{axis}(?=_|$)|^{axis}_|(?<=_){axis}(?=[a-z])", "", folded(guess.column), count=1
    )


def _flag(frame: Frame, column: str) -> str:
    """The condition of a frame's only flag of validity."""
    flags = [
        c
        for c, values in frame.columns.items()
        if "valid" in c.lower() and c != column and values.dtype.kind in "bifu"
    ]
    if len(flags) != 1:
        return ""
    states = np.unique(frame.columns[flags[0]])  # one that the source calls invalid is unknown
    if not set(states[np.isfinite(states)].tolist()) <= {0, 1}:
        return ""
    return f"{flags[0]} == 1"


def _rate(frame: Frame) -> float:
    return len(frame) / max(1e-9, float(np.ptp(frame.time)) * 1e-9)
