"""CAN traces: BLF and SQLite (python-can) and text of every dialect, decoded with databases."""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats import can, times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.can_database import bus_name
from roadlog.ingest.formats.can_text import DIALECTS, UNSTAMPED, Line, Trace
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.spool import ROWS

PAYLOAD = 64  # bytes, CAN FD
HEAD = 4096  # bytes looked at
BLF = b"LOGG"
SQLITE = b"SQLite format 3\0"
TABLE = b"arbitration_id"  # a column of python-can's table, in the text that made it


def recognizes(path: Path) -> bool:
    """Whether the file begins as one of the trace formats does."""
    if not path.is_file():
        return False
    head = _head(path)
    return bool(
        head.startswith(BLF)
        or (head.startswith(SQLITE) and TABLE in head)
        or UNSTAMPED.match(head)
        or _dialect(head)
    )


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(HEAD).removeprefix(b"\xef\xbb\xbf")


def _dialect(head: bytes) -> Callable[[Trace], Iterator[Line]] | None:
    return next((d for mark, d in DIALECTS.items() if re.search(mark, head, re.M | re.I)), None)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """What the databases know; the trace itself has no names."""
    del path
    return can.names(can.load(dbc))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Decoded messages. A trace that ends in the middle gives what comes before, and a loss.

    Raises LogReadError, MissingExtraError.
    """
    try:
        import can as python_can
    except ImportError:
        raise MissingExtraError("a CAN trace", "can") from None
    head = _head(path)
    if UNSTAMPED.match(head):
        raise LogReadError(f"{path}: frames without stamps: record with `candump -L` or -t a")
    trace = Trace(path, profile.clock.zone)
    losses: list[str] = []
    dialect = _dialect(head)
    lines = dialect(trace) if dialect else _binary(python_can, path, losses, profile.clock.zone)
    known = can.load(dbc)
    decoder: can.Decoder | None = None
    for frames in _batches(lines, path, losses):
        decoder = decoder or can.Decoder(known, path.name, profile, trace.loose)
        decoder.add(frames)
    assert decoder is not None  # there is a last batch
    decoded = decoder.recording()
    if trace.bad:
        losses.append(f"{path.name}: {trace.bad} lines are no frames that are understood")
    return Recording(decoded.frames, (*losses, *decoded.losses), (*trace.notes, *decoded.notes))


def _binary(python_can: Any, path: Path, losses: list[str], zone: str) -> Iterator[Line]:
    """Data frames of a BLF or SQLite log."""
    blf = _head(path).startswith(BLF)
    with (python_can.BLFReader if blf else python_can.SqliteReader)(path) as reader:
        promised = getattr(reader, "file_size", 0)  # BLF: what its header says
        if promised > path.stat().st_size:
            share = path.stat().st_size / promised
            losses.append(f"{path.name}: cut short: {share:.0%} of the file is there")
        shift: int | None = None if zone and blf else 0
        for frame in reader:
            if frame.is_error_frame or frame.is_remote_frame:
                continue
            stamp = round(frame.timestamp * 1e9)
            if shift is None:
                shift, _ = times.local(stamp, zone, path.name)
            mark = can.EXTENDED if frame.is_extended_id else 0
            yield stamp - shift, _bus(frame, blf), frame.arbitration_id | mark, bytes(frame.data)


def _bus(frame: Any, blf: bool) -> str:
    """BLF counts channels from 1, python-can from 0; its SQLite keeps none."""
    return bus_name(frame.channel + 1) if blf else ""


def _batches(lines: Iterator[Line], path: Path, losses: list[str]) -> Iterator[can.CanFrames]:
    """Frames in batches of ROWS. Raises LogReadError when there is none."""
    batch = _Batch()
    count = 0
    broken: list[str] = []
    with guarded(path, "a CAN trace", broken):
        for line in lines:
            batch.add(line)
            count += 1
            if len(batch) == ROWS:
                yield batch.frames()
                batch = _Batch()
    if broken and not count:
        raise LogReadError(broken[0])
    losses += [f"{sentence}; the {count} frames before are kept" for sentence in broken]
    yield batch.frames()


class _Batch:
    """Frames as they come."""

    def __init__(self) -> None:
        self.time, self.identifier, self.length = array("q"), array("L"), array("B")
        self.payload = bytearray()
        self.bus = array("B")
        self.buses: dict[str, int] = {}

    def __len__(self) -> int:
        return len(self.length)

    def add(self, line: Line) -> None:
        """One data frame."""
        time, bus, identifier, data = line
        if len(data) > PAYLOAD:
            raise ValueError(f"a frame of {len(data)} bytes")
        if not abs(time) < times.LAST_STAMP:
            raise ValueError(f"a stamp of {time} ns")
        self.time.append(time)
        self.bus.append(self.buses.setdefault(bus, len(self.buses)))
        self.identifier.append(identifier)
        self.payload += data.ljust(PAYLOAD, b"\0")
        self.length.append(len(data))

    def frames(self) -> can.CanFrames:
        """As columns."""
        n = len(self)  # a frame that was refused may have left its time
        return can.CanFrames(
            np.array(self.time[:n], np.int64),
            np.array(self.identifier[:n], np.uint32),
            np.frombuffer(bytes(self.payload[: n * PAYLOAD]), np.uint8).reshape(-1, PAYLOAD),
            np.array(self.length, np.uint8),
            np.array(self.bus[:n], np.uint8),
            tuple(self.buses) or ("",),
        )


FORMAT = Format(
    name="can_trace",
    about="CAN traces",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="can",
)
