"""Raw CAN frames to signals: databases (cantools), and the standard answers of OBD-II.

Decoding works on whole columns, not frame by frame: bits are picked from the payload matrix of all
frames of one message at once. Buses and senders stay apart: `CAN1.Motion`, `CCVS1@0x0B`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError
from roadlog.ingest.formats import obd
from roadlog.ingest.formats.can_database import EXTENDED, Known, Messages, load
from roadlog.ingest.formats.can_packets import (
    Containers,
    FastPackets,
    Transport,
    Whole,
    is_transport,
    packets_of,
)
from roadlog.ingest.formats.can_signals import CanStream, no_value
from roadlog.ingest.formats.obd_bus import Answers, answers_of
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.types import Stamps

__all__ = ["EXTENDED", "CanFrames", "Decoder", "Known", "decode", "load", "names", "no_value"]

SHOWN = 8  # identifiers in a message
# bytes of a data length code, ISO 11898-1
LENGTHS = np.array([*range(9), 12, 16, 20, 24, 32, 48, 64], np.int64)


@dataclass(frozen=True)
class CanFrames:
    """Data frames of a trace.

    time [ns], identifier (bit 31: extended), payload (n x bytes), its length in each frame. bus:
    place in `buses` of each frame's bus, whose names are such as `can0` or `CAN1`.
    """

    time: Stamps
    identifier: NDArray[np.uint32]
    data: NDArray[np.uint8]
    length: NDArray[np.uint8]
    bus: NDArray[np.uint8] | None = None
    buses: Sequence[str] = ("",)


def names(known: Sequence[Known]) -> set[str]:
    """Every name that decoding may give: `MESSAGE.SIGNAL`, `SIGNAL`, and those of OBD-II."""
    found = {f"{obd.FRAME}.{parameter.name}" for parameter in obd.PARAMETERS.values()}
    for one in known:
        for message in (one.message, *(one.message.contained_messages or ())):
            for signal in message.signals:
                found |= {signal.name, f"{message.name}.{signal.name}"}
    return found


def decode(
    frames: CanFrames, known: Sequence[Known], file: str, profile: Profile | None = None
) -> Recording:
    """`Decoder` of frames that are all there at once."""
    decoder = Decoder(known, file, profile)
    decoder.add(frames)
    return decoder.recording()


@dataclass
class _Heard:
    """One identifier on one bus: its frames, and what they are decoded to."""

    bus: str
    identifier: int
    count: int = 0
    stream: CanStream | None = None
    answers: Answers | None = None
    packets: FastPackets | Containers | None = None
    wholes: int = 0  # known messages that its frames, or parts of them, made

    @property
    def shown(self) -> str:
        return f"0x{self.identifier & ~EXTENDED:X}"

    @property
    def is_known(self) -> bool:
        """Whether anything of it was decoded."""
        return self.stream is not None or self.wholes > 0 or bool(self.answers and self.answers.any)


@dataclass
class Decoder:
    """Frames of every known message, standard OBD-II answers among them, batch by batch.

    profile: only what it reads is kept, of other signals the names. loose: the source does not
    tell 29-bit identifiers of few digits from 11-bit ones.
    """

    known: Sequence[Known]
    file: str
    profile: Profile | None = None
    loose: bool = False
    _heard: dict[tuple[str, int], _Heard] = field(default_factory=dict)
    _streams: dict[tuple[str, str, int | None], CanStream] = field(default_factory=dict)
    _transports: dict[str, Transport] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.messages = Messages(self.known)

    def add(self, frames: CanFrames, group: object = None) -> None:
        """Decode a batch. group: its source, where frames of one message come by several ways."""
        buses = frames.bus if frames.bus is not None else np.zeros(len(frames.time), np.uint8)
        key = frames.identifier.astype(np.uint64) | buses.astype(np.uint64) << np.uint64(32)
        order = np.argsort(key, kind="stable")
        seen, first = np.unique(key[order], return_index=True)
        for one, rows in zip(seen.tolist(), np.split(order, first[1:]), strict=False):
            heard = self._of(frames.buses[one >> 32], one & 0xFFFFFFFF)
            heard.count += len(rows)
            part = frames.time[rows], frames.data[rows], frames.length[rows]
            if heard.stream is not None:
                heard.stream.add((group, heard.identifier), *part)
            elif heard.packets is not None:
                self._apart(heard, group, part)
            elif heard.answers is not None:
                heard.answers.add(*part)
        if self.messages.has_groups:
            self._joined(frames, buses, group)

    def _apart(self, heard: _Heard, group: object, part: tuple[NDArray, ...]) -> None:
        """Messages of several frames, or several of one frame."""
        assert heard.packets is not None
        wholes: list[Whole] = []
        for time, data, length in zip(*part, strict=True):
            wholes += heard.packets.add(int(time), data[:length].tobytes())
        heard.wholes += len(wholes)
        source = heard.identifier & 0xFF if heard.packets.known.by_pgn else None
        self._keep(heard.bus, source, (group, heard.identifier), wholes)

    def _joined(self, frames: CanFrames, buses: NDArray[np.uint8], group: object) -> None:
        """Long messages of J1939, of announcements and packets in the order of the source."""
        seen = [i for i in np.unique(frames.identifier).tolist() if is_transport(i)]
        for row in np.flatnonzero(np.isin(frames.identifier, seen)).tolist() if seen else ():
            bus, identifier = frames.buses[buses[row]], int(frames.identifier[row])
            transport = self._transports.setdefault(bus, Transport())
            data = frames.data[row, : frames.length[row]].tobytes()
            made = transport.add(int(frames.time[row]), identifier, data)
            found = self.messages.find(bus, made[1]) if made else None
            if made and found:
                known, source = found
                self._keep(bus, source, (group, made[1]), [(known, made[0], made[2])])
                for heard in self._heard.values():  # its announcements and its packets
                    same = heard.identifier & 0xFFFF == identifier & 0xFFFF  # sender and receiver
                    if same and heard.bus == bus and is_transport(heard.identifier):
                        heard.wholes += 1

    def _keep(self, bus: str, source: int | None, origin: object, wholes: Sequence[Whole]) -> None:
        """Decode whole messages, all of a name at once."""
        by_name: dict[str, list[Whole]] = {}
        for whole in wholes:
            by_name.setdefault(whole[0].message.name, []).append(whole)
        for rows in by_name.values():
            widest = max(len(data) for *_, data in rows)
            padded = b"".join(data.ljust(widest, b"\0") for *_, data in rows)
            self._stream(bus, rows[0][0], source).add(
                origin,
                np.array([time for _, time, _ in rows], np.int64),
                np.frombuffer(padded, np.uint8).reshape(-1, widest),
                np.array([len(data) for *_, data in rows], np.int64),
            )

    def _stream(self, bus: str, known: Known, source: int | None) -> CanStream:
        """Where a message of a sender on a bus goes."""
        place = bus, known.message.name, source
        if place not in self._streams:
            names = _names(known.message.name, bus, source)
            self._streams[place] = CanStream(known, names, source, self.profile)
        return self._streams[place]

    def _of(self, bus: str, identifier: int) -> _Heard:
        key = bus, identifier
        if key not in self._heard:
            heard = _Heard(bus, identifier)
            found = self.messages.find(bus, identifier)
            if found is None and self.loose:
                found = self.messages.find(bus, identifier & ~EXTENDED)
            if found is not None:
                known, source = found
                heard.packets = packets_of(known)
                if heard.packets is None:
                    heard.stream = self._stream(bus, known, source)
            else:
                heard.answers = answers_of(identifier)
            self._heard[key] = heard
        return self._heard[key]

    @property
    def heard(self) -> bool:
        """Whether there was any frame."""
        return bool(self._heard)

    def recording(self) -> Recording:
        """What was decoded, and notes on coverage. Raises LogReadError when nothing was."""
        if not self._heard:
            raise LogReadError(f"{self.file}: holds no CAN frame; cut short or empty")
        found = [*self._decoded(), *self._answered()]
        heard = sorted(self._heard.values(), key=lambda h: (h.identifier, h.bus))
        unknown = [h for h in heard if not h.is_known]
        several = len({h.bus for h in heard}) > 1
        said = [f"{h.shown} ({h.count}{f' on {h.bus}' if several else ''})" for h in unknown]
        if not found:
            shown = ", ".join(said[:SHOWN]) + (", ..." if len(said) > SHOWN else "")
            none = "the DBC knows none of its identifiers"
            what = none if self.known else "raw CAN needs --dbc FILE"
            raise LogReadError(f"{self.file}: nothing decoded: {what} (seen: {shown})")
        decoded = ", ".join(dict.fromkeys(frame.name for frame in found))
        ids = f"{len(heard)} identifiers, {len(heard) - len(unknown)} decoded: {decoded}"
        need = "" if self.known else ", which need a database, --dbc FILE"
        remarks = {f"unknown identifiers (frames){need}": said, **self._remarks(heard)}
        notes = [f"{self.file}: CAN: {ids}"]
        notes += [f"{self.file}: CAN: {what}: {', '.join(n)}" for what, n in remarks.items() if n]
        return Recording(tuple(found), tuple(self._losses(heard)), tuple(notes))

    def _decoded(self) -> list[Frame]:
        """A frame for each message of each sender; bus and sender in its name where several."""
        buses = {bus for bus, _, _ in self._streams} | {
            h.bus for h in self._heard.values() if h.answers and h.answers.any
        }
        found = []
        for (bus, name, source), stream in self._streams.items():
            senders = {s for b, n, s in self._streams if (b, n) == (bus, name)}
            shown = name if len(senders) == 1 or source is None else f"{name}@0x{source:02X}"
            shown = f"{bus}.{shown}" if len(buses) > 1 and bus else shown
            time, columns = stream.ordered()
            also = stream.names - {shown}
            found.append(Frame(shown, self.file, time, columns, stream.units, also=also))
        return found

    def _answered(self) -> list[Frame]:
        """A frame for each parameter; the first of several answering devices has the plain name."""
        found: dict[str, list[Frame]] = {}
        for heard in sorted(self._heard.values(), key=lambda h: (h.bus, h.identifier)):
            for name, (time, values) in (heard.answers.columns() if heard.answers else {}).items():
                also = _names(obd.FRAME, heard.bus, None)
                full = f"{obd.FRAME}@{heard.shown}"
                shown = full if name in found else obd.FRAME
                also = frozenset({full}) if name in found else also | {full}
                units = {name: obd.UNITS[name]}
                frame = Frame(shown, self.file, time, {name: values}, units, also=also - {shown})
                found.setdefault(name, []).append(frame)
        return [frame for frames in found.values() for frame in frames]

    def _remarks(self, heard: Sequence[_Heard]) -> Mapping[str, list[str]]:
        """What is worth knowing of what was decoded."""
        streams = [s for s in self._streams.values() if len(s.time)]
        none = [
            f"{s.message.name}.{signal.name}: {text} ({count})"
            for s in streams
            for signal in s.signals
            for text, count in signal.none.items()
        ]
        short = [
            f"{s.message.name}: {count} frames of {size} bytes, the database says {s.length}"
            + (f" (without {', '.join(lost)})" if (lost := _beyond(s, size)) else "")
            for s in streams
            for size, count in sorted(s.short.items())
        ]
        rivals = [
            f"0x{identifier & ~EXTENDED:X} is {a.message.name} in {a.file} and {b.message.name} in "
            f"{b.file}, the first counts (--dbc BUS=FILE for a database of one bus)"
            for identifier, (a, b) in self.messages.rivals.items()
            if any(h.identifier == identifier for h in heard)
        ]
        answering = [h for h in heard if h.answers and h.answers.any]
        shared = [
            f"{obd.FRAME}.{name} by " + ", ".join(h.shown for h in by)
            for name in obd.UNITS
            if len(by := [h for h in answering if name in h.answers.columns()]) > 1  # type: ignore[union-attr]
        ]
        mended = {f"{one.file}: {one.mended}": None for one in self.known if one.mended}
        return {
            "put right in the database": list(mended),
            "multiplexed": [s.message.name for s in streams if s.message.is_multiplexed()],
            "never valid": [
                f"{s.message.name}.{signal.name} ({why})"
                for s in streams
                for signal in s.signals
                if (why := signal.idle())
            ],
            "outside of its message": [f"{s.message.name}.{n}" for s in streams for n in s.outside],
            "no value (frames)": none,
            "shorter than said": short,
            "on several buses, kept apart": _shared(heard),
            "of several senders, kept apart": self._senders(),
            "answered by several devices, the first taken": shared,
            "in two databases": rivals,
            "no such bus in the trace": self.messages.missing([h.bus for h in heard]),
        }

    def _senders(self) -> list[str]:
        found: dict[tuple[str, str], list[str]] = {}
        for (bus, name, source), stream in sorted(self._streams.items(), key=lambda s: str(s[0])):
            if source is not None:
                found.setdefault((bus, name), []).append(f"0x{source:02X} ({len(stream.time)})")
        return [f"{name} by {', '.join(by)}" for (_, name), by in found.items() if len(by) > 1]

    def _losses(self, heard: Sequence[_Heard]) -> Iterable[str]:
        for stream in self._streams.values():
            for signal in stream.signals:
                wanted = self.profile is not None and signal.name in stream.columns
                if wanted and signal.cut:
                    yield (
                        f"{self.file}: {stream.message.name}.{signal.name}: {signal.cut} frames "
                        f"cut short before it"
                    )
        broken: Counter[str] = Counter()
        for one in heard:
            if one.answers is not None and one.answers.broken:
                broken[f"{one.shown}: %d OBD-II answers of several frames"] += one.answers.broken
            if one.packets is not None and one.packets.broken:
                broken[f"{one.shown}: %d messages of several parts"] += one.packets.broken
        long = sum(transport.broken for transport in self._transports.values())
        broken |= {"J1939: %d messages of several frames": long} if long else {}
        for what, count in broken.items():
            yield f"{self.file}: {what % count} are not whole"


def _names(message: str, bus: str, source: int | None) -> frozenset[str]:
    """All names of a message: with and without its sender and its bus."""
    own = {message} if source is None else {message, f"{message}@0x{source:02X}"}
    return frozenset(own | {f"{bus}.{name}" for name in own if bus})


def _beyond(stream: CanStream, size: int) -> list[str]:
    """Signals that frames of this many bytes do not hold."""
    return [signal.name for signal in stream.signals if signal.end > size]


def _shared(heard: Sequence[_Heard]) -> list[str]:
    """Known identifiers that several buses carry."""
    found: dict[int, list[_Heard]] = {}
    for one in heard:
        if one.stream is not None:
            found.setdefault(one.identifier, []).append(one)
    return [
        f"{by[0].stream.message.name} ({by[0].shown}) comes on "  # type: ignore[union-attr]
        + " and ".join(f"{h.bus} ({h.count})" for h in by)
        for by in found.values()
        if len(by) > 1
    ]
