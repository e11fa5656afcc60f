"""CAN traces: BLF, ASC, TRC and candump logs (python-can), decoded with DBC files."""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats import can
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.spool import ROWS

PAYLOAD = 64  # bytes, CAN FD
HEAD = 4096  # bytes looked at
BLF = b"LOGG"
# what a line of each text format looks like, and of its header
MARKS = {
    "ASCReader": rb"^(base (hex|dec)  ?timestamps|date [A-Z][a-z]{2} .*\n(//.*\n)*base )",
    "TRCReader": rb"^;\$(FILEVERSION|STARTTIME)=",
    "CanutilsLogReader": rb"^\(\d+\.\d+\) +\S+ +[0-9A-Fa-f]{3,8}#",
}


def recognizes(path: Path) -> bool:
    """Whether the file begins as one of the trace formats does."""
    return path.is_file() and _reader(path) is not None


def _reader(path: Path) -> str | None:
    """The reader class of python-can."""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head.startswith(BLF):
        return "BLFReader"
    return next((name for name, mark in MARKS.items() if re.search(mark, head, re.M)), None)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """What the databases know; the trace itself has no names."""
    del path
    return can.names(can.load(dbc))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Decoded messages. A trace that ends in the middle gives what comes before, and a loss."""
    try:
        import can as python_can
    except ImportError:
        raise MissingExtraError("a CAN trace", "can") from None
    decoder = can.Decoder(can.load(dbc), path.name, profile)
    losses: list[str] = []
    for frames in _batches(python_can, path, losses):
        decoder.add(frames)
    decoded = decoder.recording()
    return Recording(decoded.frames, (*losses, *decoded.losses), decoded.notes)


def _batches(python_can: Any, path: Path, losses: list[str]) -> Iterator[can.CanFrames]:
    """Data frames in batches of ROWS. Raises LogReadError when there is none."""
    name = _reader(path)
    assert name is not None  # `recognizes` was asked
    # ASC: stamps with the date of its header, in the machine's zone as the format has it
    options = {"relative_timestamp": False} if name == "ASCReader" else {}
    batch = _Batch()
    count = 0
    broken: list[str] = []
    with guarded(path, "a CAN trace", broken), getattr(python_can, name)(path, **options) as reader:
        promised = getattr(reader, "file_size", 0)  # BLF: what its header says
        if promised > path.stat().st_size:
            share = path.stat().st_size / promised
            losses.append(f"{path.name}: cut short: {share:.0%} of the file is there")
        for frame in reader:
            if frame.is_error_frame or frame.is_remote_frame:
                continue
            batch.add(frame)
            count += 1
            if len(batch) == ROWS:
                yield batch.frames()
                batch = _Batch()
    if broken and not count:
        raise LogReadError(broken[0])
    losses += [f"{sentence}; the {count} frames before are kept" for sentence in broken]
    yield batch.frames()


class _Batch:
    """Frames of python-can as they come."""

    def __init__(self) -> None:
        self.time, self.identifier, self.length = array("q"), array("L"), array("B")
        self.payload = bytearray()

    def __len__(self) -> int:
        return len(self.length)

    def add(self, frame: Any) -> None:
        """One data frame."""
        data = bytes(frame.data)
        if len(data) > PAYLOAD:
            raise ValueError(f"a frame of {len(data)} bytes")
        self.time.append(round(frame.timestamp * 1e9))
        self.identifier.append(frame.arbitration_id | (can.EXTENDED if frame.is_extended_id else 0))
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
        )


FORMAT = Format(
    name="can_trace",
    about="CAN traces",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="can",
)
