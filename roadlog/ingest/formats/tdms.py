"""TDMS files of LabVIEW and DIAdem, by npTDMS: channels of one length and timing are a table."""

from __future__ import annotations

from collections.abc import Sequence
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
CLOCK = "time"  # of channels that state their interval
UNITS = ("unit_string", "NI_UnitDescription", "unit")

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
    found: dict[tuple[str, int, float, int], dict[str, NDArray]] = {}
    units: dict[tuple[str, int, float, int], dict[str, str]] = {}
    with guarded(path, "TDMS"):
        for group in TdmsFile.read(path).groups():
            for channel in group.channels():
                values = columns.vector(channel[:])
                if values is None:
                    continue
                start, interval = _timing(channel)
                key = group.name, len(values), interval, start
                found.setdefault(key, {})[channel.name] = values
                said = (channel.properties.get(name) for name in UNITS)
                units.setdefault(key, {})[channel.name] = str(next(filter(None, said), ""))
    if not found:
        raise LogReadError(f"{path}: holds no channel of numbers")
    tables: dict[str, dict[str, NDArray]] = {}
    stated: dict[str, dict[str, str]] = {}
    for key, own in found.items():
        group_name, size, interval, start = key
        name = group_name if group_name not in tables else f"{group_name}[{size}]"
        while name in tables:
            name += "'"
        steps = np.rint(np.arange(size) * interval * 1e9).astype(np.int64)
        clock = {CLOCK: (start + steps).astype("datetime64[ns]")} if interval else {}
        tables[name], stated[name] = {**clock, **own}, units[key]
    return tables, stated


def _timing(channel: Any) -> tuple[int, float]:
    """Start [ns] and interval [s] that a waveform channel states; interval 0 for none."""
    interval = float(channel.properties.get("wf_increment", 0.0) or 0.0)
    start = channel.properties.get("wf_start_time")
    offset = float(channel.properties.get("wf_start_offset", 0.0) or 0.0)
    moment = 0 if start is None else int(np.datetime64(start, "ns").astype(np.int64))
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
