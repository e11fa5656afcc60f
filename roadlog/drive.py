"""Drive: a log's signals on one uniform clock, with gaps and masks."""

from __future__ import annotations

from collections.abc import ItemsView, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog import stamps
from roadlog.columnar import Columnar, fixed
from roadlog.errors import LogReadError, MissingSignalError, near
from roadlog.signals import INPUTS, SECTIONS, SIGNALS, Signal
from roadlog.storage.table import Table
from roadlog.types import Bools, Floats, Stamps

DEFAULT_RATE = 100.0  # Hz
MIN_STALE = 0.1  # s; a sample is stale when older than this and STALE_INTERVALS of its channel
STALE_INTERVALS = 2.5
KEPT = 256_000_000  # bytes of resampled signals that stay; of a longer drive the last ones
MAX_DURATION = 7 * 86400.0  # s; beyond this the stamps are wrong, not the drive long
SPARSE_DURATION = 4 * 3600.0  # s; beyond this there has to be more than
SPARSEST = 10.0  # s for each sample of the fullest channel

# docs/methods/common.md#standstill and docs/methods/common.md#straight-driving
ZERO_SPEED = 0.02  # m/s
STANDSTILL_PAST = 0.5  # s
STANDSTILL_FUTURE = 0.5  # s
STRAIGHT_LATERAL = 0.5  # m/s2, |yaw rate| * max(v, 1 m/s)


@dataclass(frozen=True, eq=False)
class Samples(Columnar):
    """One channel as the logger wrote it.

    time: seconds on the drive's clock, ascending. columns: field -> values, NaN where unknown.
    """

    time: Floats
    columns: Mapping[str, Floats]

    def to_columns(self) -> dict[str, Floats]:
        """`time` in s and the fields."""
        return {"time": self.time, **self.columns}


class Resampled(Mapping[str, Floats]):
    """Signals of channels by role, put on the clock when first asked for by name, and kept.

    Hours of forty signals at once are more than the estimators need: they use half of them. So
    whoever goes through all of them leaves none behind, and of a long drive only those asked for
    last stay. others: signals that no channel of `native` gives, as they are.
    """

    def __init__(
        self,
        native: Mapping[str, Samples],
        time: Floats,
        others: Mapping[str, Floats] | None = None,
    ) -> None:
        self._native, self._time, self._others = native, time, others or {}
        self._sources = {
            signal.role: (samples, signal)
            for name, samples in native.items()
            for signal in SECTIONS[name].signals
            if signal.field in samples.columns
        }
        self._kept: dict[str, Floats] = {}
        self._last_age: tuple[Floats, Age] | None = None

    def __getitem__(self, role: str) -> Floats:
        values = self.passing(role)
        self._kept.pop(role, None)
        self._kept[role] = values  # behind those that were asked for before
        for longest_unused in list(self._kept)[: -max(1, KEPT // max(1, values.nbytes))]:
            self._kept.pop(longest_unused, None)  # another thread may have
        return values

    def passing(self, role: str) -> Floats:
        """The signal, for one look at it."""
        if role not in self._sources:
            return self._others[role]
        kept = self._kept.get(role)
        if kept is not None:
            return kept
        samples, signal = self._sources[role]
        values = samples.columns[signal.field]
        age = self._age_of(samples.time) if np.isfinite(values).all() else None
        return fixed(resample(samples.time, values, self._time, signal, age))

    def _age_of(self, own: Floats) -> Age:
        """Found once for the signals of a channel that are asked for one after the other."""
        last = self._last_age
        if last is None or last[0] is not own:
            self._last_age = last = (own, Age.of(own, self._time))
        return last[1]

    def items(self) -> ItemsView[str, Floats]:
        """Roles and signals, one after the other."""
        return _Passing(self)

    def __reduce__(self) -> tuple:
        return Resampled, (self._native, self._time, self._others)  # without what is kept

    def __contains__(self, role: object) -> bool:
        return role in self._sources or role in self._others

    def __iter__(self) -> Iterator[str]:
        return iter({**dict.fromkeys(self._others), **self._sources})

    def __len__(self) -> int:
        return len(self._others.keys() | self._sources.keys())


class _Passing(ItemsView[str, Floats]):
    """The items of `Resampled`."""

    _mapping: Resampled

    def __iter__(self) -> Iterator[tuple[str, Floats]]:
        return ((role, self._mapping.passing(role)) for role in self._mapping)


@dataclass(frozen=True, eq=False, repr=False)
class Drive(Columnar):
    """A log's signals on one uniform clock.

    Its arrays are not to be changed: every method looks at the same.
    time: seconds from `start_ns`, uniform. signals: role -> values in SI as long as `time`, NaN
    where the newest sample is older than the larger of 0.1 s and 2.5 median intervals of its
    channel. native: section -> samples at their own times, for estimators that use them so.
    """

    time: Floats
    start_ns: int
    rate: float
    signals: Mapping[str, Floats]
    native: Mapping[str, Samples]

    def __repr__(self) -> str:
        return f"<Drive: {self.time[-1]:.1f} s at {self.rate:g} Hz; {', '.join(self.native)}>"

    @classmethod
    def from_tables(cls, tables: Iterable[Table], rate: float = DEFAULT_RATE) -> Drive:
        """Put the input channels among `tables` on one grid of `rate` Hz.

        The grid runs from the first to the last sample of any input. Raises LogReadError when
        there is no input at all, or the stamps span more than a week, or hours with next to
        nothing in them.
        """
        sections = {section.topic: section for section in INPUTS}
        inputs = [(sections[t.topic], t) for t in tables if t.topic in sections and len(t)]
        if not inputs:
            topics = ", ".join(sections)
            raise LogReadError(f"no vehicle signals: the log has messages on none of {topics}")
        start = min(int(table.time.min()) for _, table in inputs)
        end = max(int(table.time.max()) for _, table in inputs)
        duration = (end - start) * 1e-9
        most = max(len(table) for _, table in inputs)
        if duration > MAX_DURATION or duration > max(SPARSE_DURATION, SPARSEST * most):
            raise LogReadError(
                f"stamps span {duration / 86400:.1f} days; a clock jumped or a channel has another "
                f"epoch (see `roadlog info`)"
            )
        time = fixed(np.arange(int(np.floor(duration * rate + 1e-6)) + 1) / rate)
        native: dict[str, Samples] = {}
        for section, table in inputs:
            order = np.argsort(table.time, kind="stable")
            own: Floats = np.multiply(table.time[order] - start, 1e-9)
            columns = {}
            for signal in section.signals:
                if signal.field not in table.columns:
                    continue
                values = np.array(table.columns[signal.field][order], np.float64)
                values[~np.isfinite(values)] = np.nan
                if np.isnan(values).all():
                    continue  # a field that the source does not know is a signal it does not have
                columns[signal.field] = fixed(values)
            native[section.name] = Samples(fixed(own), columns)
        return cls(time, start, rate, Resampled(native, time), native)

    @property
    def attributes(self) -> dict[str, Any]:
        """Start and rate."""
        return {"start_ns": self.start_ns, "rate_hz": self.rate}

    def __len__(self) -> int:
        return len(self.time)

    def __contains__(self, role: str) -> bool:
        return role in self.signals

    def __getitem__(self, role: str) -> Floats:
        try:
            return self.signals[role]
        except KeyError:
            known = role in SIGNALS
            what = "is not in this drive" if known else "is no role"
            hint = near(role, self.signals if known else SIGNALS)
            raise MissingSignalError(f"signal '{role}' {what}. {hint}") from None

    def get(self, role: str) -> Floats:
        """The signal, or NaN everywhere when the drive does not have it."""
        return self.signals[role] if role in self.signals else np.full(len(self.time), np.nan)

    def to_columns(self) -> dict[str, Floats]:
        """`time` in s and every signal by its role."""
        return {"time": self.time, **self.signals}

    @property
    def dt(self) -> float:
        """s, grid step."""
        return 1.0 / self.rate

    @property
    def time_ns(self) -> Stamps:
        """Absolute time of each grid point."""
        return self.start_ns + np.round(self.time * 1e9).astype(np.int64)

    def sources_of_speed(self) -> list[str]:
        """Which of wheel_speeds, speed, gnss can give the speed, best first."""
        candidates = {
            "wheel_speeds": any(f"wheel_speeds.{w}" in self for w in ("fl", "fr", "rl", "rr")),
            "speed": "speed.v" in self,
            "gnss": "gnss.speed" in self,
        }
        return [name for name, there in candidates.items() if there]

    @property
    def has_speed(self) -> bool:
        """Whether any speed is there."""
        return bool(self.sources_of_speed())

    def wheel_speed(self, wheels: str = "all") -> Floats:
        """m/s, mean of `all`, `front` or `rear` wheels, or `median` of all; of those known."""
        axles = {"front": ("fl", "fr"), "rear": ("rl", "rr")}
        names = axles.get(wheels, ("fl", "fr", "rl", "rr"))
        there = [f"wheel_speeds.{w}" for w in names if f"wheel_speeds.{w}" in self]
        if not there:
            raise MissingSignalError(f"no wheel speed ({', '.join(names)}) is in this drive")
        rows = np.stack([self[role] for role in there])
        return nan_median(rows) if wheels == "median" else nan_mean(rows)

    @cached_property
    def speed(self) -> Floats:
        """m/s along the road: mean of the wheel speeds, else /speed, else GNSS speed."""
        for source in self.sources_of_speed():
            if source == "wheel_speeds":
                return fixed(self.wheel_speed())
            return self["speed.v" if source == "speed" else "gnss.speed"]
        raise MissingSignalError(
            "no speed in this drive: it has none of /wheel_speeds, /speed, /gnss speed"
        )

    @cached_property
    def standstill(self) -> Bools:
        """True where the car stands, with hysteresis in past and future."""
        if not self.has_speed:
            return np.zeros(len(self), np.bool_)
        return fixed(static_mask(self.speed, self.rate))

    @cached_property
    def straight(self) -> Bools:
        """True where |yaw rate| max(v, 1 m/s) < 0.5 m/s2, or no yaw rate is known."""
        if "imu.gyro_z" not in self or not self.has_speed:
            return np.ones(len(self), np.bool_)
        lateral = np.abs(self["imu.gyro_z"]) * np.maximum(self.speed, 1.0)
        return fixed(~(lateral >= STRAIGHT_LATERAL))


def without_strays(tables: Mapping[str, Table]) -> tuple[dict[str, Table], dict[str, str]]:
    """Tables without single messages of a wrong time, and by topic a sentence on these."""
    span = stamps.main_span({topic: table.time for topic, table in tables.items()})
    result = dict(tables)
    said: dict[str, str] = {}
    if span is None:
        return result, said
    for topic, table in tables.items():
        keep = span.holds(table.time)
        if not keep.all():
            columns = {name: values[keep] for name, values in table.columns.items()}
            result[topic] = replace(table, time=table.time[keep], columns=columns)
            said[topic] = stamps.said(table.time, span)
    return result, said


class Age(NamedTuple):
    """newest (n,): the last sample up to each time, -1 before the first; fresh (n,): not stale."""

    newest: NDArray[np.int64]
    fresh: Bools

    @classmethod
    def of(cls, own: Floats, time: Floats) -> Age:
        """Of samples at `own`, seen from `time`."""
        # stamps and grid are rounded to ns: a sample on a grid point belongs to it
        newest = np.searchsorted(own, time + 1e-9, side="right") - 1
        fresh = newest >= 0
        fresh[fresh] = time[fresh] - own[newest[fresh]] <= stale_limit(own)
        return cls(newest, fresh)


def resample(
    own: Floats, values: Floats, time: Floats, signal: Signal, age: Age | None = None
) -> Floats:
    """Values at `time`: interpolated or held as the signal's kind says, NaN where stale.

    NaN samples count as absent. Between two samples further apart than the stale limit the
    result is NaN once the older one is stale. No extrapolation at the ends, except that the last
    sample holds until it is stale. age: of the samples, where none is NaN and it is known.
    """
    if age is None:
        known = np.isfinite(values)
        own, values = own[known], values[known]
    result = np.full(len(time), np.nan)
    if not len(own):
        return result
    if signal.kind == "angle":
        values = np.unwrap(values)
    newest, fresh = age or Age.of(own, time)
    if signal.kind == "hold":
        result[fresh] = values[newest[fresh]]
    else:
        result[fresh] = np.interp(time[fresh], own, values)
    return result


def stale_limit(own: Floats) -> float:
    """s, age at which a newest sample no longer counts; docs/methods/common.md#grid-and-gaps."""
    if len(own) < 2:
        return MIN_STALE
    return max(MIN_STALE, STALE_INTERVALS * float(np.median(np.diff(own))))


def static_mask(
    speed: Floats,
    rate: float,
    zero: float = ZERO_SPEED,
    past: float = STANDSTILL_PAST,
    future: float = STANDSTILL_FUTURE,
) -> Bools:
    """Zero-velocity detection with hysteresis both ways; docs/methods/common.md#standstill.

    speed in m/s, NaN counts as moving; zero in m/s; past and future in s.
    """
    n = len(speed)
    moving = np.concatenate([[0], np.cumsum(~(np.abs(speed) <= zero))])
    k = np.arange(n)
    last = np.minimum(k + round(future * rate), n - 1)
    first = np.maximum(k - round(past * rate), 0)
    return moving[last + 1] - moving[first] == 0


def runs(mask: Bools) -> list[slice]:
    """Maximal runs of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def nan_mean(rows: Floats) -> Floats:
    """Mean over the first axis of what is known; NaN where nothing is."""
    known = np.isfinite(rows)
    count = known.sum(axis=0)
    total = np.where(known, rows, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def nan_median(rows: Floats) -> Floats:
    """Median over the first axis of what is known; NaN where nothing is."""
    ordered = np.sort(rows, axis=0)  # NaN last
    count = np.isfinite(rows).sum(axis=0)
    k = np.arange(rows.shape[1])
    low = ordered[np.maximum(count - 1, 0) // 2, k]
    return (low + ordered[np.minimum(count // 2, np.maximum(count - 1, 0)), k]) / 2
