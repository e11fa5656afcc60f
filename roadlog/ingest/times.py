"""Time columns of text and table sources: numbers in a unit, ISO 8601, phone forms."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from roadlog.errors import ConfigError, LogReadError
from roadlog.types import Floats, Stamps
from roadlog.units import to_si

# forms that loggers write besides ISO 8601
FORMATS = (
    "%d-%b-%Y %H:%M:%S.%f",  # iOS loggers: 24-May-2019 18:11:23.018
    "%d-%b-%Y %H:%M:%S",
    "%d.%m.%Y %H:%M:%S.%f",
    "%d.%m.%Y %H:%M:%S",
    "%m/%d/%Y %H:%M:%S.%f",
    "%m/%d/%Y %H:%M:%S",
    "%Y/%m/%d %H:%M:%S.%f",
    "%Y/%m/%d %H:%M:%S",
    "%H:%M:%S.%f",
    "%H:%M:%S",
)
TIME_NAMES = ("time_ns", "time", "t", "timestamp", "timestamps", "time_s", "seconds", "datetime")


def from_numbers(values: Floats, unit: str) -> Stamps:
    """ns from numbers in a unit of time; the first one keeps its full value."""
    nanoseconds = round(to_si(unit, "s") * 1e9)
    whole = np.floor(values)
    return whole.astype(np.int64) * nanoseconds + np.rint((values - whole) * nanoseconds).astype(
        np.int64
    )


def from_texts(texts: Sequence[str], where: str) -> Stamps:
    """ns since the epoch from dates and times; a time without zone is taken as UTC.

    Raises LogReadError naming the row.
    """
    first = texts[0].strip()
    form = next((form for form in FORMATS if _fits(first, form)), None)
    stamps = np.empty(len(texts), np.int64)
    for k, text in enumerate(texts):
        try:
            text = text.strip()
            moment = datetime.strptime(text, form) if form else datetime.fromisoformat(text)
        except ValueError:
            raise LogReadError(
                f"{where}, row {k + 1}: '{text}' is no time that is understood; "
                f"give [time] unit in the profile, or ISO 8601"
            ) from None
        aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
        if form and form.startswith("%H"):
            aware = aware.replace(year=1970)  # a clock without a date starts at the epoch
        delta = aware - datetime(1970, 1, 1, tzinfo=UTC)
        stamps[k] = (delta.days * 86400 + delta.seconds) * 10**9 + delta.microseconds * 1000
    return stamps


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
    for unit, epoch in (("ns", 1e17), ("us", 1e14), ("ms", 1e11), ("s", 1e8)):
        if abs(first) >= epoch:
            return unit
    step = float(np.median(np.diff(values))) if len(values) > 1 else 0.01
    if step < 1.0:
        return "s"
    if step.is_integer() and len(values) > 1 and np.all(values == np.floor(values)) and step >= 5:
        return "ms"
    raise ConfigError(
        f'the unit of the time column is not clear (step {step:g}); give [time] unit = "s" or '
        f'"ms" in the profile'
    )
