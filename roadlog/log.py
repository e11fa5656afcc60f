"""DriveLog: an MCAP drive log with its drive, truth and estimates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from roadlog import results
from roadlog.bag_folder import name_results
from roadlog.car.vehicle import Vehicle
from roadlog.drive import DEFAULT_RATE, Drive, without_strays
from roadlog.errors import ConfigError, LogReadError, MissingSignalError, near
from roadlog.estimate import Detail, Estimate
from roadlog.files import changed
from roadlog.location_fix import location_fix
from roadlog.results import IN_PLACE, is_made, is_result
from roadlog.signals import (
    FIX_TOPIC,
    INPUTS,
    SECTIONS,
    TRUTH_TOPIC,
    estimate_topic,
    split_estimate_topic,
)
from roadlog.storage import Channel, LogReader, Table, update_log, write_log
from roadlog.storage.lock import exclusive

if TYPE_CHECKING:
    from roadlog.checks import Finding
    from roadlog.ingest.profile import Profile
    from roadlog.metrics import Evaluation

OWN = "roadlog."  # package of roadlog's messages
FIRST = 1_000_000_000  # ns of a log that are looked at for where its inputs begin
_SIGNALS = frozenset(section.topic for section in SECTIONS.values())


class DriveLog:
    """A drive log on disk, roadlog's own or a third-party MCAP that a profile explains.

    profile: a profile file or the name of a shipped one, for a third-party MCAP; without it the one
    that an earlier run stored in the file counts, or the shipped one that the message types ask
    for. clock: which time of its messages counts, log, publish or header (their own stamp), instead
    of the profile's. recover: put the file back where a change of it was interrupted; else it is
    only read as it was before. All times in s count from the first sample of any input.
    Raises LogReadError when the file is no readable MCAP, ConfigError.
    """

    def __init__(
        self,
        path: Path | str,
        profile: Path | str | None = None,
        clock: str = "",
        *,
        recover: bool = True,
    ) -> None:
        self.path = Path(path)
        self.given, self.clock = profile, clock
        self._open(recover)

    def _open(self, recover: bool = True) -> None:
        self._reader = LogReader(self.path, recover=recover)
        self._fingerprint = self._reader.fingerprint(is_made)
        self.channels: tuple[Channel, ...] = self._reader.channels
        self.metadata = self._reader.metadata
        self.start_ns = self._reader.start_ns
        self.end_ns = self._reader.end_ns
        self.losses: list[str] = self._reader.losses
        self.notes: list[str] = []  # on the clocks of a third-party log
        for name in ("profile", "vehicle", "drive_start_ns", "_mapped"):
            self.__dict__.pop(name, None)  # what was known of the file before it was written

    def __enter__(self) -> DriveLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self._reader.source.close()

    def __reduce__(self) -> tuple:
        # another process opens the file itself
        return DriveLog, (self.path, self.given, self.clock)

    def __repr__(self) -> str:
        seconds = 0.0
        if self.start_ns is not None and self.end_ns is not None:
            seconds = (self.end_ns - self.start_ns) * 1e-9
        made = ", ".join(self.estimators) or "no estimates"
        return f"<DriveLog {self.path}: {seconds:.1f} s, {len(self.channels)} channels; {made}>"

    def _repr_html_(self) -> str:
        from html import escape

        rows = "".join(
            f"<tr><td>{escape(c.topic)}</td><td>{escape(c.schema)}</td><td>{c.count}</td></tr>"
            for c in self.channels
        )
        head = "<tr><th>topic</th><th>schema</th><th>messages</th></tr>"
        return f"<p>{escape(repr(self))}</p><table>{head}{rows}</table>"

    def tables(self, topics: Iterable[str] | None = None) -> dict[str, Table]:
        """Columns of the given topics that the log has (default: all), in one pass.

        In a third-party MCAP, roadlog's topics are what the profile makes of the log's own.
        """
        known = [channel.topic for channel in self.channels]
        asked = None if topics is None else list(dict.fromkeys(topics))
        mapped: Mapping[str, Table] = {}
        if asked is None:
            with suppress(LogReadError):  # the log's own topics are there all the same
                mapped = self._mapped
        elif not _SIGNALS.isdisjoint(asked):
            mapped = self._mapped
        found = {topic: table for topic, table in mapped.items() if asked is None or topic in asked}
        there = known if asked is None else [topic for topic in asked if topic in known]
        return found | self._reader.read([topic for topic in there if topic not in mapped])

    @cached_property
    def profile(self) -> Profile | None:
        """What explains a third-party MCAP; None for roadlog's own.

        Raises LogReadError where nothing fits, ConfigError for a faulty profile.
        """
        record = self.metadata.get("profile", {})
        if self.given is None and record.get("use") != IN_PLACE and self._has_own_messages:
            if self.clock:
                raise ConfigError(f"{self.path}: is a log of roadlog's own, it has one clock only")
            return None
        from roadlog.ingest import foreign

        if self.given is None and record.get("use") != IN_PLACE and self.start_ns is None:
            return None
        found = foreign.explained(self.path, self.given, record)
        return found.on_clock(self.clock or record.get("clock", ""))

    @property
    def _has_own_messages(self) -> bool:
        return any(channel.schema.startswith(OWN) for channel in self.channels)

    @property
    def is_third_party(self) -> bool:
        """Whether it is others' file, without results of roadlog in it."""
        has_record = self.metadata.get("profile", {}).get("use") == IN_PLACE
        return self.profile is not None and not has_record

    def holds_messages_of(self, other: DriveLog) -> bool:
        """Whether, results aside, it holds the same messages as another log."""
        own = self._reader.fingerprint(is_made)
        return own == other._reader.fingerprint(is_made)

    @cached_property
    def _mapped(self) -> dict[str, Table]:
        """roadlog's topics out of the log's own; empty for a log of roadlog's."""
        if self.profile is None:
            return {}
        from roadlog.ingest import foreign

        found, losses, self.notes = foreign.tables(self.path, self.profile)
        self.losses += [loss for loss in losses if loss not in self.losses]
        return found

    def inputs(self) -> dict[str, Table]:
        """The channels that estimators read, without single messages of a wrong time."""
        tables, strays = without_strays(self.tables(s.topic for s in INPUTS))
        said = [f"{topic}: {stray}" for topic, stray in strays.items()]
        self.losses += [stray for stray in said if stray not in self.losses]
        return tables

    def drive(self, rate: float = DEFAULT_RATE, tables: Mapping[str, Table] | None = None) -> Drive:
        """The input signals on one clock. Raises LogReadError when there are none.

        tables: of `inputs`, where they have been read already.
        """
        try:
            return Drive.from_tables((tables or self.inputs()).values(), rate)
        except LogReadError as error:
            causes = [*self.losses, str(error)]  # before the symptom
            raise LogReadError(f"{self.path}: {'; '.join(causes)}") from error

    @cached_property
    def drive_start_ns(self) -> int:
        """ns since 1970 of the first sample of any input, without inputs of any message: time 0."""
        known = {channel.topic for channel in self.channels}
        topics = {section.topic for section in INPUTS}
        if self.profile is not None or self.start_ns is None or self.end_ns is None:
            tables = self.tables(topics)
        else:
            span, tables = FIRST, {}
            while not any(map(len, tables.values())) and span < 4 * (self.end_ns - self.start_ns):
                nothing: dict[str, list[str]] = {topic: [] for topic in topics & known}
                tables = self._reader.read(nothing, fields=nothing, end_ns=self.start_ns + span)
                span *= 8
        starts = [int(table.time.min()) for table in tables.values() if len(table)]
        return min(starts, default=self.start_ns or 0)

    @cached_property
    def vehicle(self) -> Vehicle:
        """The vehicle file stored in the log, or the default car; `as_mounted`."""
        text = self.metadata.get("vehicle", {}).get("toml", "")
        found = Vehicle.from_toml(text, f"{self.path}: metadata 'vehicle'") if text else Vehicle()
        return self.as_mounted(found)

    def as_mounted(self, vehicle: Vehicle) -> Vehicle:
        """The vehicle with the mounting that the log's profile states, unless it states its own."""
        record = self.metadata.get("profile")
        if vehicle.states_mounting or not record:
            return vehicle
        from roadlog.ingest.profile import states_mounting

        return vehicle.with_stated_mounting() if states_mounting(record) else vehicle

    @property
    def estimators(self) -> list[str]:
        """Names of the estimators whose results the log holds."""
        found = (split_estimate_topic(channel.topic) for channel in self.channels if channel.count)
        return sorted({parts[0] for parts in found if parts and parts[1] == "angles"})

    def truth(self) -> Estimate | None:
        """The true angles, when the log has them."""
        table = self.tables([TRUTH_TOPIC]).get(TRUTH_TOPIC)
        return Estimate.from_table(table, self.drive_start_ns, "truth") if table else None

    def estimate(
        self,
        name: str,
        *,
        rate: float = DEFAULT_RATE,
        vehicle: Vehicle | None = None,
        **settings: Any,
    ) -> Estimate:
        """Run one estimator; nothing is written, nothing checked (`faults`).

        vehicle: instead of the log's own. settings: the estimator's parameters. Raises
        EstimatorError when a needed signal is not there, ConfigError for an unknown name.
        """
        from roadlog import estimators

        return estimators.run(name, self.drive(rate), vehicle or self.vehicle, settings)

    def faults(
        self, vehicle: Vehicle | None = None, tables: Mapping[str, Table] | None = None
    ) -> list[Finding]:
        """What looks wrong in the log and should be put right before angles are believed.

        vehicle: instead of the log's own. tables: of `inputs`, where they have been read already.
        """
        from roadlog import checks

        found = checks.check(tables or self.inputs(), vehicle or self.vehicle)
        faults = [f for f in found if f.level == "fault"]
        if "profile" not in self.metadata:
            return faults
        from roadlog.ingest.advice import advised

        return advised(faults, self.metadata["profile"])

    @property
    def warnings(self) -> list[str]:
        """The faults that were known when the log's estimates were made."""
        records = [self.metadata.get(f"estimate/{name}", {}) for name in self.estimators]
        lines = [line for record in records for line in record.get("checks", "").splitlines()]
        return list(dict.fromkeys(lines))

    def stored(self, name: str) -> Estimate:
        """The angles of one estimator that the log holds; `detail` has its further channels.

        Raises MissingSignalError.
        """
        topic = estimate_topic(name)
        table = self.tables([topic]).get(topic)
        if table is None:
            raise MissingSignalError(
                f"{self.path}: no estimate '{name}'. {near(name, self.estimators)}"
            )
        record = self.metadata.get(f"estimate/{name}")
        return Estimate.from_table(table, self.drive_start_ns, name, record)

    def detail(self, name: str, detail: str) -> Detail | None:
        """A further channel of one estimator, when the log has it."""
        topic = estimate_topic(name, detail)
        table = self.tables([topic]).get(topic)
        if table is None:
            return None
        time = np.multiply(table.time - self.drive_start_ns, 1e-9)
        return Detail(table.schema, time, table.columns)

    def evaluate(self, skip: float | None = None, remove_offset: bool = False) -> Evaluation:
        """Every stored estimate against the truth, as `metrics.evaluate`."""
        from roadlog import metrics

        return metrics.evaluate(self, metrics.DEFAULT_SKIP if skip is None else skip, remove_offset)

    def write(
        self,
        estimates: Iterable[Estimate],
        *,
        names: Iterable[str] = (),
        vehicle: Vehicle | None = None,
        out: Path | None = None,
        in_place: bool = False,
        faults: Sequence[Finding] = (),
        as_ros2: bool = False,
    ) -> None:
        """Put estimates into the log, in place of earlier ones of the same name.

        names: of estimates that are made only as they are written, so that one of them at a time is
        in memory; others are known by themselves. Everything else stays byte for byte; the file is
        replaced at once or not at all. vehicle: stored in the log when given. in_place: change the
        file itself, with an undo journal beside it, instead of writing a copy. faults: kept with
        each estimate. as_ros2: as ROS 2 messages, the truth too, so that a bag stays one; a log
        with such results gets more of them. Raises LogWriteError, also where the log is not the one
        any more that was read.
        """
        names = set(names)
        if in_place or not names:  # a file that is being changed waits for nothing
            estimates = list(estimates)
            names |= {estimate.name for estimate in estimates}
        records = self._records(vehicle)
        as_ros2 = as_ros2 or any(is_result(c.topic) and c.encoding == "cdr" for c in self.channels)
        truth = self._mapped.get(TRUTH_TOPIC) if as_ros2 else None

        def is_replaced(topic: str) -> bool:
            parts = split_estimate_topic(topic)
            is_mapped = truth is not None and results.is_truth(topic)
            return is_mapped or (parts is not None and parts[0] in names)

        there: list[LogReader] = []  # another run may have added to it
        replaced = {*records, *(f"estimate/{name}" for name in names)}
        with nullcontext() if out else exclusive(self.path):
            update_log(
                self.path,
                results.tables(there, truth, estimates, records, faults, as_ros2=as_ros2),
                records,
                drop=is_replaced,
                drop_metadata=replaced.__contains__,
                out=out,
                in_place=in_place,
                encoding="cdr" if as_ros2 else "protobuf",
                check=lambda now: there.append(self._checked(now)),
            )
        if out is None:
            lost = self.losses  # of what the estimates rest on
            self._open()  # the file is another one now, and whole
            self.losses = list(dict.fromkeys([*lost, *self.losses]))
            if as_ros2:
                name_results(self.path, self.channels)

    def _records(self, vehicle: Vehicle | None) -> dict[str, dict[str, str]]:
        """What goes into the log besides results: the vehicle that was given, the profile."""
        records: dict[str, dict[str, str]] = {}
        if vehicle is not None:
            records["vehicle"] = {"toml": vehicle.to_toml()}
        if self.profile is not None:
            origin = {"name": self.profile.name, "toml": self.profile.text}
            clock = self.clock or self.metadata.get("profile", {}).get("clock", "")
            records["profile"] = origin | {"use": IN_PLACE} | ({"clock": clock} if clock else {})
        return records

    def _checked(self, now: LogReader) -> LogReader:
        """The log if it is the one that was read, maybe with other results, or LogWriteError."""
        if now.source.state != self._reader.source.state:
            is_whole = not now.contents.losses
            if not is_whole or now.fingerprint(is_made) != self._fingerprint:
                raise changed(self.path)
        return now


def create(
    path: Path | str,
    tables: Iterable[Table],
    metadata: Mapping[str, Mapping[str, str]] | None = None,
    vehicle: Vehicle | None = None,
) -> DriveLog:
    """Write a new log and open it, with the fixes once more for maps. Raises LogWriteError."""
    records = dict(metadata or {})
    if vehicle is not None:
        records["vehicle"] = {"toml": vehicle.to_toml()}
    tables = [_with_roles(table) for table in tables]
    topics = {table.topic for table in tables}
    if FIX_TOPIC not in topics:
        tables += [fix for fix in map(location_fix, tables) if fix is not None]
    write_log(Path(path), tables, records)
    return DriveLog(path)


def _with_roles(table: Table) -> Table:
    """The same; its channel's metadata says which field is which signal."""
    sections = [section for section in SECTIONS.values() if section.topic == table.topic]
    roles = {f"role.{s.field}": s.role for section in sections for s in section.signals}
    return replace(table, metadata=roles | dict(table.metadata))
