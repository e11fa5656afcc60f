"""GoPro: the telemetry (GPMF) in the video itself, or as gopro-telemetry exports it (JSON, CSV).

By the description of GPMF (github.com/gopro/gpmf-parser): big-endian key, type, size, count. ACCL
in m/s2 (specific force) and GYRO in rad/s at about 200 Hz, SCAL divides; ORIN says which channel is
which axis, a small letter turned round, without it Z, X, Y (up/down, right/left, forward/back).
GPS5 and GPS9 at 10 to 18 Hz: deg, m above the ellipsoid, ground and 3D speed in m/s; only fixes of
two and more dimensions. Samples lie evenly over the time of their block of the video, which GPSU or
GPS9 put on UTC. Made by its description; no file of a camera was at hand.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats import gopro_table, mp4
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame, nanoseconds
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.types import Floats

ORIENTATION = "ZXY"
TRACK = b"gpmd"
HEAD = 1 << 20
GPS_FIELDS = ("latitude", "longitude", "altitude", "speed")
TYPES = {
    "b": "i1",
    "B": "u1",
    "s": ">i2",
    "S": ">u2",
    "l": ">i4",
    "L": ">u4",
    "f": ">f4",
    "d": ">f8",
}
DAY_2000 = datetime(2000, 1, 1, tzinfo=UTC).timestamp()


def recognizes(path: Path) -> bool:
    """Whether it is a video with a telemetry track, or the JSON or the tables made of one."""
    if path.is_dir() or path.suffix.lower() == ".csv":
        return bool(gopro_table.files(path))
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(HEAD)
    if head[4:8] == b"ftyp":
        return mp4.has(path, TRACK)
    return head.lstrip().startswith(b"{") and b'"streams"' in head and b'"ACCL"' in head


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Location, accelerometer and gyroscope. Raises LogReadError."""
    del profile, dbc
    with guarded(path, "GoPro telemetry"):
        found = _Telemetry()
        if path.is_dir() or path.suffix.lower() == ".csv":
            for stream in gopro_table.streams(path):
                found.tabled(stream)
        elif begins(path, b"ftyp", at=4):
            for start, duration, block in mp4.samples(path, TRACK):
                found.take(start, duration, block)
        else:
            found.exported(json.loads(path.read_text("utf-8")))
        frames = found.frames(path.name)
    if not frames:
        raise LogReadError(f"{path}: its telemetry holds no ACCL, GYRO or GPS")
    notes = [] if found.epochs else [f"{path.name}: no GPS time; it begins at 0"]
    return Recording(tuple(frames), (), tuple(notes))


class _Telemetry:
    def __init__(self) -> None:
        self.rows: dict[str, list[Floats]] = {}  # frame -> time in s and values
        self.epochs: list[float] = []  # s, UTC less the video's time

    def take(self, start: float, duration: float, block: bytes) -> None:
        """One block of the video."""
        for key, kind, _, _, data in _items(block):
            if key == "DEVC" and kind == "\0":
                for name, nested, _, _, stream in _items(data):
                    if name == "STRM" and nested == "\0":
                        self._stream(start, duration, stream)

    def _stream(self, start: float, duration: float, data: bytes) -> None:
        items = {key: (kind, size, count, raw) for key, kind, size, count, raw in _items(data)}
        scale = _values(items["SCAL"]).ravel() if "SCAL" in items else np.ones(1)
        if "GPSU" in items:
            stamp = items["GPSU"][3][:16].decode("ascii", "replace")
            moment = datetime.strptime(stamp[:12], "%y%m%d%H%M%S").replace(tzinfo=UTC)
            self.epochs.append(moment.timestamp() + float("0" + stamp[12:16]) - start)
        fixed = "GPSF" not in items or int(_values(items["GPSF"]).ravel()[0]) >= 2
        for key in ("ACCL", "GYRO", "GPS5", "GPS9"):
            if key not in items:
                continue
            values = _complex(items) if key == "GPS9" else _values(items[key])
            values = values / scale
            time = start + duration * np.arange(len(values)) / len(values)
            if key == "GPS9":
                good = values[:, 8] >= 2
                utc = DAY_2000 + 86_400 * values[:, 5] + values[:, 6]
                self.epochs += (utc - time)[good].tolist()[:1]
                values, time = values[good], time[good]
            if key.startswith("GPS"):
                if fixed:
                    self._add("location", time, values[:, :4])
            else:
                letters = items["ORIN"][3].decode("ascii") if "ORIN" in items else ORIENTATION
                name = "accelerometer" if key == "ACCL" else "gyroscope"
                self._add(name, time, _axes(values, letters))

    def exported(self, document: dict[str, Any]) -> None:
        """gopro-telemetry's: streams of samples with cts in ms and a date."""
        for device in document.values():
            for key, stream in (
                device.get("streams", {}).items() if isinstance(device, dict) else ()
            ):
                samples = [s for s in stream.get("samples", ()) if "value" in s and "cts" in s]
                if key not in ("ACCL", "GYRO", "GPS5", "GPS9") or not samples:
                    continue
                time = np.array([s["cts"] for s in samples], np.float64) * 1e-3
                values = np.array([s["value"] for s in samples], np.float64)
                if key.startswith("GPS"):
                    self._add("location", time, values[:, :4])
                else:
                    name = "accelerometer" if key == "ACCL" else "gyroscope"
                    self._add(name, time, _axes(values, ORIENTATION))
                if (date := samples[0].get("date")) is not None:
                    self.epochs.append(datetime.fromisoformat(date).timestamp() - float(time[0]))

    def tabled(self, stream: gopro_table.GoproStream) -> None:
        """One table of an export."""
        if stream.key == "GPS":
            self._add("location", stream.time, stream.values)
        else:
            name = "accelerometer" if stream.key == "ACCL" else "gyroscope"
            self._add(name, stream.time, _axes(stream.values, stream.letters))
        self.epochs += [] if stream.epoch is None else [stream.epoch]

    def _add(self, name: str, time: Floats, values: Floats) -> None:
        self.rows.setdefault(name, []).append(np.column_stack([time, values]))

    def frames(self, file: str) -> list[Any]:
        """All, on UTC where it is known."""
        epoch = float(np.median(self.epochs)) if self.epochs else 0.0
        found = []
        for name, parts in self.rows.items():
            rows = np.concatenate(parts)
            fields = GPS_FIELDS if name == "location" else tuple("xyz")
            columns = dict(zip(fields, rows[:, 1:].T, strict=True))
            if name == "location":
                none = (rows[:, 1] == 0) & (rows[:, 2] == 0)
                columns = {c: np.where(none, np.nan, v) for c, v in columns.items()}
            found.append(frame(name, file, nanoseconds(rows[:, 0] + epoch), columns))
        return found


def _axes(values: Floats, letters: str) -> Floats:
    """Channels in the order and signs of ORIN to x, y, z."""
    xyz = np.full((len(values), 3), np.nan)
    for channel, letter in enumerate(letters[:3]):
        sign = 1.0 if letter.isupper() else -1.0
        xyz[:, "xyz".index(letter.lower())] = sign * values[:, channel]
    return xyz


def _items(data: bytes) -> Iterator[tuple[str, str, int, int, bytes]]:
    """Key, type, size and count of each item, and its bytes."""
    at = 0
    while at + 8 <= len(data):
        key, kind, size, count = struct.unpack_from(">4scBH", data, at)
        end = at + 8 + size * count
        if key == b"\0\0\0\0" or end > len(data):
            return
        yield key.decode("latin1"), kind.decode("latin1"), size, count, data[at + 8 : end]
        at = at + 8 + (size * count + 3) // 4 * 4


def _values(item: tuple[str, int, int, bytes]) -> Floats:
    kind, size, count, data = item
    dtype = np.dtype(TYPES[kind])
    return np.frombuffer(data, dtype).reshape(count, size // dtype.itemsize).astype(np.float64)


def _complex(items: dict[str, tuple[str, int, int, bytes]]) -> Floats:
    """A structure whose fields TYPE names."""
    names = items["TYPE"][3].decode("latin1").rstrip("\0")
    dtype = np.dtype([(str(k), TYPES[c]) for k, c in enumerate(names)])
    rows = np.frombuffer(items["GPS9"][3], dtype)
    return np.column_stack([rows[str(k)].astype(np.float64) for k in range(len(names))])


FORMAT = Format(
    name="gopro",
    about="GoPro videos and telemetry",
    recognizes=recognizes,
    read=read,
    profile="camera",
)
