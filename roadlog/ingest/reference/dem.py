"""A reference grade and bank from a digital terrain model: planes fitted below the drive's way."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.geo import EARTH_RADIUS, TransverseMercator
from roadlog.ingest.reference import gnss
from roadlog.ingest.reference.road import DriveFixes, fixes_of
from roadlog.storage import Table
from roadlog.types import Bools, Floats

BASE, WIDTH = 10.0, 6.0  # m of the plane along and across the way
SPACING = 0.5  # m between the samples of a plane
CELLS = 4.0  # of the grid's cells that a plane is long at least
BANK_CELL = 2.0  # m; a coarser grid holds no bank
COARSE = 5.0  # m; a coarser grid is said to be
ROUGH = 4.0  # of the median residual, beyond which a plane is no road: walls, crowns, bridge ends
DIFFERENT = np.radians(
    3.0
)  # rad from the drive's own grade, which no road is off: a bridge, a tunnel
LOWEST = -500.0  # m; there is no land below
FILLED, FAR = 10, 10.0  # cells of one extreme height, and m to the next one: no height
TELLING = 100.0  # m; a height above it tells feet from meters, geoid and receiver aside
FOOT, US_FOOT = 0.3048, 1200 / 3937  # m
_VERTICAL_UNIT = re.compile(r'VERT_?C(?:RS|S)\[.*?(?:LENGTH)?UNIT\["([^"]+)"', re.DOTALL)
CORRELATED = 2.0  # of the sd that independent cells would give: neighboring cells err alike


@dataclass(frozen=True)
class Terrain:
    """Heights of a grid. values: (rows, columns) m, NaN where unknown; transform: its own."""

    values: Floats
    inverse: Any
    crs: Any
    cell: float
    notes: tuple[str, ...]


def from_dem(path: Path, tables: Sequence[Table]) -> tuple[Table, list[str]]:
    """`/truth/angles` at the fixes of a drive, and what a reader should know of it.

    NaN where the grid is unknown or no road: bridges, tunnels, crowns. No bank from cells beyond
    BANK_CELL. Raises LogReadError, MissingExtraError.
    """
    fixes = fixes_of(tables, path.name)
    terrain = load(path, fixes)
    base = max(BASE, CELLS * terrain.cell)
    grade, bank, sds, residual = planes(terrain, fixes, base)
    known = np.isfinite(grade)
    notes = list(terrain.notes)
    if known.any():
        rough = residual > ROUGH * np.nanmedian(residual[known])
        known &= ~rough
        apart = _apart(fixes, grade, tables)
        known &= ~apart
        left_out = int(rough.sum() + (apart & ~rough).sum())
        if left_out:
            notes.append(f"{left_out} of {len(grade)} fixes lie where the grid is no road "
                         "(bridge, tunnel, trees): left out")  # fmt: skip
    if not known.any():
        raise LogReadError(f"{path}: no part of the drive lies on known terrain of this grid")
    if terrain.cell > BANK_CELL:
        bank = np.full(len(bank), np.nan)
        notes.append(f"cells of {terrain.cell:.1f} m hold no bank; needs {BANK_CELL:g} m or finer")
    if terrain.cell > COARSE:
        notes.append(f"cells of {terrain.cell:.1f} m: the grade is a mean over {base:.0f} m")
    sd, bank_sd = (
        np.where(np.isfinite(a), s, np.nan)[known] for a, s in zip((grade, bank), sds, strict=True)
    )
    return gnss.table(fixes.time[known], grade[known], sd, bank[known], bank_sd), notes


def load(path: Path, fixes: DriveFixes) -> Terrain:
    """The part of a grid that the drive crosses. Raises LogReadError."""
    rasterio = _rasterio()
    from rasterio.windows import Window, from_bounds

    try:
        with rasterio.open(path) as data:
            x, y = _projected(data.crs, fixes.latitude, fixes.longitude)
            margin = 20 * max(data.res)
            window = from_bounds(
                x.min() - margin, y.min() - margin, x.max() + margin, y.max() + margin,
                data.transform,
            ).intersection(Window(0, 0, data.width, data.height))  # fmt: skip
            window = window.round_offsets().round_lengths()
            values = data.read(1, window=window, masked=True)
            transform = data.window_transform(window)
            heights = np.ma.filled(values.astype(np.float64), np.nan)
            cell = _cell(data.crs, data.res, float(fixes.latitude[0]))
            nodata, crs, unit = data.nodata, data.crs, data.units[0] or ""
    except (rasterio.errors.RasterioError, ValueError, OSError) as error:
        raise LogReadError(f"{path}: not read as a terrain model: {error}") from error
    notes = [f"heights of {path.name} as they are: no vertical datum was converted"]
    suspect = _unknown(heights) if nodata is None else heights < LOWEST
    if nodata is None and suspect.any():
        notes.append(f"{int(suspect.sum())} cells of no height, without a nodata tag: unknown")
    heights[suspect] = np.nan
    terrain = Terrain(heights, ~transform, crs, cell, tuple(notes))
    try:
        return _in_meters(terrain, unit, fixes)
    except ValueError as error:
        raise LogReadError(f"{path}: {error}") from error


def _unknown(heights: Floats) -> Bools:
    """Cells that must be fill values: below all land, or one extreme value far from the others."""
    found: Bools = heights < LOWEST
    values, counts = np.unique(heights[np.isfinite(heights) & ~found], return_counts=True)
    if len(values) > 2:
        for k, gap in ((0, values[1] - values[0]), (-1, values[-1] - values[-2])):
            if counts[k] >= FILLED and gap > FAR:
                found |= heights == values[k]
    return found


def _in_meters(terrain: Terrain, unit: str, fixes: DriveFixes) -> Terrain:
    """Heights in m: by the unit of the band, of the vertical datum, or by the drive's altitudes.

    Raises ValueError where a grid in feet leaves that open.
    """
    named = unit or _VERTICAL_UNIT.findall(terrain.crs.to_wkt() if terrain.crs else "")[-1:]
    text = named if isinstance(named, str) else "".join(named)
    notes = []
    if re.search("f(?:oo|ee)?t", text, re.IGNORECASE):
        factor = US_FOOT if re.search("us|survey", text, re.IGNORECASE) else FOOT
        notes = [f"heights in feet ({text.strip()})"]
    elif not text and (ratio := _against_altitudes(terrain, fixes)):
        factor = min((1.0, FOOT, 0.1, 0.01), key=lambda size: abs(np.log(ratio * size)))
        if factor != 1.0:
            what = "feet" if factor == FOOT else f"{factor:g} m"
            notes = [f"heights in {what}, by the altitudes of the drive: nothing states their unit"]
    else:
        factor = 1.0
        if not text and terrain.crs.is_projected and terrain.crs.linear_units_factor[1] != 1.0:
            where = "its cells are in feet, but not said is whether its heights are"
            raise ValueError(f"{where}: give the band a unit, or the drive altitudes")
    known = (*terrain.notes, *notes)
    return replace(terrain, values=terrain.values * factor, notes=known)


def _against_altitudes(terrain: Terrain, fixes: DriveFixes) -> float | None:
    """Size of the terrain's heights for the drive's own; None where these do not tell."""
    known = np.isfinite(fixes.altitude)
    if known.sum() < 2:
        return None
    place = fixes.latitude[known], fixes.longitude[known]
    heights = bilinear(terrain, *_projected(terrain.crs, *place))
    both = np.isfinite(heights)
    if not both.any():
        return None
    own = float(np.median(fixes.altitude[known][both]))
    ratio = float(np.median(heights[both])) / own if abs(own) > TELLING else 0.0
    return ratio if ratio > 0 else None


def planes(
    terrain: Terrain, fixes: DriveFixes, base: float
) -> tuple[Floats, Floats, tuple[Floats, Floats], Floats]:
    """Grade, bank, their sds (rad) and the rms residual (m) of a plane below each fix."""
    spacing = max(SPACING, terrain.cell / 2)
    along = np.arange(-base / 2, base / 2 + spacing / 2, spacing)
    width = max(WIDTH, 2 * terrain.cell)
    across = np.arange(-width / 2, width / 2 + spacing / 2, spacing)
    a, b = (axis.ravel() for axis in np.meshgrid(along, across, indexing="ij"))
    design = np.stack([np.ones(len(a)), a, b], axis=1)
    inverse = np.linalg.pinv(design)
    plane = TransverseMercator(float(np.median(fixes.latitude)), float(np.median(fixes.longitude)))
    x, y = plane.forward(fixes.latitude, fixes.longitude)
    c, d = np.cos(fixes.heading)[:, None], np.sin(fixes.heading)[:, None]
    east, north = x[:, None] + a * c - b * d, y[:, None] + a * d + b * c
    there = np.isfinite(east).all(axis=1)
    heights = np.full(east.shape, np.nan)
    latitude, longitude = plane.inverse(east[there].ravel(), north[there].ravel())
    px, py = _projected(terrain.crs, latitude, longitude)
    heights[there] = bilinear(terrain, px, py).reshape(-1, len(a))
    level, slope, side = np.einsum("kn,mn->km", inverse, heights)
    fitted = level[:, None] + slope[:, None] * a + side[:, None] * b
    residual = np.sqrt(np.mean((heights - fitted) ** 2, axis=1))
    cells = max(3.0, base * width / terrain.cell**2)
    scale = CORRELATED * residual / np.sqrt(cells - 2)
    sds = scale / np.std(a), scale / np.std(b)
    grade = np.arctan(slope)
    return grade, np.arctan(side * np.cos(grade)), sds, residual


def bilinear(terrain: Terrain, x: Floats, y: Floats) -> Floats:
    """Heights between the centers of cells; NaN outside and beside an unknown cell."""
    a, b, c, d, e, f = terrain.inverse[:6]
    column, row = a * x + b * y + c - 0.5, d * x + e * y + f - 0.5
    rows, columns = terrain.values.shape
    inside = (row >= 0) & (column >= 0) & (row <= rows - 1) & (column <= columns - 1)
    i = np.clip(np.floor(row), 0, max(rows - 2, 0)).astype(np.int64)
    j = np.clip(np.floor(column), 0, max(columns - 2, 0)).astype(np.int64)
    u, w = row - i, column - j
    v = terrain.values
    i1, j1 = np.minimum(i + 1, rows - 1), np.minimum(j + 1, columns - 1)
    height = (
        v[i, j] * (1 - u) * (1 - w)
        + v[i, j1] * (1 - u) * w
        + v[i1, j] * u * (1 - w)
        + v[i1, j1] * u * w
    )
    return np.where(inside, height, np.nan)


def _apart(fixes: DriveFixes, grade: Floats, tables: Sequence[Table]) -> Bools:
    """Where the drive itself climbed otherwise than the terrain: it was not on the ground."""
    try:
        own = gnss.from_gnss(tables)
    except LogReadError:
        return np.zeros(len(grade), np.bool_)
    measured = np.interp(fixes.time, own.time, own.columns["grade"])
    sd = np.interp(fixes.time, own.time, own.columns["grade_sd"])
    result: Bools = np.abs(grade - measured) > DIFFERENT + 2 * np.nan_to_num(sd)
    return result


def _projected(crs: Any, latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
    from rasterio.warp import transform

    if crs is None:
        raise ValueError("it does not say its coordinate system")
    x, y = transform("EPSG:4326", crs, longitude.tolist(), latitude.tolist())[:2]
    return np.array(x), np.array(y)


def _cell(crs: Any, res: tuple[float, float], latitude: float) -> float:
    """m, the larger side of a cell."""
    if crs is not None and crs.is_geographic:
        meter = np.radians(1.0) * EARTH_RADIUS
        return float(max(res[1] * meter, res[0] * meter * np.cos(np.radians(latitude))))
    factor = crs.linear_units_factor[1] if crs is not None and crs.is_projected else 1.0
    return float(max(res)) * factor


def _rasterio() -> ModuleType:
    try:
        import rasterio
        import rasterio.warp  # what a bare import leaves out
    except ImportError as error:
        raise MissingExtraError("terrain models", "dem") from error
    return rasterio
