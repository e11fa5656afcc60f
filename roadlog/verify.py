"""An independent witness: a log read a second time with the `mcap` library, value by value."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError
from roadlog.storage import LogReader, Table

MOST_SAID = 20  # differences of one log
XCDR2 = 0x06  # the first representation of version 2: OMG DDS-XTYPES 1.3, table 60
_STEP = re.compile(r"\.?([^.\[\]]+)|\[(\w+)=([^\]]*)\]")  # of `joints.0.velocity[name=fl]`

_Step = str | tuple[str, str]


@dataclass(frozen=True)
class TopicWitness:
    """What both readers found on one topic. values: numbers alike; left_out: columns not read."""

    topic: str
    messages: int
    values: int
    left_out: tuple[str, ...]


@dataclass
class Witness:
    """Both readings of a log. differences: sentences, none where they agree."""

    log: str
    topics: list[TopicWitness] = field(default_factory=list)
    differences: list[str] = field(default_factory=list)


@dataclass
class _Theirs:
    """What the other library gave of a topic, in file order."""

    times: list[int] = field(default_factory=list)
    messages: list[Any] = field(default_factory=list)


def verify(path: Path) -> Witness:
    """Compare our reader with the `mcap` library and its decoders. Raises LogReadError."""
    found = Witness(str(path))
    with LogReader(path, recover=False) as reader:
        tables = reader.read()
        found.differences += [f"ours: {loss}" for loss in reader.losses]
    theirs = _their_reading(path, found)
    for topic in sorted(tables.keys() | theirs.keys()):
        ours, other = tables.get(topic), theirs.get(topic, _Theirs())
        if ours is None:
            found.differences.append(f"{topic}: only the mcap library has it")
            continue
        _compare(ours, other, found)
    del found.differences[MOST_SAID:]
    return found


def _their_reading(path: Path, found: Witness) -> dict[str, _Theirs]:
    from mcap.records import Channel, Message, Schema
    from mcap.stream_reader import StreamReader

    factories = list(_decoders())
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    decoders: dict[int, Any] = {}
    theirs: dict[str, _Theirs] = {}
    try:
        with path.open("rb") as file:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    channels[record.id] = record
                    theirs.setdefault(record.topic, _Theirs())
                elif isinstance(record, Message):
                    channel = channels[record.channel_id]
                    if channel.id not in decoders:
                        schema = schemas.get(channel.schema_id)
                        made = (f.decoder_for(channel.message_encoding, schema) for f in factories)
                        decoders[channel.id] = next((m for m in made if m is not None), None)
                    decode = decoders[channel.id]
                    theirs[channel.topic].times.append(record.log_time)
                    unread = channel.message_encoding == "cdr" and _is_xcdr2(record.data)
                    message = None if decode is None or unread else decode(record.data)
                    theirs[channel.topic].messages.append(message)
    except OSError as error:
        raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error
    except Exception as error:  # the library and its decoders raise what they like
        text = " ".join(str(error).split())
        found.differences.append(f"the mcap library stops: {type(error).__name__}: {text}")
    return theirs


def _is_xcdr2(message: bytes) -> bool:
    """Whether CDR is of version 2, which mcap-ros2-support 0.6.0 decodes by the rules of 1."""
    return len(message) > 1 and message[1] >= XCDR2


def _decoders() -> Iterator[Any]:
    """The decoders that are installed."""
    try:
        from mcap_protobuf.decoder import DecoderFactory as Protobuf

        yield Protobuf()
    except ImportError:
        pass
    try:
        from mcap_ros2.decoder import DecoderFactory as Ros2

        yield Ros2()
    except ImportError:
        pass


def _compare(ours: Table, theirs: _Theirs, found: Witness) -> None:
    order = np.argsort(np.array(theirs.times, np.int64), kind="stable")
    times = np.array(theirs.times, np.int64)[order]
    if len(ours) != len(times):
        found.differences.append(f"{ours.topic}: {len(ours)} messages, {len(times)} by mcap")
        return
    if (ours.time != times).any():
        found.differences.append(f"{ours.topic}: times differ")
        return
    messages = [theirs.messages[k] for k in order]
    values, left_out = 0, []
    for name, column in ours.columns.items():
        other = _column(messages, name)
        if other is None:
            left_out.append(name)
            continue
        wrong = np.flatnonzero(~_equal(np.asarray(column), other))
        values += len(other) - len(wrong)
        if len(wrong):
            k = int(wrong[0])
            found.differences.append(
                f"{ours.topic}: {name}: {len(wrong)} values differ, the first at {ours.time[k]} "
                f"ns: {float(column[k])}, by mcap {other[k]}"
            )
    found.topics.append(TopicWitness(ours.topic, len(ours), values, tuple(left_out)))


def _column(messages: list[Any], name: str) -> NDArray[np.float64] | None:
    """One number of every message, NaN where it has none; None where theirs is no number."""
    steps: list[_Step] = [(key, label) if key else word for word, key, label in _STEP.findall(name)]
    result = np.empty(len(messages))
    for k, message in enumerate(messages):
        number = _number(message, steps)
        if number is None:
            return None
        result[k] = number
    return result


def _number(message: Any, steps: list[_Step]) -> float | None:
    """NaN where a field is not set or a list is shorter; None for what is no number."""
    owner, value = None, message
    for step in steps:
        try:
            owner, value = value, _inside(owner, value, step)
        except (IndexError, StopIteration, _UnsetError):
            return np.nan
        except (AttributeError, KeyError, TypeError, ValueError):
            return None
    return value if isinstance(value, (int, float)) else None


def _inside(owner: Any, value: Any, step: _Step) -> Any:
    """A field, an element by its place, or one by its name, which it or a list beside it says."""
    if isinstance(step, tuple):
        key, label = step
        if hasattr(value[0], key):
            return next(element for element in value if getattr(element, key) == label)
        names = list(getattr(owner, key))
        if len(names) != len(value):
            raise _UnsetError
        return value[names.index(label)] if label in names else np.nan
    if step.isdigit():
        return value[int(step)]
    if _is_unset(value, step):
        raise _UnsetError
    return getattr(value, step)


class _UnsetError(Exception):
    """A message leaves a field out."""


def _is_unset(message: Any, name: str) -> bool:
    """Whether a message of protobuf leaves an optional field out."""
    try:
        return not message.HasField(name)
    except (AttributeError, ValueError):  # no protobuf, or a field that has no presence
        return False


def _equal(ours: NDArray, theirs: NDArray[np.float64]) -> NDArray[np.bool_]:
    own = ours.astype(np.float64)
    return (own == theirs) | (np.isnan(own) & np.isnan(theirs))
