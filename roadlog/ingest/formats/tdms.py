"""TDMS files of LabVIEW and DIAdem, by npTDMS: channels of one length and timing are a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError, MissingExtraError
from roadlog.ingest.formats import columns
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.times import LAST_STAMP
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

MAGIC = b"TDSm"
START, OFFSET, INTERVAL = "wf_start_time", "wf_start_offset", "wf_increment"
LONGEST_INTERVAL = 1e6  # s, of an interval
TDMS_1970 = 2_082_844_800  # s from 1904-01-01
NO_STAMP = np.iinfo(np.int64).min  # NaT
CLOCK = "time"  # of channels that state their interval
SLACK = 1.5  # samples, and
JITTER = 0.1  # s, by which stamps of blocks differ that a computer gives: they are no pause
UNITS = ("unit_string", "NI_UnitDescription", "unit")


@dataclass(frozen=True)
class Timing:
    """What the properties of a channel say of its clock: moment of the first sample [ns], interval
    [s], 0 where none is stated; dated: whether the moment is one of the calendar."""

    start: int = 0
    interval: float = 0.0
    dated: bool = False


@dataclass(frozen=True)
class Take:
    """Samples of a channel without a pause: index of the first, and its clock."""

    first: int
    timing: Timing

    def moment(self, index: int) -> int:
        """ns of a sample, as the clock of this take has it."""
        return self.timing.start + round((index - self.first) * self.timing.interval * 1e9)

    def goes_on_in(self, other: Take) -> bool:
        """Whether the clock of this take gives the other its start, but for SLACK and JITTER."""
        mine, new = self.timing, other.timing
        late = abs(new.start - self.moment(other.first))
        same = (mine.interval, mine.dated) == (new.interval, new.dated)
        return same and late <= max(SLACK * mine.interval, JITTER) * 1e9

    def then(self, first: int, was: Timing, now: Timing) -> Take:
        """The take from a sample on from which the properties say something else.

        A new interval alone begins where this take ends; where that is, it has to state itself.
        """
        if (was.start, was.dated) != (now.start, now.dated):
            return Take(first, now)
        known = self.timing.interval or first == self.first
        interval = now.interval if known else 0.0
        return Take(first, replace(self.timing, start=self.moment(first), interval=interval))


NO_CLOCK = (Take(0, Timing()),)
Tables = tuple[dict[str, dict[str, NDArray]], dict[str, dict[str, str]], list[str]]


def recognizes(path: Path) -> bool:
    """Whether the file begins as a TDMS file does."""
    return begins(path, MAGIC)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Names of the channels."""
    del dbc
    return columns.names(_tables(path)[0])


def sample(path: Path) -> dict[str, NDArray]:
    """The first rows of the largest table."""
    return columns.largest(_tables(path)[0])


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """A frame for each table. Raises LogReadError, MissingExtraError, ConfigError."""
    del dbc
    tables, units, notes = _tables(path)
    said = [f"{path.name}: {note}" for note in notes]
    try:
        recording = columns.recording(tables, units, path.name, profile)
    except ConfigError as error:
        raise ConfigError("; ".join([str(error), *said])) from None
    return replace(recording, notes=(*said, *recording.notes))


def _tables(path: Path) -> Tables:
    """Table -> channel -> values, and -> unit; a stated start and interval make a time.

    With sentences on properties that do not.
    """
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise MissingExtraError("a TDMS file", "tdms") from None
    found: dict[tuple[str, int, tuple[Take, ...]], dict[str, NDArray]] = {}
    units: dict[tuple[str, int, tuple[Take, ...]], dict[str, str]] = {}
    with guarded(path, "TDMS"):
        takes, notes = _takes(path)
        for group in TdmsFile.read(path).groups():
            for channel in group.channels():
                values = columns.vector(channel[:])
                if values is None:
                    continue
                key = group.name, len(values), takes.get(channel.path, NO_CLOCK)
                found.setdefault(key, {})[channel.name] = values
                said = (channel.properties.get(name) for name in UNITS)
                units.setdefault(key, {})[channel.name] = str(next(filter(None, said), ""))
    if not found:
        raise LogReadError(f"{path}: holds no channel of numbers")
    tables: dict[str, dict[str, NDArray]] = {}
    stated: dict[str, dict[str, str]] = {}
    for key, own in found.items():
        group_name, size, timing = key
        name = group_name if group_name not in tables else f"{group_name}[{size}]"
        while name in tables:
            name += "'"
        stamps = _stamps(timing, size)
        clock = {} if stamps is None else {CLOCK: stamps.astype("datetime64[ns]")}
        tables[name], stated[name] = {**clock, **own}, units[key]
    return tables, stated, notes


def _stamps(takes: Sequence[Take], size: int) -> NDArray | None:
    """Stamps [ns] of a channel's samples, NaT in a take without a clock; None for none at all."""
    dated = any(take.timing.dated for take in takes)
    ends = [*(take.first for take in takes[1:]), size]
    stamps = np.full(size, NO_STAMP)
    for take, end in zip(takes, ends, strict=True):
        timing = take.timing
        if timing.interval and timing.dated == dated:
            moments = timing.start + np.rint(np.arange(end - take.first) * timing.interval * 1e9)
            count = int((np.abs(moments) < LAST_STAMP).sum())
            steps = moments[:count] - float(timing.start)
            stamps[take.first : take.first + count] = timing.start + steps.astype(np.int64)
    return stamps if (stamps != NO_STAMP).any() else None


def _takes(path: Path) -> tuple[dict[str, tuple[Take, ...]], list[str]]:
    """Channel -> its takes: a recording that stopped and went on states a start for each.

    npTDMS 1.13 keeps the properties of the last segment alone and gives all samples one clock from
    there (`time_track`), so that those before a pause come too late by all of it. Its reader is
    asked here for the properties of each segment as it comes to them; one that states again what
    it said before goes on. With sentences on properties that are no clock.
    """
    from nptdms.reader import TdmsReader

    found: dict[str, list[Take]] = {}
    stated: dict[str, Timing] = {}
    notes: dict[str, None] = {}

    class Reader(TdmsReader):  # type: ignore[misc]
        """Notes what each segment states of its channels' clocks."""

        def _update_object_metadata(self, segment: Any) -> None:
            self.before = {name: one.num_values for name, one in self.object_metadata.items()}
            super()._update_object_metadata(segment)

        def _update_object_properties(self, properties: Any) -> None:
            super()._update_object_properties(properties)
            for name in properties or {}:
                was = stated.get(name, Timing())
                now = stated[name] = _timing(self.object_metadata[name].properties, notes)
                if now == was:
                    continue
                own = found.setdefault(name, [])
                first = self.before.get(name, 0)
                take = own[-1].then(first, was, now) if own else Take(first, now)
                if own and own[-1].first == first:
                    own[-1] = take
                elif not own or not own[-1].goes_on_in(take):
                    own.append(take)

    reader = Reader(path)
    try:
        reader.read_metadata()
        for name, own in found.items():
            if own[0].first >= reader.object_metadata[name].num_values:
                own[0] = replace(own[0], first=0)  # stated after all samples, so of all
    finally:
        reader.close()
    return {name: tuple(own) for name, own in found.items()}, list(notes)


def _timing(properties: Mapping[str, Any], notes: dict[str, None]) -> Timing:
    """The clock of a waveform channel; what is none is said."""
    interval = _number(properties.get(INTERVAL, 0.0))
    if INTERVAL in properties and not 0 < interval < LONGEST_INTERVAL:
        notes[f"{_said(INTERVAL, properties)} is no interval"] = None
        interval = 0.0
    offset = _number(properties.get(OFFSET, 0.0))
    if not abs(offset) * 1e9 < LAST_STAMP:
        notes[f"{_said(OFFSET, properties)} is no number of seconds: taken as 0"] = None
        offset = 0.0
    start, ahead = properties.get(START), round(offset * 1e9)
    try:
        # LabVIEW's waveforms without a start say 0, a moment of 1904
        moment = _moment(start) if start is not None and start.seconds else None
    except (AttributeError, OverflowError):
        notes[f"{_said(START, properties)} is no moment: counted from 0"] = None
        moment = None
    return Timing(ahead + (moment or 0), interval, moment is not None)


def _moment(start: Any) -> int:
    """ns of a TDMS time stamp. Raises OverflowError beyond those of a log."""
    found = int(start.seconds - TDMS_1970) * 10**9 + (int(start.second_fractions) * 10**9 >> 64)
    if abs(found) >= LAST_STAMP:
        raise OverflowError
    return found


def _said(name: str, properties: Mapping[str, Any]) -> str:
    value = properties[name]
    return f"a {name} of {value!r}" if isinstance(value, str) else f"a {name} of {value}"


def _number(value: object) -> float:
    """A property that should be a number; NaN for what is none."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return np.nan


FORMAT = Format(
    name="tdms",
    about="TDMS files",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="tdms",
    is_table=True,
    sample=sample,
)
