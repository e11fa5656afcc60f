"""Raw CAN frames to signals: DBC files (cantools), and the standard answers of OBD-II.

Decoding works on whole columns, not frame by frame: bits are picked from the payload matrix of all
frames of one message at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError, near
from roadlog.ingest import obd
from roadlog.ingest.frame import Frame, Recording
from roadlog.types import Bools, Floats, Stamps

EXTENDED = 1 << 31  # marks a 29-bit identifier, as in a DBC file
OBD_ANSWERS = range(0x7E8, 0x7F0)  # ISO 15765-4: 11-bit answers of up to eight ECUs


@dataclass(frozen=True)
class CanFrames:
    """Data frames of a trace: time [ns], identifier (bit 31: extended), payload (n x bytes)."""

    time: Stamps
    identifier: NDArray[np.uint32]
    data: NDArray[np.uint8]
    length: NDArray[np.uint8]


def load(paths: Sequence[Path]) -> list[Any]:
    """Messages of DBC (or ARXML, KCD, SYM) files. Raises LogReadError, MissingExtraError."""
    if not paths:
        return []
    try:
        import cantools
    except ImportError:
        raise MissingExtraError("a DBC file", "can") from None
    messages = []
    for path in paths:
        if not path.is_file():
            siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
            raise LogReadError(f"{path}: no such DBC file. {near(path.name, siblings)}")
        try:
            database: Any = cantools.database.load_file(path, strict=False)
        except Exception as error:  # cantools and its parsers raise a dozen unrelated types
            raise LogReadError(f"{path}: is no DBC file that can be read: {error}") from error
        messages += database.messages
    return messages


def names(messages: Sequence[Any]) -> set[str]:
    """Every name that decoding may give: `MESSAGE.SIGNAL`, `SIGNAL`, and those of OBD-II."""
    found = {f"{obd.FRAME}.{parameter.name}" for parameter in obd.PARAMETERS.values()}
    for message in messages:
        for signal in message.signals:
            found |= {signal.name, f"{message.name}.{signal.name}"}
    return found


def decode(frames: CanFrames, messages: Sequence[Any], file: str) -> Recording:
    """Frames of every known message, standard OBD-II answers among them; a note on coverage.

    Raises LogReadError when nothing of the trace could be decoded.
    """
    known = {m.frame_id | (EXTENDED if m.is_extended_frame else 0): m for m in messages}
    found: list[Frame] = []
    losses: list[str] = []
    unknown: list[str] = []
    seen, counts = np.unique(frames.identifier, return_counts=True)
    for identifier, count in zip(seen.tolist(), counts.tolist(), strict=True):
        rows = frames.identifier == identifier
        if identifier in known:
            message = known[identifier]
            whole = rows & (frames.length >= message.length)
            if whole.sum() < count:
                losses.append(f"{file}: {message.name}: {count - whole.sum()} frames cut short")
            found.append(_message(message, frames.time[whole], frames.data[whole], file))
        elif identifier in OBD_ANSWERS:
            found += obd.answers(frames.time[rows], frames.data[rows], file)
        else:
            unknown.append(f"0x{identifier & ~EXTENDED:X}")
    if not found:
        shown = ", ".join(unknown[:8])
        what = "the DBC knows none of its identifiers" if messages else "raw CAN needs --dbc FILE"
        raise LogReadError(f"{file}: nothing decoded: {what} (seen: {shown or 'no frame'})")
    note = f"{file}: CAN: {len(seen)} identifiers, {len(seen) - len(unknown)} decoded"
    if unknown:
        note += f", unknown: {', '.join(unknown)}"
    return Recording(tuple(found), tuple(losses), (note,))


def _message(message: Any, time: Stamps, data: NDArray[np.uint8], file: str) -> Frame:
    data = np.ascontiguousarray(data[:, : message.length])
    raws = {signal.name: raw_values(signal, data) for signal in message.signals}
    columns: dict[str, NDArray] = {}
    for signal in message.signals:
        raw = raws[signal.name]
        values: Floats = raw.astype(np.float64) * signal.scale + signal.offset
        if signal.multiplexer_ids is not None:
            values[~_selected(raws[signal.multiplexer_signal], signal.multiplexer_ids)] = np.nan
        columns[signal.name] = values
    units = {signal.name: signal.unit or "" for signal in message.signals}
    return Frame(message.name, file, time, columns, units)


def _selected(multiplexer: NDArray, identifiers: Sequence[int]) -> Bools:
    return np.isin(multiplexer.astype(np.int64), list(identifiers))


def raw_values(signal: Any, data: NDArray[np.uint8]) -> NDArray:
    """Raw values of one signal of all rows: int64, uint64 or float."""
    little = signal.byte_order == "little_endian"
    bits = np.unpackbits(data, axis=1, bitorder="little" if little else "big")
    # a Motorola start bit counts bits within its byte from the right, the bit row from the left
    start = signal.start if little else signal.start // 8 * 8 + 7 - signal.start % 8
    picked = bits[:, start : start + signal.length]
    if little:
        picked = picked[:, ::-1]
    value = np.zeros(len(data), np.uint64)
    for column in picked.T:
        value = (value << np.uint64(1)) | column
    if signal.is_float:
        kinds = {
            16: (np.uint16, np.float16),
            32: (np.uint32, np.float32),
            64: (np.uint64, np.float64),
        }
        integer, real = kinds[signal.length]
        return value.astype(integer).view(real)
    if not signal.is_signed:
        return value
    spare = np.int64(64 - signal.length)
    return (value << spare.astype(np.uint64)).view(np.int64) >> spare
