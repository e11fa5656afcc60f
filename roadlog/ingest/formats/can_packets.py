"""Messages that span frames or share one: J1939 transport, fast packets, AUTOSAR containers.

SAE J1939-21, 5.10: an announcement (TP.CM: BAM to all, RTS to one) and its packets (TP.DT) of seven
bytes; NMEA 2000 fast packets: six bytes, then seven, with the frame's number; containers (AUTOSAR
SRS I-PDU multiplexer): headers of three bytes of identity and one of length. A message that lacks a
frame is none. Its moment is that of its first frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from roadlog.ingest.formats.can_database import EXTENDED, Known, group_of

CONNECT, DATA = 0xEC00, 0xEB00  # parameter groups of announcements and of their packets
TO_ONE, TO_ALL, ABORT = 16, 32, 255  # control bytes
PACKET = 7  # bytes of a message in one frame
PRIORITY = 6 << 26 | EXTENDED
FAST = 8  # bytes; a longer message of a group comes in several frames
COUNTER = 0x1F  # of a fast packet's first byte; the rest says which message

Whole = tuple[Known, int, bytes]  # what it is, ns, payload


@dataclass
class _Open:
    """A message of which packets are still to come."""

    time: int
    identifier: int
    size: int
    data: bytearray = field(default_factory=bytearray)
    number: int = 1


@dataclass
class Transport:
    """Long messages of J1939 on one bus, as their frames come. broken: those that are not whole."""

    broken: int = 0
    _open: dict[tuple[int, int], _Open] = field(default_factory=dict)

    def add(self, time: int, identifier: int, data: bytes) -> tuple[int, int, bytes] | None:
        """Time, identifier and payload of a message that this frame completes."""
        if len(data) < FAST:
            return None
        ends = identifier & 0xFF, identifier >> 8 & 0xFF  # sender and receiver
        if group_of(identifier) == CONNECT:
            if data[0] in (TO_ONE, TO_ALL):
                self.broken += ends in self._open
                group = int.from_bytes(data[5:8], "little")
                to = ends[1] << 8 if group >> 8 & 0xFF < 240 else 0
                whole = PRIORITY | group << 8 | to | ends[0]
                self._open[ends] = _Open(time, whole, int.from_bytes(data[1:3], "little"))
            elif data[0] == ABORT:
                self._open.pop(ends, None)
            return None
        going = self._open.get(ends)
        if going is None:
            return None
        if data[0] != going.number:
            self.broken += 1
            del self._open[ends]
            return None
        going.data += data[1:]
        going.number += 1
        if len(going.data) < going.size:
            return None
        del self._open[ends]
        return going.time, going.identifier, bytes(going.data[: going.size])


def is_transport(identifier: int) -> bool:
    """Whether a frame belongs to a long message of J1939."""
    return bool(identifier & EXTENDED) and group_of(identifier) in (CONNECT, DATA)


@dataclass
class FastPackets:
    """The messages of one identifier that come in fast packets. broken: those not whole."""

    known: Known
    broken: int = 0
    _open: _Open | None = None
    _which: int = 0

    def add(self, time: int, data: bytes) -> Iterator[Whole]:
        """The message that this frame completes."""
        if len(data) > FAST:  # CAN FD holds it whole
            yield self.known, time, data
            return
        number, which = (data[0] & COUNTER, data[0] & ~COUNTER) if data else (0, 0)
        if number == 0 and len(data) > 1:
            self.broken += self._open is not None
            self._open = _Open(time, 0, data[1], bytearray(data[2:]))
            self._which = which
        elif self._open is None:
            return
        elif number != self._open.number or which != self._which:
            self.broken += 1
            self._open = None
            return
        else:
            self._open.data += data[1:]
            self._open.number += 1
        if self._open and len(self._open.data) >= self._open.size:
            whole, self._open = self._open, None
            yield self.known, whole.time, bytes(whole.data[: whole.size])


@dataclass
class Containers:
    """The messages in one container message. broken: containers that end within one."""

    known: Known
    broken: int = 0
    _inside: dict[str, Known] = field(default_factory=dict)

    def add(self, time: int, data: bytes) -> Iterator[Whole]:
        """The messages in this frame that the database knows."""
        container: Any = self.known.message
        at = 0
        while at + 4 <= len(data):
            identity, size = int.from_bytes(data[at : at + 3], "big"), data[at + 3]
            at += 4 + size
            if at > len(data):
                self.broken += 1
                return
            inside = container.get_contained_message_by_header_id(identity)
            if inside is not None and size:
                known = self._inside.setdefault(
                    inside.name, Known(inside, self.known.file, self.known.bus)
                )
                yield known, time, data[at - size : at]


def packets_of(known: Known) -> FastPackets | Containers | None:
    """Who takes the frames of a message apart; None for one that is its frame."""
    if known.message.is_container:
        return Containers(known)
    return FastPackets(known) if known.by_pgn and known.message.length > FAST else None
