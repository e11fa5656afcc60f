"""The moment that the head of a text table states: `Log Date`, `Start time:`, `Messbeginn`.

MoTeC, AiM, Dewesoft, CANape, DIAdem and LabVIEW write it above the names, and count the stamps of
the rows from it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from roadlog.ingest.formats import times
from roadlog.ingest.formats.text import moment

_OF = (
    r"(?:(?:log|start(?:ing)?|begin\w*|record\w*|session|measure\w*|mess\w*|aufnahme\w*|aufzeichn\w*"
    r"|acquisition|acq|test|trigger)[ _-]*(?:of)?[ _-]*)"  # not of a file's creation: an export
)
_DAY, _HOUR = r"(?:date|datum|fecha|data|jour|giorno)", r"(?:time|zeit|uhrzeit|hora|heure|ora)"
_LABEL = re.compile(
    rf"{_OF}?(?:{_DAY}|{_HOUR}|{_DAY}[ /_-]*(?:and|und|&)?[ /_-]*{_HOUR}|timestamp)"
    rf"|{_OF}(?:on|at|am|started)?|started|beginn?",
    re.IGNORECASE,
)
_CLOCK = re.compile(
    r"(?<![\d:])(\d{1,2}:\d{2})(:\d{2})?([.,:]\d+)?( *[ap]\.?m\.?)?(Z|[+-]\d{2}:?\d{2})?(?![\d:])",
    re.IGNORECASE,
)
_NUMBERS = re.compile(
    r"(?<!\d)(?:\d{4}([-/.])\d{1,2}\1\d{1,2}|\d{1,2}([-/.])\d{1,2}\2\d{2,4})(?!\d)"
)
_WORDS = re.compile(
    r"(?:(?<![^\W\d])[^\W\d]++\.? ++\d{1,2}|(?<!\d)\d{1,2}\.? ++[^\W\d]++\.?),? ++\d{4}"
)


@dataclass(frozen=True)
class Begun:
    """ns of the midnight and of the moment of the start, as if in UTC; 0 for none.

    zoned: whether a zone is stated, so that it is. guessed: a date that may be read in two ways.
    said: a sentence for where it dates the rows.
    """

    midnight: int = 0
    moment: int = 0
    zoned: bool = False
    guessed: str = ""
    said: str = ""

    def in_zone(self, zone: str, name: str) -> Begun:
        """In UTC, of a file. Raises ConfigError for an unknown zone."""
        if not self.midnight:
            return self
        said = f"{name}: dated by its head"
        if self.guessed:
            said += f"; '{self.guessed}' is read with the day before month: nothing tells"
        if self.zoned:
            return replace(self, said=said)
        ahead, local = times.local(self.moment or self.midnight, zone, name)
        moment = self.moment - ahead if self.moment else 0
        said += f"; {local.removeprefix(f'{name}: ')}"
        return replace(self, midnight=self.midnight - ahead, moment=moment, said=said)


def begun(lines: Sequence[str], delimiter: str) -> Begun:
    """What the lines above the rows say."""
    day, clock = "", None
    for label, value in _pairs(lines, delimiter):
        if not _LABEL.fullmatch(label.strip(" #%:;")):
            continue
        numbers, words = _NUMBERS.search(value), _WORDS.search(value)
        found = numbers or words
        day = day or (found[0] if found else "")
        clock = clock or _CLOCK.search(value)
    if not day:
        return Begun()
    midnight, guessed = _ns(day, "00:00:00")
    if clock is None or not midnight:
        return Begun(midnight, guessed=guessed)
    hour, second, part, half, zone = (group or "" for group in clock.groups())
    half = half.replace(".", "").strip().upper()
    text = f"{hour}{second or ':00'}{part.replace(',', '.')}{f' {half}' if half else ''}"
    return Begun(midnight, _ns(day, text + zone)[0], bool(zone), guessed)


def _pairs(lines: Sequence[str], delimiter: str) -> Iterator[tuple[str, str]]:
    """Labels and what is said of them, in the next cell or behind a colon."""
    for line in lines:
        cells = [cell.strip(' "\r\n') for cell in re.split(f"[\t{re.escape(delimiter)}]", line)]
        for cell, following in zip(cells, [*cells[1:], ""], strict=True):
            yield cell, following
            label, colon, rest = cell.partition(":")
            if colon:
                yield label, rest
        yield cells[0], " ".join(cells[1:])  # a date with a comma in it


def _ns(day: str, clock: str) -> tuple[int, str]:
    """ns of a moment as if in UTC, and the day where it may be read in two ways."""
    if _WORDS.fullmatch(day):
        return moment(f"{day} {clock}") or 0, ""
    first = re.fullmatch(r"(\d{1,2})-(\d{1,2})-(\d{2,4})", day)
    day = ".".join(first.groups()) if first else day
    text = f"{day} {clock}"
    day_first, guessed = times.day_before_month([text], likely=True)
    return times.of_text(text, day_first) or 0, day if guessed else ""
