"""What is in a log, whether it makes sense, and which estimators can run: `roadlog info`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from roadlog import checks
from roadlog.checks import Finding
from roadlog.checks.delays import delays
from roadlog.drive import Drive, stale_limit, without_strays
from roadlog.errors import ConfigError, LogReadError
from roadlog.for_viewers import is_for_viewers
from roadlog.log import DriveLog
from roadlog.outlook import Manner, Outlook, SensorSet, outlook
from roadlog.signals import SECTIONS, SIGNALS, split_estimate_topic
from roadlog.stamps import main_span
from roadlog.storage import Channel, Table
from roadlog.types import Floats, Stamps

if TYPE_CHECKING:
    from roadlog.ingest.profile import Profile

MOST = 0.95  # share of a topic's messages; where fewer are on the recording's clock it jumped
SECTION_OF = {section.topic: name for name, section in SECTIONS.items()}


@dataclass(frozen=True)
class ChannelSummary:
    """One channel.

    role: section of the vocabulary, `estimate`, or None for a channel that roadlog does not use.
    rate: Hz, median. jitter: s, sd of the intervals without the gaps. gaps: intervals beyond the
    stale limit, longest_gap the largest interval in s. nan_share: of the values
    of the signals it has, each at its own rate. not_monotonic: stamps that repeat or run backward.
    """

    topic: str
    role: str | None
    schema: str
    encoding: str
    messages: int
    rate: float | None
    jitter: float | None
    gaps: int | None
    longest_gap: float | None
    nan_share: float | None
    not_monotonic: int | None


@dataclass(frozen=True)
class SignalSummary:
    """One signal: role, unit, Hz at which it is known, share of the values at that rate which are
    not, smallest, mean, largest.
    """

    role: str
    topic: str
    unit: str
    rate: float | None
    nan_share: float
    minimum: float
    mean: float
    maximum: float


@dataclass(frozen=True)
class EstimatorSummary:
    """Whether an estimator can run on the log; reason: why not, or what to know."""

    name: str
    can_run: bool
    gives: tuple[str, ...]
    reason: str


@dataclass(frozen=True)
class LogSummary:
    """Everything that `roadlog info` says.

    profile: what the profile that made the log puts right. checks: what looks wrong, the most
    harmful first. sensors: what decides the accuracy. outlook: of each angle what to take and to
    expect. Neither without a drive.
    """

    log: str
    duration: float
    profile: list[str]
    channels: list[ChannelSummary]
    signals: list[SignalSummary]
    checks: list[Finding]
    estimators: list[EstimatorSummary]
    sensors: SensorSet | None
    outlook: list[Outlook]


def summarize(log: DriveLog) -> LogSummary:
    """Look through a whole log. Raises LogReadError when the file cannot be read."""
    from roadlog import estimators

    whole = log.tables()
    tables, strays = without_strays(whole)
    span = main_span({topic: table.time for topic, table in tables.items()})
    duration = 0.0 if span is None else (span.end - span.start) * 1e-9
    drive: Drive | None = None
    found = [
        Finding(
            "stray_stamps",
            "note" if len(tables[topic]) > MOST * len(whole[topic]) else "fault",
            (topic,),
            said,
            "leave the topic out, or mend its clock",
        )
        for topic, said in strays.items()
    ]
    found += [Finding("clocks", "note", (), note) for note in log.notes]
    found += [Finding("unread", "note", (t.topic,), t.unread) for t in tables.values() if t.unread]
    profile = _profile(log.metadata.get("profile", {}))
    found += delays({entry.role: entry.delay for entry in profile or ()})
    try:
        checked = checks.check(_own(tables, log), log.vehicle)
        if "profile" in log.metadata:
            from roadlog.ingest.advice import advised

            checked = advised(checked, log.metadata["profile"])
        found += checked
        drive = Drive.from_tables(tables.values())
    except LogReadError as error:
        advice = "`roadlog profile new` maps others"
        found.append(Finding("no_drive", "fault", (), str(error), advice))
    found.sort(key=lambda finding: finding.harm, reverse=True)
    able = _estimators(drive, log)
    sensors = SensorSet.of(drive, log.vehicle) if drive else None
    lacking = estimators.get("fusion").missing(drive)
    return LogSummary(
        str(log.path),
        duration,
        corrections(log.metadata.get("profile", {})),
        [_channel(channel, tables.get(channel.topic), duration) for channel in log.channels],
        _signals(tables),
        found,
        able,
        sensors,
        []
        if drive is None or sensors is None
        else outlook(sensors, [e.name for e in able if e.can_run], lacking, Manner.of(drive)),
    )


def _own(tables: Mapping[str, Table], log: DriveLog) -> dict[str, Table]:
    """The channels that count: of a third-party log what its profile makes of it."""
    try:
        is_mapped = log.profile is not None
    except LogReadError:
        is_mapped = False
    return {t: x for t, x in tables.items() if not is_mapped or t in SECTION_OF}


def _profile(record: Mapping[str, str]) -> Profile | None:
    """The profile that made a log; None where none did or it is of another version."""
    if not record:
        return None
    from roadlog.ingest.profile import Profile

    try:
        return Profile.from_toml(record["toml"], record.get("name", ""))
    except (KeyError, ConfigError):
        return None


def corrections(record: Mapping[str, str]) -> list[str]:
    """Sentences on what the profile that made a log puts right."""
    profile = _profile(record)
    if profile is None:
        return []
    found = []
    for name, mount in profile.mounts.items():
        if not np.allclose(mount, np.eye(3)):
            rows = ", ".join(
                "[" + ", ".join(f"{round(c, 3) + 0.0:.3g}" for c in row) + "]" for row in mount
            )
            found.append(f"{name}: axes turned by [{rows}]")
    groups: dict[str, list[str]] = {}
    for entry in profile:
        said = []
        if entry.scale == -1:
            said.append("sign turned")
        elif entry.scale != 1:
            said.append(f"scaled by {entry.scale:g}")
        if entry.offset:
            said.append(f"offset {entry.offset:g} {entry.unit}")
        if entry.delay:
            said.append(f"moved by its delay of {entry.delay:g} s")
        if entry.valid:
            condition = entry.valid
            said.append(f"used where {condition.name} {condition.compare} {condition.value:g}")
        if said:
            groups.setdefault(", ".join(said), []).append(entry.role)
    return found + [f"{', '.join(roles)}: {said}" for said, roles in groups.items()]


def _estimators(drive: Drive | None, log: DriveLog) -> list[EstimatorSummary]:
    from roadlog import estimators
    from roadlog.estimators.base import default_notes

    _, refused = estimators.runnable(drive)
    result = []
    for estimator in estimators.all_estimators():
        able = estimator.name not in refused
        reason = refused.get(estimator.name) or "; ".join(default_notes(estimator, log.vehicle))
        result.append(EstimatorSummary(estimator.name, able, estimator.gives, reason))
    return result


def _channel(channel: Channel, table: Table | None, duration: float) -> ChannelSummary:
    role = SECTION_OF.get(channel.topic)
    is_result = split_estimate_topic(channel.topic) and not is_for_viewers(channel.topic)
    if role is None and is_result:
        role = "estimate"
    what = (channel.topic, role, channel.schema, channel.encoding, channel.count)
    steps = np.empty(0) if table is None else np.diff(table.time) * 1e-9
    if table is None or not (steps > 0).any():
        rate = (channel.count - 1) / duration if channel.count > 1 and duration > 0 else None
        repeated = None if table is None or not len(table) else len(steps)
        return ChannelSummary(*what, rate, None, None, None, _nan_share(table), repeated)
    ordered = np.sort(table.time - table.time.min()) * 1e-9
    limit = stale_limit(ordered)
    return ChannelSummary(
        *what,
        float(1 / np.median(steps[steps > 0])),
        float(np.std(steps[steps <= limit])) if (steps <= limit).any() else None,
        int((steps > limit).sum()),
        float(steps.max()),
        _nan_share(table),
        int((steps <= 0).sum()),
    )


def _nan_share(table: Table | None) -> float | None:
    if table is None:
        return None
    reals = [v for v in table.columns.values() if v.dtype.kind == "f" and np.isfinite(v).any()]
    return float(np.mean([_missing(table.time, values) for values in reals])) if reals else None


def _missing(time: Stamps, values: Floats) -> float:
    """Share of the values that its own rate promises: a signal of 1 Hz in rows of 25 Hz lacks none.

    time (n,): ns.
    """
    fresh = np.isfinite(values)
    known = int(fresh.sum())
    steps = np.diff(time[fresh])
    promised = len(values)
    if (steps > 0).any():
        promised = min(promised, int(np.ptp(time) / np.median(steps[steps > 0])) + 1)
    return max(0.0, 1 - known / promised)


def _signals(tables: Mapping[str, Table]) -> list[SignalSummary]:
    result = []
    for section in SECTIONS.values():
        table = tables.get(section.topic)
        if table is None:
            continue
        for signal in section.signals:
            values = np.asarray(table.columns.get(signal.field, []), np.float64)
            fresh = np.isfinite(values)
            known = values[fresh]
            if not len(known):
                continue
            steps = np.diff(table.time[fresh]) * 1e-9
            result.append(
                SignalSummary(
                    signal.role,
                    section.topic,
                    SIGNALS[signal.role].unit,
                    float(1 / np.median(steps[steps > 0])) if (steps > 0).any() else None,
                    _missing(table.time, values),
                    float(known.min()),
                    float(known.mean()),
                    float(known.max()),
                )
            )
    return result
