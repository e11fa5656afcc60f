"""Checks of single channels: stamps, values that cannot be, a fix that comes late, frozen signals.

Each returns its findings and the tables without the samples that are no data, so that the checks
after it see what is left.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping

import numpy as np

from roadlog.checks.finding import Finding, Level
from roadlog.drive import runs
from roadlog.signals import GNSS_TOPIC, IMU_TOPIC, SECTIONS, SIGNALS, WHEELS, Section
from roadlog.storage import Table
from roadlog.types import Bools, Floats, Indices, Stamps

CHECKED = ("imu", "wheel_speeds", "speed", "steering", "gnss", "barometer")

# What no road car's sensor shows; outside these a value is a code for "invalid".
LIMITS: dict[str, tuple[float, float]] = {
    "accel": (-50.0, 50.0),  # m/s2
    "gyro": (-2000.0, 2000.0),  # rad/s or deg/s
    "gnss.altitude": (-450.0, 9000.0),  # m, Dead Sea to the highest roads with a margin
    "gnss.latitude": (-89.9, 89.9),  # deg
    "gnss.longitude": (-180.0, 180.0),  # deg
    "gnss.speed": (-0.5, 700.0),  # m/s or km/h; phones write -1
    "speed.v": (-60.0, 700.0),
    "wheel_speeds": (-60.0, 700.0),
}
ISOLATED = 3.0  # an extreme this many ranges of the rest away, met again and again, is a code
LATE_FIX = 10.0  # s after the start
FROZEN = 5.0  # s that a noisy signal stays exactly the same
SPEEDS = frozenset({"speed.v", "gnss.speed", *(f"wheel_speeds.{w}" for w in WHEELS)})
LEAP, LEAP_RATE = 3.0, 50.0  # m/s, m/s2: a wheel that locks or spins goes with 100, but not back
CODE = 1.0  # s that one code of a coarse speed may last
LAST = 0.5  # s, of a slow sensor's last sample, that no run counts
SINGLE = 1.5  # codes: steps that are mostly smaller are of one code
# share of steps that turn back: what noise does and a smooth signal does not; a speed's less often
LIVELY, LIVELY_SPEED = 0.3, 0.1
MAX_RADIANS = 100.0  # of a course; more would be sixteen turns one way
ROLLING = 1.0  # m/s
MAX_APART = 60.0  # s between two channels that should overlap
EPOCH_APART = 86400.0  # s; channels further apart count from different epochs

Checked = tuple[list[Finding], dict[str, Table]]


def inputs(tables: Mapping[str, Table]) -> Iterator[tuple[Section, Table]]:
    """Sections that are checked and have messages."""
    for name in CHECKED:
        section = SECTIONS[name]
        table = tables.get(section.topic)
        if table is not None and len(table):
            yield section, table


def stamps(tables: Mapping[str, Table]) -> list[Finding]:
    """Stamps that repeat or run backward, and channels that do not overlap in time."""
    found = []
    for topic, table in tables.items():
        backward = int((np.diff(table.time) < 0).sum())
        twice = int((np.diff(table.time) == 0).sum())
        if backward or twice:
            first = int(np.flatnonzero(np.diff(table.time) <= 0)[0])
            found.append(
                Finding(
                    "clock_backward",
                    "fault",
                    (topic,),
                    f"{backward} stamps run backward, {twice} repeat the one before",
                    "the logger's clock jumped or two recorders write one channel: use another "
                    "stamp (--clock header or publish of a bag or MCAP), or cut the log there",
                    _seconds(tables, int(table.time[first])),
                    float(backward + twice),
                )
            )
    spans = {s.topic: (int(t.time.min()), int(t.time.max())) for s, t in inputs(tables)}
    if spans:
        reference = IMU_TOPIC if IMU_TOPIC in spans else max(spans, key=lambda k: len(tables[k]))
        start, end = spans[reference]
        for topic, (first, last) in spans.items():
            apart = max(first - end, start - last) * 1e-9
            if apart > MAX_APART:
                epoch = " (another epoch)" if apart > EPOCH_APART else ""
                found.append(
                    Finding(
                        "clocks_differ",
                        "fault",
                        (topic, reference),
                        f"the channels do not overlap, they lie {apart:.0f} s apart{epoch}",
                        "their clocks differ: ingest with --time-offset, or give the right unit "
                        "in [time]",
                        value=apart,
                    )
                )
    return found


def invalid(tables: Mapping[str, Table]) -> Checked:
    """Codes for "invalid" among the values, and a first fix that comes late."""
    found: list[Finding] = []
    clean = dict(tables)
    for section, table in inputs(tables):
        columns = dict(table.columns)
        codes: dict[tuple[float, int, int], list[str]] = {}
        for signal in section.signals:
            values = _known_column(table, signal.field)
            if values is None or signal.role.endswith("_accuracy"):
                continue
            code = np.flatnonzero(_codes(signal.role, values))
            if not len(code):
                continue
            columns[signal.field] = values.copy()
            columns[signal.field][code] = np.nan
            good = np.flatnonzero(np.isfinite(columns[signal.field]))
            if section.name == "gnss" and len(good) and code[-1] < good[0]:
                continue  # `_late_fix` says so
            what = (float(values[code[0]]), len(code), int(table.time[code[0]]))
            codes.setdefault(what, []).append(signal.role)
        clean[section.topic] = dataclasses.replace(table, columns=columns)
        for (value, count, stamp), roles in codes.items():
            found.append(
                Finding(
                    "invalid_values",
                    "fault",
                    tuple(roles),
                    f"{count} samples, the first {value:g}, are no data but a code for invalid",
                    "give a condition in the profile, on the source's validity flag or on the "
                    'signal itself: valid = "NAME == 1"',
                    _seconds(tables, stamp),
                    float(count),
                )
            )
    return [*found, *_late_fix(tables, clean)], clean


def frozen(tables: Mapping[str, Table]) -> Checked:
    """Signals of IMU and speeds that stay exactly the same for seconds, where they else do not."""
    found: list[Finding] = []
    clean = dict(tables)
    for section, table in inputs(tables):
        if (np.diff(table.time) < 0).any():
            continue  # how long anything lasts is not known there, and clocks are told first
        moving = _moving(tables, table.time)
        columns = dict(table.columns)
        whole = _repeating(table, [signal.field for signal in section.signals])
        hung: dict[str, tuple[Indices, float]] = {}
        for signal in section.signals:
            values = _known_column(table, signal.field)
            if values is None or not (section.name == "imu" or signal.role in SPEEDS):
                continue
            known = np.flatnonzero(np.isfinite(values))
            seconds: Floats = np.multiply(table.time[known], 1e-9)
            lively = LIVELY_SPEED if signal.role in SPEEDS else LIVELY
            stuck = _stuck(values[known], seconds, lively) & moving[known]
            if stuck.any() and signal.role in SPEEDS:
                # a cruise holds one code of a coarse speed, for one second and for ten
                stuck &= not _lasting(values[known], seconds, moving[known])
            elif stuck.any() and _is_coarse(values[known]):
                stuck &= whole[known]  # one code of a coarse sensor lasts; all six do not
            length = float(stuck.mean() * np.ptp(table.time) * 1e-9) if len(known) else 0.0
            if length >= FROZEN - LAST:  # the rest of a stop is none
                hung[signal.role] = known[stuck], length
                columns[signal.field] = values.copy()
                columns[signal.field][known[stuck]] = np.nan
            elif section.name == "imu" and len(known) > 1 and np.ptp(values[known]) == 0:
                text = f"is {values[known[0]]:g} throughout"
                advice = "the sensor does not measure it, or the profile maps a dead channel"
                found.append(Finding("constant", "note", (signal.role,), text, advice))
        if hung:
            found.append(_hung(tables, table, hung))
        clean[section.topic] = dataclasses.replace(table, columns=columns)
    return found, clean


def _hung(
    tables: Mapping[str, Table], table: Table, hung: Mapping[str, tuple[Indices, float]]
) -> Finding:
    """One finding for the signals of a section. hung: role -> rows, s."""
    first = min(int(rows[0]) for rows, _ in hung.values())
    length = max(length for _, length in hung.values())
    if len(hung) == 1:
        signal = SIGNALS[next(iter(hung))]
        stay = f"stays at exactly {table.columns[signal.field][first]:g} {signal.unit}"
    else:
        stay = "stay exactly as they are"
    advice = (
        "the sensor or its gateway hung: leave that part out, or mark it invalid in the profile"
    )
    at = _seconds(tables, int(table.time[first]))
    return Finding("frozen", "fault", tuple(hung), f"{stay} for {length:.1f} s", advice, at, length)


def leaps(tables: Mapping[str, Table]) -> Checked:
    """Speeds of which single samples lie where no car gets and returns from in that time."""
    found: list[Finding] = []
    clean = dict(tables)
    for section, table in inputs(tables):
        columns = dict(table.columns)
        leapt: dict[str, tuple[Indices, float]] = {}
        for signal in section.signals:
            values = _known_column(table, signal.field) if signal.role in SPEEDS else None
            if values is None:
                continue
            known = np.flatnonzero(np.isfinite(values))
            rows, size = _leaps(values[known], np.multiply(table.time[known], 1e-9))
            if len(rows):
                leapt[signal.role] = known[rows], size
                columns[signal.field] = values.copy()
                columns[signal.field][known[rows]] = np.nan
        if leapt:
            first = min(int(rows[0]) for rows, _ in leapt.values())
            count = max(len(rows) for rows, _ in leapt.values())
            size = max(size for _, size in leapt.values())
            verb = "leaps" if len(leapt) == 1 else "leap"
            times = "once" if count == 1 else f"{count} times"
            text = f"{verb} by up to {size:.1f} m/s for one sample and back, {times}"
            advice = "bit errors, or a code for invalid: mark these samples invalid in the profile"
            at = _seconds(tables, int(table.time[first]))
            found.append(Finding("leaps", "fault", tuple(leapt), text, advice, at, float(count)))
        clean[section.topic] = dataclasses.replace(table, columns=columns)
    return found, clean


def _leaps(values: Floats, seconds: Floats) -> tuple[Indices, float]:
    """Samples further from both neighbours than a car gets, to one side; m/s of the largest."""
    if len(values) < 3:
        return np.empty(0, np.intp), 0.0
    before, after = values[1:-1] - values[:-2], values[1:-1] - values[2:]
    step = np.diff(seconds)
    may = np.where(step > 0, LEAP + LEAP_RATE * step, np.inf)
    away = (before * after > 0) & (np.abs(before) > may[:-1]) & (np.abs(after) > may[1:])
    beside = np.concatenate([[False], away, [False]])
    away &= ~(beside[:-2] | beside[2:])  # two channels in one leap at every sample
    rows = np.flatnonzero(away) + 1
    return rows, float(np.abs(before[away]).max()) if len(rows) else 0.0


def in_degrees(tables: Mapping[str, Table]) -> tuple[frozenset[str], dict[str, Table]]:
    """Angles all around that are in degrees, and the tables with them in radians."""
    found: set[str] = set()
    clean = dict(tables)
    for section, table in inputs(tables):
        columns = dict(table.columns)
        for signal in section.signals:
            values = _known_column(table, signal.field) if signal.kind == "angle" else None
            if values is not None and np.nanmax(np.abs(values)) > MAX_RADIANS:
                found.add(signal.role)
                columns[signal.field] = np.radians(values)
        clean[section.topic] = dataclasses.replace(table, columns=columns)
    return frozenset(found), clean


def _late_fix(tables: Mapping[str, Table], clean: Mapping[str, Table]) -> list[Finding]:
    gnss = clean.get(GNSS_TOPIC)
    if gnss is None or not len(gnss):
        return []
    start = min(int(table.time.min()) for _, table in inputs(tables))
    for field in ("latitude", "altitude"):
        values = _known_column(gnss, field)
        if values is None:
            continue
        fixed = np.flatnonzero(np.isfinite(values))
        if not len(fixed):
            continue
        first = (int(gnss.time[fixed[0]]) - start) * 1e-9
        if first <= LATE_FIX:
            return []
        raw = _known_column(tables[GNSS_TOPIC], field)
        codes = np.empty(0) if raw is None else raw[: fixed[0]][np.isfinite(raw[: fixed[0]])]
        if len(codes):
            advice = (
                f"till then the source writes {codes[0]:g}: give the signals a condition in the "
                'profile, valid = "NAME == 1" on its validity flag'
            )
        else:
            advice = "till then estimators have no GNSS"
        level: Level = "fault" if len(codes) else "note"
        text = f"no fix in the first {first:.0f} s"
        return [Finding("no_fix", level, (f"gnss.{field}",), text, advice, 0.0, first)]
    return []


def _known_column(table: Table, field: str) -> Floats | None:
    """Values as floats, NaN where not finite; None where nothing is known."""
    if field not in table.columns:
        return None
    values = np.array(table.columns[field], np.float64)
    values[~np.isfinite(values)] = np.nan
    return None if np.isnan(values).all() else values


def _codes(role: str, values: Floats) -> Bools:
    """Which samples lie outside the limits, or repeat an extreme far from all the rest."""
    low, high = next(
        (limits for key, limits in LIMITS.items() if role == key or _kind(role) == key),
        (-np.inf, np.inf),
    )
    code: Bools = (values < low) | (values > high)
    if role == "gnss.latitude" or role == "gnss.longitude":
        code |= values == 0.0
    rest = np.unique(values[np.isfinite(values) & ~code])
    for ends in (rest, rest[::-1]):
        if len(ends) < 20:
            break
        spread = abs(float(ends[-1] - ends[1]))
        if abs(float(ends[1] - ends[0])) > ISOLATED * spread and (values == ends[0]).sum() > 1:
            code |= values == ends[0]
    return code


def _kind(role: str) -> str:
    """`accel` and `gyro` for the inertial roles, else the section."""
    section, field = role.split(".")
    return field.split("_")[0] if section == "imu" else section


def _stuck(values: Floats, seconds: Floats, lively: float) -> Bools:
    """Samples in runs of one exact value of FROZEN s or more, where the rest is noisy.

    lively: share of steps that turn back, at least, of what is noisy.
    """
    if len(values) < 3:
        return np.zeros(len(values), np.bool_)
    edges = np.flatnonzero(np.diff(values) != 0) + 1
    starts, ends = np.r_[0, edges], np.r_[edges, len(values)]
    result = np.repeat(seconds[ends - 1] - seconds[starts] >= FROZEN, ends - starts)
    steps = np.diff(values[~result])
    steps = steps[steps != 0]
    if len(steps) < 10 or np.mean(steps[1:] * steps[:-1] < 0) < lively:
        return np.zeros(len(values), np.bool_)
    return result


def _lasting(values: Floats, seconds: Floats, moving: Bools) -> bool:
    """Whether values stay the same for CODE s and more on the move also outside of longer runs."""
    edges = np.flatnonzero(np.diff(values) != 0) + 1
    starts, ends = np.r_[0, edges], np.r_[edges, len(values)]
    length = seconds[ends - 1] - seconds[starts]
    return bool(((length >= CODE) & (length < FROZEN) & moving[starts]).any())


def _repeating(table: Table, fields: list[str]) -> Bools:
    """Rows of runs of FROZEN s or more in which every field stays as it is."""
    columns = [v for f in fields if (v := _known_column(table, f)) is not None]
    result = np.zeros(len(table), np.bool_)
    if not columns:
        return result
    rows = np.stack(columns)
    same = np.all((rows[:, 1:] == rows[:, :-1]) | ~np.isfinite(rows[:, 1:]), axis=0)
    for run in runs(np.concatenate([[False], same])):
        result[run] = (table.time[run.stop - 1] - table.time[run.start]) * 1e-9 >= FROZEN
    return result


def _is_coarse(values: Floats) -> bool:
    """Whether a sensor mostly moves by a single code, so that it may rest on one."""
    codes, steps = np.unique(values), np.abs(np.diff(values))
    steps = steps[steps > 0]
    step = float(np.median(np.diff(codes))) if len(codes) > 1 else 0.0
    return len(steps) > 0 and float(np.median(steps)) < SINGLE * step


def _moving(tables: Mapping[str, Table], at: Stamps) -> Bools:
    """Where the car moves; a coarse sensor may well stand still with it. True without a speed."""
    speed = speed_at(tables, at)
    return np.ones(len(at), np.bool_) if speed is None else speed > ROLLING


def speed_at(tables: Mapping[str, Table], at: Stamps) -> Floats | None:
    """Size of the first speed that the log has, at any times, m/s; None without one."""
    for role in ("wheel_speeds.fl", "speed.v", "gnss.speed"):
        table = tables.get(SECTIONS[role.split(".")[0]].topic)
        speed = None if table is None else _known_column(table, SIGNALS[role].field)
        if table is not None and speed is not None:
            known = np.isfinite(speed)
            return np.interp(at, table.time[known], np.abs(speed[known]))
    return None


def _seconds(tables: Mapping[str, Table], stamp: int) -> float:
    start = min(int(table.time.min()) for table in tables.values() if len(table))
    return (stamp - start) * 1e-9
