"""Columns that grow block by block: in memory while they are small, then in an unnamed file.

A log of any size goes through in bounded memory: pages of a file are the system's to take back,
and `release` gives them back at once.
"""

from __future__ import annotations

import mmap
import tempfile
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import DTypeLike, NDArray

SMALL = 1 << 21  # bytes of a column that stay in memory
ROWS = 1 << 17  # of a block


class Spool:
    """A growing column of one type."""

    def __init__(self, dtype: DTypeLike) -> None:
        self.dtype = np.dtype(dtype)
        # lives as long as the column does; the system removes it with its last user
        self._file = tempfile.SpooledTemporaryFile(SMALL)  # noqa: SIM115

    def __len__(self) -> int:
        return self._file.tell() // self.dtype.itemsize

    def append(self, values: NDArray) -> None:
        """Add values at the end."""
        self._file.write(np.ascontiguousarray(values, self.dtype).data.cast("B"))

    def column(self) -> NDArray:
        """All values, read-only: in memory, or mapped from the file."""
        size = self._file.tell()
        if size <= SMALL:
            self._file.seek(0)
            return np.frombuffer(self._file.read(), self.dtype)
        self._file.flush()
        return np.frombuffer(
            mmap.mmap(self._file.fileno(), size, access=mmap.ACCESS_READ), self.dtype
        )


def concatenated(parts: Sequence[NDArray]) -> NDArray:
    """Columns put end to end, long ones through a file."""
    if sum(part.nbytes for part in parts) <= SMALL or any(part.dtype == object for part in parts):
        return np.concatenate(parts)
    spool = Spool(np.result_type(*parts))
    for part in parts:
        for rows in blocks(len(part)):
            spool.append(part[rows])
        release([part])
    return spool.column()


def blocks(size: int) -> Iterator[slice]:
    """Rows of a long table in blocks."""
    return (slice(start, min(start + ROWS, size)) for start in range(0, size, ROWS))


def release(columns: Iterable[NDArray]) -> None:
    """Give back the memory of columns that are mapped from files; they stay readable."""
    for column in columns:
        base = column.base
        while base is not None and not isinstance(base, mmap.mmap):
            base = base.obj if isinstance(base, memoryview) else getattr(base, "base", None)
        if base is not None and hasattr(mmap, "MADV_DONTNEED"):  # Windows takes back what it needs
            base.madvise(mmap.MADV_DONTNEED)
