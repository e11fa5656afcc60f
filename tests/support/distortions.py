"""What happens to a drive on its way into a log: distortions of a simulated drive, by name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY as G

ACCEL = tuple(f"accel_{axis}" for axis in "xyz")
GYRO = tuple(f"gyro_{axis}" for axis in "xyz")
IMU, SPEEDS, GNSS = ("/imu",), ("/speed", "/wheel_speeds"), ("/gnss",)
JUMP = 0.5  # share of the log after which clocks jump, by JUMP of its length


@dataclass(frozen=True)
class Given:
    """A table on its way. start, end: ns, of the log."""

    table: Table
    start: int
    end: int
    rng: np.random.Generator

    @property
    def topic(self) -> str:
        return self.table.topic

    @property
    def seconds(self) -> np.ndarray:
        return (self.table.time - self.start) * 1e-9

    @property
    def share(self) -> np.ndarray:
        return (self.table.time - self.start) / (self.end - self.start)

    def become(self, **changes: Any) -> Given:
        return replace(self, table=replace(self.table, **changes))


class Column(NamedTuple):
    """x: values. share: of the log, at each."""

    x: np.ndarray
    share: np.ndarray
    rng: np.random.Generator


Change = Callable[[Given], Given]


def distorted(name: str, tables: Sequence[Table]) -> list[Table]:
    """The log's tables with one thing wrong; truth stays."""
    topics, change = DISTORTIONS[name]
    inputs = {t.topic for t in tables if not t.topic.startswith("/truth")}
    start = min(int(t.time[0]) for t in tables if t.topic in inputs)
    end = max(int(t.time[-1]) for t in tables if t.topic in inputs)
    rng = np.random.default_rng(0)
    made = [
        change(Given(t, start, end, rng)).table if t.topic in (topics or inputs) else t
        for t in tables
    ]
    return [table for table in made if len(table)]


def _with(names: Sequence[str], f: Callable[[Column], np.ndarray]) -> Change:
    """Some columns changed; () is all of them."""

    def change(t: Given) -> Given:
        old = t.table.columns
        there = [name for name in (names or old) if name in old]
        new = {n: f(Column(np.array(old[n], float), t.share, t.rng)) for n in there}
        return t.become(columns={**old, **new})

    return change


def _both(*changes: Change) -> Change:
    def change(t: Given) -> Given:
        for one in changes:
            t = one(t)
        return t

    return change


def _exchanged(a: str, b: str) -> Change:
    def change(t: Given) -> Given:
        old = t.table.columns
        return t.become(columns={**old, a: old[b], b: old[a]})

    return change


def _rows(keep: Callable[[Given], np.ndarray]) -> Change:
    def change(t: Given) -> Given:
        rows = keep(t)
        columns = {n: np.asarray(v)[rows] for n, v in t.table.columns.items()}
        return t.become(time=t.table.time[rows], columns=columns)

    return change


def _moved(by: Callable[[Given], np.ndarray]) -> Change:
    """Stamps later by so many seconds."""
    return lambda t: t.become(time=t.table.time + np.round(by(t) * 1e9).astype(np.int64))


def _late(seconds: float) -> Change:
    return _moved(lambda t: np.full(len(t.table), seconds))


def _back(t: Given) -> np.ndarray:
    return np.where(t.share > JUMP, -JUMP * (t.end - t.start) * 1e-9, 0.0)


def _to_1970(t: Given) -> Given:
    half, since = (t.end - t.start) // 2, t.table.time - t.start
    return t.become(time=np.where(since > half, since - half + 1, t.table.time))


def _jitter(t: Given) -> np.ndarray:
    return t.rng.normal(0, 0.020, len(t.table))


def _jitter_sorted(t: Given) -> np.ndarray:
    return np.sort(t.seconds + _jitter(t)) - t.seconds


def _kept(t: Given) -> np.ndarray:
    starts = t.rng.uniform(0, t.seconds[-1], round(t.seconds[-1] / 5))
    return ~np.any([(t.seconds >= a) & (t.seconds < a + 0.5) for a in starts], axis=0)


def _quantized(names: Sequence[str], lsb: float) -> Change:
    return _with(names, lambda c: np.round(c.x / lsb) * lsb)


def _jumps(name: str, size: float) -> Change:
    return _with([name], lambda c: c.x + size * ((c.share * 200 % 40 < 5) & (c.share > 0.1)))


def _white(sd: float) -> Change:
    return _with(ACCEL, lambda c: c.x + c.rng.normal(0, sd, len(c.x)))


def _clipped(limit: float) -> Change:
    return _with(ACCEL, lambda c: np.clip(c.x, -limit, limit))


def _each(imu: Change, speeds: Change) -> Change:
    """Of a car without a receiver."""
    gone = _rows(lambda t: np.zeros(len(t.table), np.bool_))
    return lambda t: (imu if t.topic in IMU else speeds if t.topic in SPEEDS else gone)(t)


_ZERO = _with((), lambda c: 0 * c.x)
_FROZEN_ALTITUDE = _with(["altitude"], lambda c: 0 * c.x + c.x[0])
_RAMP = _both(
    _with(["accel_x"], lambda c: c.x + 0.5 * c.share),
    _with(["accel_z"], lambda c: c.x - 0.3 * c.share),
    _with(["gyro_y"], lambda c: c.x + np.radians(0.5) * c.share),
)
_AT_REST = _both(
    _with(["accel_x", "accel_y"], lambda c: c.rng.normal(0, 0.02, len(c.x))),
    _with(["accel_z"], lambda c: c.rng.normal(G, 0.02, len(c.x))),
    _with(GYRO, lambda c: c.rng.normal(0, 0.001, len(c.x))),
)

DISTORTIONS: dict[str, tuple[tuple[str, ...], Change]] = {
    "gyro x and y exchanged": (IMU, _exchanged("gyro_x", "gyro_y")),
    "gyro y and z exchanged": (IMU, _exchanged("gyro_y", "gyro_z")),
    "accel clipped at 1 g": (IMU, _clipped(G)),
    "vibration 5 m/s2": (IMU, _white(5.0)),
    "vibration 12 m/s2 clipped at 2 g": (IMU, _both(_white(12.0), _clipped(2 * G))),
    "8 bits": (IMU, _both(_quantized(ACCEL, 8 * G / 256), _quantized(GYRO, 500 / 256 / 57.3))),
    "stamps jitter by 20 ms": (IMU, _moved(_jitter)),
    "stamps jitter by 20 ms, sorted": (IMU, _moved(_jitter_sorted)),
    "10 % dropped": ((), _rows(_kept)),
    "mph taken as km/h": (SPEEDS, _with((), lambda c: 0.6214 * c.x)),
    "km/h taken as mph": (SPEEDS, _with((), lambda c: 1.609 * c.x)),
    "speed lag grows to 0.5 s": (SPEEDS, _moved(lambda t: 0.5 * t.share)),
    "fix jumps 100 m aside and 30 m up": (
        GNSS,
        _both(_jumps("latitude", 100 / 111_195), _jumps("altitude", 30.0)),
    ),
    "altitude frozen": (GNSS, _FROZEN_ALTITUDE),
    "altitude and climb frozen": (
        GNSS,
        _both(_FROZEN_ALTITUDE, _with(["climb"], lambda c: 0 * c.x)),
    ),
    "altitude negated": (GNSS, _with(["altitude"], lambda c: -c.x)),
    "upside down": (IMU, _with(["accel_y", "accel_z", "gyro_y", "gyro_z"], lambda c: -c.x)),
    "starts in motion": ((), _rows(lambda t: t.seconds >= 25)),
    "flatbed": (SPEEDS, _ZERO),
    "no fix after 40 s": (GNSS, _rows(lambda t: t.seconds < 40)),
    "temperature ramp": (IMU, _RAMP),
    "wheel radius 5 % off": (SPEEDS, _with((), lambda c: 1.05 * c.x)),
    "tire change on the way": (SPEEDS, _with((), lambda c: c.x * np.where(c.share > 0.5, 1.05, 1))),
    "gravity removed": (IMU, _with(["accel_z"], lambda c: c.x - G)),
    "accelerations in g": (IMU, _with(ACCEL, lambda c: c.x / G)),
    "gyro in deg/s": (IMU, _with(GYRO, lambda c: np.degrees(c.x))),
    "imu 18 s late": (IMU, _late(18.0)),
    "imu 1 s late": (IMU, _late(1.0)),
    "fixes 3 s late": (GNSS, _late(3.0)),
    "fixes 18 s late": (GNSS, _late(18.0)),
    "clock of all to 1970": ((), _to_1970),
    "clock of all jumps back": ((), _moved(_back)),
    "clock of the imu jumps back": (IMU, _moved(_back)),
    "imu at 1 Hz": (IMU, _rows(lambda t: np.arange(len(t.table)) % 100 == 0)),
    "turntable": (
        (),
        _each(_both(_AT_REST, _with(["gyro_z"], lambda c: c.x + 0.2)), _ZERO),
    ),
    "dynamometer": ((), _each(_AT_REST, _with((), lambda c: 0 * c.x + 20.0))),
    "flatbed without fixes": ((*SPEEDS, *GNSS), _each(lambda t: t, _ZERO)),
}
HARMLESS = frozenset(  # nothing that a right log may not have
    {
        "stamps jitter by 20 ms, sorted",
        "starts in motion",
        "no fix after 40 s",
        "tire change on the way",
    }
)
NOT_JUDGED = frozenset({"turntable", "dynamometer"})  # the truth of the drive does not hold there
