"""Stamps that cannot be: single messages far from the time of all others."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import NamedTuple

import numpy as np

from roadlog.types import Bools, Stamps

HOUR = 3600 * 10**9  # ns; what lies this far from all the rest belongs to another recording
JUMP = 10**9  # ns; no buffer or network reorders messages by more
WEEK = 7 * 24  # hours; no drive is that long
STRAY = 0.01  # share of all messages, up to which another recording is none but a wrong clock


class Span(NamedTuple):
    """ns of the first and last message that counts."""

    start: int
    end: int

    def holds(self, time: Stamps) -> Bools:
        """Which stamps lie in it."""
        inside: Bools = (time >= self.start) & (time <= self.end)
        return inside


def backward(time: Stamps) -> Bools:
    """Which stamps, in the order of recording, run backward by more than `JUMP`.

    The most that go forward together stay; smaller steps back are a matter of order only.
    """
    false = np.zeros(len(time), np.bool_)
    if len(time) < 2 or not (np.diff(time) < -JUMP).any():
        return false
    before = np.maximum.accumulate(time)
    behind = np.minimum.accumulate(time[::-1])[::-1]
    doubted = np.flatnonzero((time < before - JUMP) | (time > behind + JUMP))
    ends: list[int] = []  # smallest last stamp of a forward series of each length
    last: list[int] = []  # its place among the doubted
    came: list[int] = []  # from where, for each of them
    for k, stamp in enumerate(time[doubted].tolist()):
        length = bisect_left(ends, stamp)
        came.append(last[length - 1] if length else -1)
        ends[length : length + 1] = [stamp]
        last[length : length + 1] = [k]
    at, kept = last[-1], []
    while at >= 0:
        kept.append(at)
        at = came[at]
    false[np.delete(doubted, kept)] = True
    return false


def main_span(times: Mapping[str, Stamps]) -> Span | None:
    """From the first to the last stamp, without strays; None where there is no message.

    Strays: at most 1 % of all messages, an hour or more from the rest; where the rest spans more
    than a week, all but the fullest part of it.
    """
    known = [time for time in times.values() if len(time)]
    if not known:
        return None
    first, last = min(int(t.min()) for t in known), max(int(t.max()) for t in known)
    if last - first < HOUR:
        return Span(first, last)
    hours: dict[int, int] = {}
    for time in known:
        values, counts = np.unique(time // HOUR, return_counts=True)
        for hour, count in zip(values.tolist(), counts.tolist(), strict=True):
            hours[hour] = hours.get(hour, 0) + count
    clusters: list[list[int]] = []
    for hour in sorted(hours):
        if clusters and hour - clusters[-1][-1] <= 2:
            clusters[-1].append(hour)
        else:
            clusters.append([hour])
    limit = STRAY * sum(hours.values())
    kept = [hour for c in clusters if sum(hours[h] for h in c) > limit for hour in c]
    if kept and kept[-1] - kept[0] > WEEK:
        kept = max(clusters, key=lambda c: sum(hours[h] for h in c))
    if not kept:
        return Span(first, last)
    inside = [t[(t // HOUR >= kept[0]) & (t // HOUR <= kept[-1])] for t in known]
    inside = [time for time in inside if len(time)]
    return Span(min(int(t.min()) for t in inside), max(int(t.max()) for t in inside))


def said(time: Stamps, span: Span) -> str:
    """What to say of the messages of a topic outside the span; empty for none."""
    out = time[~span.holds(time)]
    if not len(out):
        return ""
    count = counted(len(out))
    first = f"{date(int(out[0]))}" + (" and elsewhere" if len(out) > 1 and np.ptp(out) else "")
    return (
        f"{count} stamped {first}, far from the recording "
        f"({date(span.start)} to {date(span.end)}), left out"
    )


def counted(number: int) -> str:
    """`1 message`, `2 messages`."""
    return "1 message" if number == 1 else f"{number} messages"


def date(ns: int) -> str:
    """UTC to the second; the number itself where there is no such date."""
    try:
        moment = datetime.fromtimestamp(ns // 10**9, UTC)
    except (OverflowError, OSError, ValueError):
        return f"{ns} ns"
    return moment.strftime("%Y-%m-%d %H:%M:%S")
