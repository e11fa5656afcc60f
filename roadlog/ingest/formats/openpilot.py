"""openpilot's rlog and qlog (.zst, .bz2 or plain), by pycapnp and a schema of what is read.

Messages of comma three: accelerometer and gyroscope of the LSM6DS3 at 104 Hz, specific force in
m/s2 and rad/s in the sensor's axes, of which openpilot's device axes (forward, right, down) are
-z, -y, -x; carState at 100 Hz: m/s, steering wheel in deg, left positive; gpsLocation(External) at
1 to 10 Hz: m/s, deg clockwise from north, accuracies 1 sd; vNED down. openpilot's own estimates are
the comparison: `pose.inclination`, `pose.roll_total` of livePose less the mounting of
liveCalibration, `pose.bank` the road's roll of liveParameters, rad, nose up and right side down
positive. qlogs hold every tenth message of most. Stamps are the device's monotonic clock, put on
UTC by the fixes. Made by the published schema; no log of a device was at hand.
"""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator, Sequence
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.signals import WHEELS

NAMES = ("rlog", "qlog")
ZSTD, BZIP2 = b"\x28\xb5\x2f\xfd", b"BZh"
MAX_SIZE = 1 << 31  # bytes of a segment of a minute when unpacked
LOCATION = {
    "latitude": "latitude",
    "longitude": "longitude",
    "altitude": "altitude",
    "speed": "speed",
    "bearingDeg": "course",
    "horizontalAccuracy": "horizontal_accuracy",
    "verticalAccuracy": "vertical_accuracy",
    "bearingAccuracyDeg": "course_accuracy",
    "speedAccuracy": "speed_accuracy",
}


def recognizes(path: Path) -> bool:
    """Whether a file is named as openpilot names its logs."""
    name = path.name.lower().removesuffix(".zst").removesuffix(".bz2")
    return path.is_file() and (name in NAMES or name.endswith(tuple(f"--{n}" for n in NAMES)))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """IMU, car, receiver and openpilot's own angles. Raises LogReadError, MissingExtraError."""
    del profile, dbc
    try:
        import capnp
    except ImportError as error:
        raise MissingExtraError("reading openpilot logs", "comma") from error
    rows: dict[str, list[tuple[float, ...]]] = {}
    cut: list[str] = []
    with guarded(path, "an openpilot log"):
        data = _unpacked(path)
        with as_file(files("roadlog.ingest.formats").joinpath("openpilot.capnp")) as schema:
            event = capnp.load(str(schema)).Event
        with guarded(path, "an openpilot log", cut):
            for message in event.read_multiple_bytes(data):
                kind = message.which()
                if take := _TAKEN.get(str(kind)):
                    for name, row in take(getattr(message, str(kind))):
                        rows.setdefault(name, []).append((message.logMonoTime, *row))
    frames = list(_frames(path.name, rows))
    if not frames:
        raise LogReadError(f"{path}: holds none of {', '.join(sorted(_TAKEN))}")
    note = "the truth in it is openpilot's own estimate, a comparison"
    notes = (f"{path.name}: {note}",) if any(f.name == "pose" for f in frames) else ()
    return Recording(tuple(frames), tuple(cut), notes)


def _unpacked(path: Path) -> bytes:
    data = path.read_bytes()
    if data.startswith(BZIP2):
        data = bz2.BZ2Decompressor().decompress(data, MAX_SIZE)
    elif data.startswith(ZSTD):
        import zstandard

        with path.open("rb") as file, zstandard.ZstdDecompressor().stream_reader(file) as reader:
            data = reader.read(MAX_SIZE)
    return data


Taken = Iterator[tuple[str, tuple[float, ...]]]


def _sensor(m: Any) -> Taken:
    kind = str(m.which())
    if kind in ("acceleration", "gyro", "gyroUncalibrated"):
        v = getattr(m, kind).v
        if len(v) >= 3:
            yield ("accelerometer" if kind == "acceleration" else "gyroscope"), tuple(v)[:3]


def _sensors(batch: Any) -> Taken:
    for m in batch:
        yield from _sensor(m)


def _fix(m: Any) -> Taken:
    down = m.vNED[2] if len(m.vNED) > 2 else np.nan
    yield "location", (m.unixTimestampMillis, *(getattr(m, n) for n in LOCATION), -down)


def _car(m: Any) -> Taken:
    wheels = (getattr(m.wheelSpeeds, w) for w in WHEELS)
    yield "car", (m.vEgoRaw or m.vEgo, m.steeringAngleDeg, *wheels)


def _mounting(m: Any) -> Taken:
    if len(m.rpyCalib) >= 3:
        yield "mounting", tuple(m.rpyCalib)[:3]


def _road(m: Any) -> Taken:
    yield "road", (m.roll,)


def _pose(m: Any) -> Taken:
    if m.orientationNED.valid:
        yield "pose", (m.orientationNED.x, m.orientationNED.y)


_TAKEN: dict[str, Callable[[Any], Taken]] = {
    "accelerometer": _sensor,
    "gyroscope": _sensor,
    "sensorEvents": _sensors,
    "gpsLocation": _fix,
    "gpsLocationExternal": _fix,
    "carState": _car,
    "liveCalibration": _mounting,
    "liveParameters": _road,
    "livePose": _pose,
}


def _frames(file: str, rows: dict[str, list[tuple[float, ...]]]) -> Iterator[Frame]:
    values = {name: np.array(found, np.float64) for name, found in rows.items()}
    epoch = 0.0
    if "location" in values:
        known = values["location"][values["location"][:, 1] > 0]
        epoch = float(np.median(known[:, 1] * 1e6 - known[:, 0])) if len(known) else 0.0
    time = {n: v[:, 0].astype(np.int64) + np.int64(epoch) for n, v in values.items()}
    for name in ("accelerometer", "gyroscope"):
        if name in values:
            columns = dict(zip("xyz", values[name][:, 1:].T, strict=True))
            yield frame(name, file, time[name], columns)
    if "location" in values:
        names = (*LOCATION.values(), "climb")
        columns = dict(zip(names, values["location"][:, 2:].T, strict=True))
        none = columns["latitude"] == 0
        columns = {n: np.where(none, np.nan, v) for n, v in columns.items()}
        yield frame("location", file, time["location"], columns)
    if "car" in values:
        names = ("speed", "steering_angle", *WHEELS)
        columns = dict(zip(names, values["car"][:, 1:].T, strict=True))
        columns = {n: v for n, v in columns.items() if n not in WHEELS or v.any()}
        units = {n: "deg" if n == "steering_angle" else "m/s" for n in columns}
        yield Frame("car", file, time["car"], columns, units)
    if "pose" in values:
        roll, pitch = values["pose"][:, 1], values["pose"][:, 2]
        lies = np.median(values["mounting"][:, 1:], axis=0) if "mounting" in values else np.zeros(3)
        columns = {"inclination": pitch - lies[1], "roll_total": roll - lies[0]}
        yield Frame("pose", file, time["pose"], columns, dict.fromkeys(columns, "rad"))
    if "road" in values:
        yield Frame("road", file, time["road"], {"bank": values["road"][:, 1]}, {"bank": "rad"})


FORMAT = Format(
    name="openpilot",
    about="openpilot logs",
    recognizes=recognizes,
    read=read,
    extra="comma",
    profile="openpilot",
)
