"""A profile to start from: by names, by units, and by what the data itself shows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from roadlog.ingest import Source, expanded, mapping, open_source
from roadlog.ingest.drafting.by_type import by_type
from roadlog.ingest.drafting.draft import Draft, Guess
from roadlog.ingest.drafting.inference import by_data
from roadlog.ingest.drafting.match import match
from roadlog.ingest.drafting.time_guess import clock_of, first_rows
from roadlog.ingest.frame import Frame, Recording, joined
from roadlog.ingest.profile import Clock, Everything, Profile, fitting

NOTHING = (
    "No name in it looks like a signal that roadlog knows. Write what is which, e.g.",
    "  [speed]",
    '  v = { from = "NAME", unit = "km/h" }',
    "  [imu]",
    '  accel_x = { from = "NAME", unit = "m/s^2" }',
    '  gyro_y = { from = "NAME", unit = "deg/s" }',
)


DEVICES = ("phone", "receiver", "camera")  # profiles of devices that lie in the car in any way


def starter(sources: Sequence[Path | str], dbc: Sequence[Path] = ()) -> str:
    """TOML text of a profile for what the sources hold; it loads and ingests them.

    Names are matched with those that vendors use, units by what the source states, by endings of
    names and by size; mounting, signs and delays by the drive itself (`roadlog.checks`). What was
    not certain stands in comments; where no name means a signal, all is comments. Raises
    LogReadError for an unreadable source.
    """
    paths, databases, _ = expanded([Path(source) for source in sources], dbc)
    opened = [open_source(path, Everything("everything", ""), databases) for path in paths]
    own = {source.format.profile for source in opened}
    if len(own) == 1 and (name := own.pop()):
        if name in DEVICES:
            return _of_device(Profile.load(name), [s.read(databases) for s in opened]).toml()
        return f"# the shipped profile {name}, which fits this source\n{Profile.load(name).text}"
    names = ", ".join(path.name for path in paths)
    head = [f"A profile to start from, for {names}. Check each line, then see `info`."]
    clocks: dict[str, Clock] = {}
    frames: list[Frame] = []
    for source in opened:
        if not source.format.is_table:
            recording = source.read(databases)
            frames += recording.frames
            head += [note for note in recording.notes if ": CAN: " in note]
            continue
        clock, doubt = clock_of(source)
        clocks[source.path.name] = clock
        head += [f"{source.path.name}: {doubt}" if len(opened) > 1 else doubt] if doubt else []
        frames += (
            _timeless(source) if "no column" in doubt else _with(source, clock).read(()).frames
        )
    draft = Draft(clocks, joined(frames), head=head)
    known = {n for f in draft.frames for c in f.columns for n in (c, *f.full(c))}
    if fits := fitting(known):
        draft.head.append(f"The shipped profile {fits.name} has these names too: see `profiles`.")
        if fits.name not in DEVICES:
            draft.guesses += [g for g in _as_shipped(fits, draft.frames) if _is_outside(g)]
    match(draft, by_type(draft))
    if draft.guesses:
        by_data(draft)
    else:
        draft.head += NOTHING
    return draft.toml()


def _with(source: Source, clock: Clock) -> Source:
    """The source, all of it to be read on that clock."""
    return replace(source, profile=Everything("everything", "", clock))


def _of_device(profile: Profile, recordings: Sequence[Recording]) -> Draft:
    """The entries of a device's profile that are there, its mounting by the drive."""
    frames = joined(frame for recording in recordings for frame in recording.frames)
    draft = Draft({}, frames)
    draft.head = [f"The profile {profile.name}, with the mounting that this drive shows."]
    draft.guesses = _as_shipped(profile, frames)
    by_data(draft)
    return draft


def _as_shipped(profile: Profile, frames: Sequence[Frame]) -> list[Guess]:
    """The entries of a shipped profile that are there."""
    return [
        Guess(e.role, frame, column, e.unit, True, e.scale, e.offset, e.delay, typed=True)
        for e, frame, column in mapping.locate(profile, frames)[0]
    ]


def _is_outside(guess: Guess) -> bool:
    """Whether it does not depend on how the sensor is mounted, which the drive shows."""
    return not guess.role.startswith("imu.")


def _timeless(source: Source) -> list[Frame]:
    """The first rows of a table whose time is not known, on no clock."""
    sample = source.format.sample(source.path)
    time = np.arange(first_rows(sample), dtype=np.int64)
    return [Frame("", source.path.name, time, sample)]
