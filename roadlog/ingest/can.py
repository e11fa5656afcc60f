"""Raw CAN frames to signals: DBC files (cantools), and the standard answers of OBD-II.

Decoding works on whole columns, not frame by frame: bits are picked from the payload matrix of all
frames of one message at once.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError, near
from roadlog.ingest import obd
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.types import Bools, Floats, Stamps

EXTENDED = 1 << 31  # marks a 29-bit identifier, as in a DBC file
SHOWN = 8  # identifiers in a message
LONG = 4  # bits; a shorter field of ones is a state rather than "not available" (SAE J1939-71)
_NO_VALUE = re.compile(r"\b(sna|not.?available|unavailable|invalid|no.?data)\b|^error", re.I)
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


def decode(
    frames: CanFrames, messages: Sequence[Any], file: str, profile: Profile | None = None
) -> Recording:
    """Frames of every known message, standard OBD-II answers among them; notes on coverage.

    profile: only what it reads is kept, of other signals the names. Raises LogReadError when
    nothing of the trace could be decoded.
    """
    known = {m.frame_id | (EXTENDED if m.is_extended_frame else 0): m for m in messages}
    found: list[Frame] = []
    losses: list[str] = []
    unknown: list[str] = []
    never: list[str] = []
    paged: list[str] = []
    seen, counts = np.unique(frames.identifier, return_counts=True)
    for identifier, count in zip(seen.tolist(), counts.tolist(), strict=True):
        rows = frames.identifier == identifier
        if identifier in known:
            message = known[identifier]
            whole = rows & (frames.length >= message.length)
            if whole.sum() < count:
                losses.append(f"{file}: {message.name}: {count - whole.sum()} frames cut short")
            if not whole.any():
                continue
            frame, idle = _message(message, frames.time[whole], frames.data[whole], file, profile)
            found.append(frame)
            never += idle
            paged += [message.name] if message.is_multiplexed() else []
        elif identifier in OBD_ANSWERS and (
            answers := obd.answers(frames.time[rows], frames.data[rows], file)
        ):
            found += answers
        else:
            unknown.append(f"0x{identifier & ~EXTENDED:X} ({count})")
    if not found:
        shown = ", ".join(unknown[:SHOWN]) + (", ..." if len(unknown) > SHOWN else "")
        what = "the DBC knows none of its identifiers" if messages else "raw CAN needs --dbc FILE"
        raise LogReadError(f"{file}: nothing decoded: {what} (seen: {shown or 'no frame'})")
    decoded = ", ".join(dict.fromkeys(frame.name for frame in found))
    notes = [f"{file}: CAN: {len(seen)} identifiers, {len(seen) - len(unknown)} decoded: {decoded}"]
    if unknown:
        notes.append(f"{file}: CAN: unknown identifiers (frames): {', '.join(unknown)}")
    if paged:
        notes.append(f"{file}: CAN: multiplexed: {', '.join(paged)}")
    if never:
        notes.append(f"{file}: CAN: never valid: {', '.join(never)}")
    return Recording(tuple(found), tuple(losses), tuple(notes))


def _message(
    message: Any, time: Stamps, data: NDArray[np.uint8], file: str, profile: Profile | None
) -> tuple[Frame, list[str]]:
    """The columns of one message, and the signals of it that never hold a value."""
    data = np.ascontiguousarray(data[:, : message.length])
    bits = {order: np.unpackbits(data, axis=1, bitorder=order) for order in ("little", "big")}
    columns: dict[str, NDArray] = {}
    never = []
    for signal in message.signals:
        raw = raw_values(signal, bits)
        there = np.ones(len(time), np.bool_)
        if signal.multiplexer_ids is not None:
            switch = message.get_signal_by_name(signal.multiplexer_signal)
            there = _selected(raw_values(switch, bits), signal.multiplexer_ids)
        if why := _idle(signal, raw[there]):
            never.append(f"{message.name}.{signal.name} ({why})")
        if profile is not None and not profile.reads(signal.name, message.name):
            columns[signal.name] = absent(len(time))
            continue
        values: Floats = raw.astype(np.float64) * signal.scale + signal.offset
        values[~there] = np.nan
        columns[signal.name] = values
    units = {signal.name: signal.unit or "" for signal in message.signals}
    return Frame(message.name, file, time, columns, units), never


def _idle(signal: Any, raw: NDArray) -> str:
    """Why a signal never holds a value; empty where it does."""
    if not len(raw):
        return "its page is never sent"
    first = raw[0]
    if (raw != first).any():
        return ""
    if signal.length == 1:
        return "always 0" if first == 0 and signal.name.lower().endswith("valid") else ""
    choice = str((signal.choices or {}).get(int(first), "")) if not signal.is_float else ""
    if _NO_VALUE.search(choice):
        return f"always {choice}"
    whole = not signal.is_float and not signal.is_signed and signal.length >= LONG
    if whole and int(first) == (1 << signal.length) - 1:
        return "all bits set"
    value = float(first) * signal.scale + signal.offset
    low, high = signal.minimum, signal.maximum
    if low is not None and high is not None and low < high and not low <= value <= high:
        return f"always {value:g}, outside {low:g} to {high:g}"
    return ""


def _selected(multiplexer: NDArray, identifiers: Sequence[int]) -> Bools:
    return np.isin(multiplexer.astype(np.int64), list(identifiers))


def raw_values(signal: Any, bits: Mapping[str, NDArray[np.uint8]]) -> NDArray:
    """Raw values of one signal of all rows: int64, uint64 or float.

    bits: of the payload, each byte's from the least ("little") or most significant ("big") one.
    """
    little = signal.byte_order == "little_endian"
    # a Motorola start bit counts bits within its byte from the right, the bit row from the left
    start = signal.start if little else signal.start // 8 * 8 + 7 - signal.start % 8
    picked = bits["little" if little else "big"][:, start : start + signal.length]
    if little:
        picked = picked[:, ::-1]
    value = np.zeros(len(picked), np.uint64)
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
