"""A road as ASAM OpenCRG 1.2, by pycrg: banking is a tangent, left side up +; heights on a grid."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from roadlog.errors import ConfigError, LogReadError, MissingExtraError
from roadlog.roads.model import RoadModel, road_of
from roadlog.types import Floats

STEP = 1.0  # m between cross sections: 7 mm of the line and 0.002 deg of bank off, 321 kB for 10 km
HALF_WIDTH = 4.0  # m to each side
INSIDE = 0.9  # of the smallest radius: the grid may not reach a bend's center


def to_bytes(model: RoadModel, ending: str) -> bytes:
    """Heading, slope and banking as channels over a flat grid; sds in the comment.

    An unknown bank is written as 0 and said in the comment. Raises ConfigError.
    """
    del ending
    pycrg = _pycrg()
    fine = _by_chords(model)
    heading = np.arctan2(np.diff(fine.y), np.diff(fine.x))
    radius = 1 / max(float(np.nanmax(np.abs(fine.curvature))), 1e-9)
    half = min(HALF_WIDTH, INSIDE * radius)
    latitude, longitude = model.positions
    comment = [
        f"road {model.name}, by roadlog; plane of transverse Mercator, k 1, WGS 84,",
        f"origin latitude {model.origin[0]:.9f} longitude {model.origin[1]:.9f} deg",
        f"heights: {model.datum}",
        f"median sd: grade {_median(model.grade_sd)} rad, bank {_median(model.bank_sd)} rad",
        f"grid {half:.2f} m to each side" + (" (sharpest bend)" if half < HALF_WIDTH else ""),
    ]
    if not np.isfinite(model.bank).all():
        comment.append("bank: not known everywhere, 0 there")
    with TemporaryDirectory(prefix="roadlog-") as folder:
        path = Path(folder) / "road.crg"
        try:
            pycrg.write(
                path,
                np.zeros((len(fine), 2)),
                STEP,
                [-half, half],
                heading,
                x0=float(fine.x[0]),
                y0=float(fine.y[0]),
                z0=float(fine.z[0]),
                slope=np.diff(fine.z) / STEP,
                banking=np.nan_to_num(np.tan(fine.bank) * np.hypot(1, fine.slope)),
                comment=comment,
                mods={},  # without this section readers move the road to the origin
                road={
                    "reference_line_start_lat": float(latitude[0]),
                    "reference_line_start_lon": float(longitude[0]),
                },
            )
        except ValueError as error:
            raise ConfigError(f"{model.name} cannot be an OpenCRG road: {error}") from error
        return path.read_bytes()


def _by_chords(model: RoadModel) -> RoadModel:
    """The model at points STEP apart in a straight line, as a CRG's reference line is stored.

    A chord is shorter than its arc by a share of (curvature STEP)^2 / 24; left in, it would move
    the far end of a winding road.
    """
    fine = model.refined(STEP / 4)
    share = 1 - (np.nan_to_num(fine.curvature) * STEP) ** 2 / 24
    u = np.concatenate([[0.0], np.cumsum(0.5 * (share[1:] + share[:-1]) * np.diff(fine.s))])
    return fine.at(np.interp(np.arange(0.0, u[-1], STEP), u, fine.s))


def read(path: Path) -> RoadModel:
    """The line, its slope and the cross slope of its middle; a grid of heights counts as well."""
    pycrg = _pycrg()
    try:
        with pycrg.DataSet.open(str(path)) as data:
            grid, header = data.grid(), data.header
    except (pycrg.OpenCRGError, ValueError, OSError) as error:
        raise LogReadError(f"{path}: not read as OpenCRG: {error}") from error
    z, across = _middle(grid)
    origin = _origin(header.comment, header.road)
    if len(grid.u) < 3:
        raise LogReadError(f"{path}: a grid of {len(grid.u)} cross sections is no road")
    x, y = np.asarray(grid.x, np.float64), np.asarray(grid.y, np.float64)
    if origin is None:
        raise LogReadError(
            f"{path}: reference_line_start_lat and _lon are missing: where on earth is it?"
        )
    place, moved = origin
    if moved:
        x, y = x - x[0], y - y[0]
    s = np.asarray(grid.u, np.float64) - float(grid.u[0])
    grade = np.arctan(np.gradient(z, s))
    heading = np.unwrap(np.arctan2(np.gradient(y, s), np.gradient(x, s)))
    bank = np.arctan(across * np.cos(grade))
    return road_of(path.stem, place, x, y, z, grade=grade, bank=bank, heading=heading, s=s)


def _middle(grid: object) -> tuple[Floats, Floats]:
    """Height of the reference line and the cross slope (left up +) about it."""
    v = np.asarray(grid.v, np.float64)  # type: ignore[attr-defined]
    heights = np.asarray(grid.z, np.float64)  # type: ignore[attr-defined]
    base = np.asarray(grid.ref_z, np.float64)  # type: ignore[attr-defined]
    bank = np.asarray(grid.bank, np.float64)  # type: ignore[attr-defined]
    near = np.abs(v) <= max(2.0, float(np.sort(np.abs(v))[min(1, len(v) - 1)]))
    v, heights = v[near], np.nan_to_num(heights[:, near])
    if len(v) < 2:
        return base + heights.mean(axis=1), bank
    design = np.stack([np.ones(len(v)), v], axis=1)
    level, slope = np.linalg.lstsq(design, heights.T, rcond=None)[0]
    return base + level, bank + slope


def _origin(comment: str, road: dict[str, float]) -> tuple[tuple[float, float], bool] | None:
    """Origin in deg of the plane, and whether the line must be moved to it."""
    found = re.search(r"origin latitude (-?[\d.]+) longitude (-?[\d.]+) deg", comment)
    if found:
        return (float(found[1]), float(found[2])), False
    keys = "reference_line_start_lat", "reference_line_start_lon"
    if all(key in road for key in keys):
        return (float(road[keys[0]]), float(road[keys[1]])), True
    return None


def _median(values: Floats) -> str:
    known = values[np.isfinite(values)]
    return f"{np.median(known):.2g}" if len(known) else "unknown"


def _pycrg() -> ModuleType:
    try:
        import pycrg
    except ImportError as error:
        raise MissingExtraError("OpenCRG roads", "road") from error
    return pycrg
