"""A road as ASAM OpenCRG 1.2, by pycrg: banking is a tangent, left side up +; heights on a grid."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType

import numpy as np

from roadlog.errors import ConfigError, LogReadError, MissingExtraError
from roadlog.roads.model import SOMEWHERE, RoadModel, road_of
from roadlog.types import Floats

STEP = 1.0  # m between cross sections: 7 mm of the line and 0.002 deg of bank off, 321 kB for 10 km
LEAST_STEP = 1.0  # m between the points that are read
HALF_WIDTH = 4.0  # m to each side
AMISS = ("integration error", "inconsistent")  # what pycrg only warns of
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
    """The line, its slope and the cross slope of its middle; a grid of heights counts as well.

    A file without a modifier section is taken as it stands: readers of OpenCRG move it to the
    origin. Grids finer than LEAST_STEP are averaged over it: what a tire rolls over is no slope.
    """
    pycrg = _pycrg()
    told: list[str] = []
    try:
        with _warnings_into(pycrg, told):
            with pycrg.DataSet.open(str(path), apply_modifiers=False) as data:
                grid, header = data.grid(), data.header
            if header.modifiers is not None:
                with pycrg.DataSet.open(str(path)) as data:
                    grid = data.grid()
    except (pycrg.OpenCRGError, ValueError, OSError) as error:
        why = str(error).replace(f"Failed to load CRG file: '{path}'", "").strip(" ()")
        why = why.replace(str(path), path.name)
        raise LogReadError(f"{path}: not read as OpenCRG: {why}") from error
    if any(word in " ".join(told) for word in AMISS):
        why = " ".join(" ".join(dict.fromkeys(told)).split())
        raise LogReadError(
            f"{path}: reference line: headings or slopes do not lead to the header's end: {why}"
        )
    if len(grid.u) < 3:
        raise LogReadError(f"{path}: a grid of {len(grid.u)} cross sections is no road")
    u, x, y, z, across = _coarsened(np.stack([grid.u, grid.x, grid.y, *_middle(path, grid)]))
    if len(u) < 3:
        raise LogReadError(f"{path}: {grid.u[-1] - grid.u[0]:.2f} m are too short for a road")
    place, is_moved = _origin(header.comment, header.road)
    if is_moved or place is None:
        x, y = x - grid.x[0], y - grid.y[0]
    s = u - u[0]
    grade = np.arctan(np.gradient(z, s))
    heading = np.unwrap(np.arctan2(np.gradient(y, s), np.gradient(x, s)))
    bank = np.arctan(across * np.cos(grade))
    return road_of(
        path.stem, place or SOMEWHERE, x, y, z, grade=grade, bank=bank, heading=heading, s=s,
        placed=place is not None,
    )  # fmt: skip


@contextmanager
def _warnings_into(pycrg: ModuleType, told: list[str]) -> Iterator[None]:
    """Collect what the library warns of; it would print it."""

    def listen(level: int, text: str) -> None:
        if level <= pycrg.MSG_LEVEL_WARN:
            told.append(text)

    pycrg.set_message_callback(listen)
    try:
        yield
    finally:
        pycrg.clear_message_callback()


def _coarsened(columns: Floats) -> Floats:
    """Means over as many cross sections as lie in LEAST_STEP."""
    every = max(1, round(LEAST_STEP / float(columns[0, 1] - columns[0, 0])))
    whole = columns.shape[1] // every * every
    means: Floats = columns[:, :whole].reshape(len(columns), -1, every).mean(axis=2)
    return means


def _middle(path: Path, grid: object) -> tuple[Floats, Floats]:
    """Height of the reference line and the cross slope (left up +) about it; NaN cells left out."""
    v = np.asarray(grid.v, np.float64)  # type: ignore[attr-defined]
    heights = np.asarray(grid.z, np.float64)  # type: ignore[attr-defined]
    base = np.asarray(grid.ref_z, np.float64)  # type: ignore[attr-defined]
    bank = np.broadcast_to(np.asarray(grid.bank, np.float64), base.shape)  # type: ignore[attr-defined]
    near = np.abs(v) <= max(2.0, float(np.sort(np.abs(v))[min(1, len(v) - 1)]))
    v, heights = v[near], heights[:, near]
    known = np.isfinite(heights)
    count = known.sum(axis=1)
    if not count.all():
        u = float(grid.u[int(np.argmin(count))])  # type: ignore[attr-defined]
        raise LogReadError(f"{path}: no height within 2 m of the line at u = {u:g} m")
    heights = np.where(known, heights, 0.0)
    middle = (known @ v) / count
    away = np.where(known, v - middle[:, None], 0.0)
    spread = (away**2).sum(axis=1)
    slope = np.where(spread > 0, (away * heights).sum(axis=1) / np.where(spread > 0, spread, 1), 0)
    level = heights.sum(axis=1) / count - slope * middle
    return base + level, bank + slope


def _origin(comment: str, road: dict[str, float]) -> tuple[tuple[float, float] | None, bool]:
    """Origin in deg of the plane if it is known, and whether the line must be moved to it."""
    found = re.search(r"origin latitude (-?[\d.]+) longitude (-?[\d.]+) deg", comment)
    if found:
        return (float(found[1]), float(found[2])), False
    keys = "reference_line_start_lat", "reference_line_start_lon"
    if all(key in road for key in keys):
        return (float(road[keys[0]]), float(road[keys[1]])), True
    return None, True


def _median(values: Floats) -> str:
    known = values[np.isfinite(values)]
    return f"{np.median(known):.2g}" if len(known) else "unknown"


def _pycrg() -> ModuleType:
    try:
        import pycrg
    except ImportError as error:
        raise MissingExtraError("OpenCRG roads", "road") from error
    return pycrg
