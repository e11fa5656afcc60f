"""The plan view of an OpenDRIVE road: its records evaluated to points with headings."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np

from roadlog.errors import LogReadError
from roadlog.types import Floats

SPIRAL_STEP = 0.05  # m, of the quadrature along a clothoid (trapezoidal; 1e-8 m over 100 m)
MAX_ROAD = 1e6  # m; a longer road is an error of the file, not a road
JUMP = 0.5  # m, that a record may begin beside the end of the one before
SHORT_SHARE = 0.01  # of a road's stated length, that its records may be off, and a meter
GAP = 0.1  # m between the end of a record and the beginning of the next


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """Points of a reference line. s, x, y: m; heading: rad, unwrapped."""

    s: Floats
    x: Floats
    y: Floats
    heading: Floats


def line_of(road: ET.Element, where: str, step: float) -> ReferenceLine:
    """The reference line at most every `step` m. Raises LogReadError naming the element."""
    records = road.findall("planView/geometry")
    if not records:
        raise LogReadError(f"{where}: <planView>: has no geometry")
    parts: list[tuple[Floats, Floats, Floats, Floats]] = []
    total, end = 0.0, -np.inf
    for k, record in enumerate(records):
        start, x, y, heading, length = (
            number(where, record, key) for key in ("s", "x", "y", "hdg", "length")
        )
        total += max(length, 0.0)
        if np.isfinite(end) and start > end + GAP:
            raise LogReadError(
                f"{where}: <geometry> number {k + 1}: begins at s = {start:g}, the one before it "
                f"ends at {end:g}: {start - end:g} m of road are missing"
            )
        if start < end - GAP or length < 0 or total > MAX_ROAD:
            raise LogReadError(
                f"{where}: <geometry> number {k + 1}: s = {start}, length = {length}: "
                "s must ascend over a road of finite length"
            )
        end = start + length
        if length == 0:
            continue
        count = max(1, int(np.ceil(length / step)))
        at = np.linspace(0.0, length, count + 1)
        u, v, turn = _shape(where, record, at, length)
        c, d = np.cos(heading), np.sin(heading)
        xs, ys = x + u * c - v * d, y + u * d + v * c
        if parts:
            jump = float(np.hypot(xs[0] - parts[-1][1][-1], ys[0] - parts[-1][2][-1]))
            if jump > JUMP:
                raise LogReadError(
                    f"{where}: <geometry> number {k + 1}: begins {jump:.2f} m away from where the "
                    f"one before it ends"
                )
            parts[-1] = tuple(column[:-1] for column in parts[-1])  # type: ignore[assignment]
        parts.append((start + at, xs, ys, heading + turn))
    stated = number(where, road, "length") if "length" in road.attrib else end
    if not abs(stated - end) <= max(1.0, SHORT_SHARE * end):
        raise LogReadError(
            f"{where}: <planView>: ends at s = {end:g} m, but <road> length = {stated:g} m"
        )
    if not parts:
        raise LogReadError(f"{where}: <planView>: its geometries have no length")
    s, x_all, y_all, headings = (np.concatenate(column) for column in zip(*parts, strict=True))
    ascending = np.concatenate([[True], np.diff(s) > 1e-9])
    return ReferenceLine(
        s[ascending], x_all[ascending], y_all[ascending], np.unwrap(headings[ascending])
    )


def _shape(
    where: str, record: ET.Element, at: Floats, length: float
) -> tuple[Floats, Floats, Floats]:
    """u, v in m and turn in rad at distances along one record, in its own axes."""
    kinds = [child for child in record if child.tag in _KINDS]
    if len(kinds) != 1:
        found = ", ".join(child.tag for child in record) or "nothing"
        raise LogReadError(f"{where}: <geometry> holds {found}; must be {', '.join(_KINDS)}")
    return _KINDS[kinds[0].tag](where, kinds[0], at, length)


def _straight(
    where: str, element: ET.Element, at: Floats, length: float
) -> tuple[Floats, Floats, Floats]:
    del where, element, length
    return at, np.zeros(len(at)), np.zeros(len(at))


def _arc(
    where: str, element: ET.Element, at: Floats, length: float
) -> tuple[Floats, Floats, Floats]:
    del length
    return _bent(at, np.full(len(at), number(where, element, "curvature")), 0.0)


def _spiral(
    where: str, element: ET.Element, at: Floats, length: float
) -> tuple[Floats, Floats, Floats]:
    first, last = (number(where, element, key) for key in ("curvStart", "curvEnd"))
    rate = (last - first) / length
    if abs(rate) < 1e-12:
        return _bent(at, np.full(len(at), first), 0.0)
    fine = np.linspace(0.0, length, max(2, int(np.ceil(length / SPIRAL_STEP))) + 1)
    turn = first * fine + 0.5 * rate * fine**2
    step = np.diff(fine)
    middle = 0.5 * (fine[1:] + fine[:-1])
    between = first * middle + 0.5 * rate * middle**2
    u, v = (
        np.concatenate([[0.0], np.cumsum(step / 6 * (w(turn[:-1]) + 4 * w(between) + w(turn[1:])))])
        for w in (np.cos, np.sin)
    )
    return (
        np.interp(at, fine, u),
        np.interp(at, fine, v),
        first * at + 0.5 * rate * at**2,
    )


def _bent(at: Floats, curvature: Floats, turn: float) -> tuple[Floats, Floats, Floats]:
    """A circle's arc."""
    bend = float(curvature[0])
    if abs(bend) < 1e-12:
        return at, np.zeros(len(at)), np.full(len(at), turn)
    angle = bend * at
    return np.sin(angle) / bend, (1 - np.cos(angle)) / bend, angle


def _poly3(
    where: str, element: ET.Element, at: Floats, length: float
) -> tuple[Floats, Floats, Floats]:
    """v as a cubic of u; u goes as far as the record is long."""
    a, b, c, d = (number(where, element, key) for key in "abcd")
    u = np.linspace(0.0, length, 20 * len(at) + 1)
    slope = b + u * (2 * c + 3 * d * u)
    way = np.concatenate(
        [[0.0], np.cumsum(np.diff(u) * 0.5 * (np.hypot(1, slope)[1:] + np.hypot(1, slope)[:-1]))]
    )
    u = np.interp(at, way, u)
    return u, a + u * (b + u * (c + u * d)), np.arctan(b + u * (2 * c + 3 * d * u))


def _param_poly3(
    where: str, element: ET.Element, at: Floats, length: float
) -> tuple[Floats, Floats, Floats]:
    kind = element.get("pRange", "normalized")
    if kind not in ("arcLength", "normalized"):
        raise LogReadError(f"{where}: <paramPoly3> pRange = {kind!r}: arcLength or normalized")
    p = _by_way(where, element, at / length) if kind == "normalized" else at
    u, du = _cubic(where, element, "U", p)
    v, dv = _cubic(where, element, "V", p)
    return u, v, np.unwrap(np.arctan2(dv, du))


def _by_way(where: str, element: ET.Element, share: Floats) -> Floats:
    """Parameter in [0, 1] at shares of the curve's own length: it need not run evenly."""
    p = np.linspace(0.0, 1.0, 20 * len(share) + 1)
    u, v = (_cubic(where, element, axis, p)[0] for axis in "UV")
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(u), np.diff(v)))])
    return np.interp(share * way[-1], way, p)


def _cubic(where: str, element: ET.Element, axis: str, p: Floats) -> tuple[Floats, Floats]:
    a, b, c, d = (number(where, element, f"{n}{axis}") for n in "abcd")
    return a + p * (b + p * (c + p * d)), b + p * (2 * c + 3 * d * p)


def number(where: str, element: ET.Element, key: str) -> float:
    """A finite number of an element. Raises LogReadError."""
    text = element.get(key)
    try:
        value = float(text) if text is not None else np.nan
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise LogReadError(f"{where}: <{element.tag}> {key} = {text!r}: must be a number")
    return value


_KINDS = {
    "line": _straight,
    "arc": _arc,
    "spiral": _spiral,
    "poly3": _poly3,
    "paramPoly3": _param_poly3,
}
