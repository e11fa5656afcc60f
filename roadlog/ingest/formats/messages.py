"""Topics of messages as frames, whatever container they come from: fields and clocks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from roadlog import stamps
from roadlog.errors import LogReadError
from roadlog.ingest import kinds
from roadlog.ingest.formats import can, can_messages, message_clocks
from roadlog.ingest.formats.derived import named
from roadlog.ingest.formats.message_clocks import Stamped
from roadlog.ingest.frame import Frame, Recording, absent, unread
from roadlog.ingest.profile import Clock, Profile
from roadlog.storage import Channel, Table
from roadlog.types import Bools, Floats

FIRST = 2_000_000_000  # ns of each topic that are looked at for its fields


class MessageReader(Protocol):
    """A container of messages: `storage.LogReader`, or a bag."""

    losses: list[str]
    start_ns: int | None

    @property
    def has_publish(self) -> bool: ...  # a time beside that of recording
    @property
    def channels(self) -> tuple[Channel, ...]: ...
    def read(
        self,
        topics: Iterable[str],
        *,
        fields: Mapping[str, Sequence[str]] | None = None,
        end_ns: int | None = None,
        clock: str = "log",
        ordered: bool = True,
    ) -> dict[str, Table]: ...
    def units(self, topic: str) -> Mapping[str, str]: ...
    def texts(self, topic: str) -> Mapping[str, str]: ...


@dataclass
class Topic:
    """A topic of one or several parts of a recording.

    fields: paths of its numbers. unread: sentences on those that are in no column.
    """

    name: str
    kind: str
    readers: list[MessageReader] = field(default_factory=list)
    fields: dict[str, None] = field(default_factory=dict)
    unread: dict[str, None] = field(default_factory=dict)


def kind(name: str) -> str:
    """`sensor_msgs/Imu` of `sensor_msgs/msg/Imu`: ROS 1, ROS 2 and IDL name the same message."""
    return name.replace("::", "/").replace("/msg/", "/")


def topics(readers: Sequence[MessageReader]) -> dict[str, Topic]:
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
            topic.unread |= dict.fromkeys([first[name].unread] if first[name].unread else [])
            topic.fields |= dict.fromkeys(f for f, c in columns if c.dtype.kind in "bifu")
            topic.kind = topic.kind or kinds.by_fields(topic.fields)
    return result


def names(readers: Sequence[MessageReader], dbc: Sequence[Path] = ()) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every numeric field, and the signals of a database."""
    found = {
        name
        for topic in topics(readers).values()
        for path in topic.fields
        for name in (f"{topic.kind}.{path}", f"{topic.name}.{path}")
    }
    return found | (can.names(can.load(dbc)) if dbc else set())


def recording(
    readers: Sequence[MessageReader], profile: Profile, label: str, dbc: Sequence[Path] = ()
) -> Recording:
    """Fields that the profile reads, one frame a topic; of the others only the names.

    Time is the clock that the profile chooses: log, publish, or header for a message's own stamp;
    a topic that does not have that one keeps the time of recording, which is said. label: the
    name of the source. dbc: databases for topics of CAN frames. Raises LogReadError.
    """
    read = _Read(profile, label, can.Decoder(can.load(dbc), label, profile) if dbc else None)
    there = topics(readers).values()
    for topic in there:
        read.add(topic)
    frames, losses, notes = read.finish()
    losses += [f"{label}: {loss}" for loss in dict.fromkeys(x for r in readers for x in r.losses)]
    if not frames:
        raise LogReadError("; ".join([f"{label}: holds no message with numbers", *losses]))
    unread = tuple(f"{label}: {text}" for topic in there for text in topic.unread)
    return Recording(tuple(frames), tuple(losses), tuple(notes), unread)


@dataclass
class _Read:
    """Topics on their way to frames. stamped: times of each topic. can: frames of buses."""

    profile: Profile
    label: str
    decoder: can.Decoder | None
    frames: list[Frame] = field(default_factory=list)
    stamped: dict[str, Stamped] = field(default_factory=dict)
    can: dict[str, dict[str, NDArray]] = field(default_factory=dict)

    def add(self, topic: Topic) -> None:
        """Read a topic, as far as the profile wants it."""
        if self.decoder and can_messages.is_can(topic.kind):
            table, found = self._timed(topic, can_messages.FIELDS)
            self.can[topic.name] = {n: _rows(c, found.keep) for n, c in table.columns.items()}
            self.stamped[topic.name] = found
            return
        more = named(self.profile.names, (topic.name, topic.kind), topic.fields)
        wanted = [f for f in topic.fields if self.profile.reads(f, topic.name, topic.kind)]
        if not wanted and not more:
            self.frames.append(unread(topic.name, self.label, topic.fields, topic.kind))
            return
        inner = {name for made in more.values() for name in made.fields}
        table, found = self._timed(topic, [*wanted, *inner])
        read = {name: column for name, column in table.columns.items() if name in wanted}
        found = message_clocks.without_false(found, read, lambda: self._cure(topic, found))
        columns: dict[str, NDArray] = {
            f: _rows(table.columns[f], found.keep) if f in wanted else absent(len(found.time))
            for f in topic.fields
        }
        columns |= {n: _rows(made.of(table.columns), found.keep) for n, made in more.items()}
        units = dict(topic.readers[0].units(topic.name))
        frame = Frame(topic.name, self.label, found.time, columns, units, topic.kind)
        self.frames.append(replace(frame, frame_id=_frame_id(topic)))
        self.stamped[topic.name] = found

    def _timed(self, topic: Topic, fields: Iterable[str]) -> tuple[Table, Stamped]:
        """The fields of a topic and the times of its messages."""
        clock = self.profile.clock
        stamp = message_clocks.fields_of(clock, list(topic.fields))
        table = _read(topic, list(dict.fromkeys([*fields, *stamp])), clock)
        is_publish = clock.clock == "publish" and not clock.column
        if is_publish and not all(reader.has_publish for reader in topic.readers):
            return table, Stamped(table.time, np.ones(len(table), np.bool_), own=False)
        recorded = _read(topic, [], Clock()).time if is_publish else table.time
        return table, message_clocks.stamped(table, recorded, clock, stamp)

    def _cure(self, topic: Topic, found: Stamped) -> str:
        """What to do where the clock of a topic is wrong."""
        header = message_clocks.header(topic.fields)
        if self.profile.clock.is_own and found.own:
            return message_clocks.KEEPS
        if header and not self.profile.clock.is_own:
            clock = Clock(clock="header")
            if message_clocks.stamped(_read(topic, header, clock), found.time, clock, header).own:
                return "--clock header keeps them"
        return "cut the log there"

    def finish(self) -> tuple[list[Frame], list[str], list[str]]:
        """Frames, losses and notes."""
        clocks = message_clocks.on_recording(self.stamped)
        frames = [
            replace(f, time=clocks[f.name].time) if f.name in clocks else f for f in self.frames
        ]
        losses = [f"{topic}: {loss}" for topic, own in clocks.items() for loss in own.losses]
        notes = [f"{topic}: {note}" for topic, own in clocks.items() for note in own.notes]
        losses += [loss] if (loss := message_clocks.mixed(clocks)) else []
        frames, strays = _without_strays(frames, clocks)
        losses += strays
        decoded = None
        if self.decoder and self.can:
            for topic, rows in self.can.items():
                self.decoder.add(can_messages.frames(clocks[topic].time, rows, topic))
            decoded = self.decoder.recording() if self.decoder.heard else None
        if decoded is not None:
            frames += decoded.frames
        found = [[f"{self.label}: {text}" for text in texts] for texts in (losses, notes)]
        if decoded is not None:
            found[0] += decoded.losses
            found[1] += decoded.notes
        return frames, found[0], found[1]


def _frame_id(topic: Topic) -> str:
    """The coordinate frame that its messages name: of what moves, where they name two."""
    texts = topic.readers[0].texts(topic.name)
    names = ("child_frame_id", "body_frame_id", "header.frame_id", "frame_id")
    return next((texts[name] for name in names if texts.get(name)), "")


def _rows(column: NDArray, keep: Bools) -> NDArray:
    return column if keep.all() else column[keep]


def _read(topic: Topic, fields: Sequence[str], clock: Clock) -> Table:
    """One table of all parts, in the order of recording."""
    which = clock.clock if clock.clock == "publish" else "log"
    parts = [
        reader.read([topic.name], fields={topic.name: fields}, clock=which, ordered=False)[
            topic.name
        ]
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


def _without_strays(
    frames: Sequence[Frame], clocks: Mapping[str, Stamped]
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
