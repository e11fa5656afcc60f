"""Text of loggers: whatever its encoding, and dates in the words of several languages."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

# first letters of months without accents: English, German, French, Spanish, Italian
_MONTHS = (
    ("jan", "ene", "gen"),
    ("feb", "fev"),
    ("mar", "mrz", "mae"),
    ("apr", "avr", "abr"),
    ("may", "mai", "mag"),
    ("jun", "juin", "giu"),
    ("jul", "juil", "lug"),
    ("aug", "aou", "ago"),
    ("sep", "set"),
    ("oct", "okt", "ott"),
    ("nov",),
    ("dec", "dez", "dic"),
)
_DATE = re.compile(
    r"(?:(?P<month>[a-z]+)\.? +(?P<day>\d+)|(?P<day2>\d+)\.? +(?P<month2>[a-z]+)\.?),? +"
    r"(?:(?P<year2>\d{4}),? +)?(?P<hour>\d+):(?P<minute>\d+):(?P<second>\d+)(?:[.,:](?P<part>\d+))?"
    r"(?: *(?P<half>[ap])\.?m\.?)?(?: +(?P<year>\d{4}))?$"
)


# code page -> its most common letters, as bytes: Japanese; Korean, then Chinese, whose common
# characters begin where Korean letters do
_LETTERS = {
    "cp932": rb"[\x81-\x9f][\x40-\x7e\x80-\xfc]",
    "cp949": rb"[\xb0-\xc8][\xa1-\xfe]",
    "gb18030": rb"[\xb0-\xd7][\xa1-\xfe]",
}
_MOSTLY = 0.8  # of what is not ASCII
_CYRILLIC = rb"[\xc0-\xff]{3}"  # Western words have no three letters with accents in a row


def decoded(line: bytes) -> str:
    """UTF-8, or where it is not (a unit written by another program), the code page of its bytes."""
    try:
        return line.decode("utf-8-sig")
    except UnicodeDecodeError:
        return line.decode(_code_page(line), "replace")


def _code_page(line: bytes) -> str:
    """The one of whose common letters a line is, else Windows-1252."""
    for name, letter in _LETTERS.items():
        found = len(re.findall(letter, line))
        if found > 1:
            with suppress(UnicodeDecodeError):
                strange = sum(not c.isascii() for c in line.decode(name))
                if found > _MOSTLY * strange:
                    return name
    return "cp1251" if re.search(_CYRILLIC, line) else "cp1252"


def lines_of(path: Path) -> Iterator[str]:
    """The lines of a file without their ends."""
    with path.open("rb") as file:
        for line in file:
            yield decoded(line).rstrip("\r\n")


def plain(text: str) -> str:
    """In lower case without accents."""
    apart = unicodedata.normalize("NFKD", text.lower())
    return "".join(c for c in apart if not unicodedata.combining(c))


def moment(text: str) -> int | None:
    """ns since the epoch of `Mon Mär 30 12:24:00.5 pm 2026`, as if UTC; None for no such date."""
    words = re.sub(r"^[a-z]+\.?,? +(?=[a-z]|\d+\.? +[a-z])", "", plain(text.strip()))  # weekday
    match = _DATE.search(words)
    if not match:
        return None
    found = match.groupdict()
    name = found["month"] or found["month2"]
    month = next((k for k, names in enumerate(_MONTHS, 1) if name.startswith(names)), 0)
    hour = int(found["hour"])
    if found["half"]:
        hour = hour % 12 + (12 if found["half"] == "p" else 0)
    try:
        whole = datetime(
            int(found["year"] or found["year2"] or 1970),
            month,
            int(found["day"] or found["day2"]),
            hour,
            int(found["minute"]),
            int(found["second"]),
            tzinfo=UTC,
        )
    except ValueError:
        return None
    return round(whole.timestamp()) * 10**9 + int((found["part"] or "0")[:9].ljust(9, "0"))
