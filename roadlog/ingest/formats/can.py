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
from roadlog.ingest.formats import obd
from roadlog.ingest.formats.parsers import guarded, readable
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.spool import Spool
from roadlog.types import Bools, Floats, Stamps

EXTENDED = 1 << 31  # marks a 29-bit identifier, as in a DBC file
SHOWN = 8  # identifiers in a message
LONGEST = 64  # bits of a number
REALS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}
LONG = 4  # bits; a shorter field of ones is a state rather than "not available" (SAE J1939-71)
FURTHEST = 8 * 65536  # bits; a message of a bus, put together of many frames, is shorter
_BITS = re.compile(rb"(?<=:)\s*(\d{1,30})\s*\|\s*(\d{1,30})\s*(?=@)")  # of a signal: start|length
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
        with readable(path):
            _bounded(path)
        with guarded(path, "a DBC file"):
            database: Any = cantools.database.load_file(path, strict=False)
        messages += database.messages
    return messages


def _bounded(path: Path) -> None:
    """Refuse bits far outside of any message: cantools would take memory for all before them."""
    for match in _BITS.finditer(path.read_bytes()):
        if int(match[1]) > FURTHEST or int(match[2]) > FURTHEST:
            said = match[0].decode("ascii")
            raise LogReadError(f"{path}: cannot be read as a DBC file: a signal at bits {said}")


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
    """`Decoder` of frames that are all there at once."""
    decoder = Decoder(messages, file, profile)
    decoder.add(frames)
    return decoder.recording()


class Decoder:
    """Frames of every known message, standard OBD-II answers among them, batch by batch.

    profile: only what it reads is kept, of other signals the names.
    """

    def __init__(self, messages: Sequence[Any], file: str, profile: Profile | None = None) -> None:
        self.file = file
        self.profile = profile
        self.known = {m.frame_id | (EXTENDED if m.is_extended_frame else 0): m for m in messages}
        self.counts: dict[int, int] = {}
        self.messages: dict[int, _Message] = {}
        self.answers: dict[tuple[int, str], _Answer] = {}

    def add(self, frames: CanFrames) -> None:
        """Decode a batch."""
        order = np.argsort(frames.identifier, kind="stable")
        seen, first = np.unique(frames.identifier[order], return_index=True)
        for identifier, rows in zip(seen.tolist(), np.split(order, first[1:]), strict=False):
            self.counts[identifier] = self.counts.get(identifier, 0) + len(rows)
            if identifier in self.known:
                if identifier not in self.messages:
                    self.messages[identifier] = _Message(self.known[identifier], self.profile)
                message = self.messages[identifier]
                whole = rows[frames.length[rows] >= message.length]
                message.short += len(rows) - len(whole)
                if len(whole):
                    message.add(frames.time[whole], frames.data[whole])
            elif identifier in OBD_ANSWERS:
                for frame in obd.answers(frames.time[rows], frames.data[rows], self.file):
                    key = identifier, next(iter(frame.columns))
                    self.answers.setdefault(key, _Answer(frame.units)).add(frame)

    def recording(self) -> Recording:
        """What was decoded, and notes on coverage. Raises LogReadError when nothing was."""
        file, found = self.file, []
        unknown, losses = [], []
        for identifier, count in sorted(self.counts.items()):
            answers = [a.frame(n, file) for (i, n), a in self.answers.items() if i == identifier]
            if message := self.messages.get(identifier):
                if message.short:
                    losses.append(f"{file}: {message.name}: {message.short} frames cut short")
                found += [message.frame(file)] if len(message.time) else []
            elif answers:
                found += answers
            else:
                unknown.append(f"0x{identifier & ~EXTENDED:X} ({count})")
        if not self.counts:
            raise LogReadError(f"{file}: holds no CAN frame; cut short or empty")
        if not found:
            shown = ", ".join(unknown[:SHOWN]) + (", ..." if len(unknown) > SHOWN else "")
            none = "the DBC knows none of its identifiers"
            what = none if self.known else "raw CAN needs --dbc FILE"
            raise LogReadError(f"{file}: nothing decoded: {what} (seen: {shown})")
        decoded = ", ".join(dict.fromkeys(frame.name for frame in found))
        ids = f"{len(self.counts)} identifiers, {len(self.counts) - len(unknown)} decoded"
        there = [m for _, m in sorted(self.messages.items()) if len(m.time)]
        remarks = {
            "unknown identifiers (frames)": unknown,
            "multiplexed": [m.name for m in there if m.paged],
            "never valid": [f"{m.name}.{idle}" for m in there for idle in m.idle()],
            "outside of its message": [f"{m.name}.{name}" for m in there for name in m.outside],
        }
        notes = [f"{file}: CAN: {ids}: {decoded}"]
        notes += [f"{file}: CAN: {what}: {', '.join(n)}" for what, n in remarks.items() if n]
        return Recording(tuple(found), tuple(losses), tuple(notes))


class _Answer:
    """One OBD-II parameter as its answers come."""

    def __init__(self, units: Mapping[str, str]) -> None:
        self.units = units
        self.time, self.values = Spool(np.int64), Spool(np.float64)

    def add(self, frame: Frame) -> None:
        self.time.append(frame.time)
        self.values.append(next(iter(frame.columns.values())))

    def frame(self, name: str, file: str) -> Frame:
        return Frame(obd.FRAME, file, self.time.column(), {name: self.values.column()}, self.units)


class _Message:
    """The columns of one message as its frames come, and what is known of each signal."""

    def __init__(self, message: Any, profile: Profile | None) -> None:
        self.name: str = message.name
        self.length: int = message.length
        self.paged: bool = message.is_multiplexed()
        self.signals = [s for s in message.signals if _fits(s, message.length)]
        self.outside = [s.name for s in message.signals if s not in self.signals]
        self.switches = {s.name: s for s in self.signals if s.is_multiplexer}
        self.short = 0
        self.time = Spool(np.int64)
        self.columns = {
            s.name: Spool(np.float64)
            for s in self.signals
            if profile is None or profile.reads(s.name, message.name)
        }
        # signal -> its first raw value, until another one comes
        self.constant: dict[str, Any] = {}
        self.varied: set[str] = set()

    def add(self, time: Stamps, data: NDArray[np.uint8]) -> None:
        """Frames that are long enough."""
        data = np.ascontiguousarray(data[:, : self.length])
        bits = {order: np.unpackbits(data, axis=1, bitorder=order) for order in ("little", "big")}
        self.time.append(time)
        for signal in self.signals:
            if signal.name in self.varied and signal.name not in self.columns:
                continue
            raw = raw_values(signal, bits)
            there = self._there(signal, bits, len(time))
            self._watch(signal.name, raw[there])
            if signal.name in self.columns:
                values: Floats = raw.astype(np.float64) * signal.scale + signal.offset
                values[~there] = np.nan
                self.columns[signal.name].append(values)

    def _there(self, signal: Any, bits: Mapping[str, NDArray[np.uint8]], size: int) -> Bools:
        """Which frames hold the signal's page."""
        if signal.multiplexer_ids is None:
            return np.ones(size, np.bool_)
        switch = self.switches.get(signal.multiplexer_signal)
        if switch is None:
            return np.zeros(size, np.bool_)
        return np.isin(raw_values(switch, bits).astype(np.int64), list(signal.multiplexer_ids))

    def _watch(self, name: str, raw: NDArray) -> None:
        if not len(raw) or name in self.varied:
            return
        first = self.constant.setdefault(name, raw[0])
        if (raw != first).any():
            self.varied.add(name)

    def idle(self) -> list[str]:
        """The signals that never hold a value, and why."""
        whys = {s.name: _idle(s, self.constant.get(s.name)) for s in self.signals}
        return [f"{name} ({why})" for name, why in whys.items() if why and name not in self.varied]

    def frame(self, file: str) -> Frame:
        time = self.time.column()
        columns = {
            s.name: self.columns[s.name].column() if s.name in self.columns else absent(len(time))
            for s in self.signals
        }
        return Frame(self.name, file, time, columns, {s.name: s.unit or "" for s in self.signals})


def _fits(signal: Any, length: int) -> bool:
    """Whether a signal's bits lie in the message; a broken database may say anything."""
    if not 0 < signal.length <= LONGEST or (signal.is_float and signal.length not in REALS):
        return False
    little = signal.byte_order == "little_endian"
    start = signal.start if little else _from_left(signal.start)
    return bool(start >= 0 and start + signal.length <= 8 * length)


def _from_left(start: int) -> int:
    """A Motorola start bit counts within its byte from the right, the bit row from the left."""
    return start // 8 * 8 + 7 - start % 8


def _idle(signal: Any, first: Any) -> str:
    """Why a signal of one raw value (None: never sent) holds none; empty where it does."""
    if first is None:
        return "its page is never sent"
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


def raw_values(signal: Any, bits: Mapping[str, NDArray[np.uint8]]) -> NDArray:
    """Raw values of one signal of all rows: int64, uint64 or float.

    bits: of the payload, each byte's from the least ("little") or most significant ("big") one.
    """
    little = signal.byte_order == "little_endian"
    start = signal.start if little else _from_left(signal.start)
    picked = bits["little" if little else "big"][:, start : start + signal.length]
    if little:
        picked = picked[:, ::-1]
    value = np.zeros(len(picked), np.uint64)
    for column in picked.T:
        value = (value << np.uint64(1)) | column
    if signal.is_float:
        integer, real = REALS[signal.length]
        return value.astype(integer).view(real)
    if not signal.is_signed:
        return value
    spare = np.int64(64 - signal.length)
    return (value << spare.astype(np.uint64)).view(np.int64) >> spare
