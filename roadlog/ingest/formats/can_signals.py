"""Signals out of payloads, whole columns at a time: bits, pages, and codes for "no value"."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.ingest.formats.can_database import Known
from roadlog.ingest.formats.database_xml import of_range
from roadlog.ingest.frame import absent
from roadlog.ingest.profile import Profile
from roadlog.spool import Spool
from roadlog.types import Bools, Floats, Stamps

MAX_BITS = 64  # bits of a number
REALS = {16: (np.uint16, np.float16), 32: (np.uint32, np.float32), 64: (np.uint64, np.float64)}
LONG = 4  # bits; a shorter field of ones is a state rather than "not available" (SAE J1939-71)
EXACT = 2**53  # beyond it floats do not hold every integer
ERROR, NOT_AVAILABLE = 0xFE, 0xFF  # SAE J1939-71, table 1: the highest eight bits of a number
# texts of a database that say that there is no value (English, German, French, Spanish)
NO_VALUE = re.compile(
    r"(?<![a-z])(?:sna|n[/._]?a|nan|in_?valid\w*|un_?available|un_?defined|un_?known"
    r"|not?[ _.-]*(?:available|avail|valid|defined|used|present|measured|supported|connected)"
    r"|(?:signal|data|value)[ _]?(?:lost|missing)|no[ _.-]*(?:data|value|signal|fix|measurement)"
    r"|(?<!no )(?<!no_)(?<!no-)(?<!without )(?:error|fault\w*|failure|defect\w*)(?![ _-]?free)"
    r"|(?:sensor|short)[ _-]?circuit|open[ _-]?(?:load|circuit)|out[ _]of[ _]range|reserved"
    r"|not[ _]?initiali[sz]ed|initiali[sz](?:ation|ing|ierung)|init(?:wert)?"
    r"|(?<!kein )(?<!kein_)(?<!keine )fehler(?!frei)\w*|ung(?:ue|ü)ltig|nicht[ _-]*\w+bar|defekt"
    r"|reserviert|unbekannt|invalide|non[ _-]*(?:valide|disponible)|indisponible|erreur"
    r"|no[ _-]*disponible|inv[aá]lido|fallo)(?![a-z])",
    re.IGNORECASE,
)


def no_value(text: str) -> bool:
    """Whether a database's text for a raw value says that it is none."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", text.strip())
    return bool(NO_VALUE.search(apart.replace("_", " ")) or NO_VALUE.search(apart))


class CanSignal:
    """One signal of a message: where it stands, what it means, and what was seen of it."""

    def __init__(self, signal: Any, groups: bool) -> None:
        self.definition = signal
        self.name: str = signal.name
        self.little = signal.byte_order == "little_endian"
        self.start = signal.start if self.little else _from_left(signal.start)
        self.end = (self.start + signal.length - 1) // 8 + 1  # bytes that hold it
        self.ranges = groups and not signal.is_float  # of J1939, beside the texts
        self.codes = _codes(signal)
        self.spans = _spans(signal)
        self.pages = frozenset(signal.multiplexer_ids or ())
        self.switch: CanSignal | None = None
        self.constant: Any = None  # its first raw value, until another one comes
        self.varied = False
        self.none: Counter[str] = Counter()  # why there was no value -> frames
        self.cut = 0  # frames that end before it

    def raw(self, bits: Mapping[str, NDArray[np.uint8]]) -> NDArray:
        """Raw values of all rows: int64, uint64 or float.

        bits: of the payload, each byte's from the least ("little") or most significant one.
        """
        signal = self.definition
        picked = bits["little" if self.little else "big"]
        picked = picked[:, self.start : self.start + signal.length]
        if self.little:
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

    def there(self, bits: Mapping[str, NDArray[np.uint8]], length: NDArray[np.uint8]) -> Bools:
        """Which frames are long enough for it and hold its page, and that of its page's switch."""
        long: Bools = length >= self.end
        if self.switch is None:
            return long if not self.pages else np.zeros(len(length), np.bool_)
        page = np.isin(self.switch.raw(bits).astype(np.int64), list(self.pages))
        return long & page & self.switch.there(bits, length)

    def watch(self, raw: NDArray) -> None:
        """Note whether it ever changes."""
        if not len(raw) or self.varied:
            return
        if self.constant is None:
            self.constant = raw[0]
        self.varied = bool((raw != self.constant).any())

    def values(self, raw: NDArray) -> Floats:
        """Physical values, NaN for codes that say that there is none."""
        values = _scaled(self.definition, raw)
        if not self.definition.scale or not np.isfinite(self.definition.scale):
            everything = np.ones(len(raw), np.bool_)
            self._leave_out(values, everything, f"its factor is {self.definition.scale:g}")
            return values
        for code, text in self.codes.items():
            self._leave_out(values, raw == code, text)
        for text, first, last in self.spans:
            self._leave_out(values, (raw >= first) & (raw <= last) & ~np.isnan(values), text)
        if self.ranges:
            for mask, text in _ranges(self.definition, raw):
                self._leave_out(values, mask & ~np.isnan(values), text)
        return values

    def _leave_out(self, values: Floats, mask: Bools, why: str) -> None:
        if mask.any():
            self.none[why] += int(mask.sum())
            values[mask] = np.nan

    def idle(self) -> str:
        """Why it never holds a value; empty where it does."""
        if self.varied:
            return ""
        signal, first = self.definition, self.constant
        if first is None:
            return "its page is never sent" if self.pages else "the frames end before it"
        if signal.length == 1 and not self.codes:
            return "always 0" if first == 0 and self.name.lower().endswith("valid") else ""
        if first in self.codes:
            return f"always {self.codes[int(first)]}"
        whole = not signal.is_float and not signal.is_signed and signal.length >= LONG
        if whole and int(first) == (1 << signal.length) - 1:
            return "all bits set"
        value = float(first) * signal.scale + signal.offset
        low, high = signal.minimum, signal.maximum
        if low is not None and high is not None and low < high and not low <= value <= high:
            return f"always {value:g}, outside {low:g} to {high:g}"
        return ""


class CanStream:
    """The columns of one message of one sender as its frames come.

    names: all under which a profile may mean it. source: the sender's address where the message
    is one of a parameter group.
    """

    def __init__(
        self, known: Known, names: frozenset[str], source: int | None, profile: Profile | None
    ) -> None:
        message = known.message
        self.message = message
        self.names = names
        self.length: int = message.length
        groups = source is not None
        fitting = [s for s in message.signals if _fits(s, message.length)]
        self.outside = [s.name for s in message.signals if s not in fitting]
        self.signals = [CanSignal(s, groups) for s in fitting]
        by_name = {s.name: s for s in self.signals}
        for signal in self.signals:
            switch = signal.definition.multiplexer_signal
            if signal.definition.multiplexer_ids is not None and switch in by_name:
                signal.switch = by_name[switch]
        self.time = Spool(np.int64)
        self.columns = {
            s.name: Spool(np.float64)
            for s in self.signals
            if profile is None or profile.reads(s.name, *names)
        }
        self.short: Counter[int] = Counter()  # bytes -> frames shorter than the database says
        self.origins: set[object] = set()

    def add(self, origin: object, time: Stamps, data: NDArray[np.uint8], length: NDArray) -> None:
        """Frames of one identifier of one group, in the order of the source."""
        self.origins.add(origin)
        data = np.ascontiguousarray(data[:, : self.length])
        if data.shape[1] < self.length:
            data = np.pad(data, ((0, 0), (0, self.length - data.shape[1])))
        for size in np.unique(length[length < self.length]).tolist():
            self.short[size] += int((length == size).sum())
        bits = {order: np.unpackbits(data, axis=1, bitorder=order) for order in ("little", "big")}
        self.time.append(time)
        for signal in self.signals:
            kept = signal.name in self.columns
            if signal.varied and not kept:
                continue
            raw = signal.raw(bits)
            there = signal.there(bits, length)
            signal.cut += int((length < signal.end).sum())
            signal.watch(raw[there])
            if kept:
                values = np.full(len(raw), np.nan)
                values[there] = signal.values(raw[there])
                self.columns[signal.name].append(values)

    def ordered(self) -> tuple[Stamps, dict[str, NDArray]]:
        """Stamps and columns; frames that came by several ways are put in order of time."""
        time = self.time.column()
        columns = {
            s.name: self.columns[s.name].column() if s.name in self.columns else absent(len(time))
            for s in self.signals
        }
        if len(self.origins) > 1:
            order = np.argsort(time, kind="stable")
            time = time[order]
            columns = {
                name: column[order] if name in self.columns else column
                for name, column in columns.items()
            }
        return time, columns

    @property
    def units(self) -> dict[str, str]:
        return {s.name: s.definition.unit or "" for s in self.signals}


def _scaled(signal: Any, raw: NDArray) -> Floats:
    """raw * scale + offset as cantools does it: of integers exactly, rounded once."""
    scale, offset = signal.scale, signal.offset
    whole = float(scale).is_integer() and float(offset).is_integer() and not signal.is_float
    large = 2.0**signal.length * abs(scale) + abs(offset) >= EXACT
    if whole and large and (scale, offset) != (1, 0):
        exact = [int(value) * int(scale) + int(offset) for value in raw.tolist()]
        return np.array([float(value) for value in exact], np.float64)
    with np.errstate(invalid="ignore", over="ignore"):  # of floats any bits may come
        values: Floats = raw.astype(np.float64) * scale + offset
    return values


def _codes(signal: Any) -> dict[int, str]:
    """Raw values that a database names as no value, with its text in one line."""
    found = {}
    for code, text in (signal.choices or {}).items():
        if no_value(str(text)) and not of_range(code, str(text)):
            for raw in (int(code), *_of_other_sign(signal, int(code), int(code))[:1]):
                found[raw] = " ".join(str(text).split())
    return found


def _spans(signal: Any) -> list[tuple[str, int, int]]:
    """Texts of ranges of raw values that mean no value, with first and last."""
    found = []
    for code, label in (signal.choices or {}).items():
        if (span := of_range(code, str(label))) and no_value(span[0]):
            text = " ".join(span[0].split())
            found.append((text, *span[1:]))
            if ends := _of_other_sign(signal, *span[1:]):
                found.append((text, *ends))
    return found


def _of_other_sign(signal: Any, first: int, last: int) -> tuple[()] | tuple[int, int]:
    """Raw values that a database wrote without their sign, or with one that they have not."""
    count = 1 << signal.length
    half = count // 2
    if signal.is_float:
        return ()
    if signal.is_signed and (first >= half or last < count):
        low, high, moved = max(first, half), min(last, count - 1), -count
    elif not signal.is_signed and first >= -half:
        low, high, moved = first, min(last, -1), count
    else:
        return ()
    return (low + moved, high + moved) if low <= high else ()


def _ranges(signal: Any, raw: NDArray) -> list[tuple[Bools, str]]:
    """SAE J1939-71: 0xFE.. is an error, 0xFF.. not available; of signed numbers (NMEA 2000) the
    two largest."""
    if signal.length < 8:
        return []
    if signal.is_signed:
        largest = (1 << (signal.length - 1)) - 1
        return [(raw == largest, "not available"), (raw == largest - 1, "error")]
    top = raw >> np.uint64(signal.length - 8)
    return [(top == NOT_AVAILABLE, "not available"), (top == ERROR, "error")]


def _fits(signal: Any, length: int) -> bool:
    """Whether a signal's bits lie in the message; a broken database may say anything."""
    if not 0 < signal.length <= MAX_BITS or (signal.is_float and signal.length not in REALS):
        return False
    little = signal.byte_order == "little_endian"
    start = signal.start if little else _from_left(signal.start)
    return bool(start >= 0 and start + signal.length <= 8 * length)


def _from_left(start: int) -> int:
    """A Motorola start bit counts within its byte from the right, the bit row from the left."""
    return int(start // 8 * 8 + 7 - start % 8)
