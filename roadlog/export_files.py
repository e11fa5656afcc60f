"""The files that `roadlog export` writes: CSV, Parquet, Excel, MATLAB."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from roadlog.csv_text import csv_text
from roadlog.errors import LogWriteError, MissingExtraError
from roadlog.types import Bools, Stamps

TIME, SECONDS = "time_ns", "time_s"
SHEET_ROWS = 1_048_576  # of one sheet of Excel, its heading among them


@dataclass(frozen=True)
class Column:
    """One column of the output: name, where it comes from, its type, its unit as written, and what
    SI values are multiplied by for it."""

    name: str
    topic: str
    field: str
    dtype: np.dtype
    unit: str = ""
    factor: float = 1.0

    @property
    def heading(self) -> str:
        """Name and unit, as people read it."""
        return f"{self.name} [{self.unit}]" if self.unit not in ("", "-", "1") else self.name


Put = Callable[[Stamps, Sequence[tuple[NDArray, Bools]]], None]
Opened = Callable[[IO[bytes], Sequence[Column], int], AbstractContextManager[Put]]


@contextmanager
def _csv(file: IO[bytes], columns: Sequence[Column], start: int) -> Iterator[Put]:
    text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
    text.write(csv_text([TIME, SECONDS, *(c.heading for c in columns)], ()).rstrip() + "\n")

    def put(time: Stamps, block: Sequence[tuple[NDArray, Bools]]) -> None:
        cells = [list(map(str, time.tolist())), [f"{x:.9g}" for x in _seconds(time, start)]]
        for values, known in block:
            plain = (values.astype(np.int64) if values.dtype.kind == "b" else values).tolist()
            # repr is the shortest text that gives the same number back
            there = (known & np.isfinite(values)).tolist()
            cells.append([repr(x) if k else "" for x, k in zip(plain, there, strict=True)])
        text.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))

    yield put
    text.flush()
    text.detach()


@contextmanager
def _parquet(file: IO[bytes], columns: Sequence[Column], _start: int) -> Iterator[Put]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError:
        raise MissingExtraError("a Parquet file", "table") from None
    fields = [pa.field(TIME, pa.int64())]
    for c in columns:
        unit = {"unit": c.unit} if c.unit else None
        fields.append(pa.field(c.name, pa.from_numpy_dtype(c.dtype), metadata=unit))
    schema = pa.schema(fields)
    with pq.ParquetWriter(file, schema, compression="zstd") as writer:

        def put(time: Stamps, block: Sequence[tuple[NDArray, Bools]]) -> None:
            arrays = [pa.array(time)]
            arrays += [pa.array(values, mask=~known) for values, known in block]
            writer.write_table(pa.Table.from_arrays(arrays, schema=schema))

        yield put


@contextmanager
def _excel(file: IO[bytes], columns: Sequence[Column], start: int) -> Iterator[Put]:
    """Seconds and the moment; a cell of Excel holds no nanoseconds."""
    try:
        from openpyxl import Workbook
    except ImportError:
        raise MissingExtraError("an Excel file", "excel") from None
    book = Workbook(write_only=True)
    sheet = book.create_sheet("drive")
    sheet.append(["UTC", f"{SECONDS} [s]", *(c.heading for c in columns)])
    rows = 1

    def put(time: Stamps, block: Sequence[tuple[NDArray, Bools]]) -> None:
        nonlocal rows
        rows += len(time)
        if rows > SHEET_ROWS:
            raise LogWriteError(
                f"more than {SHEET_ROWS - 1} rows, which no Excel sheet holds; take fewer with "
                f"--every 1s, or --roles, or write .csv"
            )
        moments = time.astype("datetime64[ns]").astype("datetime64[ms]").tolist()
        cells = [moments, _seconds(time, start)]
        for values, known in block:
            there = (known & np.isfinite(values)).tolist()
            cells.append([x if k else None for x, k in zip(values.tolist(), there, strict=True)])
        for row in zip(*cells, strict=True):
            sheet.append(row)

    yield put
    book.save(file)


@contextmanager
def _matlab(file: IO[bytes], columns: Sequence[Column], start: int) -> Iterator[Put]:
    """A variable a column, its dots as underlines, `time_s`, and the struct `units`."""
    from scipy.io import savemat

    parts: list[tuple[Stamps, list[NDArray]]] = []

    def put(time: Stamps, block: Sequence[tuple[NDArray, Bools]]) -> None:
        values = [np.where(known, values, np.nan) for values, known in block]
        parts.append((time, values))

    yield put
    names = [re.sub(r"\W+", "_", c.name).strip("_") for c in columns]
    time = np.concatenate([part for part, _ in parts]) if parts else np.empty(0, np.int64)
    found: dict[str, Any] = {TIME: time, SECONDS: np.array(_seconds(time, start))}
    for k, name in enumerate(names):
        found[name] = np.concatenate([values[k] for _, values in parts])
    found["units"] = {name: c.unit for name, c in zip(names, columns, strict=True)} | {SECONDS: "s"}
    savemat(file, found, long_field_names=True, oned_as="column", do_compression=True)


FORMATS: dict[str, Opened] = {
    ".csv": _csv,
    ".parquet": _parquet,
    ".xlsx": _excel,
    ".mat": _matlab,
}


def _seconds(time: Stamps, start: int) -> list[float]:
    """s from the log's first message."""
    return ((time - start) * 1e-9).tolist()
