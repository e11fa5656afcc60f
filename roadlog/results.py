"""What goes into a log with estimates: their channels, the truth where it is not there yet."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from roadlog.estimate import Estimate
from roadlog.for_viewers import beside, is_for_viewers, with_viewers
from roadlog.memory import trim
from roadlog.signals import TRUTH_PREFIX, TRUTH_TOPIC, split_estimate_topic
from roadlog.storage import LogReader, Table

if TYPE_CHECKING:
    from roadlog.checks import Finding

IN_PLACE = "in place"  # the profile record of an MCAP whose own topics it explains


def is_result(topic: str) -> bool:
    """Whether it is a topic of an estimate."""
    return split_estimate_topic(topic) is not None


def is_made(topic: str) -> bool:
    """Whether estimating makes it: a log that differs in these only is the same drive."""
    return is_result(topic) or (is_truth(topic) and topic != TRUTH_TOPIC)


def is_truth(topic: str) -> bool:
    """Whether it is the true angles, or what other viewers draw of them."""
    return topic == TRUTH_TOPIC or (topic.startswith(TRUTH_PREFIX) and is_for_viewers(topic))


def tables(
    there: Sequence[LogReader],
    truth: Table | None,
    estimates: Iterable[Estimate],
    records: dict[str, dict[str, str]],
    faults: Sequence[Finding],
    *,
    as_ros2: bool,
) -> Iterator[Table]:
    """Every channel, one estimate in memory at a time; the record of each goes into `records`.

    there: the log, once it is open to be written to. truth: by its profile.
    """
    yield from _truth(there[-1], truth, as_ros2=as_ros2)
    for estimate in estimates:
        checked = {"checks": "\n".join(map(str, faults))}
        records[f"estimate/{estimate.name}"] = estimate.record() | checked
        yield from with_viewers(estimate.tables(), as_ros2)
        del estimate
        trim()


def _truth(reader: LogReader, mapped: Table | None, *, as_ros2: bool) -> Iterator[Table]:
    """The truth that a profile makes, for a bag; or what lacks beside a truth that is there."""
    if mapped is not None and as_ros2:
        yield from with_viewers([mapped], as_ros2)
        return
    there = {channel.topic for channel in reader.channels if is_truth(channel.topic)}
    if there == {TRUTH_TOPIC}:
        yield from beside(reader.read(there)[TRUTH_TOPIC], as_ros2)
