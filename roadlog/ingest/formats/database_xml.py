"""KCD and ARXML databases in the form that cantools reads: texts of ranges, other conversions.

cantools 45 leaves a text that stands for a range of raw values out of KCD (`LabelGroup`) and of
ARXML conversions that mix a slope with texts, and refuses an ARXML table of texts for one: "not
available" from 0xFE to 0xFF would be a speed. Here such a range becomes one label with the range
in its name, which `of_range` reads again. Of ARXML's conversions (AUTOSAR TPS_SWCT, category of
CompuMethod) it applies the last of several slopes to every value, and none at all where the
category is not one of those it knows: what is one line is named as such, of all else every raw
value is labelled as none.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

NOT_A_LINE = "not available: conversion that is not one line"
LINE_AND_TEXTS = "SCALE_LINEAR_AND_TEXTTABLE"
OF_CANTOOLS = frozenset({"LINEAR", LINE_AND_TEXTS})
# categories whose scales are slopes; the others are raw values, texts or bits
SLOPED = OF_CANTOOLS | {
    "SCALE_LINEAR", "RAT_FUNC", "SCALE_RATIONAL", "SCALE_RATIONAL_AND_TEXTTABLE", "TAB_NOINTP"
}  # fmt: skip
_RANGE = re.compile(r"^(.*) \[(-?\d+)\.\.(-?\d+)\]$", re.DOTALL)
_EVERYTHING = -(1 << 63), (1 << 64) - 1
_NO_RAW_VALUE = -(1 << 66)  # labels of ranges stand beyond all that a signal can hold
LIMITS = ("LOWER-LIMIT", "UPPER-LIMIT")


def of_range(label: str) -> tuple[str, int, int] | None:
    """Text, first and last raw value of a label that stands for a range."""
    match = _RANGE.match(label)
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
        for label in labels:
            name, kind = label.get("name", ""), label.get("type", "value")
            if kind != "value":  # invalid, error
                label.set("name", name := f"{kind}: {name}")
            if label.tag == f"{space}LabelGroup":
                first, last = int(label.get("from", "0"), 0), int(label.get("to", "0"), 0)
                label.tag = f"{space}Label"
                label.set("value", str(_NO_RAW_VALUE + first))
                label.set("name", f"{name} [{first}..{last}]")


def _arxml(root: Element) -> None:
    space = _namespace(root)
    for method in root.iter(f"{space}COMPU-METHOD"):
        scales = list(method.iterfind(f"{space}COMPU-INTERNAL-TO-PHYS//{space}COMPU-SCALE"))
        for scale in scales:
            text = scale.find(f"{space}COMPU-CONST/{space}VT")
            if text is not None and (limits := _limits(scale, space)) and limits[0] < limits[1]:
                _name(scale, space, text.text or "", *limits)
        category = method.find(f"{space}CATEGORY")
        if category is None or category.text not in SLOPED:
            continue
        lines = {_line(s, space) for s in scales if s.find(f"{space}COMPU-CONST") is None}
        if not lines and category.text in OF_CANTOOLS:
            continue
        if len(lines) != 1 or None in lines:
            _hold_back(method, space)
        elif category.text not in OF_CANTOOLS:
            category.text = LINE_AND_TEXTS


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
    _name(everything, space, NOT_A_LINE, *_EVERYTHING)


def _name(scale: Element, space: str, text: str, first: int, last: int) -> None:
    """Make a scale the label of a range."""
    scale.clear()
    for limit in LIMITS:
        ElementTree.SubElement(scale, f"{space}{limit}").text = str(_NO_RAW_VALUE + first)
    constant = ElementTree.SubElement(scale, f"{space}COMPU-CONST")
    ElementTree.SubElement(constant, f"{space}VT").text = f"{text} [{first}..{last}]"


def _limits(scale: Element, space: str) -> tuple[int, int] | None:
    """First and last whole raw value of a scale; None without both limits."""
    found = []
    for limit, inward, infinite in zip(LIMITS, (1, -1), _EVERYTHING, strict=True):
        element = scale.find(f"{space}{limit}")
        if element is None:
            return None
        said, kind = (element.text or "").strip(), element.get("INTERVAL-TYPE")
        if kind == "INFINITE" or "INF" in said.upper():
            found.append(infinite)
        elif said:
            found.append(_whole(said) + (inward if kind == "OPEN" else 0))
        else:
            return None
    return found[0], found[1]


def _whole(said: str) -> int:
    """A limit as ARXML writes it: 255, 0xFF, 0b11, 255.0."""
    try:
        return int(said, 0)
    except ValueError:
        return int(float(said))


def _line(scale: Element, space: str) -> tuple[float, ...] | None:
    """Offset and slope of a scale, 0 and 1 where none is stated; None where it is no line."""
    if scale.find(f"{space}COMPU-RATIONAL-COEFFS") is None:
        return 0.0, 1.0
    rational = f"{space}COMPU-RATIONAL-COEFFS/{space}"
    above = [float(v.text or "nan") for v in scale.iterfind(f"{rational}COMPU-NUMERATOR/{space}V")]
    below = [
        float(v.text or "nan") for v in scale.iterfind(f"{rational}COMPU-DENOMINATOR/{space}V")
    ]
    line = len(above) == 2 and len(below) == 1 and below[0] != 0
    return (above[0] / below[0], above[1] / below[0]) if line else None


def _namespace(root: Element) -> str:
    """`{...}` of the root's own name."""
    return root.tag[: root.tag.index("}") + 1] if root.tag.startswith("{") else ""


KINDS: Mapping[str, Callable[[Element], None]] = {"kcd": _kcd, "arxml": _arxml}
