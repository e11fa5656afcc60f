"""MDF 4 (and 3) measurement files: channel groups, and raw CAN frames decoded with a DBC."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest import can
from roadlog.ingest.frame import Frame, Recording, absent, unread
from roadlog.ingest.parsers import guarded
from roadlog.ingest.profile import Profile
from roadlog.storage.spool import Spool
from roadlog.types import Stamps

MAGIC = b"MDF     "
UNFINISHED = b"UnFinMF "  # the logger was switched off before it closed the file
BUS = "CAN_DataFrame"  # ASAM MDF bus logging: raw frames
SLICE = 1 << 25  # bytes of records read at a time
MASTERS = (2, 3)  # channel types that are the time itself: master, virtual master


def recognizes(path: Path) -> bool:
    """Whether the file begins as an MDF file does."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(8) in (MAGIC, UNFINISHED)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Names of the channels, and of what the bus may hold where frames were logged."""
    with _opened(path) as groups:
        found: set[str] = set()
        for group in groups:
            if BUS in group.names:
                found |= can.names(can.load(dbc))
            else:
                found |= {*group.names, *(f"{group.title}.{name}" for name in group.names)}
        return found


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Channel groups that the profile reads, and decoded bus frames.

    Raises LogReadError, MissingExtraError.
    """
    messages = can.load(dbc)
    frames: list[Frame] = []
    notes: list[str] = []
    losses: list[str] = []
    with _opened(path) as groups:
        for group in groups:
            if not group.size:
                continue
            if BUS in group.names:
                decoder = can.Decoder(messages, path.name, profile)
                for batch in _bus_frames(group):
                    decoder.add(batch)
                decoded = decoder.recording()
                frames += decoded.frames
                notes += decoded.notes
                losses += decoded.losses
            else:
                frames.append(_frame(group, path.name, profile))
    if not frames:
        raise LogReadError(f"{path}: holds no sample")
    return Recording(tuple(frames), tuple(losses), tuple(notes))


class _Slice(NamedTuple):
    """Some records: their times, and of each channel the values and which of them are invalid."""

    time: Stamps
    values: list[NDArray]
    invalid: list[NDArray[np.bool_] | None]


class _Group:
    """One channel group of an open file."""

    def __init__(self, file: Any, index: int, epoch: int, path: Path) -> None:
        group = file.groups[index]
        self._file, self._index, self._epoch, self._path = file, index, epoch, path
        self.title = str(group.channel_group.acq_name or "")
        self.size = int(group.channel_group.cycles_nr)
        self.record = int(group.channel_group.samples_byte_nr)
        self.names: list[str] = [channel.name for channel in group.channels]
        # of channels of one name the last counts
        self.places = {
            c.name: k for k, c in enumerate(group.channels) if c.channel_type not in MASTERS
        }
        self.units: dict[str, str] = {c.name: c.unit or "" for c in group.channels}

    def slices(self, wanted: Sequence[str], raw: bool = False) -> Iterator[_Slice]:
        """Records of some channels in slices of SLICE bytes. Raises LogReadError."""
        channels = [(None, self._index, self.places[name]) for name in wanted]
        step = max(1, SLICE // max(1, self.record))
        for start in range(0, self.size, step):
            count = min(step, self.size - start)
            with guarded(self._path, "MDF"):
                signals = self._file.select(
                    channels,
                    record_offset=start,
                    record_count=count,
                    raw=raw,
                    copy_master=False,
                    ignore_value2text_conversions=True,
                )
                time = np.rint(signals[0].timestamps * 1e9).astype(np.int64) + self._epoch
            yield _Slice(time, [s.samples for s in signals], [s.invalidation_bits for s in signals])


@contextmanager
def _opened(path: Path) -> Iterator[list[_Group]]:
    """The channel groups. Raises LogReadError, MissingExtraError."""
    try:
        from asammdf import MDF
    except ImportError:
        raise MissingExtraError("an MDF file", "mdf") from None
    with path.open("rb") as source, tempfile.TemporaryFile() as copy:
        opened: IO[bytes] = source
        if source.read(8) == UNFINISHED:  # its counters are put right in a copy
            source.seek(0)
            shutil.copyfileobj(source, copy)
            opened = copy
        with guarded(path, "MDF"):
            # of a path asammdf reads whole columns, of an open file the records that are asked for
            file = MDF(opened, process_bus_logging=False)
            epoch = int(file.start_time.timestamp() * 1e6) * 1000
            groups = [_Group(file, index, epoch, path) for index in range(len(file.groups))]
        with file:
            yield groups


def _frame(group: _Group, file: str, profile: Profile) -> Frame:
    """One channel group; of channels that the profile does not read only the names."""
    wanted = [name for name in group.places if profile.reads(name, group.title)]
    if not wanted:
        return unread(group.title, file, group.places)
    time = Spool(np.int64)
    spools: dict[str, Spool] = {name: Spool(np.float64) for name in wanted}
    texts: dict[str, str] = {}
    for part in group.slices(wanted):
        time.append(part.time)
        for name, values, invalid in zip(wanted, part.values, part.invalid, strict=True):
            if values.dtype.kind not in "bifu" or values.ndim != 1:
                texts[name] = str(values[0])
            else:
                spools[name].append(
                    values if invalid is None else np.where(invalid, np.nan, values)
                )
    stamps = time.column()
    columns: dict[str, NDArray] = {name: absent(len(stamps)) for name in group.places}
    for name in wanted:
        text = np.array(texts.get(name), object)
        columns[name] = (
            np.broadcast_to(text, len(stamps)) if name in texts else spools[name].column()
        )
    return Frame(group.title, file, stamps, columns, group.units)


def _bus_frames(group: _Group) -> Iterator[can.CanFrames]:
    names = [f"{BUS}.{name}" for name in ("ID", "IDE", "DataBytes", "DataLength")]
    for time, (identifier, extended, data, length), _ in group.slices(names, raw=True):
        marked = identifier.astype(np.uint32)
        marked = np.where(extended.astype(bool), marked | np.uint32(can.EXTENDED), marked)
        yield can.CanFrames(time, marked, np.atleast_2d(data), length.astype(np.uint8))
