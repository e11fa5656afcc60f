"""A third-party MCAP, used in place: its messages through a profile to roadlog's tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from roadlog.errors import LogReadError
from roadlog.ingest import mapping, repeats, typed
from roadlog.ingest.formats import mcap
from roadlog.ingest.grid import one_grid
from roadlog.ingest.profile import Profile, shipped
from roadlog.results import IN_PLACE
from roadlog.signals import INPUTS
from roadlog.storage import Table


def explained(path: Path, given: Path | str | None, record: Mapping[str, str]) -> Profile:
    """The profile that was given, that a log's record holds, or that its messages ask for.

    Raises LogReadError where nothing fits, ConfigError for a faulty profile.
    """
    if given is not None:
        return Profile.load(given)
    if record.get("use") != IN_PLACE:
        return own_profile(path)
    where = f"{path}: metadata 'profile'"
    stored = Profile.from_toml(record.get("toml", ""), record.get("name", ""), where)
    return replace(stored, family=record["name"] in shipped())


def own_profile(path: Path) -> Profile:
    """The profile that a log's message types make, or a shipped one. Raises LogReadError."""
    frames = mcap.read(path, typed.read_all()).frames
    found = typed.or_shipped(typed.profile(frames), typed.names(frames))
    if found is None:
        topics = ", ".join(section.topic for section in INPUTS)
        raise LogReadError(
            f"{path}: no vehicle signals: messages on none of {topics}, and no shipped profile "
            f"fits; say what its topics mean with --profile (a file, or one of: "
            f"{', '.join(shipped())})"
        )
    return found


def tables(path: Path, profile: Profile) -> tuple[dict[str, Table], list[str], list[str]]:
    """Topic -> table of what a profile maps; sentences on what was lost, and on clocks.

    Raises ConfigError for a profile that does not fit, LogReadError.
    """
    recording = mcap.read(path, profile)
    frames, coarse, same = repeats.apart(frame for frame in recording.frames if len(frame))
    located, _ = mapping.locate(profile, frames)
    signals, _ = mapping.signals(profile, located)
    found = {table.topic: table for table in mapping.tables(one_grid(signals)[0])}
    return found, [*recording.losses, *same], [*recording.notes, *coarse]
