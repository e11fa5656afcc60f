"""Parquet tables, by pyarrow."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats import times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.row_clock import RowClock
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile
from roadlog.spool import ROWS, Spool

MAGIC = b"PAR1"


def recognizes(path: Path) -> bool:
    """Whether the file begins as a Parquet file does."""
    return begins(path, MAGIC)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Column names."""
    del dbc
    return set(_opened(path).schema_arrow.names)


def sample(path: Path) -> dict[str, NDArray]:
    """The first rows."""
    file = _opened(path)
    return next(_batches(path, file, list(file.schema_arrow.names)), {})


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """The columns that the profile reads; of the others only the names.

    Raises LogReadError, MissingExtraError, ConfigError when there is no time column.
    """
    del dbc
    file = _opened(path)
    names_ = file.schema_arrow.names
    clock = times.time_column(names_, profile.clock.column, str(path))
    wanted = [name for name in names_ if name != clock and profile.reads(name)]
    rows = RowClock(profile.clock.unit, profile.clock.zone)
    spools = {name: Spool(np.float64) for name in wanted}
    texts: dict[str, object] = {}
    for batch in _batches(path, file, [clock, *wanted]):
        keep = rows.add(batch[clock], str(path))
        for name in wanted:
            values = batch[name][keep]
            if values.dtype.kind == "m":
                values = np.where(np.isnat(values), np.nan, values / np.timedelta64(1, "s"))
            if values.dtype.kind in "bifu":
                spools[name].append(values)
            elif len(values):
                texts[name] = values[0]
    if not rows.rows:
        raise LogReadError(f"{path}: has columns but no rows")
    stamps, notes, losses = rows.stamps(path.name)
    columns: dict[str, NDArray] = {
        name: spools[name].column() if name in spools else absent(len(stamps))
        for name in names_
        if name != clock
    }
    for name, text in texts.items():
        columns[name] = np.broadcast_to(np.array(str(text), object), len(stamps))
    lost = rows.rows - len(stamps)
    losses += [f"{path.name}: {lost} rows without a time left out"] if lost else []
    return Recording((Frame("", path.name, stamps, columns),), tuple(losses), tuple(notes))


def _opened(path: Path) -> Any:
    try:
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("a Parquet file", "table") from None
    with guarded(path, "Parquet"):
        return parquet.ParquetFile(path)


def _batches(path: Path, file: Any, columns: list[str]) -> Iterator[dict[str, NDArray]]:
    """Some rows at a time, column by column."""
    with guarded(path, "Parquet"):
        for batch in file.iter_batches(ROWS, columns=columns):
            yield {name: _array(batch[name]) for name in columns}


def _array(column: Any) -> NDArray:
    import pyarrow

    if pyarrow.types.is_timestamp(column.type):
        column = column.cast(pyarrow.timestamp("ns", column.type.tz))
        return np.asarray(column.to_numpy(zero_copy_only=False).astype("datetime64[ns]"))
    if pyarrow.types.is_duration(column.type):
        return np.asarray(column.to_numpy(zero_copy_only=False).astype("timedelta64[ns]"))
    if pyarrow.types.is_time(column.type):
        whole = column.cast(pyarrow.time64("ns")).cast(pyarrow.int64())
        return np.asarray(whole.to_numpy(zero_copy_only=False)).astype("timedelta64[ns]")
    if pyarrow.types.is_decimal(column.type) or pyarrow.types.is_boolean(column.type):
        column = column.cast(pyarrow.float64())
    return np.asarray(column.to_numpy(zero_copy_only=False))


FORMAT = Format(
    name="parquet",
    about="Parquet tables",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="table",
    is_table=True,
    sample=sample,
)
