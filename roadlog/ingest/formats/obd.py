"""OBD-II: the standard parameters (SAE J1979 service 01), and text logs of phone apps."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.times import LAST_STAMP
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.types import Floats

POSITIVE = 0x41  # answer to service 01
FRAME = "OBD"  # name of the frames that hold its parameters


@dataclass(frozen=True)
class Parameter:
    """One parameter: its name, unit, and value from the data bytes A, B (J1979 appendix B)."""

    name: str
    unit: str
    value: Callable[[Floats, Floats], Floats]


PARAMETERS = {
    0x04: Parameter("EngineLoad", "%", lambda a, _: a * 100 / 255),
    0x0C: Parameter("EngineSpeed", "rpm", lambda a, b: (256 * a + b) / 4),
    0x0D: Parameter("VehicleSpeed", "km/h", lambda a, _: a),
    0x11: Parameter("ThrottlePosition", "%", lambda a, _: a * 100 / 255),
    0x33: Parameter("BarometricPressure", "kPa", lambda a, _: a),
    0x61: Parameter("DemandTorque", "%", lambda a, _: a - 125),
    0x62: Parameter("ActualTorque", "%", lambda a, _: a - 125),
    0x63: Parameter("ReferenceTorque", "N m", lambda a, b: 256 * a + b),
}
UNITS = {parameter.name: parameter.unit for parameter in PARAMETERS.values()}


def recognizes(path: Path) -> bool:
    """Whether a file holds lines of `epoch ms;PID;value`."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        fields = file.readline(200).split(b";")
    return len(fields) >= 3 and len(fields[0]) == 13 and fields[0].isdigit()


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """The parameters of a text log, in the app's units. Raises LogReadError."""
    del profile, dbc
    rows: dict[int, tuple[list[int], list[float]]] = {}
    bad = 0
    with path.open(encoding="utf-8", errors="replace") as file:
        for line in file:
            stamp, _, rest = line.partition(";")
            key, _, value = rest.partition(";")
            if not (len(key) == 4 and key.startswith("01")):
                continue  # gps and remarks of the app
            try:
                number, time, figure = int(key[2:], 16), int(stamp) * 1_000_000, float(value)
            except ValueError:
                bad += 1
                continue
            if abs(time) > LAST_STAMP:
                bad += 1
                continue
            times, values = rows.setdefault(number, ([], []))
            times.append(time)
            values.append(figure)
    frames = [
        Frame(FRAME, path.name, np.array(times), {p.name: np.array(values)}, {p.name: p.unit})
        for number, (times, values) in rows.items()
        if values and (p := PARAMETERS.get(number))
    ]
    if not frames:
        raise LogReadError(f"{path}: holds no standard parameter of service 01")
    return Recording(tuple(frames), (f"{path.name}: {bad} lines undecodable",) if bad else ())


FORMAT = Format(
    name="obd",
    about="OBD logs",
    recognizes=recognizes,
    read=read,
    profile="obd2",
)
