"""Time columns of text and table sources: numbers in a unit, ISO 8601, phone forms."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta, timezone, tzinfo
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.types import Bools, Floats, Stamps
from roadlog.units import CLOCK_FORMS, to_si

# forms that loggers write besides ISO 8601, up to the minute; month names are English
FORMATS = (
    "%d-%b-%Y %H:%M",  # iOS loggers: 24-May-2019 18:11:23.018
    "%d-%b-%Y %I:%M%p",
    "%d-%b-%Y %H:%M%z",
    "%d %b %Y %H:%M",
    "%b %d, %Y %H:%M",
    "%b %d, %Y %I:%M%p",
    "%d.%m.%Y %H:%M",
    "%d.%m.%y %H:%M",
    "%Y/%m/%d %H:%M",
    "%Y_%m_%d %H:%M",
    "%H:%M",
    "%I:%M%p",
)
# the same numbers mean either; a drive is too short to tell, but for a day beyond the 12th
DAY_FIRST, MONTH_FIRST = (
    tuple(f"{date}{year} {clock}" for year in ("%Y", "%y") for clock in ("%H:%M", "%I:%M%p"))
    for date in ("%d/%m/", "%m/%d/")
)
_SLASHED = re.compile(r"\s*(\d{1,2})/(\d{1,2})/\d{2}(?:\d{2})?[ T]")
# head up to the minute, seconds, fraction, and what follows: a zone, AM or PM
_CLOCK = re.compile(
    r"^\s*+(.*?\d{1,2}:\d{2}):(\d{2})(?:[.,:](\d+))?\s*+([A-Za-z]{0,3}|[+-]\d{2}:?\d{2})\s*$"
)
_BRACKETS = re.compile(r"[\[(]([^\[(\])]*)[\])]\s*$")
# what C's asctime and Java's Date write: Sun Mar 01 09:00:06 GMT+08:00 2026
_ASCTIME = re.compile(
    r"^\s*[A-Z][a-z]{2} ([A-Z][a-z]{2}) +(\d{1,2}) (\d{2}:\d{2}:\d{2}(?:\.\d+)?)"
    r"(?: (?:GMT|UTC)?([+-]\d{2}:\d{2})?)? (\d{4})\s*$"
)
LAST_STAMP = 2**62  # ns, year 2116: int64 holds the difference of two stamps too
UNSIGNED = 2.0**64  # a negative number of 64 bits that lost its sign lies below
MINUTE = 60 * 10**9 + 10**9  # ns, one with a leap second
DAY = 86400 * 10**9  # ns
EXCEL_1970, DATENUM_1970 = 25569.0, 719529.0  # 1970-01-01 in days of spreadsheets and of MATLAB
DAYS = {"excel": (30000.0, 60000.0), "datenum": (720000.0, 760000.0)}  # 1982 to 2064, to 2080
LARGEST_DAY_STEP = 2e-4  # 17 s
DATES = (1.9e13, 2.1e13)  # yyyymmddhhmmss
SLOWEST = 2.0  # s between rows of a time of day
TIME_NAMES = ("time_ns", "time", "t", "timestamp", "timestamps", "time_s", "seconds", "datetime")


def time_column(names: Sequence[str], column: str, where: str) -> str:
    """The time column of a table: the profile's, or the first of a usual name.

    Raises ConfigError with the near names.
    """
    if column:
        if column not in names:
            raise ConfigError(f"{where}: no time column '{column}'. {near(column, names)}")
        return column
    folded = {without_unit(name).lower(): name for name in reversed(names)}
    for name in TIME_NAMES:
        if name in folded:
            return folded[name]
    raise ConfigError(
        f'{where}: which column is the time? Say [time] column = "..." in the profile. '
        + near("time", names)
    )


def without_unit(name: str) -> str:
    """`Time (s)` and `Time [s]` without what stands in brackets at the end."""
    return _BRACKETS.sub("", name).strip() or name


def bracketed(name: str) -> str:
    """What stands in brackets at the end of a name; empty for nothing."""
    found = _BRACKETS.search(name)
    return found[1].strip() if found else ""


def stamps(
    values: NDArray,
    unit: str,
    where: str,
    before: int = 0,
    zone: str = "",
    day_first: bool = False,
) -> tuple[Stamps, Bools]:
    """ns of each row of a time column that has one, and which rows these are.

    values: numbers, datetime64, timedelta64 or texts. before: rows before these, for messages.
    zone, day_first: of dates, as `from_texts` has them. Raises LogReadError naming the first row
    where none has a time, ConfigError for a unit that is not clear.
    """
    if values.dtype.kind in "Mm":
        keep: Bools = ~np.isnat(values)
        return values[keep].astype(f"{values.dtype.kind}8[ns]").astype(np.int64), keep
    if values.dtype.kind in "OUS":
        texts = [str(value) for value in values]
        return from_texts(texts, where, before, zone, day_first)
    keep = np.isfinite(values)
    if not keep.any():
        raise LogReadError(f"{where}: the time column holds no number")
    return from_numbers(values, unit or unit_of(values, where))


def unit_of(values: NDArray, where: str) -> str:
    """`guess_unit` of the known ones. Raises ConfigError."""
    try:
        return guess_unit(np.asarray(values[np.isfinite(values)], np.float64))
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def from_numbers(values: NDArray, unit: str) -> tuple[Stamps, Bools]:
    """ns from numbers in a unit of time, and which rows have a time that int64 holds.

    The first one keeps its full value.
    """
    if unit in CLOCK_FORMS:
        return _from_form(values, unit)
    nanoseconds = tick(unit)
    if values.dtype.kind == "f":
        values = np.where(values >= UNSIGNED / 2, values - UNSIGNED, values)
    elif values.dtype.kind == "u" and values.dtype.itemsize == 8:
        values = values.view(np.int64)
    keep: Bools = np.abs(values.astype(np.float64)) < LAST_STAMP / nanoseconds  # not so for NaN
    kept = values[keep]
    if values.dtype.kind in "iu":
        return kept.astype(np.int64) * nanoseconds, keep
    whole = np.floor(kept)
    rest = np.rint((kept - whole) * nanoseconds).astype(np.int64)
    return whole.astype(np.int64) * nanoseconds + rest, keep


def tick(unit: str) -> int:
    """ns of a unit of time; of texts and forms of clocks a second."""
    return 10**9 if unit in CLOCK_FORMS or not unit else round(to_si(unit, "s") * 1e9)


def _from_form(values: NDArray, form: str) -> tuple[Stamps, Bools]:
    """ns from one of CLOCK_FORMS."""
    keep: Bools = np.isfinite(values.astype(np.float64))
    numbers = values[keep].astype(np.float64)
    if form in ("excel", "datenum"):
        days = numbers - (EXCEL_1970 if form == "excel" else DATENUM_1970)
        return np.rint(days * DAY * 1e-3).astype(
            np.int64
        ) * 1000, keep  # to a us: what doubles hold
    whole = np.floor(numbers)
    rest = np.rint((numbers - whole) * 1e9).astype(np.int64)
    clock = (whole % 1e6).astype(np.int64)
    seconds = clock // 10000 * 3600 + clock // 100 % 100 * 60 + clock % 100
    if form == "yyyymmddhhmmss":
        date = (whole // 1e6).astype(np.int64)
        months = (date // 10000 - 1970) * 12 + date // 100 % 100 - 1
        first = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
        seconds = seconds + (first + date % 100 - 1) * 86400
    return seconds * 10**9 + rest, keep


def day_before_month(texts: Sequence[str], likely: bool) -> tuple[bool, bool]:
    """Whether dates with slashes have the day first, and whether that is a guess.

    likely: where no date tells, as where a comma stands for the point.
    """
    dates = {match.groups() for text in texts if (match := _SLASHED.match(text))}
    if any(int(first) > 12 for first, _ in dates):
        return True, False
    if any(int(second) > 12 for _, second in dates) or not dates:
        return False, False
    if any(text.strip().lower().endswith(("am", "pm")) for text in texts):
        return False, True
    return likely or any("," in text for text in texts), True


def from_texts(
    texts: Sequence[str], where: str, before: int = 0, zone: str = "", day_first: bool = False
) -> tuple[Stamps, Bools]:
    """ns since the epoch from dates and times, and which are understood.

    A time without zone is taken in `zone`, else as UTC; day_first: 01/03 is the first of March.
    Raises LogReadError naming the first row where none is.
    """
    minutes: dict[tuple[str, str], int | None] = {}  # what stands around the seconds -> ns
    result = np.empty(len(texts), np.int64)
    keep = np.zeros(len(texts), np.bool_)
    for k, text in enumerate(texts):
        match = _CLOCK.match(_ASCTIME.sub(r"\2-\1-\5 \3\4", text))
        if match is None:
            continue
        head, seconds, fraction, tail = match.groups()
        key = head, tail
        if key not in minutes:
            minutes[key] = _minute(head, tail, zone, day_first)
        minute = minutes[key]
        if minute is not None:
            rest = int(seconds) * 10**9 + int((fraction or "0")[:9].ljust(9, "0"))
            result[k] = minute + rest
            keep[k] = True
    if not keep.any() and any(text.strip() for text in texts):
        row, text = next((k, text) for k, text in enumerate(texts) if text.strip())
        raise LogReadError(
            f"{where}, row {before + row + 1}: '{text}' is no time that is understood; "
            f"give [time] unit in the profile, or ISO 8601"
        )
    return result[keep], keep


def of_text(text: str, day_first: bool = False) -> int | None:
    """ns since the epoch of one date and time as if in UTC; None for none."""
    match = _CLOCK.match(_ASCTIME.sub(r"\2-\1-\5 \3\4", text))
    minute = _minute(match[1], match[4], day_first=day_first) if match else None
    if match is None or minute is None:
        return None
    return minute + int(match[2]) * 10**9 + int((match[3] or "0")[:9].ljust(9, "0"))


def _minute(head: str, tail: str, zone: str = "", day_first: bool = False) -> int | None:
    """ns of a moment without its seconds: `2019-05-24T18:11` and `Z`; None for no such moment."""
    tail = tail.strip()
    text = head.strip()
    slashed = (*DAY_FIRST, *MONTH_FIRST) if day_first else (*MONTH_FIRST, *DAY_FIRST)
    forms = slashed if text[1:3].count("/") else FORMATS
    form = next((form for form in forms if _fits(text + tail, form)), None)
    try:
        if form:
            moment = datetime.strptime(text + tail, form)
        else:
            moment = datetime.fromisoformat(f"{text}:00{tail}")
    except ValueError:
        return None
    clock = bool(form and form.startswith(("%H", "%I")))
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=zone_of(zone) if zone and not clock else UTC)
    if clock:
        moment = moment.replace(year=1970)  # a clock without a date starts at the epoch
    delta = moment - datetime(1970, 1, 1, tzinfo=UTC)
    nanoseconds = (delta.days * 86400 + delta.seconds) * 10**9
    return nanoseconds if abs(nanoseconds) < LAST_STAMP - MINUTE else None


def _fits(text: str, form: str) -> bool:
    try:
        datetime.strptime(text, form)
    except ValueError:
        return False
    return True


def guess_unit(values: Floats) -> str:
    """Unit of a time column that the profile does not state: by its size (epoch) or its step.

    Raises ConfigError when the step could be either seconds or milliseconds.
    """
    first = float(values[0])
    steps = np.diff(values)
    moved = steps[steps != 0]  # coarse stamps repeat
    step = float(np.median(moved)) if len(moved) else 0.01
    if DATES[0] < first < DATES[1]:
        return "yyyymmddhhmmss"
    for unit, (low, high) in DAYS.items():
        if low < first < high and 0 < step < LARGEST_DAY_STEP:
            return unit
    for unit, epoch in (("ns", 1e17), ("us", 1e14), ("ms", 1e11), ("s", 1e8)):
        if abs(first) >= epoch:
            return unit
    if _are_of_day(values):
        return "hhmmss"
    if step < 1.0 or (step == 1.0 and len(moved) < len(steps) / 2):
        return "s"
    if step.is_integer() and len(values) > 1 and np.all(values == np.floor(values)) and step >= 5:
        return "ms"
    raise ConfigError(
        f'the unit of the time column is not clear (step {step:g}); give [time] unit = "s" or '
        f'"ms" in the profile'
    )


def _are_of_day(values: Floats) -> bool:
    """Whether numbers are hhmmss: minutes go by, and never a second beyond 59."""
    whole = np.floor(values)
    minutes = np.unique(whole // 100)
    if len(minutes) < 2 or values.min() < 0 or values.max() >= 240000:
        return False
    near = bool(np.median(np.abs(np.diff(values))) <= SLOWEST)
    return near and bool((whole % 100 < 60).all() and (minutes % 100 < 60).all())


def unit_stated(*units: str) -> str:
    """The first of some units that is one of time; empty for none."""
    for unit in units:
        if unit in CLOCK_FORMS:
            return unit
        with suppress(ConfigError):
            if unit and to_si(unit, "s"):
                return unit
    return ""


def local(moment: int, zone: str, where: str) -> tuple[int, str]:
    """ns by which a clock without a zone is ahead of UTC at a moment of its own, and a sentence.

    zone: `Europe/Berlin` or `+01:00`; empty for unknown, taken as UTC. Raises ConfigError.
    """
    if not zone:
        said = "its stamps are in a local time without a zone, taken as UTC (--timezone ZONE)"
        return 0, f"{where}: {said}"
    at = datetime.fromtimestamp(moment // 10**9, UTC).replace(tzinfo=zone_of(zone))
    ahead = at.utcoffset() or timedelta(0)
    return round(ahead.total_seconds()) * 10**9, f"{where}: its stamps are taken in {zone}"


def zone_of(text: str) -> tzinfo:
    """A zone by its name or its distance from UTC. Raises ConfigError."""
    if match := re.fullmatch(r"(?:UTC|GMT)?([+-])(\d{1,2}):?(\d{2})?", text.strip()):
        ahead = timedelta(hours=int(match[2]), minutes=int(match[3] or 0))
        return timezone(-ahead if match[1] == "-" else ahead)
    try:
        return ZoneInfo(text.strip())
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ConfigError(f"'{text}' is no time zone: write Europe/Berlin or +01:00") from None
