"""u-blox UBX logs by pyubx2: NAV-PVT, HNR-PVT, ESF-MEAS, ESF-INS.

NAV-PVT (1 to 25 Hz) and HNR-PVT (to 30 Hz): mm, mm/s, deg; velD is down, climb its opposite. Only
fixes that say gnssFixOK count. ESF-MEAS: 24-bit fields, signed: gyroscope 2^-12 deg/s (types 14,
13, 5), accelerometer 2^-10 m/s2 (16 to 18), in the axes of the module, speed 10^-3 m/s (11), wheel
ticks (6 to 9, 10) of 23 bits that wrap, their bit 23 the direction: set backward; without the car's
distance a tick they stay ticks/s, frame `wheel_ticks`. ESF-INS: rates
10^-3 deg/s in vehicle axes, used where there is no ESF-MEAS; its accelerations are without gravity
and never taken. Its time tags are the sensor's own; they are placed by the fixes about them.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.pocket import frame
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.types import Floats, Stamps

HEAD = 1 << 16
MARK = b"\xb5b"
AXES = {14: ("gyroscope", "x"), 13: ("gyroscope", "y"), 5: ("gyroscope", "z")}
AXES |= {16: ("accelerometer", "x"), 17: ("accelerometer", "y"), 18: ("accelerometer", "z")}
SCALES = {"gyroscope": np.pi / 180 * 2**-12, "accelerometer": 2**-10}
TICKS = {6: "fl", 7: "fr", 8: "rl", 9: "rr", 10: "single"}
SPEED = 11
BACKWARD, WRAP = 1 << 23, 1 << 23
SAME_CLOCK = 1000.0  # ms; time tags that near the fixes' time of week are that


def recognizes(path: Path) -> bool:
    """Whether its first bytes hold a UBX frame: sync, class, id, and a length that fits."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(HEAD)
    at = head.find(MARK)
    while at >= 0 and at + 6 <= len(head):
        size = int.from_bytes(head[at + 4 : at + 6], "little")
        body = head[at + 2 : at + 6 + size]
        check = head[at + 6 + size : at + 8 + size]
        if len(check) == 2 and _fletcher(body) == check:
            return True
        at = head.find(MARK, at + 2)
    return False


def _fletcher(body: bytes) -> bytes:
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return bytes((a, b))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Location, IMU, speed and wheel ticks. Raises LogReadError, MissingExtraError."""
    del profile, dbc
    try:
        from pyubx2 import ERR_IGNORE, UBX_PROTOCOL, UBXReader
    except ImportError as error:
        raise MissingExtraError("reading UBX", "gnss") from error
    found = _Messages()
    with guarded(path, "UBX"), path.open("rb") as file:
        reader = UBXReader(file, protfilter=UBX_PROTOCOL, quitonerror=ERR_IGNORE)
        for _, message in reader:
            if message is not None:
                found.add(message)
    frames = found.frames(path.name)
    if not frames:
        raise LogReadError(f"{path}: holds no NAV-PVT, HNR-PVT, ESF-MEAS or ESF-INS of use")
    return Recording(tuple(frames), (), tuple(found.notes))


class _Messages:
    def __init__(self) -> None:
        self.fixes: dict[str, list[tuple[float, ...]]] = {"NAV-PVT": [], "HNR-PVT": []}
        self.sensors: dict[tuple[str, str], list[tuple[float, float]]] = {}
        self.ticks: dict[str, list[tuple[float, ...]]] = {}
        self.turns: list[tuple[float, ...]] = []
        self.utc: list[float] = []  # ms, UTC less time of week
        self.apart: list[float] = []  # ms, time of week less the time tag that follows it
        self.week_time: float | None = None
        self.notes: list[str] = []

    def add(self, m: Any) -> None:
        if m.identity in self.fixes:
            self._fix(m)
        elif m.identity == "ESF-MEAS":
            self._measured(m)
        elif m.identity == "ESF-INS":
            rates = (m.xAngRate, m.yAngRate, m.zAngRate)
            self.turns.append((float(m.iTOW), *(np.radians(r) for r in rates)))

    def _fix(self, m: Any) -> None:
        whole = datetime(m.year, m.month, m.day, m.hour, m.min, 0, tzinfo=UTC) if m.year else None
        if whole is not None:
            ms = 1000 * (whole.timestamp() + m.second) + m.nano * 1e-6
            self.utc.append(ms - m.iTOW)
        self.week_time = float(m.iTOW)
        ok = (
            getattr(m, "gnssFixOk", getattr(m, "GPSfixOK", 1)) and _any(m, "fixType", "gpsFix") >= 2
        )
        if not ok:
            return
        height = m.hMSL * 1e-3
        climb = -m.velD * 1e-3 if hasattr(m, "velD") else np.nan
        sd = [_any(m, name) * 1e-3 for name in ("hAcc", "vAcc", "sAcc")]
        self.fixes[m.identity].append(
            (
                m.iTOW,
                m.lat,
                m.lon,
                height,
                m.gSpeed * 1e-3,
                m.headMot,
                climb,
                *sd,
                _any(m, "headAcc"),
            )
        )

    def _measured(self, m: Any) -> None:
        tag = float(m.timeTag)
        if self.week_time is not None:
            self.apart.append(self.week_time - tag)
            self.week_time = None
        for k in range(1, m.numMeas + 1):
            kind, raw = getattr(m, f"dataType_{k:02d}"), getattr(m, f"dataField_{k:02d}")
            if kind in TICKS:
                count = raw & (WRAP - 1)
                self.ticks.setdefault(TICKS[kind], []).append(
                    (tag, -1 if raw & BACKWARD else 1, count)
                )
                continue
            value = raw - (1 << 24) if raw & (1 << 23) else raw
            if kind in AXES:
                name, axis = AXES[kind]
                self.sensors.setdefault((name, axis), []).append((tag, value * SCALES[name]))
            elif kind == SPEED:
                self.sensors.setdefault(("obd", "speed"), []).append((tag, value * 1e-3))

    def frames(self, file: str) -> list[Frame]:
        """All that there is, on UTC where a fix tells it."""
        base = float(np.median(self.utc)) if self.utc else 0.0
        apart = float(np.median(self.apart)) if self.apart else 0.0
        apart = 0.0 if abs(apart) < SAME_CLOCK else apart
        result = []
        rows = max(self.fixes.values(), key=len)
        if rows:
            week, *values = np.array(rows, np.float64).T
            result.append(
                frame(
                    "location", file, _stamps(week + base), dict(zip(FIELDS, values, strict=True))
                )
            )
        names = dict.fromkeys(name for name, _ in self.sensors)
        for name in names:
            own = {c: np.array(v) for (n, c), v in self.sensors.items() if n == name}
            first = next(iter(own.values()))[:, 0]
            columns = {c: _at(first, v) for c, v in own.items()}
            result.append(frame(name, file, _stamps(first + apart + base), columns))
        if self.turns and "gyroscope" not in names:
            week, *rates = np.array(self.turns).T
            columns = dict(zip("xyz", rates, strict=True))
            result.append(frame("gyroscope", file, _stamps(week + base), columns))
        if self.ticks:
            result += [_tick_rates(file, w, rows, apart + base) for w, rows in self.ticks.items()]
        if self.sensors and apart:
            self.notes.append(f"{file}: the sensors' time tags are placed by the fixes about them")
        return result


FIELDS = (
    "latitude",
    "longitude",
    "altitude",
    "speed",
    "course",
    "climb",
    "horizontal_accuracy",
    "vertical_accuracy",
    "speed_accuracy",
    "course_accuracy",
)


def _tick_rates(file: str, wheel: str, rows: list[Any], base: float) -> Frame:
    """ticks/s of one wheel, negative backward; the counter wraps."""
    tag, direction, count = np.array(rows, np.float64).T
    steps = np.mod(np.diff(count), WRAP)
    rate = direction[1:] * steps / np.maximum(np.diff(tag) * 1e-3, 1e-3)
    return Frame("wheel_ticks", file, _stamps(tag[1:] + base), {wheel: rate}, {wheel: "1/s"})


def _at(first: Floats, rows: Floats) -> Floats:
    """Values at some time tags, NaN where a message lacks them."""
    place = np.searchsorted(rows[:, 0], first)
    place = np.minimum(place, len(rows) - 1)
    return np.where(rows[place, 0] == first, rows[place, 1], np.nan)


def _stamps(milliseconds: Floats) -> Stamps:
    whole = np.floor(milliseconds)
    return whole.astype(np.int64) * 1_000_000 + np.rint((milliseconds - whole) * 1e6).astype(
        np.int64
    )


def _any(m: Any, *names: str) -> float:
    return float(next((getattr(m, n) for n in names if hasattr(m, n)), np.nan))


FORMAT = Format(
    name="ubx",
    about="u-blox UBX logs",
    recognizes=recognizes,
    read=read,
    extra="gnss",
    profile="receiver",
)
