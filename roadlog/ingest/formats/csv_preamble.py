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
    r"(?<![\d:])(\d{1,2}:\d{2})(:\d{2})?([.,:]\d+)?( *[ap]\.?m\.?)?"
    r"( *(?:Z|UTC|GMT|[+-]\d{2}:?\d{2}))?(?![\d:])",
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

    zoned: whether a zone is stated, so that it is. guessed: how a date that may be read in two
    ways is read. wrong: what should be a moment and is none. said: a sentence for where it dates
    the rows, or should.
    """

    midnight: int = 0
    moment: int = 0
    zoned: bool = False
    guessed: str = ""
    wrong: str = ""
    said: str = ""

    def in_zone(self, zone: str, name: str) -> Begun:
        """In UTC, of a file. Raises ConfigError for an unknown zone."""
        if self.wrong:
            said = f"{name}: '{self.wrong}' in its head is no moment: it dates no row"
            return replace(self, said=said)
        if not self.midnight:
            return self
        said = f"{name}: dated by its head{self.guessed}"
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
    if clock is None:
        midnight, guessed = _ns(day, "00:00:00")
        return Begun(midnight, guessed=guessed, wrong="" if midnight else day)
    half, zone = clock[4] or "", (clock[5] or "").strip()
    midnight, guessed = _ns(day, "00:00:00", half)
    text = _of_24_hours(clock)
    start, _ = _ns(day, text, half) if text else (0, "")
    if not midnight or not start:
        return Begun(wrong=f"{day} {clock[0].strip()}")
    ahead = times.local(start, zone, "")[0] if zone[:1] in ("+", "-") else 0
    return Begun(midnight - ahead, start - ahead, bool(zone), guessed)


def _of_24_hours(clock: re.Match[str]) -> str:
    """`13:02:03.5` of `1:02:03,5 p.m.`; empty where no clock shows that."""
    whole, second, part, half = (clock[k] or "" for k in range(1, 5))
    hour, minute = map(int, whole.split(":"))
    if half and "a" in half.lower() and hour > 12:
        return ""
    if half and hour <= 12:
        hour = hour % 12 + (12 if "p" in half.lower() else 0)
    return f"{hour:02d}:{minute:02d}{second or ':00'}{part.replace(',', '.')}"


def _pairs(lines: Sequence[str], delimiter: str) -> Iterator[tuple[str, str]]:
    """Labels and what is said of them, in the next cell, behind a colon or a blank."""
    for line in lines:
        cells = [cell.strip(' "\r\n') for cell in re.split(f"[\t{re.escape(delimiter)}]", line)]
        for cell, following in zip(cells, [*cells[1:], ""], strict=True):
            yield cell, following
            label, colon, rest = cell.partition(":")
            if colon:
                yield label, rest
            if found := _NUMBERS.search(cell) or _WORDS.search(cell) or _CLOCK.search(cell):
                yield cell[: found.start()], cell[found.start() :]
        yield cells[0], " ".join(cells[1:])  # a date with a comma in it


def _ns(day: str, clock: str, half: str = "") -> tuple[int, str]:
    """ns of a moment as if in UTC, 0 for none, and how a day of two readings is read.

    half: AM or PM, as those write who put the month first.
    """
    if _WORDS.fullmatch(day):
        return moment(f"{day} {clock}") or 0, ""
    day = day if re.match(r"\d{4}", day) else day.replace("-", "/")
    written = f"{day} {clock}{half}".replace(".m", "m").rstrip(".")
    day_first, guessed = times.day_before_month([written], likely=True)
    order = "day before month" if day_first else "month before day"
    said = f"; '{day}' is read with the {order}: nothing tells" if guessed else ""
    return times.of_text(f"{day} {clock}", day_first) or 0, said
