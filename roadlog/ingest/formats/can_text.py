"""Lines of CAN traces in text: Vector ASC, PEAK TRC, candump, python-can and SavvyCAN CSV.

python-can reads the plain ones of each; these know the dialects: relative and delta stamps, months
in other languages, TRC 1.0 to 2.1, what `candump` prints for people.
"""

from __future__ import annotations

import re
from base64 import b64decode
from binascii import Error as Base64Error
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from itertools import islice, pairwise
from pathlib import Path

from roadlog.ingest.formats import times
from roadlog.ingest.formats.can_database import EXTENDED, bus_name
from roadlog.ingest.formats.text import lines_of, moment

Line = tuple[int, str, int, bytes]  # ns, bus, identifier (bit 31: extended), payload
DELPHI = datetime(1899, 12, 30, tzinfo=UTC)  # day 0 of PEAK's $STARTTIME
LOOKED = 400  # lines that tell stamps from steps
EPOCH = 10**8  # s; a larger stamp is a date
SHORT_DIGITS, SHORT = 4, 0x7FF  # of an 11-bit identifier in PEAK's traces
SECOND = 10**9
NEAR = 2.0  # s; dates of triggers are whole seconds


@dataclass
class Trace:
    """One text trace while it is read.

    start: ns of its first moment, as its own clock says. local: that clock has no zone. bad: lines
    that should be frames and are none. loose: 29-bit identifiers may be 11-bit ones.
    """

    path: Path
    zone: str = ""
    local: bool = False
    bad: int = 0
    loose: bool = False
    notes: list[str] = field(default_factory=list)

    def dated(self, start: int | None, said: str) -> int:
        """ns of a date of the file in its zone."""
        if start is None:
            if said:
                self._note(f"its date '{said}' is not understood, the stamps count from 0")
            return 0
        shift, note = times.local(start, self.zone, self.path.name)
        if note not in self.notes:
            self.notes.append(note)
        return start - shift

    def _note(self, text: str) -> None:
        self.notes.append(f"{self.path.name}: {text}")


def _ns(seconds: str) -> int:
    """ns of decimal seconds, exactly."""
    whole, _, part = seconds.partition(".")
    return int(whole or 0) * SECOND + int(part[:9].ljust(9, "0") or 0)


def _ms(text: str) -> int:
    """ns of decimal milliseconds."""
    whole, _, part = text.partition(".")
    return int(whole or 0) * 10**6 + int(part[:6].ljust(6, "0") or 0)


_FLAGS = {"d": "data", "r": "remote"}
_ASC = re.compile(r"\s*(\d+\.\d+)\s+(.*)")
_ASC_DATA = re.compile(r"(\d+)\s+(\S+)\s+(Rx|Tx|TxRq)\s+d\s+([0-9a-f]+)\s*(.*)", re.I)
_ASC_FD = re.compile(
    r"CANFD\s+(\d+)\s+(Rx|Tx|TxRq)\s+(\S+)\s+(?:\S*[^\d\s]\S*\s+)?([01])\s+([01])\s+"
    r"([0-9a-f]+)\s+(\d+)\s*(.*)",
    re.I,
)
_ASC_IDENTIFIER = re.compile(r"\bID = (\d+)(x?)", re.I)
_NUMBER = re.compile(r"[0-9a-f]+x?", re.I)
_COUNT_OF_MS = re.compile(r"(?<=:\d\d)\.(\d{1,2})(?!\d)")


def asc(trace: Trace) -> Iterator[Line]:
    """Vector ASC: absolute or relative stamps, hexadecimal or decimal, CAN and CAN FD."""
    base, relative = 16, False
    header = start = offset = 0
    clock = 0
    triggered: int | None = None
    for line in lines_of(trace.path):
        event = _ASC.match(line)
        if event is None:
            words = line.split(None, 1)
            word = words[0].lower() if words else ""
            if word == "date" and len(words) > 1:
                header = start = trace.dated(_asc_date(words[1]), words[1])
            elif word == "base":
                base = 10 if "dec" in line.lower() else 16
                relative = "relative" in line.lower()
            elif word == "begin" and (
                found := re.match(r"begin\s+triggerblock\s+(.+)", line, re.I)
            ):
                triggered = _asc_date(found[1])
            continue
        stamp = _ns(event[1])
        clock = clock + stamp if relative else stamp
        if triggered is not None:
            own = trace.dated(triggered, "")
            # stamps go on from the start of the measurement, or begin anew with the trigger
            late = (own - header) * 1e-9
            start = header if header and late > 0 and clock * 1e-9 >= late - NEAR else own
            triggered = None
        frame = _asc_frame(event[2], base)
        if frame is None:
            trace.bad += bool(_ASC_DATA.match(event[2]) or event[2].startswith("CANFD"))
        elif frame[1] is not None:
            yield start + offset + clock, bus_name(frame[0]), frame[1], frame[2]


def _asc_date(text: str) -> int | None:
    """ns of a date; its milliseconds are a count: python-can writes `20.18` for 18 of them."""
    return moment(_COUNT_OF_MS.sub(lambda m: f".{m[1]:0>3}", text))


def _asc_frame(text: str, base: int) -> tuple[str, int | None, bytes] | None:
    """Channel, identifier (None for what is no data on the bus) and payload."""
    try:
        if match := _ASC_DATA.match(text):
            channel, name, way, code, rest = match.groups()
            size = min(int(code, base), 8)
        elif match := _ASC_FD.match(text):
            channel, way, name, _, _, _, length, rest = match.groups()
            size = int(length)
        else:
            return None if text.startswith("CANFD") else ("", None, b"")
        if way.lower() == "txrq":  # wanted, not yet sent
            return channel, None, b""
        if not _NUMBER.fullmatch(name) or (base == 10 and not name.rstrip("xX").isdigit()):
            said = _ASC_IDENTIFIER.search(rest)
            if said is None:
                return None
            identifier, extended = int(said[1]), bool(said[2])
        else:
            extended = name[-1] in "xX"
            identifier = int(name.rstrip("xX"), base)
        data = bytes(int(byte, base) for byte in rest.split()[:size])
    except ValueError:
        return None
    if len(data) < size or identifier >= EXTENDED:
        return None
    return channel, identifier | (EXTENDED if extended else 0), data


def trc(trace: Trace) -> Iterator[Line]:
    """PEAK TRC 1.0 to 2.1."""
    version, start, columns = "1.0", 0, list[str]()
    for line in lines_of(trace.path):
        text = line.strip()
        if text.startswith(";"):
            key, _, value = text[1:].strip().partition("=")
            if key == "$FILEVERSION":
                version = value.strip()
            elif key == "$STARTTIME":
                days = timedelta(days=float(value.replace(",", ".")))
                begun = (DELPHI + days - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(
                    microseconds=1
                )
                start = trace.dated(begun * 1000, "")
            elif key == "$COLUMNS":
                columns = value.strip().split(",")
            elif version == "1.0" and (said := re.search(r"Start time:\s*(\d.*)", text)):
                start = trace.dated(times.of_text(said[1].strip()), said[1].strip())
            continue
        if not text:
            continue
        trace.loose = version == "1.0"
        try:
            usual = _TRC_COLUMNS.get(version, "").split(",")
            frame = _trc_frame(text, version, columns or usual)
        except (ValueError, IndexError, KeyError):
            trace.bad += 1
            continue
        if frame is not None:
            offset, bus, name, data = frame
            identifier = int(name, 16)
            long = len(name) > SHORT_DIGITS
            yield start + offset, bus, identifier | (EXTENDED if long else 0), data


_TRC_PLACES = {  # version -> fields before the identifier: bus, kind; and between it and the length
    "1.0": (None, None, 2, 3),
    "1.1": (None, 2, 3, 4),
    "1.2": (2, 3, 4, 5),
    "1.3": (2, 3, 4, 6),
}
_TRC_COLUMNS = {"2.0": "N,O,T,I,d,l,D", "2.1": "N,O,T,B,I,d,R,L,D"}
_TRC_DATA = {"DT", "FD", "FB", "FE", "BI", "Rx", "Tx"}
FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


def _trc_frame(text: str, version: str, columns: list[str]) -> tuple[int, str, str, bytes] | None:
    """Offset, bus, identifier and payload; None for what is no data.

    Raises ValueError, IndexError, KeyError.
    """
    if version.startswith("2"):
        words = text.split(None, len(columns) - 1)
        place = {name: words[k] for k, name in enumerate(columns) if k < len(words)}
        if place["T"] not in _TRC_DATA:
            return None
        size = int(place["l"]) if "l" in place else FD_LENGTHS[int(place["L"])]
        bus, name, data = place.get("B", ""), place["I"], place.get("D", "")
        offset = place["O"]
    else:
        words = text.split()
        bus_at, kind_at, name_at, size_at = _TRC_PLACES.get(version, _TRC_PLACES["1.1"])
        if kind_at is not None and words[kind_at] not in _TRC_DATA:
            return None
        bus = words[bus_at] if bus_at is not None else ""
        offset, name, size = words[1], words[name_at], int(words[size_at])
        data = " ".join(words[size_at + 1 :])
        if name == "FFFFFFFF":  # version 1.0: a state of the bus
            return None
    if data.startswith("RTR"):
        return None
    payload = bytes.fromhex(" ".join(data.split()[:size]))
    if len(payload) < size:
        raise ValueError
    return _ms(offset), bus_name(bus) if bus else "", name, payload


_LOG = re.compile(
    r"\((\d+\.\d+)\)\s+(\S+)\s+([0-9A-Fa-f]{3,8})#(#[0-9A-Fa-f])?([0-9A-Fa-f.]*)(?:\s+[RT])?\s*$"
)
_DUMP = re.compile(
    r"\s*\(([^)]+)\)\s+(\S+)\s+(?:[TR]X\s+\S\s+\S\s+)?([0-9A-Fa-f]{3,8})\s+\[(\d+)\]\s*(.*)"
)


def candump(trace: Trace) -> Iterator[Line]:
    """The log form of candump (-l, -L)."""
    for line in lines_of(trace.path):
        match = _LOG.match(line.strip())
        if match is None:
            trace.bad += bool(line.strip()) and "#R" not in line
            continue
        stamp, bus, name, _, text = match.groups()
        try:
            data = bytes.fromhex(text.replace(".", ""))
        except ValueError:
            trace.bad += 1
            continue
        identifier = int(name, 16)
        if identifier & ERROR_FRAME and len(name) > 3:
            continue
        yield _ns(stamp), bus, identifier | (EXTENDED if len(name) > 3 else 0), data


ERROR_FRAME = 1 << 29  # of candump's identifiers


def printed(trace: Trace) -> Iterator[Line]:
    """What candump prints for people, with stamps of -t a, z, d or A."""
    steps = _are_steps(trace.path)
    clock = 0
    for line in lines_of(trace.path):
        match = _DUMP.match(line)
        if match is None:
            trace.bad += bool(line.strip()) and "remote" not in line and "ERRORFRAME" not in line
            continue
        stamp, bus, name, size, rest = match.groups()
        if rest.startswith("remote") or "ERRORFRAME" in rest:
            continue
        try:
            if "-" in stamp or ":" in stamp:
                at = trace.dated(times.of_text(stamp.strip()), stamp)
            else:
                clock = clock + _ns(stamp.strip()) if steps else _ns(stamp.strip())
                at = clock
            data = bytes.fromhex(" ".join(rest.split()[: int(size)]))
        except ValueError:
            trace.bad += 1
            continue
        if len(data) < int(size):
            trace.bad += 1
            continue
        yield at, bus, int(name, 16) | (EXTENDED if len(name) > 3 else 0), data


def _are_steps(path: Path) -> bool:
    """Whether stamps count from the frame before (-t d): they go up and down, or stay the same.

    Those of two interfaces fall too, by as much as one was read late.
    """
    found = (match[1] for line in islice(lines_of(path), LOOKED) if (match := _DUMP.match(line)))
    stamps = [_ns(text.strip()) for text in found if re.fullmatch(r"\s*\d+\.\d+\s*", text)]
    if len(stamps) < 2 or max(stamps) > EPOCH * SECOND:
        return False
    way = sum(abs(b - a) for a, b in pairwise(stamps[1:]))  # the first is 0 in both
    return 2 * (stamps[-1] - stamps[1]) < way or (not way and len(stamps) > 3)


def python_can_csv(trace: Trace) -> Iterator[Line]:
    """The CSV of python-can: payload in base64."""
    for line in islice(lines_of(trace.path), 1, None):
        words = line.split(",")
        try:
            stamp, name, extended, remote, error, _, text = words
            data = b64decode(text, validate=True)
            at, identifier = _ns(stamp), int(name, 16)
        except (ValueError, Base64Error):
            trace.bad += bool(line.strip())
            continue
        if remote == "0" and error == "0":
            yield at, "", identifier | (EXTENDED if extended == "1" else 0), data


def savvycan_csv(trace: Trace) -> Iterator[Line]:
    """The CSV of SavvyCAN and GVRET: stamps in us, a column for each byte."""
    rows = lines_of(trace.path)
    header = [name.strip().lower() for name in next(rows).split(",")]
    place = {name: k for k, name in enumerate(header)}
    first = place["d1"]
    for line in rows:
        words = [word.strip() for word in line.split(",")]
        try:
            at = (
                round(float(words[place["time stamp"]]) * 1000)
                if "." in words[0]
                else int(words[0]) * 1000
            )
            identifier = int(words[place["id"]], 16)
            size = int(words[place["len"]])
            data = bytes(int(word, 16) for word in words[first : first + size])
            extended = words[place["extended"]].lower() in ("true", "1")
        except (ValueError, IndexError):
            trace.bad += bool(line.strip())
            continue
        if len(data) < size:
            trace.bad += 1
            continue
        bus = bus_name(words[place["bus"]]) if "bus" in place else ""
        yield at, bus, identifier | (EXTENDED if extended else 0), data


# what the beginning of each looks like, and who reads it
DIALECTS: dict[bytes, Callable[[Trace], Iterator[Line]]] = {
    rb"^\s*base\s+(hex|dec)\b|^date .*\r?\n(?:.*\r?\n){0,4}base ": asc,
    rb"^;\$(FILEVERSION|STARTTIME)=|^;#{20,}\r?\n(?:;.*\r?\n)*\s*\d+\)": trc,
    rb"^;#{20,}\s*$[^\0]*^;\s*(Start time|Columns description):": trc,
    rb"^\(\d+\.\d+\) +\S+ +[0-9A-Fa-f]{3,8}#": candump,
    rb"^\s*\([^)\n]+\)\s+\S+\s+(?:[TR]X\s+\S\s+\S\s+)?[0-9A-Fa-f]{3,8}\s+\[\d+\]\s": printed,
    rb"^timestamp,arbitration_id,extended,remote,error,dlc,data\s": python_can_csv,
    rb"^Time Stamp,ID,Extended,(?:Dir,)?Bus,LEN,D1,": savvycan_csv,
}
UNSTAMPED = re.compile(rb"^\s*v?s?l?can\d+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]\s", re.MULTILINE)
