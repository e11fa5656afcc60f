"""TDMS files of LabVIEW and DIAdem, by npTDMS: channels of one length and timing are a table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats import columns
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

MAGIC = b"TDSm"
INTERVAL = "wf_increment"
CLOCK = "time"  # of channels that state their interval
SLACK = 1.5  # samples; stamps of blocks by a computer's clock are no pause
UNITS = ("unit_string", "NI_UnitDescription", "unit")


@dataclass(frozen=True)
class Take:
    """Samples of a channel that were recorded without a pause.

    first: index. start: moment of that sample [ns]. interval: [s], 0 where none is stated.
    """

    first: int
    start: int
    interval: float

    def goes_on_in(self, other: Take) -> bool:
        """Whether the clock of this take gives the other its start, but for a sample or so."""
        due = self.start + (other.first - self.first) * self.interval * 1e9
        same = self.interval == other.interval
        return same and abs(other.start - due) <= SLACK * self.interval * 1e9


NO_CLOCK = (Take(0, 0, 0.0),)
Tables = tuple[dict[str, dict[str, NDArray]], dict[str, dict[str, str]]]


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
    return columns.recording(*_tables(path), path.name, profile)


def _tables(path: Path) -> Tables:
    """Table -> channel -> values, and -> unit; a stated start and interval make a time."""
    try:
        from nptdms import TdmsFile
    except ImportError:
        raise MissingExtraError("a TDMS file", "tdms") from None
    found: dict[tuple[str, int, tuple[Take, ...]], dict[str, NDArray]] = {}
    units: dict[tuple[str, int, tuple[Take, ...]], dict[str, str]] = {}
    with guarded(path, "TDMS"):
        takes = _takes(path)
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
    return tables, stated


def _stamps(takes: Sequence[Take], size: int) -> NDArray | None:
    """Stamps [ns] of a channel's samples; None where a take states no interval."""
    ends = [*(take.first for take in takes[1:]), size]
    parts = []
    for take, end in zip(takes, ends, strict=True):
        if not take.interval:
            return None
        steps = np.rint(np.arange(end - take.first) * take.interval * 1e9)
        parts.append(take.start + steps.astype(np.int64))
    return np.concatenate(parts)


def _takes(path: Path) -> dict[str, tuple[Take, ...]]:
    """Channel -> its takes: a recording that stopped and went on states a start for each.

    npTDMS 1.13 keeps the properties of the last segment alone and gives all samples one clock from
    there (`time_track`), so that those before a pause come too late by all of it. Its reader is
    asked here for the properties of each segment as it comes to them.
    """
    from nptdms.reader import TdmsReader

    found: dict[str, list[Take]] = {}

    class Reader(TdmsReader):  # type: ignore[misc]
        """Notes what each segment states of its channels' clocks."""

        def _update_object_metadata(self, segment: Any) -> None:
            self.before = {name: one.num_values for name, one in self.object_metadata.items()}
            super()._update_object_metadata(segment)

        def _update_object_properties(self, properties: Any) -> None:
            super()._update_object_properties(properties)
            for name, stated in (properties or {}).items():
                if not any(key == INTERVAL for key, _ in stated):
                    continue
                first = self.before.get(name, 0)
                take = Take(first, *_timing(self.object_metadata[name].properties))
                own = found.setdefault(name, [])
                if own and own[-1].first == first:
                    own[-1] = take
                elif not own or not own[-1].goes_on_in(take):
                    own.append(take)

    reader = Reader(path)
    try:
        reader.read_metadata()
    finally:
        reader.close()
    return {name: tuple(own) for name, own in found.items()}


def _timing(properties: Mapping[str, Any]) -> tuple[int, float]:
    """Start [ns] and interval [s] of a waveform channel; interval 0 for none."""
    interval = float(properties.get(INTERVAL, 0.0) or 0.0)
    start = properties.get("wf_start_time")
    offset = float(properties.get("wf_start_offset", 0.0) or 0.0)
    moment = 0 if start is None else int(start.as_datetime64("ns").astype(np.int64))
    return moment + round(offset * 1e9), interval if interval > 0 else 0.0


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
