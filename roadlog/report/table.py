"""The rows of a report: `rows.jsonl` as they come, then tables for other tools."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from roadlog.csv_text import csv_text
from roadlog.errors import LogReadError
from roadlog.files import replacing, write
from roadlog.report import schema

ROWS = "rows.jsonl"
TABLE = "table"
METRICS = "metrics"
STEMS = (TABLE, METRICS)

# columns of the table, one row a log
FACTS = (
    "log", "name", "status", "message", "vehicle", "road", "start", "duration_s", "distance_m",
    "stops", "size", "stamp", "key", "roadlog", "peak_memory_mb", "worker", "detail",
)  # fmt: skip
STATISTICS = ("mean_deg", "sd_deg", "p05_deg", "p95_deg", "min_deg", "max_deg")
SHOWN = ("rmse_deg", "bias_deg", "within_2sd", "valid_share")  # of each estimator and angle
FIGURES = (
    "n", "matched_share", "valid_share", "bias_deg", "rmse_deg", "mae_deg", "p95_deg", "max_deg",
    "std_deg", "bias_percent", "rmse_percent", "mae_percent", "p95_percent", "max_percent",
    "within_2sd", "nees",
)  # fmt: skip

TableRow = dict[str, Any]


def read_rows(folder: Path) -> dict[str, TableRow]:
    """Rows of a report by log; the last of a log counts. Nothing is written.

    A last line that a killed run left unfinished does not count. Raises LogReadError.
    """
    path = folder / ROWS
    rows: dict[str, TableRow] = {}
    number = 0
    try:
        with path.open("rb") as file:
            for text in file:
                number += 1
                if not text.endswith(b"\n"):
                    break
                row = schema.parse(text)
                schema.check_row(row)
                rows[row["log"]] = row
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise LogReadError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise LogReadError(f"{path}: is no table of a report: line {number}: {error}") from error
    return rows


def line(row: Mapping[str, Any]) -> str:
    """A row as it stands in the file."""
    return json.dumps(row, separators=(",", ":"), allow_nan=False) + "\n"


def write_row(file: IO[str], row: Mapping[str, Any]) -> None:
    """Append a row; it is with the operating system when this returns."""
    file.write(line(row))
    file.flush()


def write_tables(folder: Path, rows: Sequence[TableRow]) -> None:
    """table.* with one row a log and metrics.* with one row a log, estimator and angle.

    As CSV and as Parquet.
    """
    pairs = sorted({(e, a) for row in rows for e, angles in row["angles"].items() for a in angles})
    wide = [_wide(row, pairs) for row in rows]
    columns = list(wide[0]) if wide else list(FACTS)
    _write(folder / TABLE, columns, wide)
    long = [
        {"log": row["log"], "estimator": estimator, "angle": angle}
        | {figure: figures.get(figure) for figure in FIGURES}
        | {"run_time_s": row["run_time_s"].get(estimator)}
        for row in rows
        for estimator, angles in row["angles"].items()
        for angle, figures in angles.items()
    ]
    _write(folder / METRICS, ["log", "estimator", "angle", *FIGURES, "run_time_s"], long)


def _wide(row: TableRow, pairs: Iterable[tuple[str, str]]) -> TableRow:
    wide = {name: row[name] for name in FACTS}
    wide["estimators"] = " ".join(row["estimators"])
    wide |= {f"seconds.{k}": row["seconds"].get(k) for k in ("read", "estimate", "total")}
    wide |= {name: "; ".join(row[name]) for name in ("warnings", "losses")}
    for angle in ("grade", "bank"):
        found = row[angle] or {}
        wide |= {f"{angle}.{name}": found.get(name) for name in ("estimator", *STATISTICS)}
    for estimator, angle in pairs:
        figures = row["angles"].get(estimator, {}).get(angle, {})
        wide |= {f"{estimator}.{angle}.{name}": figures.get(name) for name in SHOWN}
    return wide


def _write(stem: Path, columns: Sequence[str], rows: Sequence[TableRow]) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    printable = [{name: _printable(row[name]) for name in columns} for row in rows]
    write(stem.with_suffix(".csv"), csv_text(columns, printable))
    arrays = {name: [row[name] for row in printable] for name in columns}
    with replacing(stem.with_suffix(".parquet")) as file:
        parquet.write_table(pa.table(arrays), file)


def _printable(value: Any) -> Any:
    """A file name need not be Unicode; a table must be."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode()
    return value
