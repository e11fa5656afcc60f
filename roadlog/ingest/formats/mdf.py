"""MDF 4 (and 3) measurement files: channel groups, and raw CAN frames decoded with a DBC."""

from __future__ import annotations

import shutil
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError, MissingExtraError, RoadlogError
from roadlog.ingest.formats import can, mdf_attached, mdf_blocks, times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.can_database import bus_name
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Frame, Recording, absent, unread
from roadlog.ingest.profile import Profile
from roadlog.spool import Spool
from roadlog.types import Floats, Stamps

MAGIC = b"MDF     "
UNFINISHED = b"UnFinMF "  # the logger was switched off before it closed the file
BUS = "CAN_DataFrame"  # ASAM MDF bus logging: raw frames
OTHER_FRAMES = ("CAN_RemoteFrame", "CAN_ErrorFrame", "CAN_OverloadFrame", "LIN_Frame", "FLX_Frame")
SHORT_IDENTIFIER = 0x7FF
SECONDS = 1  # what a master counts (MDF 4: cn_sync_type)
MASTERS = {2: "an angle", 3: "a distance", 4: "an index"}
REMOTE_MASTER = 1 << 3  # flag of a channel group: another one holds its master
LOCAL_TIME = 1  # flag of the header: no zone is known
TEXTS_4, TEXTS_3 = (7, 8), (11, 12)  # conversions of values and ranges to text, by version
FEW = 99  # values that asammdf converts one by one
SLICE = 1 << 25  # bytes of records read at a time


def recognizes(path: Path) -> bool:
    """Whether the file begins as an MDF file does."""
    return begins(path, MAGIC, UNFINISHED)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Names of the channels, and of what the bus may hold where frames were logged."""
    with _opened(path) as opened:
        found: set[str] = set()
        for group in opened.groups:
            if BUS in group.names:
                found |= can.names(opened.known(dbc)[0])
            else:
                titles = (group.title, *group.also)
                found |= {*group.names, *(f"{t}.{name}" for t in titles for name in group.names)}
        return found


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Channel groups that the profile reads, and decoded bus frames.

    A group that cannot be read is a loss, or a note where the profile asks nothing of it. Raises
    LogReadError where nothing can be, MissingExtraError.
    """
    frames: list[Frame] = []
    notes: list[str] = []
    losses: list[str] = []
    refused: list[RoadlogError] = []
    heard = 0
    with _opened(path, profile.clock.zone) as opened:
        known, said = opened.known(dbc)
        decoder = can.Decoder(known, path.name, profile)
        notes += opened.notes + said
        for k, group in enumerate(g for g in opened.groups if g.promised):
            bus = BUS in group.names
            wanted = bus or group.reads(profile)
            try:
                if group.size < group.promised:
                    what = f"{group.size} of {group.promised} records are there"
                    losses.append(f"{path.name}: {group.label}: cut short: {what}")
                if bus:
                    for batch in _bus_frames(group):
                        decoder.add(batch, k)
                        heard += len(batch.time)
                elif any(name.split(".")[0] in OTHER_FRAMES for name in group.names):
                    notes.append(f"{path.name}: {group.label}: {group.size} records, not decoded")
                elif group.size:
                    frames.append(frame := _frame(group, path.name, profile))
                    if wanted and (lost := group.size - len(frame)):
                        losses.append(f"{path.name}: {group.label}: {lost} rows without a time")
                if wanted and group.counted != "s":
                    notes.append(f"{path.name}: {group.label}: its master counts {group.counted}")
            except RoadlogError as error:
                refused.append(error)
                (losses if wanted else notes).append(str(error).replace(str(path), path.name))
    if heard:
        try:
            decoded = decoder.recording()
        except LogReadError as error:
            refused.append(LogReadError("; ".join([str(error), *said])))
            notes.append(str(error))
        else:
            frames += decoded.frames
            notes += decoded.notes
            losses += decoded.losses
    if not frames:
        raise refused[0] if refused else LogReadError(f"{path}: holds no sample")
    return Recording(tuple(frames), tuple(losses), tuple(notes))


class _Slice(NamedTuple):
    """Some records: their times, and the values of each channel, NaN where it has none."""

    time: Stamps
    values: list[NDArray]


class _Group:
    """One channel group of an open file."""

    def __init__(self, file: Any, index: int, path: Path) -> None:
        group = file.groups[index]
        self._file, self._index, self._path = file, index, path
        self.epoch = 0  # ns
        self._new = file.version >= "4"
        head = group.channel_group
        self.title = str(getattr(head, "acq_name", "") or "")  # not in version 3
        self.also: frozenset[str] = frozenset()  # its title, where others have the same
        self.label = f"group {self.title or index}"
        self.record = int(head.samples_byte_nr)
        held = sum(block.original_size for block in group.get_data_blocks())
        beside = (
            0 if getattr(group, "uses_ld", False) else getattr(head, "invalidation_bytes_nr", 0)
        )
        self.promised = int(head.cycles_nr)
        self.size = min(self.promised, held // max(1, self.record + int(beside or 0)))
        self.names: list[str] = [channel.name for channel in group.channels]
        # of channels of one name the last counts; the master is the time itself
        master = file.masters_db.get(index)
        self.master = None if master is None else group.channels[master]
        said = file.get_channel_unit(group=index, index=master) if master is not None else ""
        self.counted = times.unit_stated(said or "") or "s"  # by the master: s in the standard
        self.remote = bool(self._new and head.flags & REMOTE_MASTER)
        self.places = {name: k for k, name in enumerate(self.names) if k != master}

    def reads(self, profile: Profile) -> list[str]:
        """Channels that a profile reads."""
        return [n for n in self.places if profile.reads(n, self.title, *self.also)]

    def clock(self, column: str = "") -> str:
        """The channel that is the time, empty for a master that is one. Raises LogReadError."""
        kind = getattr(self.master, "sync_type", SECONDS) if self.master is not None else None
        if self.remote or (kind in (SECONDS, 0) and not column):
            return ""
        try:
            return times.time_column(list(self.places), column, self.label)
        except ConfigError:
            if kind in (SECONDS, 0):
                return ""
        name = f"'{self.master.name}'" if self.master is not None else ""
        what = (
            f"its master {name} is {MASTERS.get(kind or 0, 'no time')}"
            if name
            else "it has no master"
        )
        raise LogReadError(
            f"{self._path}: {self.label}: {what}, and no channel of it is a time: left out"
        )

    def unit(self, name: str) -> str:
        """As the file states it. Raises LogReadError."""
        with guarded(self._path, "MDF"):
            return self._file.get_channel_unit(group=self._index, index=self.places[name]) or ""

    def slices(self, wanted: Sequence[str], clock: str = "", unit: str = "") -> Iterator[_Slice]:
        """Records of some channels in slices of SLICE bytes, physical values.

        clock, unit: the channel that is the time, where the master is none. Raises LogReadError.
        """
        if lacking := [name for name in wanted if name not in self.places]:
            raise LogReadError(f"{self._path}: a channel group has no {', '.join(lacking)}")
        read = [*wanted, clock] if clock else list(wanted)
        channels = [(None, self._index, self.places[name]) for name in read]
        step = max(1, SLICE // max(1, self.record))
        for start in range(0, self.size, step):
            count = min(step, self.size - start)
            with guarded(self._path, "MDF"):
                signals = self._file.select(
                    channels, record_offset=start, record_count=count, raw=True, copy_master=False
                )
                values = [self._physical(signal) for signal in signals]
                if clock:
                    stamps = values.pop()
                    unit = unit or times.unit_of(stamps, f"{self._path}: {clock}")
                    time, keep = times.from_numbers(stamps, unit)
                else:
                    stamps = np.asarray(signals[0].timestamps)
                    time, keep = times.from_numbers(stamps, self.counted)
                found = _Slice(time + self.epoch, [column[keep] for column in values])
            yield found

    def _physical(self, signal: Any) -> NDArray:
        """Converted values; NaN where they are marked invalid or a text says that there is none."""
        raw, rule = signal.samples, signal.conversion
        values = raw
        if rule is not None and raw.dtype.names is None and raw.dtype.kind in "buif":
            texts = TEXTS_4 if self._new else TEXTS_3
            values = (
                _through_texts(rule, raw) if rule.conversion_type in texts else rule.convert(raw)
            )
        if signal.invalidation_bits is None or values.dtype.kind not in "buif":
            return np.asarray(values)
        return np.where(np.asarray(signal.invalidation_bits, np.bool_), np.nan, values)


def _through_texts(rule: Any, raw: NDArray) -> Floats:
    """Values through a conversion that gives texts, or texts and numbers.

    A state keeps its number; a text among numbers, or one that says so, is no value.
    """
    unique, places = np.unique(raw, return_inverse=True)
    numbers = any(
        block is not None and not isinstance(block, bytes)
        for block in (getattr(rule, "referenced_blocks", None) or {}).values()
    )
    result = unique.astype(np.float64)
    for start in range(0, len(unique), FEW):  # of more it takes the limits of ranges for integers
        rows = slice(start, start + FEW)
        for k, said in enumerate(rule.convert(unique[rows], as_object=True).tolist(), start):
            if not isinstance(said, bytes | str):
                result[k] = said
            elif numbers or can.no_value(
                said.decode("utf-8", "replace") if isinstance(said, bytes) else said
            ):
                result[k] = np.nan
    return result[places.reshape(raw.shape)]


class _Opened(NamedTuple):
    """The groups of a file, and what is to be said of its clock."""

    file: Any
    path: Path
    groups: list[_Group]
    notes: list[str]

    def known(self, dbc: Sequence[Path]) -> tuple[list[can.Known], list[str]]:
        """The messages of the bus, by databases or else by those in the file, and which these are.

        Raises LogReadError, MissingExtraError.
        """
        if dbc or not any(BUS in group.names for group in self.groups):
            return can.load(dbc), []
        return mdf_attached.databases(self.file, self.path)


@contextmanager
def _opened(path: Path, zone: str = "") -> Iterator[_Opened]:
    """The channel groups. Raises LogReadError, MissingExtraError."""
    try:
        from asammdf import MDF
    except ImportError:
        raise MissingExtraError("an MDF file", "mdf") from None
    with path.open("rb") as source, tempfile.TemporaryFile() as copy:
        opened: IO[bytes] = source
        unfinished = source.read(8) == UNFINISHED
        cut = mdf_blocks.cut(source)
        if unfinished or cut:  # its counters, its last block's length are put right in a copy
            source.seek(0)
            shutil.copyfileobj(source, copy)
            mdf_blocks.shorten(copy, cut)
            opened = copy
        mdf_blocks.no_loops(path, opened)
        with guarded(path, "MDF"):
            # of a path asammdf reads whole columns, of an open file the records that are asked for
            file = MDF(opened, process_bus_logging=False)
            epoch, local = _epoch(file)
            groups = [_Group(file, index, path) for index in range(len(file.groups))]
        shift, note = times.local(epoch, zone, path.name) if local else (0, "")
        for group in groups:
            group.epoch = epoch - shift
        _told_apart(groups)
        with file:
            yield _Opened(file, path, groups, [note] if note else [])


def _told_apart(groups: list[_Group]) -> None:
    """Number groups of one title that share a channel, as a second raster of a logger does."""
    seen = Counter((group.title, name) for group in groups for name in group.places)
    for k, group in enumerate(groups):
        if BUS not in group.names and any(seen[group.title, name] > 1 for name in group.places):
            group.also = frozenset({group.title} - {""})
            group.title = f"{group.title}[{k}]" if group.title else f"group {k}"


def _epoch(file: Any) -> tuple[int, bool]:
    """Start of the measurement in ns, and whether it is in a local time of unknown zone."""
    head = file.header
    if file.version >= "4":
        return int(head.abs_time), bool(head.time_flags & LOCAL_TIME)
    stated = int(getattr(head, "abs_time", 0) or 0)
    text = f"{head.date.decode('ascii')} {head.time.decode('ascii')}".strip("\0 ")
    clock = datetime.strptime(text, "%d:%m:%Y %H:%M:%S").replace(tzinfo=UTC)
    local = round(clock.timestamp()) * 10**9
    if not stated:
        return local, True
    # the standard has local time there, others write UTC: the date beside it tells
    hours = int(getattr(head, "tz_offset", 0) or 0)
    if abs(stated - local) < 10**9 * 60:
        return stated - hours * 3600 * 10**9, False
    return stated, False


def _frame(group: _Group, file: str, profile: Profile) -> Frame:
    """One channel group; of channels that the profile does not read only the names."""
    wanted = group.reads(profile)
    if not wanted:
        return replace(unread(group.title, file, group.places), also=group.also)
    clock = group.clock(profile.clock.column if profile.clock.column in group.places else "")
    unit = times.unit_stated(profile.clock.unit, group.unit(clock)) if clock else ""
    wanted = [name for name in wanted if name != clock]
    time = Spool(np.int64)
    spools: dict[str, Spool] = {name: Spool(np.float64) for name in wanted}
    texts: dict[str, str] = {}
    for part in group.slices(wanted, clock, unit):
        time.append(part.time)
        for name, values in zip(wanted, part.values, strict=True):
            if values.dtype.kind not in "bifu" or values.ndim != 1:
                texts[name] = str(values[0])
            else:
                spools[name].append(values)
    stamps = time.column()
    columns: dict[str, NDArray] = {n: absent(len(stamps)) for n in group.places if n != clock}
    for name in wanted:
        text = np.array(texts.get(name), object)
        columns[name] = (
            np.broadcast_to(text, len(stamps)) if name in texts else spools[name].column()
        )
    units = {name: group.unit(name) for name in wanted}
    return Frame(group.title, file, stamps, columns, units, also=group.also)


def _bus_frames(group: _Group) -> Iterator[can.CanFrames]:
    """Raw frames of a bus logging group: whatever is not stored may be said by a conversion."""
    there = [n for n in ("IDE", "BusChannel", "DataLength", "DLC") if f"{BUS}.{n}" in group.places]
    names = [f"{BUS}.{name}" for name in ("ID", "DataBytes", *there)]
    for time, (identifier, data, *fields) in group.slices(names):
        field = dict(zip(there, fields, strict=True))
        data = np.atleast_2d(data)
        marked = np.asarray(identifier).astype(np.int64)
        extended = (marked & can.EXTENDED > 0) | (marked > SHORT_IDENTIFIER)
        if "IDE" in field:
            extended |= field["IDE"].astype(np.bool_)
        marked = marked & ~can.EXTENDED | np.where(extended, can.EXTENDED, 0)
        if "DataLength" in field:
            length = field["DataLength"].astype(np.int64)
        else:
            length = (
                can.LENGTHS[np.clip(field["DLC"].astype(np.int64), 0, 15)]
                if "DLC" in field
                else np.full(len(time), data.shape[1])
            )
        channel = (
            field["BusChannel"].astype(np.int64)
            if "BusChannel" in field
            else np.zeros(len(time), np.int64)
        )
        numbers, bus = np.unique(channel, return_inverse=True)
        buses = [bus_name(n) if "BusChannel" in field else "" for n in numbers.tolist()]
        yield can.CanFrames(
            time,
            marked.astype(np.uint32),
            data,
            np.minimum(length, data.shape[1]).astype(np.uint8),
            bus.astype(np.uint8),
            buses,
        )


FORMAT = Format(
    name="mdf",
    about="MDF files",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="mdf",
)
