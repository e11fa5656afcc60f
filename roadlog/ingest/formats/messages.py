"""Topics of messages as frames, whatever container they come from: fields and clocks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from roadlog import stamps
from roadlog.errors import LogReadError
from roadlog.ingest.formats import can, can_messages, times
from roadlog.ingest.formats.derived import Derived, derived
from roadlog.ingest.frame import Frame, Recording, absent, unread
from roadlog.ingest.profile import Clock, Profile
from roadlog.storage import Channel, Table
from roadlog.types import Bools, Floats, Stamps

FIRST = 2_000_000_000  # ns of each topic that are looked at for its fields
APART = 0.05  # s; clocks that differ by more are not one
OTHER_EPOCH = 86400.0  # s; a device's clock that is further off counts from another moment
# seconds and nanoseconds of a message's own stamp, as ROS, protobuf and JSON spell them
HEADERS = [
    (f"{stamp}.{second}", f"{stamp}.{rest}")
    for stamp in ("header.stamp", "timestamp", "stamp", "header.timestamp", "fixes.0.timestamp")
    for second, rest in (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"))
] + [(f"{stamp}.seconds", f"{stamp}.nanos") for stamp in ("timestamp", "header.timestamp", "stamp")]


class Reader(Protocol):
    """A container of messages: `storage.LogReader`, or a bag."""

    losses: list[str]
    start_ns: int | None

    @property
    def channels(self) -> tuple[Channel, ...]: ...
    def read(
        self,
        topics: Iterable[str],
        *,
        fields: Mapping[str, Sequence[str]] | None = None,
        end_ns: int | None = None,
        clock: str = "log",
    ) -> dict[str, Table]: ...
    def units(self, topic: str) -> Mapping[str, str]: ...
    def texts(self, topic: str) -> Mapping[str, str]: ...


@dataclass
class Topic:
    """A topic of one or several parts of a recording. fields: paths of its numbers."""

    name: str
    kind: str
    readers: list[Reader] = field(default_factory=list)
    fields: dict[str, None] = field(default_factory=dict)


def kind(name: str) -> str:
    """`sensor_msgs/Imu` of `sensor_msgs/msg/Imu`: ROS 1, ROS 2 and IDL name the same message."""
    return name.replace("::", "/").replace("/msg/", "/")


def topics(readers: Sequence[Reader]) -> dict[str, Topic]:
    """Topic -> what it is, with the fields that its first messages have."""
    result: dict[str, Topic] = {}
    for reader in readers:
        there = {channel.topic: channel for channel in reader.channels if channel.count}
        if not there or reader.start_ns is None:
            continue
        first = reader.read(there, end_ns=reader.start_ns + FIRST)
        late = [topic for topic in there if not len(first[topic])]
        if late:  # a topic that starts later than the log
            first |= reader.read(late)
        for name, channel in there.items():
            topic = result.setdefault(name, Topic(name, kind(first[name].schema or channel.schema)))
            topic.readers.append(reader)
            columns = first[name].columns.items()
            topic.fields |= dict.fromkeys(f for f, c in columns if c.dtype.kind in "bifu")
    return result


def names(readers: Sequence[Reader], dbc: Sequence[Path] = ()) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every numeric field, and the signals of a database."""
    found = {
        name
        for topic in topics(readers).values()
        for path in topic.fields
        for name in (f"{topic.kind}.{path}", f"{topic.name}.{path}")
    }
    return found | (can.names(can.load(dbc)) if dbc else set())


def recording(
    readers: Sequence[Reader], profile: Profile, label: str, dbc: Sequence[Path] = ()
) -> Recording:
    """Fields that the profile reads, one frame a topic; of the others only the names.

    Time is the clock that the profile chooses: log, publish, or header for a message's own stamp;
    a topic that does not have that one keeps the time of recording, which is said. label: the
    name of the source. dbc: databases for topics of CAN frames. Raises LogReadError.
    """
    frames: list[Frame] = []
    losses: list[str] = []
    notes: list[str] = []
    clocks: dict[str, _Stamped] = {}
    decoder = can.Decoder(can.load(dbc), label, profile) if dbc else None
    for topic in topics(readers).values():
        if decoder and can_messages.is_can(topic.kind):
            stamp = _stamp(profile.clock, topic.fields)
            table = _read(topic, [*can_messages.FIELDS, *stamp], profile.clock)
            stamped = _stamped(table, profile.clock, stamp)
            rows = {name: _rows(column, stamped.keep) for name, column in table.columns.items()}
            decoder.add(can_messages.frames(stamped.time, rows, topic.name))
            continue
        more = _derived(profile, topic)
        wanted = [f for f in topic.fields if profile.reads(f, topic.name, topic.kind)]
        if not wanted and not more:
            frames.append(unread(topic.name, label, topic.fields, topic.kind))
            continue
        inner = {name for made in more.values() for name in made.fields}
        stamp = _stamp(profile.clock, topic.fields)
        table = _read(topic, list(dict.fromkeys([*wanted, *inner, *stamp])), profile.clock)
        stamped = clocks[topic.name] = _stamped(table, profile.clock, stamp)
        if lost := len(table) - len(stamped.time):
            losses.append(f"{label}: {topic.name}: {lost} messages without a time left out")
        columns: dict[str, NDArray] = {
            f: _rows(table.columns[f], stamped.keep) if f in wanted else absent(len(stamped.time))
            for f in topic.fields
        }
        columns |= {n: _rows(made.of(table.columns), stamped.keep) for n, made in more.items()}
        units = dict(topic.readers[0].units(topic.name))
        own = Frame(topic.name, label, stamped.time, columns, units, topic.kind)
        frames.append(replace(own, frame_id=_frame_id(topic)))
    if decoder and decoder.heard:
        decoded = decoder.recording()
        frames += decoded.frames
        losses += decoded.losses
        notes += decoded.notes
    losses += _mixed(clocks, label)
    notes += [f"{label}: {topic}: {c.note}" for topic, c in clocks.items() if c.note]
    frames, strays = _without_strays(frames, clocks)
    losses += [f"{label}: {stray}" for stray in strays]
    losses += [f"{label}: {loss}" for loss in dict.fromkeys(x for r in readers for x in r.losses)]
    if not frames:
        raise LogReadError("; ".join([f"{label}: holds no message with numbers", *losses]))
    return Recording(tuple(frames), tuple(losses), tuple(notes))


def _derived(profile: Profile, topic: Topic) -> dict[str, Derived]:
    """Columns that the profile names beside the topic's own fields."""
    found = {}
    for full in profile.names:
        for prefix in (f"{topic.name}.", f"{topic.kind}.", ""):
            name = full[len(prefix) :]
            if full.startswith(prefix) and name not in topic.fields:
                made = derived(name, topic.fields)
                if made is not None:
                    found[name] = made
    return found


def _frame_id(topic: Topic) -> str:
    """The coordinate frame that its messages name: of what moves, where they name two."""
    texts = topic.readers[0].texts(topic.name)
    names = ("child_frame_id", "body_frame_id", "header.frame_id", "frame_id")
    return next((texts[name] for name in names if texts.get(name)), "")


def _rows(column: NDArray, keep: Bools) -> NDArray:
    return column if keep.all() else column[keep]


def _read(topic: Topic, fields: Sequence[str], clock: Clock) -> Table:
    """One table of all parts, in the order of the parts."""
    which = clock.clock if clock.clock == "publish" else "log"
    parts = [
        reader.read([topic.name], fields={topic.name: fields}, clock=which)[topic.name]
        for reader in topic.readers
    ]
    if len(parts) == 1:
        part = parts[0]
        lacking = {name: absent(len(part)) for name in fields if name not in part.columns}
        return Table(part.topic, part.schema, part.time, {**part.columns, **lacking})
    columns = {
        name: np.concatenate([part.columns.get(name, absent(len(part))) for part in parts])
        for name in fields
    }
    time = np.concatenate([part.time for part in parts])
    return Table(topic.name, parts[0].schema, time, columns)


@dataclass(frozen=True)
class _Stamped:
    """The times of a topic's messages.

    time: ns of those that have one. keep: which these are. own: whether it is the clock that was
    asked for. late: s by which the recording is later, in the median; NaN for other clocks.
    """

    time: Stamps
    keep: Bools
    own: bool
    late: float
    note: str = ""


def _stamp(clock: Clock, fields: Iterable[str]) -> list[str]:
    """The fields that hold a message's own time, where the profile wants it."""
    if clock.column:
        return [clock.column] if clock.column in fields else []
    if clock.clock != "header":
        return []
    return next((list(pair) for pair in HEADERS if set(pair) <= set(fields)), [])


def _stamped(table: Table, clock: Clock, stamp: Sequence[str]) -> _Stamped:
    whole = np.ones(len(table), np.bool_)
    wants_own = bool(clock.column) or clock.clock == "header"
    if not stamp or not len(table):
        return _Stamped(table.time, whole, not wants_own, np.nan)
    time, keep = _own_time(table, clock, stamp)
    if not keep.any():  # nobody filled the stamps in
        return _Stamped(table.time, whole, False, np.nan)
    late = float(np.median(table.time[keep] - time)) * 1e-9
    note = ""
    if clock.column and abs(late) > OTHER_EPOCH:
        time, late = time + np.int64(round(late * 1e9)), 0.0
        note = f"{clock.column} counts from another moment; it is put on the clock of recording"
    return _Stamped(time, keep, True, late, note)


def _own_time(table: Table, clock: Clock, stamp: Sequence[str]) -> tuple[Stamps, Bools]:
    """ns of the messages that hold a stamp, and which these are; 0 is none."""
    values = [table.columns[name] for name in stamp]
    if len(values) == 1:
        return times.stamps(values[0], clock.unit, f"{table.topic}: {stamp[0]}")
    known = values[0] != 0
    (second, keep), (rest, also) = (
        times.from_numbers(column, unit) for column, unit in zip(values, ("s", "ns"), strict=True)
    )
    whole: Bools = keep & also & known
    return second[whole[keep]] + rest[whole[also]], whole


def _mixed(clocks: Mapping[str, _Stamped], label: str) -> Iterator[str]:
    """A sentence where some topics have the wanted clock and others have not."""
    own = {topic: found for topic, found in clocks.items() if found.own}
    others = sorted(clocks.keys() - own.keys())
    if not others:
        return
    plural = "their messages have" if len(others) > 1 else "its messages have"
    loss = f"{label}: {', '.join(others)}: {plural} no such stamp, the time of recording is used"
    if own:
        late = max(own.items(), key=lambda item: abs(item[1].late))
        if abs(late[1].late) <= APART:
            return
        loss += (
            f"; two clocks are mixed: on {late[0]} it is {late[1].late:+.3f} s later than the "
            f'message\'s own; if they lag as much, delay = "{late[1].late:.3f} s" makes up for it'
        )
    yield loss


def _without_strays(
    frames: Sequence[Frame], clocks: Mapping[str, _Stamped]
) -> tuple[list[Frame], list[str]]:
    """Frames without single messages of a wrong time, and sentences on these."""
    span = stamps.main_span({f.name: f.time for f in frames if f.name in clocks})
    if span is None:
        return list(frames), []
    result, said = [], []
    for frame in frames:
        keep = span.holds(frame.time)
        if frame.name not in clocks or keep.all():
            result.append(frame)
            continue
        said.append(f"{frame.name}: {stamps.said(frame.time, span)}")
        columns: dict[str, NDArray | Floats] = {n: _rows(c, keep) for n, c in frame.columns.items()}
        time = frame.time[keep]
        result.append(replace(frame, time=time, columns=columns))
    return result, said
