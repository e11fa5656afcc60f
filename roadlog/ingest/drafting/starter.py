"""A profile to start from: by names, by units, and by what the data itself shows."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from roadlog.errors import ConfigError, near
from roadlog.ingest import Source, expanded, open_source
from roadlog.ingest.drafting.draft import Draft, Guess
from roadlog.ingest.drafting.inference import by_data, gravity_unit
from roadlog.ingest.drafting.names import TIME, WORDED, bare, folded, roles_of, stated_unit, unit_of
from roadlog.ingest.formats import times
from roadlog.ingest.frame import Frame, joined
from roadlog.ingest.profile import Clock, Profile, fitting
from roadlog.signals import AXES, SIGNALS


@dataclass(frozen=True)
class _Everything(Profile):
    """Reads all that a source has."""

    def reads(self, column: str, *frames: str) -> bool:
        """Whatever the name."""
        del column, frames
        return True


def starter(sources: Sequence[Path | str], dbc: Sequence[Path] = ()) -> str:
    """TOML text of a profile for what the sources hold; it loads and ingests them.

    Names are matched with those that vendors use, units by what the source states, by endings of
    names and by size; mounting, signs and delays by the drive itself (`roadlog.checks`). What was
    not certain stands in comments. Raises ConfigError where no name means a signal, LogReadError
    for an unreadable source.
    """
    paths, databases, _ = expanded([Path(source) for source in sources], dbc)
    opened = [open_source(path, _Everything("everything", ""), databases) for path in paths]
    own = {source.format.profile for source in opened}
    if len(own) == 1 and (shared := own.pop()):
        profile = Profile.load(shared)
        return f"# the profile {profile.name}, which fits this source\n{profile.text}"
    clock = _clock(opened)
    frames: list[Frame] = []
    unclear = False
    for source in opened:
        try:
            recording = _with(source, clock).read(databases)
        except ConfigError:
            if clock.unit or not source.format.is_table:
                raise
            clock, unclear = replace(clock, unit="s"), True
            recording = _with(source, clock).read(databases)
        frames += recording.frames
    draft = Draft(clock, joined(frames))
    names = ", ".join(path.name for path in paths)
    draft.head = [f"A profile to start from, for {names}. Check each line, then see `info`."]
    known = {n for f in draft.frames for c in f.columns for n in (c, *f.full(c))}
    if fits := fitting(known):
        draft.head.append(f"The shipped profile {fits.name} has these names too: see `profiles`.")
    if unclear:
        draft.head.append("The unit of the time column is not clear: s is assumed.")
    _match(draft)
    if not draft.guesses:
        raise ConfigError(
            f"{names}: no name in it looks like a signal that roadlog knows. "
            + near("speed", {c for f in draft.frames for c in f.columns})
        )
    by_data(draft)
    return draft.toml()


def _clock(opened: Sequence[Source]) -> Clock:
    """The time column of the tables among the sources, and the unit its name states."""
    for source in opened:
        if not source.format.is_table:
            continue
        names = sorted(source.format.names(source.path, ()))
        try:
            times.time_column(names, "", source.path.name)
            return Clock()
        except ConfigError:
            found = [n for n in names if TIME.match(folded(n))]
            found = [n for n in found if bare(n) in ("t", "date_time") or "time" in folded(n)]
            if not found:
                raise
            column = min(found, key=len)
            return Clock(column, unit_of(column, "s"))
    return Clock()


def _with(source: Source, clock: Clock) -> Source:
    """The source, all of it to be read on that clock."""
    return replace(source, profile=_Everything("everything", "", clock))


def _match(draft: Draft) -> None:
    """Which column is which signal, by names."""
    found: dict[str, list[Guess]] = {}
    for frame in draft.frames:
        for column, values in frame.columns.items():
            if values.dtype.kind not in "bifu" or not np.isfinite(values).any():
                continue
            for role in roles_of(frame, column):
                unit, stated = stated_unit(frame, column, SIGNALS[role].unit)
                valid = _flag(frame, column)
                found.setdefault(role, []).append(
                    Guess(role, frame, column, unit, stated, valid=valid)
                )
    for kind in ("accel", "gyro"):
        _triad(draft, [found.pop(f"imu.{kind}_{axis}", []) for axis in AXES])
    for guesses in found.values():
        best = max(guesses, key=lambda g: (_rate(g.frame), -len(g.column)))
        others = [g.column for g in guesses if g is not best]
        doubts = (f"or: {', '.join(others)}",) if others else ()
        draft.guesses.append(replace(best, doubts=doubts))


def _triad(draft: Draft, found: Sequence[Sequence[Guess]]) -> None:
    """Three axes of one device: those of one frame and one stem, with gravity where there is."""
    groups: dict[tuple[int, str], list[Guess]] = {}
    for guess in (g for axis in found for g in axis):
        groups.setdefault((id(guess.frame), _stem(guess)), []).append(guess)
    if not groups:
        return
    ranked = sorted(groups.values(), key=lambda g: (_full(g), _weighs(g)), reverse=True)
    draft.guesses += ranked[0]
    for other in ranked[1:]:
        draft.put([ranked[0][0].role], doubt=f"or: {', '.join(g.column for g in other)}")


def _stem(guess: Guess) -> str:
    base = bare(guess.column)
    worded = any(re.search(pattern, base) for pattern in WORDED.values())
    return "" if worded else base.removesuffix(guess.role[-1]).rstrip("_")


def _full(group: Sequence[Guess]) -> int:
    return len({g.role for g in group})


def _weighs(group: Sequence[Guess]) -> bool:
    return gravity_unit(group) != ""


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
