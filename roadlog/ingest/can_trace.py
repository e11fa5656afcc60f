"""CAN traces: BLF, ASC, TRC and candump logs (python-can), decoded with DBC files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest import can
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

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
    messages = can.load(dbc)
    name = _reader(path)
    assert name is not None  # `recognizes` was asked
    times: list[int] = []
    identifiers: list[int] = []
    lengths: list[int] = []
    payload = bytearray()
    losses: list[str] = []
    try:
        # ASC: stamps with the date of its header, in the machine's zone as the format has it
        options = {"relative_timestamp": False} if name == "ASCReader" else {}
        with getattr(python_can, name)(path, **options) as reader:
            promised = getattr(reader, "file_size", 0)  # BLF: what its header says
            if promised > path.stat().st_size:
                share = path.stat().st_size / promised
                losses.append(f"{path.name}: cut short: {share:.0%} of the file is there")
            for frame in reader:
                if frame.is_error_frame or frame.is_remote_frame:
                    continue
                times.append(round(frame.timestamp * 1e9))
                identifiers.append(
                    frame.arbitration_id | (can.EXTENDED if frame.is_extended_id else 0)
                )
                lengths.append(len(frame.data))
                payload += bytes(frame.data).ljust(PAYLOAD, b"\0")
    except Exception as error:  # each reader raises its own types for a cut-off file
        if not times:
            raise LogReadError(f"{path}: cannot be read as a CAN trace: {error}") from error
        losses.append(f"{path.name}: unreadable after {len(times)} frames: {error}")
    frames = can.CanFrames(
        np.array(times, np.int64),
        np.array(identifiers, np.uint32),
        np.frombuffer(bytes(payload), np.uint8).reshape(-1, PAYLOAD),
        np.array(lengths, np.uint8),
    )
    decoded = can.decode(frames, messages, path.name, profile)
    return Recording(decoded.frames, (*losses, *decoded.losses), decoded.notes)
