"""Sources of every kind to one drive log: read, mapped, on one clock."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from roadlog.checks.delays import delays
from roadlog.checks.finding import Finding
from roadlog.checks.impossible import beyond
from roadlog.errors import ConfigError, LogReadError, near
from roadlog.ingest import clocks, mapping, repeats, typed
from roadlog.ingest.formats import format_of, understood
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.parsers import readable
from roadlog.ingest.formats.times import zone_of
from roadlog.ingest.frame import Frame, Recording, joined
from roadlog.ingest.gaps import gaps
from roadlog.ingest.grid import one_grid
from roadlog.ingest.mapping import Mapped
from roadlog.ingest.profile import Clock, Profile, fitting, shipped
from roadlog.ingest.reference import reference
from roadlog.spool import blocks, release
from roadlog.storage import Table
from roadlog.types import Stamps

LIES = {  # devices that may lie in the car in any way
    "phone": "the phone is taken as flat, its top forward",
    "camera": "the camera is taken as upright, its lens forward",
}


@dataclass(frozen=True)
class IngestResult:
    """What came of the sources.

    tables: ready to be written. metadata: `profile` and `source` records. left_over: source names
    that the profile does not use. lacking: roles of a shipped profile that the source does not
    have. notes (profile found, coverage of a bus, clocks), gaps, losses: sentences for people.
    """

    tables: list[Table]
    metadata: dict[str, dict[str, str]]
    mapped: list[Mapped]
    left_over: list[str]
    lacking: list[str]
    notes: list[str]
    gaps: list[str]
    losses: list[str]


@dataclass(frozen=True)
class Source:
    """One source with the format that reads it and the profile that says what its names mean.

    seen: what was read to find the profile, where that holds all that the profile reads.
    """

    path: Path
    format: Format
    profile: Profile
    seen: Recording | None = None

    def in_zone(self, timezone: str) -> Source:
        """The same with another zone of local stamps. Raises ConfigError for no zone."""
        if not timezone:
            return self
        zone_of(timezone)
        clock = replace(self.profile.clock, zone=timezone)
        return replace(self, profile=replace(self.profile, clock=clock))

    def on_clock(self, clock: str) -> Source:
        """The same on another clock of messages, where it has messages. Raises ConfigError."""
        return replace(self, profile=self.profile.on_clock(clock)) if self.format.is_typed else self

    def read(self, dbc: Sequence[Path]) -> Recording:
        """What it holds. Raises LogReadError, ConfigError, MissingExtraError."""
        if self.seen is not None and self.profile.clock == Clock():
            return self.seen
        with readable(self.path):
            return self.format.read(self.path, self.profile, dbc)


def ingest(
    sources: Sequence[Path | str],
    profile: Profile | str | Path | None = None,
    dbc: Sequence[Path] = (),
    truth_from: str | Path | None = None,
    time_offsets: Mapping[str, float] | None = None,
    timezone: str = "",
    clock: str = "",
) -> IngestResult:
    """Read the sources of one drive and map them.

    A folder that is no format of its own stands for the files in it. profile: a Profile, a file,
    the name of a shipped one, or None where each source says what it is. dbc: databases for raw
    CAN frames, `BUS=FILE` for one bus. truth_from: a reference grade, from the altitude (`gnss`)
    or a surveyed table (a file). time_offsets: file name -> s
    to add to its clock, instead of an estimate. timezone: of sources whose stamps are in a local
    time, `Europe/Berlin` or `+01:00`. clock: which time of the messages of a bag or MCAP counts,
    log, publish or header, instead of the profile's. Raises LogReadError for an unreadable source,
    ConfigError for a profile that does not fit.
    """
    given = Profile.load(profile) if isinstance(profile, (str, Path)) else profile
    paths, databases, ignored = expanded([Path(source) for source in sources], dbc)
    found = [open_source(path, given, databases).in_zone(timezone) for path in paths]
    opened = _on_clock(found, clock)
    recordings = [source.read(databases) for source in opened]
    profiles = list({source.profile.name: source.profile for source in opened}.values())
    groups, mapped, over, lacking, doubts = [], [], [], [], []
    losses = [loss for recording in recordings for loss in recording.losses]
    for chosen in profiles:
        own = [r for s, r in zip(opened, recordings, strict=True) if s.profile.name == chosen.name]
        whole = joined(frame for recording in own for frame in recording.frames)
        frames, coarse, same = repeats.apart(whole)
        located, absent = mapping.locate(chosen, frames)
        lacking += absent
        over += mapping.left_over(frames, located)
        doubts += coarse + mapping.contradicted(located)
        losses += same + _backward(frames) + mapping.without_minutes(located)
        for members in _clock_groups(own, frames):
            here = [place for place in located if any(place.frame is f for f in members)]
            signals, kinds = mapping.signals(chosen, here)
            groups.append(clocks.Group(_files(members), signals))
            mapped += kinds
    signals, said = clocks.merged(groups, time_offsets or {})
    signals, moved = one_grid(signals)
    tables = mapping.tables(signals)
    if truth_from is not None:
        tables, mapped, told = _referenced(truth_from, tables, mapped)
        said += told
    metadata = _records(profiles, clock, paths)
    inertial = any(m.role.startswith("imu.") for m in mapped)
    notes = [] if given else [_by_itself(source, inertial) for source in opened]
    notes += [note for recording in recordings for note in recording.notes] + said + moved + doubts
    notes += [text for recording in recordings for text in recording.unread]
    unusable = [f"{m.role}: no sample of {m.source} is usable" for m in mapped if not m.samples]
    (losses if given and not given.family else notes).extend(unusable)
    notes += [f"check: {finding}" for finding in _findings(profiles, tables)]
    notes += [f"not a source: {', '.join(ignored)}"] if ignored else []
    return IngestResult(tables, metadata, mapped, over, lacking, notes, gaps(tables), losses)


def _referenced(
    truth_from: str | Path, tables: Sequence[Table], mapped: Sequence[Mapped]
) -> tuple[list[Table], list[Mapped], list[str]]:
    """Tables with the truth that is made, what was mapped beside it, and notes."""
    made, told = reference(truth_from, tables)
    kept = [m for m in mapped if not m.role.startswith("truth.")]
    known = [a for a in ("grade", "bank") if np.isfinite(made.columns[a]).any()]
    left = "; the source's own truth is left out" if len(kept) < len(mapped) else ""
    note = f"truth: {' and '.join(known)} by {Path(truth_from).name}{left}"
    return [*(t for t in tables if t.topic != made.topic), made], kept, [note, *told]


def _on_clock(sources: Sequence[Source], clock: str) -> list[Source]:
    if clock and not any(source.format.is_typed for source in sources):
        where = sources[0].path.name if sources else "nothing"
        raise ConfigError(f"{where}: only messages of a bag or MCAP have a clock to choose")
    return [source.on_clock(clock) for source in sources]


def _by_itself(source: Source, inertial: bool) -> str:
    """Which profile a source asked for, and how a device of one's own is taken to lie."""
    said = f"{source.path.name}: profile {source.profile.name}, found by itself"
    lies = LIES.get(source.profile.name, "") if inertial else ""
    return f"{said}; {lies}: `roadlog profile new` finds how it lies" if lies else said


def _records(
    profiles: Sequence[Profile], clock: str, paths: Sequence[Path]
) -> dict[str, dict[str, str]]:
    """What a log keeps of where it came from."""
    profile = {
        "name": ", ".join(p.name for p in profiles),
        "toml": "\n".join(p.text for p in profiles),
    } | ({"clock": clock} if clock else {})
    return {"profile": profile, "source": {"files": json.dumps(_digests(paths), sort_keys=True)}}


def _findings(profiles: Sequence[Profile], tables: Sequence[Table]) -> list[Finding]:
    """What cannot be, in the profiles and in the tables."""
    found = delays({entry.role: entry.delay for profile in profiles for entry in profile})
    return found + beyond({table.topic: table for table in tables})[0]


def expanded(
    paths: Sequence[Path], dbc: Sequence[Path]
) -> tuple[list[Path], list[Path], list[str]]:
    """Sources, databases and names of other files; folders of files taken apart."""
    found: list[Path] = []
    databases, ignored = list(dbc), []
    for path in paths:
        if not path.is_dir() or format_of(path) is not None:
            found.append(path)
            continue
        files = sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
        inside = [p for p in files if p.stat().st_size and format_of(p) is not None]
        if not inside:
            raise LogReadError(f"{path}: holds no file of a known format; {understood()}")
        found += inside
        if not dbc:
            databases += [p for p in files if p.suffix.lower() == ".dbc"]
        ignored += [p.name for p in files if p not in inside and p not in databases]
    return found, databases, ignored


def open_source(path: Path, profile: Profile | None, dbc: Sequence[Path]) -> Source:
    """The source with its format and profile. Raises LogReadError, ConfigError."""
    if not path.exists():
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        raise LogReadError(f"{path}: no such file or folder. {near(path.name, siblings)}")
    if path.is_file() and not path.stat().st_size:
        raise LogReadError(f"{path}: is empty; nothing to ingest")
    with readable(path):
        found = format_of(path)
        if found is None:
            raise LogReadError(f"{path}: is of no known format; {understood()}")
        if profile is not None:
            return Source(path, found, profile.for_file(path.name))
        meant, seen = _own_profile(found, path, dbc)
        return Source(path, found, meant.for_file(path.name), seen)


def _own_profile(
    format_: Format, path: Path, dbc: Sequence[Path]
) -> tuple[Profile, Recording | None]:
    """The profile that a source asks for by its kind or by its names; what was read to find it."""
    if format_.profile:
        return replace(Profile.load(format_.profile), family=True), None
    seen = None
    if format_.is_typed:
        everything = format_.read(path, typed.read_all(), dbc)
        by_type = typed.profile(everything.frames)
        names = format_.names(path, dbc) if dbc else typed.names(everything.frames)
        found = typed.or_shipped(by_type, names)
        # losses may be of topics that the profile does not use
        if found is not None and found is by_type and not (dbc or everything.losses):
            seen = replace(everything, frames=tuple(typed.with_made(found, everything.frames)))
    else:
        found = fitting(format_.names(path, dbc))
    if found is None:
        raise ConfigError(
            f"{path.name}: say what its names mean with --profile (a file, or one of: "
            f"{', '.join(shipped())}); `roadlog profile new {path.name}` writes one to start from"
        )
    return found, seen


def _clock_groups(recordings: Sequence[Recording], frames: Sequence[Frame]) -> list[list[Frame]]:
    """Frames by logger: files that hold the same messages are one logger's, on one clock."""
    groups: list[tuple[set, set[str]]] = []
    for recording in recordings:
        keys = {frame.key for frame in recording.frames if len(frame)}
        names = {frame.file for frame in recording.frames}
        for group in [g for g in groups if g[0] & keys]:
            groups.remove(group)
            keys, names = keys | group[0], names | group[1]
        groups.append((keys, names))
    return [
        [f for f in frames if f.key in keys and set(f.file.split(", ")) <= names]
        for keys, names in groups
    ]


def _files(frames: Sequence[Frame]) -> list[str]:
    return list(dict.fromkeys(name for frame in frames for name in frame.file.split(", ")))


def _backward(frames: Sequence[Frame]) -> list[str]:
    """A sentence for each frame whose clock steps back; its rows are put in order."""
    return [
        f"{frame.file}: {frame.name or 'the time column'} runs backward {steps} times; put in order"
        for frame in frames
        if (steps := _steps_back(frame.time))
    ]


def _steps_back(time: Stamps) -> int:
    count = 0
    for rows in blocks(len(time)):
        part = time[max(rows.start - 1, 0) : rows.stop]
        count += int((part[1:] < part[:-1]).sum())
    release([time])
    return count


def _digests(paths: Sequence[Path]) -> dict[str, str]:
    """File name -> sha256; of a folder, one per file in it."""
    result = {}
    for path in paths:
        inside = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for file in inside:
            with readable(file), file.open("rb") as opened:
                digest = hashlib.file_digest(opened, "sha256").hexdigest()
            result[str(file.relative_to(path.parent))] = digest
    return result
