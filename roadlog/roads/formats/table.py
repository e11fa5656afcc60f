"""A road as a table, CSV or Parquet: a row a point, units in the headings."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.geo import TransverseMercator
from roadlog.roads.model import RoadModel, road_of
from roadlog.types import Floats

# heading -> attribute of the model; what is read back
HEADINGS = {
    "s_m": "s",
    "z_m": "z",
    "heading_rad": "heading",
    "curvature_per_m": "curvature",
    "grade_rad": "grade",
    "bank_rad": "bank",
    "z_sd_m": "z_sd",
    "grade_sd_rad": "grade_sd",
    "bank_sd_rad": "bank_sd",
    "grade_common_sd_rad": "grade_common_sd",
    "bank_common_sd_rad": "bank_common_sd",
    "passes": "passes",
}
NEEDED = ("latitude_deg", "longitude_deg", "grade_rad")


def columns(model: RoadModel) -> dict[str, NDArray]:
    """As the file has them; percent beside the radians for people."""
    latitude, longitude = model.positions
    result: dict[str, NDArray] = {"s_m": model.s}
    result |= {"latitude_deg": latitude, "longitude_deg": longitude}
    result |= {"x_m": model.x, "y_m": model.y}
    result |= {h: getattr(model, a) for h, a in HEADINGS.items() if h != "s_m"}
    result["grade_percent"] = 100 * np.tan(model.grade)
    return result


def to_bytes(model: RoadModel, ending: str) -> bytes:
    """The table, as CSV or Parquet."""
    return content(columns(model), ending, {"name": model.name, "datum": model.datum})


def content(table: dict[str, NDArray], ending: str, about: dict[str, str] | None = None) -> bytes:
    """Columns of roads as CSV or Parquet; about: of Parquet's own metadata."""
    if ending == ".parquet":
        pa, parquet = _pyarrow()
        made = pa.table(table).replace_schema_metadata(about)
        sink = pa.BufferOutputStream()
        parquet.write_table(made, sink, compression="zstd")
        return bytes(sink.getvalue())
    if not table:
        return b""
    digits = dict.fromkeys(("stretch", "passes"), "%d")
    digits |= {"latitude_deg": "%.9f", "longitude_deg": "%.9f"}
    formats = [digits.get(name, "%.6f" if name.endswith("_m") else "%.9g") for name in table]
    text = io.StringIO()
    rows = np.stack([np.asarray(c, np.float64) for c in table.values()], axis=1)
    np.savetxt(text, rows, formats, ",", header=",".join(table), comments="")
    return text.getvalue().encode()


def read(path: Path) -> RoadModel:
    """A road that `write` wrote, or a table with its needed headings."""
    table = _parquet(path) if path.suffix.lower() == ".parquet" else _csv(path)
    latitude, longitude = table["latitude_deg"], table["longitude_deg"]
    for name, limit in (("latitude_deg", 90.0), ("longitude_deg", 360.0)):
        if len(table[name]) < 2 or not (np.abs(table[name]) <= limit).all():
            raise LogReadError(
                f"{path}: {name}: needs two rows or more, all numbers within {limit:g}"
            )
    if not np.isfinite(table["grade_rad"]).any():
        raise LogReadError(f"{path}: grade_rad: is known nowhere")
    middle = float(np.median(latitude)), float(longitude[len(longitude) // 2])
    x, y = TransverseMercator(*middle).forward(latitude, longitude)
    given = {a: table[h] for h, a in HEADINGS.items() if h in table}
    grade = given.pop("grade")
    if "passes" in given:
        given["passes"] = np.nan_to_num(given["passes"]).astype(np.int64)
    z = given.pop("z", np.zeros(len(x)))
    return road_of(path.stem, middle, x, y, z, grade=grade, **given)


def _check(path: Path, names: Sequence[str]) -> None:
    """Raise LogReadError where a table is of something else."""
    lacking = [name for name in NEEDED if name not in names]
    if lacking:
        raise LogReadError(
            f"{path}: is no road table (of `roadlog road`): it has no {', '.join(lacking)}; "
            "the table of a drive goes through `roadlog ingest` first"
        )


def _parquet(path: Path) -> dict[str, Floats]:
    pa, parquet = _pyarrow()
    try:
        table = parquet.read_table(path)
        _check(path, table.column_names)
        return {name: table[name].to_numpy().astype(np.float64) for name in table.column_names}
    except (pa.ArrowException, OSError, ValueError, TypeError) as error:
        why = str(error).replace(str(path), path.name)
        raise LogReadError(f"{path}: no road table: {why}") from error


def _csv(path: Path) -> dict[str, Floats]:
    try:
        with path.open(encoding="utf-8-sig") as file:
            names, rows = file.readline().strip().split(","), file.readlines()
        _check(path, names)
        if not rows:
            raise LogReadError(f"{path}: is a road table without rows")
        values = np.loadtxt(rows, delimiter=",", ndmin=2)
    except (OSError, ValueError) as error:
        why = str(error).partition("; use `usecols`")[0]
        raise LogReadError(f"{path}: no road table: {why}") from error
    if values.shape[1] != len(names):
        raise LogReadError(f"{path}: {len(names)} headings over {values.shape[1]} columns")
    return dict(zip(names, values.T, strict=True))


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError as error:
        raise MissingExtraError("Parquet files", "table") from error
    return pa, parquet
