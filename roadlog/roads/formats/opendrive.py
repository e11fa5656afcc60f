"""A road as ASAM OpenDRIVE 1.8 (.xodr): paramPoly3 line, Hermite height, superelevation in rad.

Signs are roadlog's own: superelevation is the bank (right side down +, looking along s).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.roads.formats import georeference
from roadlog.roads.formats.geometry import line_of, number
from roadlog.roads.model import RoadModel, road_of
from roadlog.types import Floats
from roadlog.version import __version__

LANE_WIDTH = 3.5  # m, of the one lane to each side: a road model does not know its lanes
READ_STEP = 1.0  # m, at which a file's road is sampled
LATEST_START = 1.0  # m into the road, that its elevation may begin
LEAST_CROWN = 0.01  # deg, that is said
SIDES = ("left", "right", "both")  # of a crossfall
CODE = "roadlog"  # of the user data that holds the sds


def to_bytes(model: RoadModel, ending: str) -> bytes:
    """One road, one record a point of the model, sds as user data."""
    del ending
    root = ET.Element("OpenDRIVE")
    header = ET.SubElement(
        root, "header", revMajor="1", revMinor="8", name=model.name, version=__version__,
        north=_n(model.y.max()), south=_n(model.y.min()), east=_n(model.x.max()),
        west=_n(model.x.min()), vendor="roadlog",
    )  # fmt: skip
    ET.SubElement(header, "geoReference").text = (
        f"+proj=tmerc +lat_0={model.origin[0]:.9f} +lon_0={model.origin[1]:.9f} +k=1 +x_0=0 +y_0=0 "
        "+ellps=WGS84 +units=m +no_defs"
    )
    road = ET.SubElement(
        root, "road", name=model.name, length=_n(model.length), id="1", junction="-1", rule="RHT"
    )
    s = model.s - model.s[0]
    _plan_view(ET.SubElement(road, "planView"), model, s)
    _cubics(
        ET.SubElement(road, "elevationProfile"), "elevation", s, model.z,
        model.slope + model.tilt,
    )  # fmt: skip
    lateral = ET.SubElement(road, "lateralProfile")
    if np.isfinite(model.bank).any():
        bank = _filled(s, model.bank)
        _cubics(lateral, "superelevation", s, bank, np.gradient(bank, s))
    _lanes(ET.SubElement(road, "lanes"))
    user = ET.SubElement(road, "userData", code=CODE, value=f"drives={model.drives}")
    for k in range(len(s)):
        values = {n: _n(getattr(model, n)[k]) for n in ("grade_sd", "bank_sd", "z_sd")}
        values |= {"s": _n(s[k]), "passes": str(int(model.passes[k]))}
        ET.SubElement(user, "point", values)
    ET.indent(root)
    content: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return content


def _plan_view(view: ET.Element, model: RoadModel, s: Floats) -> None:
    """Cubic Hermite curves between points with their headings, by arc length."""
    for k in range(len(s) - 1):
        length = s[k + 1] - s[k]
        c, d = np.cos(model.heading[k]), np.sin(model.heading[k])
        dx, dy = model.x[k + 1] - model.x[k], model.y[k + 1] - model.y[k]
        end_u, end_v = dx * c + dy * d, -dx * d + dy * c
        turn = model.heading[k + 1] - model.heading[k]
        u = _hermite(0.0, end_u, 1.0, float(np.cos(turn)), length)
        v = _hermite(0.0, end_v, 0.0, float(np.sin(turn)), length)
        geometry = ET.SubElement(
            view, "geometry", s=_n(s[k]), x=_n(model.x[k]), y=_n(model.y[k]),
            hdg=_n(model.heading[k]), length=_n(length),
        )  # fmt: skip
        coefficients = {f"{n}{axis}": _n(value) for axis, four in (("U", u), ("V", v))
                        for n, value in zip("abcd", four, strict=True)}  # fmt: skip
        ET.SubElement(geometry, "paramPoly3", coefficients, pRange="arcLength")


def _cubics(parent: ET.Element, name: str, s: Floats, values: Floats, slopes: Floats) -> None:
    """Hermite records; one that the last goes on through is left out."""
    last: tuple[float, tuple[float, float, float, float]] | None = None
    for k in range(len(s) - 1):
        cubic = _hermite(
            float(values[k]), float(values[k + 1]), float(slopes[k]), float(slopes[k + 1]),
            float(s[k + 1] - s[k]),
        )  # fmt: skip
        if last is not None and _goes_on(last, float(s[k]), cubic):
            continue
        last = float(s[k]), cubic
        named = {n: _n(value) for n, value in zip("abcd", cubic, strict=True)}
        ET.SubElement(parent, name, {"s": _n(s[k])} | named)


def _goes_on(
    last: tuple[float, tuple[float, float, float, float]],
    s: float,
    cubic: tuple[float, float, float, float],
) -> bool:
    """Whether two records are one polynomial."""
    start, (a, b, c, d) = last
    x = s - start
    moved = (a + x * (b + x * (c + x * d)), b + x * (2 * c + 3 * d * x), c + 3 * d * x, d)
    return bool(np.allclose(moved, cubic, rtol=0, atol=1e-12))


def _hermite(
    first: float, last: float, slope: float, end_slope: float, length: float
) -> tuple[float, float, float, float]:
    """Coefficients of the cubic with these values and slopes at its ends."""
    rise = (last - first) / length
    return (
        first,
        slope,
        (3 * rise - 2 * slope - end_slope) / length,
        (slope + end_slope - 2 * rise) / length**2,
    )


def _lanes(lanes: ET.Element) -> None:
    section = ET.SubElement(lanes, "laneSection", s="0")
    for side, place in (("left", 1), ("center", 0), ("right", -1)):
        lane = ET.SubElement(
            ET.SubElement(section, side), "lane", id=str(place),
            type="driving" if place else "none", level="false",
        )  # fmt: skip
        if place:
            ET.SubElement(
                lane, "width", sOffset="0", a=_n(LANE_WIDTH), b="0", c="0", d="0"
            )  # fmt: skip


def _n(value: float) -> str:
    return repr(float(value)) if np.isfinite(value) else "NaN"


def _filled(s: Floats, values: Floats) -> Floats:
    known = np.isfinite(values)
    return np.interp(s, s[known], values[known])


def read(path: Path) -> RoadModel:
    """The reference line of the one road in a file, with its height and cross slope.

    Lines, arcs, spirals, poly3 and paramPoly3; superelevation and crossfall. Raises LogReadError
    naming file and element.
    """
    try:
        root = ET.parse(path).getroot()
    except (ET.ParseError, OSError, ValueError, LookupError) as error:
        raise LogReadError(f"{path}: not read as OpenDRIVE: {error}") from error
    for element in root.iter():  # some writers put all names into a namespace
        element.tag = element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""
    found = root.findall("road")
    if root.tag != "OpenDRIVE" or not found:
        raise LogReadError(f"{path}: <{root.tag}>: no OpenDRIVE road in it")
    if len(found) > 1:
        names = ", ".join(str(r.get("id")) for r in found[:6])
        raise LogReadError(
            f"{path}: <road>: {len(found)} roads (id {names}); a road model is one. Cut it to one"
        )
    road = found[0]
    line = line_of(road, str(path), READ_STEP)
    z, slope = _profile(path, road, "elevationProfile/elevation", line.s)
    if z is None or slope is None:
        raise LogReadError(f"{path}: <elevationProfile>: is missing; nothing says the grade")
    bank, notes = _across(path, road, line.s)
    place = georeference.placed(path, root, line, z)
    return road_of(
        path.stem, place.origin, place.x, place.y, place.z, grade=np.arctan(slope), bank=bank,
        heading=place.heading, s=line.s, placed=place.is_known,
        notes=(*notes, *_left_out(path, road)),
        **_user_data(path, road, line.s),
    )  # fmt: skip


def _across(path: Path, road: ET.Element, s: Floats) -> tuple[Floats | None, tuple[str, ...]]:
    """Bank in rad of the mean plane of both sides, None where nothing says it, and notes.

    Crossfall falls from the line outward: to the right it is a bank, to the left against one.
    """
    lateral = "lateralProfile/"
    bank = _profile(path, road, f"{lateral}superelevation", s, before=0.0)[0]
    sides = [
        _profile(path, road, f"{lateral}crossfall", s, before=0.0, side=side)[0]
        for side in ("right", "left")
    ]
    if all(side is None for side in sides):
        return bank, ()
    right, left = (np.zeros(len(s)) if side is None else side for side in sides)
    mean = 0.5 * (right - left) + (0.0 if bank is None else bank)
    crown = float(np.degrees(np.max(np.abs(0.5 * (right + left)))))
    note = f"<crossfall>: a crown of up to {crown:.2f} deg; the bank is that of the mean plane"
    return mean, (note,) if crown > LEAST_CROWN else ()


def _profile(
    path: Path,
    road: ET.Element,
    name: str,
    s: Floats,
    before: float | None = None,
    side: str | None = None,
) -> tuple[Floats, Floats] | tuple[None, None]:
    """Value and slope at s of a chain of cubics; None where the file has none.

    before: what holds before the first of them; None if there may be nothing before. side: of
    records that have one. Raises LogReadError.
    """
    records = road.findall(name)
    if side is not None:
        for record in records:
            if record.get("side", "both") not in SIDES:
                told = record.get("side")
                raise LogReadError(f"{path}: <{record.tag}> side = {told!r}: {', '.join(SIDES)}")
        records = [r for r in records if r.get("side", "both") in (side, "both")]
    if not records:
        return None, None
    tag = records[0].tag
    rows = np.array(
        [
            [number(str(path), record, key) for key in ("s", "a", "b", "c", "d")]
            for record in records
        ]
    )
    if np.any(np.diff(rows[:, 0]) < 0):
        raise LogReadError(f"{path}: <{tag}>: s does not ascend")
    if before is None and rows[0, 0] > s[0] + LATEST_START:
        raise LogReadError(f"{path}: <{tag}>: begins at s = {rows[0, 0]:g} m, nothing before")
    at = np.searchsorted(rows[:, 0], s, "right") - 1
    start, a, b, c, d = rows[np.maximum(at, 0)].T
    x = s - start
    value, slope = a + x * (b + x * (c + x * d)), b + x * (2 * c + 3 * d * x)
    if before is None:
        return value, slope
    return np.where(at < 0, before, value), np.where(at < 0, 0.0, slope)


def _user_data(path: Path, road: ET.Element, s: Floats) -> dict[str, Floats]:
    """The sds that roadlog wrote; NaN where they are unknown. Raises LogReadError."""
    for user in road.findall("userData"):
        points = user.findall("point")
        if user.get("code") == CODE and points:
            try:
                at, *sds = (
                    np.array([float(p.get(name, "nan")) for p in points])
                    for name in ("s", "grade_sd", "bank_sd", "z_sd")
                )
            except ValueError as error:
                raise LogReadError(f"{path}: <point> of <userData>: {error}") from error
            if not np.all(np.diff(at) > 0):
                raise LogReadError(f"{path}: <point> of <userData>: s does not ascend")
            named = zip(("grade_sd", "bank_sd", "z_sd"), sds, strict=True)
            return {name: np.interp(s, at, sd) for name, sd in named}
    return {}


def _left_out(path: Path, road: ET.Element) -> tuple[str, ...]:
    surface = tuple(
        f"<{name}> is not read: the surface beside the line is finer than a bank"
        for name in ("shape", "crossSectionSurface")
        if road.find(f"lateralProfile/{name}") is not None
    )
    shifts = (
        number(str(path), record, key)
        for record in road.iterfind("lanes/laneOffset")
        for key in ("a", "b", "c", "d")
    )
    if not any(shifts):
        return surface
    return (*surface, "<laneOffset> is not read: the road is its reference line, not a lane")
