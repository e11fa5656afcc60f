"""Where on earth an OpenDRIVE file lies: its projection and offset, turned into our own plane."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.geo import TransverseMercator
from roadlog.roads.formats.geometry import ReferenceLine, number
from roadlog.roads.model import SOMEWHERE
from roadlog.types import Floats

FARTHEST = 2e7  # m from a projection's origin: half around the earth
AHEAD = 1.0  # m along the line, by which its heading is carried into another projection


@dataclass(frozen=True, eq=False)
class Placed:
    """A line in the transverse Mercator plane of `origin` (deg); is_known: it is there."""

    origin: tuple[float, float]
    x: Floats
    y: Floats
    z: Floats
    heading: Floats
    is_known: bool


def placed(path: Path, root: ET.Element, line: ReferenceLine, z: Floats) -> Placed:
    """The line on earth; in a plane somewhere for a file without a projection.

    Our own projection is read here, others by rasterio (extra `dem`). Raises LogReadError,
    MissingExtraError.
    """
    x, y, z, heading = _offset(path, root, line, z)
    text = " ".join((root.findtext("header/geoReference") or "").split())
    if not text:
        return Placed(SOMEWHERE, x, y, z, heading, False)
    far = max(float(np.abs(x).max()), float(np.abs(y).max()))
    if far > FARTHEST:
        raise LogReadError(f"{path}: <planView>: {far:.3g} m from the origin are not on earth")
    own = _own(text)
    if own is not None and (abs(own[0]) > 90 or abs(own[1]) > 360):
        raise LogReadError(f"{path}: <geoReference> {text[:80]!r}: lat_0, lon_0 are not on earth")
    if own is not None:
        return Placed(own, x, y, z, heading, True)
    crs = _crs(path, text)
    latitude, longitude = _on_earth(crs, x, y)
    ahead = _on_earth(crs, x + AHEAD * np.cos(heading), y + AHEAD * np.sin(heading))
    if not np.isfinite([latitude, longitude, *ahead]).all():
        raise LogReadError(f"{path}: <geoReference>: its line lies outside of {text[:60]!r}")
    origin = float(np.median(latitude)), float(np.median(longitude))
    plane = TransverseMercator(*origin)
    x, y = plane.forward(latitude, longitude)
    there_x, there_y = plane.forward(*ahead)
    return Placed(origin, x, y, z, np.unwrap(np.arctan2(there_y - y, there_x - x)), True)


def _offset(
    path: Path, root: ET.Element, line: ReferenceLine, z: Floats
) -> tuple[Floats, Floats, Floats, Floats]:
    """x, y, z and heading with the header's offset, which moves and turns the whole file."""
    element = root.find("header/offset")
    if element is None:
        return line.x, line.y, z, line.heading
    x, y, up, turn = (number(str(path), element, key) for key in ("x", "y", "z", "hdg"))
    c, d = np.cos(turn), np.sin(turn)
    return x + line.x * c - line.y * d, y + line.x * d + line.y * c, z + up, line.heading + turn


def _own(text: str) -> tuple[float, float] | None:
    """Origin in deg of a transverse Mercator as roadlog has it: k = 1, no false origin."""
    values = {
        key: float(found[1])
        for key in ("lat_0", "lon_0", "k", "k_0", "x_0", "y_0")
        if (found := re.search(rf"\+{key}=(-?[\d.]+)(?![\d.]*[eE])", text))
    }
    flat = not (values.get("x_0", 0.0) or values.get("y_0", 0.0))
    one = values.get("k", values.get("k_0", 1.0)) == 1.0
    globe = set(re.findall(r"\+(?:ellps|datum)=(\S+)", text))
    near = globe <= {"WGS84", "GRS80"}  # a tenth of a millimeter apart
    if "+proj=tmerc" in text and flat and one and near and "lat_0" in values:
        return values["lat_0"], values.get("lon_0", 0.0)
    return None


def _crs(path: Path, text: str) -> Any:
    try:
        from rasterio import Env
        from rasterio.crs import CRS
        from rasterio.errors import CRSError
    except ImportError as error:
        raise MissingExtraError(f"a road in {text[:40]!r}", "dem") from error
    try:
        with Env():  # else GDAL prints its errors by itself
            crs = CRS.from_string(text)
    except CRSError as error:
        raise LogReadError(f"{path}: <geoReference> {text[:80]!r}: is no projection") from error
    if not crs.is_projected:
        raise LogReadError(f"{path}: <geoReference> {text[:80]!r}: is no projection to meters")
    return crs


def _on_earth(crs: Any, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Latitude and longitude in deg of projected places."""
    from rasterio import Env
    from rasterio.warp import transform

    with Env():
        longitude, latitude = transform(crs, "EPSG:4326", x.tolist(), y.tolist())[:2]
    return np.array(latitude), np.array(longitude)
