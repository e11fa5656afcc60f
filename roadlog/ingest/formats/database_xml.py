"""KCD and ARXML databases in the form that cantools reads: texts of ranges, other conversions.

cantools 45 leaves a text that stands for a range of raw values out of KCD (`LabelGroup`) and of
ARXML conversions that mix a slope with texts, and refuses an ARXML table of texts for one: "not
available" from 0xFE to 0xFF would be a speed. Here such a range becomes one label with the range
in its name, which `of_range` reads again. Of ARXML's conversions (AUTOSAR TPS_SWCT, category of
CompuMethod) it applies the last of several slopes to every value, and none at all where a number
stands beside the slope or the category is not one of those it knows: what is one line is named as
such, a number gives no value in its range, and of all else every raw value is labelled as none.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

NOT_A_LINE = "not available: conversion that is not one line"
A_NUMBER = "not available: a number of the database for a range"
LINE_AND_TEXTS = "SCALE_LINEAR_AND_TEXTTABLE"
CODES = frozenset({"TEXTTABLE", "BITFIELD_TEXTTABLE"})
# categories that may do without a slope; where none is stated, what stands there counts
PLAIN = CODES | {"IDENTICAL", ""}
SLOPED = frozenset({
    "LINEAR", LINE_AND_TEXTS, "SCALE_LINEAR", "RAT_FUNC", "SCALE_RATIONAL",
    "SCALE_RATIONAL_AND_TEXTTABLE", "TAB_NOINTP", "",
})  # fmt: skip
_RANGE = re.compile(r"^(.*) \[(-?\d+)\.\.(-?\d+)\]$", re.DOTALL)
_EVERYTHING = -(1 << 63), (1 << 64) - 1
_NO_RAW_VALUE = -(1 << 66)  # labels of ranges stand beyond all that a signal can hold
LIMITS = ("LOWER-LIMIT", "UPPER-LIMIT")


def of_range(code: int, label: str) -> tuple[str, int, int] | None:
    """Text, first and last raw value of a label that stands for a range."""
    match = _RANGE.match(label) if code <= _NO_RAW_VALUE else None
    return (match[1], int(match[2]), int(match[3])) if match else None


def as_labels(path: Path, kind: str) -> str:
    """The text of a database of one of the KINDS with labels for its ranges.

    Raises ElementTree.ParseError, OSError.
    """
    root = ElementTree.fromstring(path.read_bytes())
    KINDS[kind](root)
    return ElementTree.tostring(root, encoding="unicode")


def _kcd(root: Element) -> None:
    space = _namespace(root)
    for labels in root.iter(f"{space}LabelSet"):
        for number, label in enumerate(labels):
            name, kind = label.get("name", ""), label.get("type", "value")
            if kind != "value":  # invalid, error
                label.set("name", name := f"{kind}: {name}")
            if label.tag == f"{space}LabelGroup":
                low, high = _whole(label.get("from", "0"), 1), _whole(label.get("to", "inf"), -1)
                label.tag = f"{space}Label"
                label.set("value", str(_NO_RAW_VALUE - number))
                label.set("name", _of_all(name, low, high))


def _arxml(root: Element) -> None:
    space = _namespace(root)
    for method in root.iter(f"{space}COMPU-METHOD"):
        category = method.find(f"{space}CATEGORY")
        if category is None:
            category = ElementTree.SubElement(method, f"{space}CATEGORY")
        category.text = (category.text or "").strip()
        scales = list(method.iterfind(f"{space}COMPU-INTERNAL-TO-PHYS//{space}COMPU-SCALE"))
        try:
            certain = _is_line(category.text, scales, space)
        except ValueError:  # a limit or coefficient that is no number
            certain = False
        inverse = f"{space}COMPU-PHYS-TO-INTERNAL//{space}COMPU-SCALE"
        if not certain or (not scales and method.find(inverse) is not None):
            _hold_back(method, space)
        elif scales and category.text not in CODES:
            category.text = LINE_AND_TEXTS


def _is_line(category: str, scales: list[Element], space: str) -> bool:
    """Whether a conversion is one line with texts, or codes; texts and numbers become labels.

    Raises ValueError.
    """
    lines: set[tuple[float, ...] | None] = set()
    numbers = False
    for label, scale in enumerate(scales):
        constant = scale.find(f"{space}COMPU-CONST")
        limits = _limits(scale, space)
        if constant is None:
            lines.add(_line(scale, space))
        elif limits is None:
            return False
        else:
            text = constant.find(f"{space}VT")
            numbers |= text is None
            said = A_NUMBER if text is None else text.text or ""
            _name(scale, space, _NO_RAW_VALUE - label, _of_all(said, *limits))
    if not lines:
        return not numbers and (category in PLAIN or (bool(scales) and category in SLOPED))
    return len(lines) == 1 and None not in lines and category in SLOPED


def _hold_back(method: Element, space: str) -> None:
    """Name every raw value as none."""
    conversion = method.find(f"{space}COMPU-INTERNAL-TO-PHYS")
    if conversion is None:
        conversion = ElementTree.SubElement(method, f"{space}COMPU-INTERNAL-TO-PHYS")
    conversion.clear()
    category = method.find(f"{space}CATEGORY")
    assert category is not None
    category.text = LINE_AND_TEXTS
    scales = ElementTree.SubElement(conversion, f"{space}COMPU-SCALES")
    everything = ElementTree.SubElement(scales, f"{space}COMPU-SCALE")
    _name(everything, space, _NO_RAW_VALUE, _of_all(NOT_A_LINE, *_EVERYTHING))


def _name(scale: Element, space: str, code: int, text: str) -> None:
    """Make a scale the label of a single value."""
    scale.clear()
    for limit in LIMITS:
        ElementTree.SubElement(scale, f"{space}{limit}").text = str(code)
    constant = ElementTree.SubElement(scale, f"{space}COMPU-CONST")
    ElementTree.SubElement(constant, f"{space}VT").text = text


def _of_all(text: str, low: int, high: int) -> str:
    """A label that stands for a range; one with its limits in the wrong order is meant as well."""
    return f"{text} [{min(low, high)}..{max(low, high)}]"


def _limits(scale: Element, space: str) -> tuple[int, int] | None:
    """First and last whole raw value of a scale, one limit alone for both; None without.

    Raises ValueError.
    """
    found = []
    for limit, inward in zip(LIMITS, (1, -1), strict=True):
        element = scale.find(f"{space}{limit}")
        said = "" if element is None else (element.text or "").strip()
        kind = None if element is None else element.get("INTERVAL-TYPE")
        if kind == "INFINITE":
            found.append(_EVERYTHING[inward < 0])
        elif said:
            found.append(_whole(said, inward, kind == "OPEN"))
    return (found[0], found[-1]) if found else None


def _whole(said: str, inward: int, is_open: bool = False) -> int:
    """The raw value that a limit allows: 255, 0xFF, 0b11, 255.0, INF. inward: 1 for a lower one.

    Raises ValueError.
    """
    try:
        whole = int(said, 0)
    except ValueError:
        real = float(said)
        if math.isinf(real):
            return _EVERYTHING[real > 0]
        whole = math.ceil(real) if inward > 0 else math.floor(real)
        is_open = is_open and whole == real
    return whole + inward if is_open else whole


def _line(scale: Element, space: str) -> tuple[float, ...] | None:
    """Offset and slope of a scale, 0 and 1 where none is stated; None where it is no line.

    Raises ValueError.
    """
    if scale.find(f"{space}COMPU-RATIONAL-COEFFS") is None:
        return 0.0, 1.0
    rational = f"{space}COMPU-RATIONAL-COEFFS/{space}"
    above, below = (
        [float(v.text or "nan") for v in scale.iterfind(f"{rational}{part}/{space}V")]
        for part in ("COMPU-NUMERATOR", "COMPU-DENOMINATOR")
    )
    if len(above) != 2 or len(below) != 1 or not below[0]:
        return None
    line = above[0] / below[0], above[1] / below[0]
    return line if all(map(math.isfinite, line)) else None


def _namespace(root: Element) -> str:
    """`{...}` of the root's own name."""
    return root.tag[: root.tag.index("}") + 1] if root.tag.startswith("{") else ""


KINDS: Mapping[str, Callable[[Element], None]] = {"kcd": _kcd, "arxml": _arxml}
