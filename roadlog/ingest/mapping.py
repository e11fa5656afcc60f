"""Frames through a profile to tables: units, validity, clocks, mounting."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.geo import of_degrees_minutes
from roadlog.ingest.frame import Frame
from roadlog.ingest.grid import Signals, one_grid
from roadlog.ingest.profile import AbsentError, Entry, Profile, find
from roadlog.ingest.union import rows_of, united, windows
from roadlog.signals import AXES, SECTIONS, SIGNALS, Section
from roadlog.spool import Spool, blocks, release
from roadlog.storage import Table, schemas
from roadlog.types import Bools, Floats, Stamps
from roadlog.units import DEGREES_MINUTES, SLOPES, canonical, is_written, to_si

SLOW_SECTIONS = ("speed", "gnss", "barometer")  # of devices that fast tables repeat
REPEATS = 5  # rows; a value that typically stays this long is held, not measured anew
HELD = 2  # rows, of a position: no receiver measures the same twice while it moves
HELD_SHARE = 0.6  # of rows with a new position, below which the whole fix is held
POSITIONS = ("gnss.latitude", "gnss.longitude")
NEGLIGIBLE = 1e-9  # a mount coefficient below this does not use its axis


class Located(NamedTuple):
    """Where a signal of the profile is in the source."""

    entry: Entry
    frame: Frame
    column: str


@dataclass(frozen=True)
class Mapped:
    """One signal that was mapped: where it came from and how many samples of it are usable."""

    role: str
    source: str
    file: str
    unit: str
    samples: int
    invalid: int


def locate(profile: Profile, frames: Sequence[Frame]) -> tuple[list[Located], list[str]]:
    """Where each signal of a profile is, and roles that the source does not have.

    Only a profile that comes with roadlog may name more than the source has, a user's own raises
    ConfigError. Raises LogReadError when nothing is there.
    """
    found, lacking = [], []
    for entry in profile:
        try:
            frame, column = find(entry, frames)
        except AbsentError as error:
            if not profile.family:
                raise ConfigError(str(error)) from None
            lacking.append(entry.role)
            continue
        found.append(Located(entry, frame, column))
    if not found:
        names = {
            f"{frame.name}.{c}" if frame.name else c for frame in frames for c in frame.columns
        }
        raise LogReadError(
            f"profile {profile.name} fits nothing in the source; give another --profile. "
            + near("", names)
        )
    return found, lacking


def signals(profile: Profile, located: Sequence[Located]) -> tuple[Signals, list[Mapped]]:
    """Located signals in SI units and vehicle axes, each on its own stamps, and what they are.

    Raises ConfigError for text instead of numbers, a condition that is not there, or a mount that
    needs more axes.
    """
    found: Signals = {}
    mapped = []
    begin = min((int(place.frame.time.min()) for place in located if len(place.frame)), default=0)
    fresh: dict[tuple[str, int, float], Stamps] = {}  # of a device's messages with a new value
    held: set[tuple[str, int, float]] = set()  # devices whose fixes stay for several rows
    for entry, frame, column in sorted(located, key=lambda place: _rank(place.entry)):
        time, samples = _samples(entry, frame, column)
        if entry.delay > 0:  # what was measured before the recording began
            time, samples = _since(begin, time, samples)
        section = entry.role.partition(".")[0]
        device = section, id(frame), entry.delay
        follows = device in held or (_is_accuracy(entry) and device in fresh)
        if section in SLOW_SECTIONS and (entry.role in POSITIONS or not follows):
            rows, same = len(time), entry.role in POSITIONS and _is_constant(samples)
            time, samples = _fresh(time, samples, HELD if entry.role in POSITIONS else REPEATS)
            if not same:  # due north a longitude tells of no fix
                fresh[device] = np.union1d(fresh[device], time) if device in fresh else time
            if entry.role in POSITIONS and not same:
                few = len(fresh[device]) < HELD_SHARE * rows
                (held.add if few else held.discard)(device)
        elif section in SLOW_SECTIONS:
            time, samples = _at(time, samples, fresh[device])
        found[entry.role] = time, samples
        usable = sum(int(np.isfinite(samples[rows]).sum()) for rows in blocks(len(samples)))
        release([time, samples])
        place = f"{frame.name}.{column}" if frame.name else column
        unit = entry.unit or "-"
        mapped.append(Mapped(entry.role, place, frame.file, unit, usable, len(samples) - usable))
    order = [place.entry.role for place in located]
    mapped.sort(key=lambda m: order.index(m.role))
    for section, mount in profile.mounts.items():
        for kind in ("accel", "gyro"):
            _mount(found, [f"{section}.{kind}_{axis}" for axis in AXES], mount)
    return found, mapped


def contradicted(located: Sequence[Located]) -> list[str]:
    """Sentences on units of the profile that are not those that the source states."""
    found = []
    for entry, frame, column in located:
        stated = frame.units.get(column, "")
        try:
            same = not stated or not entry.unit or canonical(stated) == canonical(entry.unit)
        except ConfigError:  # a unit that is none of ours
            continue
        scaled = entry.scale != 1.0 or is_written(entry.role, entry.unit)
        if not same and not scaled:
            name = f"{frame.name}.{column}" if frame.name else column
            found.append(
                f"{entry.role}: the source states {stated} for {name}, the profile {entry.unit}"
            )
    return found


def without_minutes(located: Sequence[Located]) -> list[str]:
    """Sentences on degrees and minutes in one number that are none: minutes of 60 and more."""
    found = []
    for entry, frame, column in located:
        if entry.unit != DEGREES_MINUTES:
            continue
        values = _numbers(frame.columns[column], entry.role) * entry.scale + entry.offset
        rows = np.flatnonzero(np.isfinite(values) & np.isnan(of_degrees_minutes(values)))
        if len(rows):
            found.append(
                f"{entry.role}: {len(rows)} of {len(values)} values of {column} left out, with "
                f"minutes of 60 or more (row {rows[0] + 1}: {values[rows[0]]:.10g}); is it "
                f"{DEGREES_MINUTES}?"
            )
    return found


def left_over(frames: Iterable[Frame], located: Sequence[Located]) -> list[str]:
    """Names in the source that nothing uses."""
    used = {(id(frame), column) for _, frame, column in located}
    used |= {(id(frame), entry.valid.name) for entry, frame, _ in located if entry.valid}
    return [
        f"{frame.name}.{column}" if frame.name else column
        for frame in frames
        for column in frame.columns
        if (id(frame), column) not in used
    ]


def tables(found: Signals) -> list[Table]:
    """One table a section, its signals on the union of their stamps, NaN where one has no value.

    Raises LogReadError when there is no usable value at all.
    """
    result = []
    for section in SECTIONS.values():
        values = {s.field: found[s.role] for s in section.signals if s.role in found}
        if values:
            result.append(_table(section, values))
    if not any(len(table) for table in result):
        raise LogReadError("the sources hold no usable sample of any mapped signal")
    return result


def _samples(entry: Entry, frame: Frame, column: str) -> tuple[Stamps, Floats]:
    """Stamps and SI values of one entry; NaN where invalid."""
    expected = SIGNALS[entry.role].unit
    written = is_written(entry.role, entry.unit)
    factor = to_si(entry.unit, expected) if entry.unit and not written else 1.0
    if entry.valid is not None and entry.valid.name not in frame.columns:
        raise ConfigError(
            f"{entry.role}: valid needs '{entry.valid.name}' in the same message as "
            f"'{column}' ({', '.join(frame.columns)})"
        )
    raw = frame.columns[column]
    flag = None if entry.valid is None else frame.columns[entry.valid.name]
    is_si = (entry.scale, entry.offset, factor) == (1.0, 0.0, 1.0) and not written
    if is_si and flag is None and raw.dtype == np.float64 and not _has_infinity(raw):
        return _delayed(frame.time, entry.delay), raw
    found = Spool(np.float64)
    for rows in blocks(len(raw)):
        with np.errstate(over="ignore", invalid="ignore"):  # what is beyond a float is unknown
            numbers = _numbers(raw[rows], entry.role)
            values: Floats = (numbers * entry.scale + entry.offset) * factor
            if written:
                values = _read(values, entry.unit)
        values[~np.isfinite(values)] = np.nan
        if entry.valid is not None and flag is not None:
            values[~entry.valid.holds(_numbers(flag[rows], entry.role))] = np.nan
        found.append(values)
        release([raw] if flag is None else [raw, flag])
    return _delayed(frame.time, entry.delay), found.column()


def _read(values: Floats, unit: str) -> Floats:
    """Angles of what is written as a slope, or as degrees and minutes in one number."""
    if unit == DEGREES_MINUTES:
        return of_degrees_minutes(values)
    return np.asarray(np.arctan(values * SLOPES[unit]))


def _has_infinity(values: Floats) -> bool:
    found = any(np.isinf(values[rows]).any() for rows in blocks(len(values)))
    release([values])
    return found


def _delayed(time: Stamps, delay: float) -> Stamps:
    """Stamps of what was measured `delay` s before."""
    steps = round(delay * 1e9)
    if not steps:
        return time
    early = Spool(np.int64)
    for rows in blocks(len(time)):
        early.append(time[rows] - steps)
    return early.column()


def _since(begin: int, time: Stamps, values: Floats) -> tuple[Stamps, Floats]:
    """The rows from a moment on, block by block."""
    stamps, kept = Spool(np.int64), Spool(np.float64)
    for rows in blocks(len(time)):
        keep = time[rows] >= begin
        stamps.append(time[rows][keep])
        kept.append(values[rows][keep])
        release([time, values])
    return stamps.column(), kept.column()


def _fresh(time: Stamps, values: Floats, repeats: int) -> tuple[Stamps, Floats]:
    """The rows that bring a new value, block by block."""
    stamps, kept = Spool(np.int64), Spool(np.float64)
    before = np.nan
    for rows in blocks(len(time)):
        keep = refreshed(time[rows], values[rows], before, repeats)
        stamps.append(time[rows][keep])
        kept.append(values[rows][keep])
        before = float(values[rows][-1])
        release([time, values])
    return stamps.column(), kept.column()


def _at(time: Stamps, values: Floats, stamps: Stamps) -> tuple[Stamps, Floats]:
    """The rows of some stamps, block by block."""
    kept, chosen = Spool(np.int64), Spool(np.float64)
    for rows in blocks(len(time)):
        keep = np.isin(time[rows], stamps)
        kept.append(time[rows][keep])
        chosen.append(values[rows][keep])
        release([time, values])
    return kept.column(), chosen.column()


def _rank(entry: Entry) -> int:
    """Positions first: they tell which fixes are new. An accuracy, which stays the same for long,
    last: it belongs to the values beside it."""
    return 0 if entry.role in POSITIONS else 2 if _is_accuracy(entry) else 1


def _is_constant(values: Floats) -> bool:
    return all((values[rows] == values[0]).all() for rows in blocks(len(values)))


def _is_accuracy(entry: Entry) -> bool:
    return entry.role.endswith("_accuracy")


def refreshed(
    time: Stamps, values: Floats, before: float = np.nan, repeats: int = REPEATS
) -> Bools:
    """Which rows bring a new value, where a fast table repeats a slow device's last one.

    before: the value before the first row. repeats: rows that a value typically stays if it is
    held.

    A phone writes its 1 Hz fix into every row of a 25 Hz table; taken as samples, these are steps
    with an infinite slope. Rows of a change are kept, and while nothing changes (standstill) one
    row for each typical interval between changes.
    """
    changes = np.flatnonzero(np.diff(values, prepend=before) != 0)
    if len(changes) < 3 or np.median(np.diff(changes)) < repeats:
        return np.ones(len(values), np.bool_)
    keep = np.zeros(len(values), np.bool_)
    keep[changes] = True
    interval = max(1.0, float(np.median(np.diff(time[changes]))))  # ns
    for a, b in zip(changes, [*changes[1:], len(values)], strict=True):
        if b - a <= repeats:
            continue
        lap = ((time[a:b] - time[a]) / interval).astype(np.int64)
        late = lap[-1] if b < len(values) else lap[-1] + 1  # a fix a little late is no standstill
        keep[a + np.flatnonzero((np.diff(lap, prepend=0) > 0) & (lap < late))] = True
    return keep


def _numbers(values: NDArray, role: str) -> Floats:
    if values.dtype.kind not in "bifu":
        raise ConfigError(f"{role}: its source holds no numbers (e.g. {values[0]!r})")
    return np.array(values, np.float64)


def _table(section: Section, values: Mapping[str, tuple[Stamps, Floats]]) -> Table:
    """One table; what its message has besides is unknown."""
    time, columns = rows_of(values)
    complete: dict[str, NDArray] = {}
    for name, dtype in schemas.columns(section.schema).items():
        if name in columns:
            complete[name] = columns[name]
        elif name == "valid":
            complete[name] = np.broadcast_to(np.True_, len(time))  # every row left has a value
        else:
            blank = np.array(np.nan if dtype.kind == "f" else 0, dtype)
            complete[name] = np.broadcast_to(blank, len(time))
    return Table(section.topic, section.schema, time, complete)


def _mount(found: Signals, roles: list[str], mount: Floats) -> None:
    """Turn one sensor triad to vehicle axes; an axis that needs an unmapped one is an error."""
    there = [role in found for role in roles]
    if not any(there):
        return
    sensor, _ = one_grid({role: found.pop(role) for role in roles if role in found})
    rows_of = {}
    for row, role in zip(mount, roles, strict=True):
        needs = [abs(c) > NEGLIGIBLE for c in row]
        if all(has for need, has in zip(needs, there, strict=True) if need):
            rows_of[role] = {r: c for r, c, need in zip(roles, row, needs, strict=True) if need}
        elif sum(needs) > 1:
            lacking = [r for r, need, has in zip(roles, needs, there, strict=True) if need > has]
            raise ConfigError(f"imu: mount turns several axes; map {', '.join(lacking)} too")
    stamps = Spool(np.int64)
    turned = {role: Spool(np.float64) for role in rows_of}
    for window in windows(sensor):
        time, columns = united(window)
        stamps.append(time)
        for role, parts in rows_of.items():
            zero = np.zeros(len(time))
            turned[role].append(sum((c * columns[r] for r, c in parts.items()), zero))
        release(array for pair in sensor.values() for array in pair)
    time = stamps.column()
    found |= {role: (time, spool.column()) for role, spool in turned.items()}
