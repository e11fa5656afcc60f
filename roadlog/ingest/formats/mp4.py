"""The index of an MP4 video: where the samples of a track of data lie (ISO/IEC 14496-12)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

NESTS = {b"moov", b"trak", b"mdia", b"minf", b"stbl"}
MAX_SAMPLE = 1 << 24  # bytes of telemetry in a second of video
MAX_RUN = 1 << 20  # samples


def has(path: Path, kind: bytes) -> bool:
    """Whether a video has a track whose samples are of a kind."""
    return any(track.kind == kind for track in _tracks(path))


def samples(path: Path, kind: bytes) -> Iterator[tuple[float, float, bytes]]:
    """Start and duration in s, and bytes, of each sample of the tracks of a kind."""
    for track in _tracks(path):
        if track.kind == kind:
            yield from track.samples(path)


@dataclass(frozen=True)
class _Track:
    """moov: the index. tables: kind -> where it lies in the index."""

    moov: bytes
    tables: dict[bytes, tuple[int, int]]

    @property
    def kind(self) -> bytes:
        first = self.tables[b"stsd"][0]
        return self.moov[first + 12 : first + 16]

    def column(self, name: bytes, form: str, skip: int = 8) -> Any:
        """All numbers of a table after its head."""
        start, end = self.tables[name]
        dtype = np.dtype(form)
        room = max(0, (end - start - skip) // dtype.itemsize)
        return np.frombuffer(self.moov, dtype, room, start + skip).astype(np.int64)

    def samples(self, path: Path) -> Iterator[tuple[float, float, bytes]]:
        head = self.tables[b"mdhd"][0]
        at = head + (20 if self.moov[head] == 1 else 12)
        ticks = struct.unpack_from(">I", self.moov, at)[0]
        runs = self.column(b"stts", ">u4").reshape(-1, 2)
        steps = np.repeat(runs[:, 1], np.minimum(runs[:, 0], MAX_RUN)) / ticks
        fixed = struct.unpack_from(">I", self.moov, self.tables[b"stsz"][0] + 4)[0]
        sizes = np.full(len(steps), fixed) if fixed else self.column(b"stsz", ">u4", 12)
        wide = b"co64" in self.tables
        offsets = self.column(b"co64", ">u8") if wide else self.column(b"stco", ">u4")
        places = self._places(offsets, sizes)
        times = np.concatenate([[0.0], np.cumsum(steps)])
        with path.open("rb") as file:
            for k, place in enumerate(places[: len(steps)]):
                file.seek(place)
                yield float(times[k]), float(steps[k]), file.read(min(int(sizes[k]), MAX_SAMPLE))

    def _places(self, offsets: Any, sizes: Any) -> list[int]:
        """Where each sample begins: chunks hold one or more."""
        runs = self.column(b"stsc", ">u4").reshape(-1, 3)
        places: list[int] = []
        for chunk, offset in enumerate(offsets.tolist(), 1):
            rows = runs[runs[:, 0] <= chunk]
            for _ in range(int(rows[-1, 1]) if len(rows) else 1):
                if len(places) < len(sizes):
                    places.append(offset)
                    offset += int(sizes[len(places) - 1])
        return places


def _boxes(data: bytes, at: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Kind, start and end of what each box of an MP4 holds."""
    while at + 8 <= end:
        size, kind = struct.unpack_from(">I4s", data, at)
        head = 8
        if size == 1 and at + 16 <= end:
            size, head = struct.unpack_from(">Q", data, at + 8)[0], 16
        size = size or end - at
        if size < head or at + size > end:
            return
        yield kind, at + head, at + size
        at += size


def _tracks(path: Path) -> Iterator[_Track]:
    moov = _moov(path)
    for kind, start, end in _boxes(moov, 0, len(moov)):
        if kind == b"trak":
            tables: dict[bytes, tuple[int, int]] = {}
            _collect(moov, start, end, tables)
            if b"stsd" in tables:
                yield _Track(moov, tables)


def _collect(data: bytes, start: int, end: int, tables: dict[bytes, tuple[int, int]]) -> None:
    for kind, a, b in _boxes(data, start, end):
        if kind in NESTS:
            _collect(data, a, b, tables)
        else:
            tables[kind] = a, b


def _moov(path: Path) -> bytes:
    """The index of the video, wherever it stands in the file."""
    size = path.stat().st_size
    with path.open("rb") as file:
        at = 0
        while at + 8 <= size:
            file.seek(at)
            length, kind = struct.unpack(">I4s", file.read(8))
            head = 8
            if length == 1:
                length, head = struct.unpack(">Q", file.read(8))[0], 16
            length = length or size - at
            if kind == b"moov":
                return file.read(min(length - head, size - at))
            if length < head:
                break
            at += length
    return b""
