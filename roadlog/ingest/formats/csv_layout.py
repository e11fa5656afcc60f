"""How a text table is written: encoding, delimiter, what stands before the numbers, names, units.

Loggers write a preamble of any form (MoTeC, AiM, Dewesoft, DIAdem, CANape), then names, often a row
of units, then rows of one width. The rows are found first; what stands above them is the header.
"""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest.formats.text import decoded
from roadlog.signals import SIGNALS
from roadlog.units import UNITS, canonical

HEAD = 1 << 16  # bytes in which the header and the first rows are
LOOKED = 60  # rows that tell the width
FOLLOWING = 5  # lines after the first row of numbers that are rows too
COMMENTS = ("#", "%", "//")
SEPARATOR = "sep="  # Excel's word on the delimiter
DELIMITERS = "\t;,|"
BLANK = " "
SURE = 0.9  # share of lines that are rows of one width
_NUMBER = re.compile(r"[+-]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?", re.IGNORECASE)
_CONTROL = re.compile(rb"[\x00-\x08\x0e-\x19\x1b\x1c\x7f]")  # of no text; 1A ends one in DOS
_MOMENT = re.compile(r"\d{1,4}[-/.:]\d{1,2}[-/.:T ].*\d")
NOTHING = frozenset(("", "-", "--", "na", "n/a", "null", "none", "nan", "inf", "-inf", "#n/a"))
# units of quantities that are none of ours, and what stands where there is none
_OTHERS = re.compile(
    r"m?bar|[kh]?pa|psi|m?v|m?a|k?w|hp|ps|[ckf]|deg[cf]|celsius|k?hz|m?l|g/s|kg|gal|ohm|lambda|#|"
    r"deg/m|1/m|l/h|l/100 ?km|count|bool|raw|hh:?mm:?ss|enum|state|degrees|minutes|ratio|lap|bit|"
    r"text|°[cf]|unix time|sats",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class TextLayout:
    """How a text table is written.

    encoding: of the text. delimiter: between fields, a blank for runs of blanks. names, units: of
    the columns, units where a row under the names has them. start: bytes before the first row of
    numbers. headless: its first line holds numbers, the names are ours. above: the lines before.
    """

    encoding: str
    delimiter: str
    names: list[str]
    units: dict[str, str]
    start: int
    headless: bool = False
    above: tuple[str, ...] = ()


def layout(path: Path) -> TextLayout:
    """Raises LogReadError when it is no text table."""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
            whole = len(head) < HEAD
    except OSError as error:
        raise LogReadError(f"{path}: cannot be opened: {error.strerror}") from error
    encoding = _encoding(head)
    if not encoding.startswith("utf-16"):
        head = head.rstrip(b"\0")  # a block that a logger did not come to fill
        strange = sum(byte > 127 for byte in head) if encoding == "cp1252" else 0
        if _CONTROL.search(head) or 2 * strange > len(head):
            raise LogReadError(f"{path}: is no text table")
    lines = _lines(head, encoding)
    if not any(line.strip() and not _is_comment(line) for line, _ in lines):
        raise LogReadError(f"{path}: is empty; nothing to ingest")
    if not whole and lines:
        if len(lines) == 1:
            raise LogReadError(f"{path}: is no text table: its first line does not end")
        lines.pop()  # cut by the end of the head
    delimiter, first, width = _rows(lines)
    starts = np.cumsum([0, *(size for _, size in lines)])
    above = tuple(line for line, _ in lines[:first])
    names, units, headless = _header(above, delimiter, width)
    behind = (fields_of(line, delimiter)[len(names) :] for line, _ in lines[first:])
    if len(names) < width - 1 and not any(map(any, behind)):  # spreadsheets delimit blank columns
        names += [f"column {k + 1}" for k in range(len(names), width)]
    return TextLayout(encoding, delimiter, names, units, int(starts[first]), headless, above)


def _rows(lines: Sequence[tuple[str, int]]) -> tuple[str, int, int]:
    """Delimiter, the first row of numbers, and the fields of a row.

    Where there is no such row, the first line that is no comment is the header.
    """
    said = next((line.strip()[4:5] for line, _ in lines if line.startswith(SEPARATOR)), "")
    plain = [
        (k, line) for k, (line, _) in enumerate(lines) if line.strip() and not _is_comment(line)
    ]
    best: tuple[float, str, int, int] = (0.0, said or ",", 0, 0)
    for delimiter in said or DELIMITERS + BLANK:
        kinds = [(k, fields_of(line, delimiter)) for k, line in plain]
        rows = [(k, len(fields)) for k, fields in kinds if len(fields) > 1 and _is_row(fields)]
        if not rows:
            continue
        width = Counter(size for _, size in rows[-LOOKED:]).most_common(1)[0][0]
        fitting = {k for k, size in rows if size == width}
        order = [k for k, _ in kinds]
        leads = (k for n, k in enumerate(order) if k in fitting and _lead(order[n + 1 :], fitting))
        first = next(leads, min(fitting))
        share = sum(k >= first for k in fitting) / max(1, sum(k >= first for k, _ in plain))
        if delimiter == BLANK and (share < SURE or len(fitting) < 3):
            continue  # any text has blanks
        # a decimal comma splits numbers as evenly as a delimiter does: those before it win
        best = max(best, (round(share, 1), delimiter, first, width), key=lambda found: found[0])
    share, delimiter, first, width = best
    if not share:
        first = plain[0][0]
        delimiter = said or max("\t;,", key=plain[0][1].count)
        return delimiter, first + 1, len(fields_of(plain[0][1], delimiter))
    return delimiter, first, width


def _lead(after: Sequence[int], fitting: Collection[int]) -> bool:
    """Whether the next lines are rows too, but for a remark among them; in a preamble few are."""
    following = [k in fitting for k in after[:FOLLOWING]]
    return not following or (following[0] and sum(following) >= len(following) - 1)


def _header(
    above: Sequence[str], delimiter: str, width: int
) -> tuple[list[str], dict[str, str], bool]:
    """Names and units from the lines above the rows, and whether there are none."""
    rows = [_trimmed(fields_of(line, delimiter)) for line in above if not _is_comment(line)]
    rows = [row for row in rows if row]
    if not rows:
        said = [_trimmed(fields_of(c.lstrip("#%/ \t"), delimiter)) for c in above if _is_comment(c)]
        fitting = [row for row in said if len(row) == width and not all(map(is_number, row))]
        rows = fitting[-1:]
    if not rows:
        return [f"column {k + 1}" for k in range(width)], {}, True
    units: list[str] = []
    rows = _without_kinds(rows)
    over = [row for row in rows[:-1] if len(row) >= len(rows[-1]) - 1]
    if over and _are_units(rows[-1]):
        units = [_bare(text) for text in rows[-1]]
        rows = _without_kinds(over)
    names = _distinct(next((row for row in reversed(rows) if len(row) == width), rows[-1]))
    return names, {n: unit for n, unit in zip(names, units, strict=False) if unit}, False


def _without_kinds(rows: list[list[str]]) -> list[list[str]]:
    """Without a last row of devices (RaceChrono) or of types (ETAS), the same for many columns."""
    if len(rows) < 2 or len(rows[-2]) < len(rows[-1]) - 1 or _are_units(rows[-1]):
        return rows
    return rows[:-1] if _repeats(rows[-1]) else rows


def _repeats(fields: Sequence[str]) -> bool:
    """Whether a row is mostly repetitions, as no row of names is."""
    held = [field for field in fields if field]
    return 2 * len(set(held)) <= len(held) or (len(held) > 2 and len(set(held[1:])) == 1)


def _distinct(names: Sequence[str]) -> list[str]:
    """The second column of a name is `NAME (2)`, one without a name `column N`."""
    seen: Counter[str] = Counter()
    found = []
    for k, name in enumerate(names, 1):
        name = name or f"column {k}"
        name = _own_role(name)
        seen[name] += 1
        found.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return found


def _own_role(name: str) -> str:
    """Of a heading of `roadlog export`, `imu.gyro_x [rad/s]`, the role, where it is in SI units."""
    role, _, unit = name.removesuffix("]").partition(" [")
    return role if unit and role in SIGNALS and SIGNALS[role].unit == unit else name


def _trimmed(fields: list[str]) -> list[str]:
    """Without blank fields, which delimiters at the end of a line make."""
    while fields and not fields[-1]:
        fields = fields[:-1]
    return fields


def fields_of(line: str, delimiter: str) -> list[str]:
    """The fields of a line, blanks around them taken off."""
    if delimiter == BLANK:
        apart = re.split(r"\s{2,}|\t", line.strip())
        return apart if len(apart) > 2 and not _NUMBER.match(apart[0]) else line.split()
    text = line.strip("\r\n")
    with suppress(csv.Error):
        return [field.strip() for field in next(csv.reader([text], delimiter=delimiter), [])]
    return [field.strip().strip('"') for field in text.split(delimiter)]


def is_number(text: str) -> bool:
    """Whether a cell is a number, with a point or a comma."""
    return bool(_NUMBER.fullmatch(text.strip().strip('"').strip()))


def _is_row(fields: Sequence[str]) -> bool:
    """Whether fields are those of a row of numbers: a third of those that hold anything."""
    held = [field for field in fields if field.lower() not in NOTHING]
    numbers = sum(is_number(field) or bool(_MOMENT.fullmatch(field)) for field in held)
    return bool(held) and 3 * numbers >= len(held)


def _are_units(fields: Sequence[str]) -> bool:
    """Whether every cell is a unit or blank, and one of them is one that we know."""
    known = 0
    for field in map(_bare, fields):
        if field.lower() in NOTHING or _OTHERS.fullmatch(field):
            continue
        try:
            known += canonical("g" if field == "G" else field) in UNITS
        except ConfigError:
            return _look_like_units(fields)
    return known > 0


def _look_like_units(fields: Sequence[str]) -> bool:
    """Whether a row without a digit has a unit that we know among short words."""
    known = 0
    for field in map(_bare, fields):
        if any(map(str.isdigit, field)) or len(field) > 8:
            return False
        with suppress(ConfigError):
            known += bool(field) and canonical(field) in UNITS
    return known >= 2 or known == len(fields)


def _bare(text: str) -> str:
    return text.strip(' []()"')


def _is_comment(line: str) -> bool:
    text = line.lstrip()
    return text.startswith(COMMENTS) or line.startswith(SEPARATOR)


def _encoding(head: bytes) -> str:
    """By the mark at the start, or by where the zeros of ASCII characters are."""
    if head.startswith(codecs.BOM_UTF8):
        return "utf-8-sig"
    if head.startswith(codecs.BOM_UTF16_LE):
        return "utf-16-le"
    if head.startswith(codecs.BOM_UTF16_BE):
        return "utf-16-be"
    pairs = np.frombuffer(head[: len(head) // 2 * 2], np.uint8).reshape(-1, 2)
    zeros = (pairs == 0).mean(axis=0) if len(pairs) else np.zeros(2)
    if zeros[1] > 0.5 and not zeros[0]:
        return "utf-16-le"
    if zeros[0] > 0.5 and not zeros[1]:
        return "utf-16-be"
    try:
        head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 4:  # not a character that the end of the head cuts
            return "cp1252"
    return "utf-8"


def _lines(head: bytes, encoding: str) -> list[tuple[str, int]]:
    """The first lines and their sizes in bytes; in single-byte text each decoded as it can be."""
    if not encoding.startswith("utf-16"):
        return [(decoded(line), len(line)) for line in head.splitlines(keepends=True)]
    text = head[: len(head) // 2 * 2].decode(encoding, "replace")
    lines = [f"{line}\n" for line in text.split("\n")]
    return [(line.removeprefix("\ufeff"), len(line.encode(encoding))) for line in lines]
