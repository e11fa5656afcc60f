"""CAN traces: BLF, ASC, TRC and candump logs (python-can), decoded with DBC files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest import can
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

SUFFIXES = (".blf", ".asc", ".trc", ".log")
PAYLOAD = 64  # bytes, CAN FD


def recognizes(path: Path) -> bool:
    """Whether the suffix is one of a CAN trace; the text ones have no sure mark."""
    return path.is_file() and path.suffix.lower() in SUFFIXES


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Decoded messages. A trace that ends in the middle gives what comes before, and a loss."""
    del profile
    try:
        from can import LogReader
    except ImportError:
        raise MissingExtraError("a CAN trace", "can") from None
    messages = can.load(dbc)
    times: list[int] = []
    identifiers: list[int] = []
    lengths: list[int] = []
    payload = bytearray()
    losses: list[str] = []
    try:
        with LogReader(path) as reader:
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
    decoded = can.decode(frames, messages, path.name)
    return Recording(decoded.frames, (*losses, *decoded.losses), decoded.notes)
