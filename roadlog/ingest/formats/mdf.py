"""MDF 4 (and 3) measurement files: channel groups, and raw CAN frames decoded with a DBC."""

from __future__ import annotations

import os
import shutil
import struct
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats import can, times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Frame, Recording, absent, unread
from roadlog.ingest.profile import Profile
from roadlog.spool import Spool
from roadlog.types import Stamps

MAGIC = b"MDF     "
UNFINISHED = b"UnFinMF "  # the logger was switched off before it closed the file
BUS = "CAN_DataFrame"  # ASAM MDF bus logging: raw frames
SLICE = 1 << 25  # bytes of records read at a time
LINKS = 3  # of a block that are looked at
CHAINED = (b"DG", b"CG", b"CN", b"FH", b"CH", b"AT", b"EV", b"HL", b"DL", b"LD")
PARENTS = (b"DG", b"CG", b"CN")


def recognizes(path: Path) -> bool:
    """Whether the file begins as an MDF file does."""
    return begins(path, MAGIC, UNFINISHED)


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
        self.title = str(getattr(group.channel_group, "acq_name", "") or "")  # not in version 3
        self.record = int(group.channel_group.samples_byte_nr)
        held = sum(block.original_size for block in group.get_data_blocks())
        # what is promised, as far as it is there
        self.size = min(int(group.channel_group.cycles_nr), held // max(1, self.record))
        self.names: list[str] = [channel.name for channel in group.channels]
        # of channels of one name the last counts; the master is the time itself
        master = file.masters_db.get(index)
        self.places = {name: k for k, name in enumerate(self.names) if k != master}

    def units(self, wanted: Sequence[str]) -> dict[str, str]:
        """As the file states them. Raises LogReadError."""
        with guarded(self._path, "MDF"):
            return {
                name: self._file.get_channel_unit(group=self._index, index=self.places[name]) or ""
                for name in wanted
            }

    def slices(self, wanted: Sequence[str], raw: bool = False) -> Iterator[_Slice]:
        """Records of some channels in slices of SLICE bytes. Raises LogReadError."""
        if lacking := [name for name in wanted if name not in self.places]:
            raise LogReadError(f"{self._path}: a channel group has no {', '.join(lacking)}")
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
                time, keep = times.from_numbers(np.asarray(signals[0].timestamps), "s")
                found = _Slice(
                    time + self._epoch,
                    [s.samples[keep] for s in signals],
                    [
                        None if (bits := s.invalidation_bits) is None else bits[keep]
                        for s in signals
                    ],
                )
            yield found


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
        _no_loops(path, opened)
        with guarded(path, "MDF"):
            # of a path asammdf reads whole columns, of an open file the records that are asked for
            file = MDF(opened, process_bus_logging=False)
            epoch = int(file.start_time.timestamp() * 1e6) * 1000
            groups = [_Group(file, index, epoch, path) for index in range(len(file.groups))]
        with file:
            yield groups


def _no_loops(path: Path, file: IO[bytes]) -> None:
    """Refuse blocks that refer back to themselves: asammdf would follow them for ever.

    In versions 3 and 4 alike, a block's first link is the next one of its kind, and its second
    the first one of the kind below. Raises LogReadError.
    """
    file.seek(0)
    new = int.from_bytes(file.read(30)[28:], "little") >= 400
    head = struct.Struct("<2s2sIQQ" if new else "<2sH")
    word = struct.Struct("<Q" if new else "<I")

    size = file.seek(0, os.SEEK_END)

    def block(address: int) -> tuple[bytes, list[int]]:
        file.seek(min(address, size))  # a broken link may lie beyond what a file can be
        start = file.read(head.size)
        if len(start) < head.size:
            return b"", []
        kind = start[2:4] if new else start[:2]
        links = file.read(LINKS * word.size)
        return kind, [
            link for (link,) in word.iter_unpack(links[: len(links) // word.size * word.size])
        ]

    _, starts = block(64)
    seen: set[int] = set()
    below = starts if new else starts[:1]
    while below:
        address = below.pop()
        while address:
            kind, links = block(address)
            if kind not in CHAINED or len(links) < LINKS:
                break
            if address in seen:
                raise LogReadError(f"{path}: cannot be read as MDF: its blocks go in a circle")
            seen.add(address)
            below += links[1:3] if kind in PARENTS else []
            address = links[0]


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
    return Frame(group.title, file, stamps, columns, group.units(wanted))


def _bus_frames(group: _Group) -> Iterator[can.CanFrames]:
    names = [f"{BUS}.{name}" for name in ("ID", "IDE", "DataBytes", "DataLength")]
    for time, (identifier, extended, data, length), _ in group.slices(names, raw=True):
        marked = identifier.astype(np.uint32)
        marked = np.where(extended.astype(bool), marked | np.uint32(can.EXTENDED), marked)
        yield can.CanFrames(time, marked, np.atleast_2d(data), length.astype(np.uint8))


FORMAT = Format(
    name="mdf",
    about="MDF files",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="mdf",
)
