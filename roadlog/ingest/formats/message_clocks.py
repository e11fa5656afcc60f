"""The time of each message of a topic: of recording, of publishing, or its own; and false stamps.

A stamp is false where it is far from the recording beside its neighbors, where it runs backward by
more than any buffer delays, or where it repeats the one before. Such rows are left out and said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from roadlog import stamps
from roadlog.ingest.formats import times
from roadlog.ingest.profile import Clock
from roadlog.storage import Table
from roadlog.types import Bools, Stamps

APART = 0.05  # s; clocks that differ by more are not one
FAR = 60.0  # s from the recording; no message is on its way for longer, its clock is another one
NS = 10**9
KEEPS = "--clock log keeps them"  # the cure for a clock that is not the recording's
# seconds and nanoseconds of a message's own stamp, as ROS, protobuf and JSON spell them
HEADERS = [
    (f"{stamp}.{second}", f"{stamp}.{rest}")
    for stamp in ("header.stamp", "timestamp", "stamp", "header.timestamp", "fixes.0.timestamp")
    for second, rest in (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs"))
] + [(f"{stamp}.seconds", f"{stamp}.nanos") for stamp in ("timestamp", "header.timestamp", "stamp")]


@dataclass(frozen=True)
class Stamped:
    """The times of a topic's messages.

    time: ns of those that count, in the order of recording. keep: which these are. own: whether it
    is the clock that was asked for. late: s by which the recording is later, in the median; NaN for
    the clock of recording. losses, notes: sentences without the topic.
    """

    time: Stamps
    keep: Bools
    own: bool = True
    late: float = np.nan
    losses: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def header(fields: Iterable[str]) -> list[str]:
    """The fields that hold a message's own stamp; empty for none."""
    there = set(fields)
    return next((list(pair) for pair in HEADERS if set(pair) <= there), [])


def fields_of(clock: Clock, fields: Sequence[str]) -> list[str]:
    """The fields that hold the time that a profile wants; empty for another clock."""
    if clock.column:
        return [clock.column] if clock.column in fields else []
    return header(fields) if clock.clock == "header" else []


def stamped(table: Table, recorded: Stamps, clock: Clock, fields: Sequence[str]) -> Stamped:
    """Messages in the order of recording, on the clock of a profile where they have it.

    recorded: their times of recording. fields: of `fields_of`.
    """
    wants_own = bool(clock.column) or clock.clock == "header"
    whole = np.ones(len(table), np.bool_)
    by_recording = Stamped(recorded, whole, not wants_own)
    if not len(table) or (clock.clock == "log" and not clock.column):
        return by_recording
    time, keep = (table.time, whole)
    if wants_own:
        if not fields:
            return by_recording
        time, keep = _own(table, clock, fields)
    if not keep.any():  # nobody filled the stamps in
        return by_recording
    losses = [f"{lost} messages without a time left out"] if (lost := int((~keep).sum())) else []
    late = recorded[keep] - time
    middle = int(np.median(late))
    found = Stamped(time, keep, True, middle / NS)
    far = np.abs(late - middle) > FAR * NS
    if far.any():  # what lies among the others was recorded at a false time
        first, last = time[~far].min() - FAR * NS, time[~far].max() + FAR * NS
        far &= (time < first) | (time > last)
    if far.any():
        date = stamps.date(int(time[far][0]))
        count = stamps.counted(int(far.sum()))
        losses.append(f"{count} stamped {date}, far from the recording, left out; {KEEPS}")
        found = _only(found, ~far)
    return replace(found, losses=tuple(losses))


def without_false(
    found: Stamped, columns: Mapping[str, np.ndarray], cure: Callable[[], str]
) -> Stamped:
    """Without the rows that run backward or repeat a stamp.

    columns: of all messages; a row that says the same again is no loss. cure: what to do else.
    """
    backward = stamps.backward(found.time)
    losses, notes = list(found.losses), list(found.notes)
    if backward.any():
        steps = np.diff(found.time)
        count, by = stamps.counted(int(backward.sum())), -int(steps.min()) / NS
        at = stamps.date(int(found.time[backward][0]))
        losses.append(
            f"{count} at {at} left out, the clock runs backward there by {by:.1f} s; {cure()}"
        )
        found = _only(found, ~backward)
    first, back = np.unique(found.time, return_index=True, return_inverse=True)[1:]
    if len(first) < len(found.time):
        again = np.ones(len(found.time), np.bool_)
        again[first] = False
        rows = np.flatnonzero(found.keep)
        same = _alike(columns, rows[again], rows[first[back[again]]])
        count, at = stamps.counted(int(again.sum())), stamps.date(int(found.time[again][0]))
        if same:
            notes.append(f"{count} repeat the one before, stamp and values (first at {at})")
        else:
            text = (
                f"{count} left out that repeat a stamp with other values (first at {at}); {cure()}"
            )
            losses.append(text)
        found = _only(found, ~again)
    return replace(found, losses=tuple(losses), notes=tuple(notes))


def on_recording(found: Mapping[str, Stamped]) -> dict[str, Stamped]:
    """The same, clocks that count from another moment put on the clock of recording.

    By one offset where they agree: what they know of each other is better than what the recording
    knows of them.
    """
    far = {topic: own.late for topic, own in found.items() if abs(own.late) > FAR}
    common = float(np.median(list(far.values()))) if far else 0.0
    result = dict(found)
    for topic, late in far.items():
        offset = common if abs(late - common) < 1.0 else late
        own = found[topic]
        said = (
            f"its stamps count from another moment, {offset:.1f} s before the recording; they are"
        )
        result[topic] = replace(
            own,
            time=own.time + np.int64(round(offset * NS)),
            late=late - offset,
            notes=(*own.notes, f"{said} put on its clock"),
        )
    return result


def mixed(found: Mapping[str, Stamped]) -> str:
    """A sentence where some topics have the wanted clock and others have not; else empty."""
    own = {topic: stamped for topic, stamped in found.items() if stamped.own}
    others = sorted(found.keys() - own.keys())
    late = max((s.late for s in own.values()), key=abs, default=0.0)
    if not others or (own and not abs(late) > APART):
        return ""
    plural = "their messages have" if len(others) > 1 else "its messages have"
    loss = f"{', '.join(others)}: {plural} no such stamp, the time of recording is used"
    if own:
        where = next(topic for topic, stamped in own.items() if stamped.late == late)
        loss += (
            f"; two clocks are mixed: on {where} it is {late:+.3f} s later than the message's own; "
            f'if they lag as much, delay = "{late:.3f} s" makes up for it'
        )
    return loss


def _own(table: Table, clock: Clock, fields: Sequence[str]) -> tuple[Stamps, Bools]:
    """ns of the messages that hold a stamp, and which these are; 0 is none."""
    values = [table.columns[name] for name in fields]
    if len(values) == 1:
        return times.stamps(values[0], clock.unit, f"{table.topic}: {fields[0]}")
    known = values[0] != 0
    (second, keep), (rest, also) = (
        times.from_numbers(column, unit) for column, unit in zip(values, ("s", "ns"), strict=True)
    )
    whole: Bools = keep & also & known
    return second[whole[keep]] + rest[whole[also]], whole


def _only(found: Stamped, rows: Bools) -> Stamped:
    """Without some of the rows that are kept."""
    keep = found.keep.copy()
    keep[np.flatnonzero(found.keep)[~rows]] = False
    return replace(found, time=found.time[rows], keep=keep)


def _alike(columns: Mapping[str, np.ndarray], rows: np.ndarray, others: np.ndarray) -> bool:
    """Whether rows hold the same numbers as others."""
    return all(
        np.array_equal(values[rows], values[others], equal_nan=values.dtype.kind == "f")
        for values in columns.values()
        if values.dtype.kind in "bifu"
    )
