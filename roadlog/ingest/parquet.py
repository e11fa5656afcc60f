"""Parquet tables, by pyarrow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest import times
from roadlog.ingest.frame import Frame, Recording, absent
from roadlog.ingest.profile import Profile

MAGIC = b"PAR1"


def recognizes(path: Path) -> bool:
    """Whether the file begins as a Parquet file does."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def names(path: Path, dbc: object = ()) -> set[str]:
    """Column names."""
    del dbc
    return set(_opened(path).schema_arrow.names)


def read(path: Path, profile: Profile, dbc: object = ()) -> Recording:
    """The columns that the profile reads; of the others only the names.

    Raises LogReadError, MissingExtraError, ConfigError when there is no time column.
    """
    del dbc
    file = _opened(path)
    schema = file.schema_arrow
    clock = times.time_column(schema.names, profile.clock.column, str(path))
    wanted = [name for name in schema.names if name != clock and profile.reads(name)]
    try:
        table = file.read([clock, *wanted])
    except Exception as error:  # pyarrow's own tree, and OSError of a damaged page
        raise LogReadError(f"{path}: cannot be read: {error}") from error
    if not table.num_rows:
        raise LogReadError(f"{path}: has columns but no rows")
    raw = _array(table[clock])
    time, keep = times.stamps(raw, profile.clock.unit, str(path))
    columns = {
        n: _array(table[n])[keep] if n in wanted else absent(len(time))
        for n in schema.names
        if n != clock
    }
    lost = int((~keep).sum())
    losses = (f"{path.name}: {lost} rows without a time left out",) if lost else ()
    return Recording((Frame("", path.name, time, columns),), losses)


def _opened(path: Path) -> Any:
    try:
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError("a Parquet file", "table") from None
    try:
        return parquet.ParquetFile(path)
    except Exception as error:  # pyarrow's own tree
        raise LogReadError(f"{path}: cannot be read as Parquet: {error}") from error


def _array(column: Any) -> NDArray:
    import pyarrow

    if pyarrow.types.is_timestamp(column.type):
        values = column.cast(pyarrow.timestamp("ns", column.type.tz)).to_numpy()
        return values.astype("datetime64[ns]")
    return np.asarray(column.to_numpy())
