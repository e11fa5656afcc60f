"""MDF 4 (and 3) measurement files: channel groups, and raw CAN frames decoded with a DBC."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest import can
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.types import Floats, Stamps

MAGIC = b"MDF     "
BUS = "CAN_DataFrame"  # ASAM MDF bus logging: raw frames


def recognizes(path: Path) -> bool:
    """Whether the file begins as an MDF file does."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(8) in (MAGIC, b"UnFinMF ")


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Names of the channels, and of what the bus may hold where frames were logged."""
    with _opened(path) as file:
        found: set[str] = set()
        for group in file.groups:
            here = [channel.name for channel in group.channels]
            if BUS in here:
                found |= can.names(can.load(dbc))
            else:
                found |= {*here, *(f"{_title(group)}.{name}" for name in here)}
        return found


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Channel groups that the profile reads, and decoded bus frames.

    Raises LogReadError, MissingExtraError.
    """
    messages = can.load(dbc)
    with _opened(path) as file:
        try:
            return _read(file, path, profile, messages)
        except LogReadError:
            raise
        except Exception as error:  # asammdf raises whatever a broken block leads to
            raise LogReadError(f"{path}: cannot be read as MDF: {error}") from error


def _opened(path: Path) -> Any:
    try:
        from asammdf import MDF
    except ImportError:
        raise MissingExtraError("an MDF file", "mdf") from None
    try:
        return MDF(path)
    except Exception as error:  # asammdf raises whatever a broken block leads to
        raise LogReadError(f"{path}: cannot be read as MDF: {error}") from error


def _read(file: Any, path: Path, profile: Profile, messages: Sequence[Any]) -> Recording:
    epoch = int(file.start_time.timestamp() * 1e6) * 1000
    frames: list[Frame] = []
    notes: list[str] = []
    losses: list[str] = []
    for index, group in enumerate(file.groups):
        names = [channel.name for channel in group.channels]
        if not group.channel_group.cycles_nr:
            continue
        if BUS in names:
            decoded = can.decode(_bus_frames(file, index, epoch), messages, path.name, profile)
            frames += decoded.frames
            notes += decoded.notes
            losses += decoded.losses
        else:
            frames.append(_group(file, index, epoch, path.name, profile))
    if not frames:
        raise LogReadError(f"{path}: holds no sample")
    return Recording(tuple(frames), tuple(losses), tuple(notes))


def _group(file: Any, index: int, epoch: int, name: str, profile: Profile) -> Frame:
    """One channel group; of channels that the profile does not read only the names."""
    group = file.groups[index]
    time = _stamps(file.get_master(index), epoch)
    columns, units = {}, {}
    for number, channel in enumerate(group.channels):
        if channel.channel_type in (2, 3):  # master and virtual master: the time itself
            continue
        if profile.reads(channel.name, _title(group)):
            signal = file.get(group=index, index=number)
            columns[channel.name], units[channel.name] = signal.samples, signal.unit
        else:
            columns[channel.name] = absent(len(time))
    return Frame(_title(group), name, time, columns, units)


def _title(group: Any) -> str:
    return str(group.channel_group.acq_name or "")


def _bus_frames(file: Any, index: int, epoch: int) -> can.CanFrames:
    def column(name: str) -> Any:
        return file.get(f"{BUS}.{name}", group=index, raw=True).samples

    identifier = column("ID").astype(np.uint32)
    extended = column("IDE").astype(bool)
    data = np.atleast_2d(column("DataBytes"))
    length = column("DataLength").astype(np.uint8)
    marked = np.where(extended, identifier | np.uint32(can.EXTENDED), identifier)
    return can.CanFrames(_stamps(file.get_master(index), epoch), marked, data, length)


def _stamps(seconds: Floats, epoch: int) -> Stamps:
    return np.rint(seconds * 1e9).astype(np.int64) + epoch
