"""Scenario files: a user's own drive in TOML.

```toml
base = "mountain"            # optional: begin from a scenario that ships with roadlog
name = "my-pass"
gears = true
speed = { kind = "tour", length = 900.0, stops = [[450.0, 10.0]] }
[road]
grade = { points = [[0, 0.0], [200, 0.06]], smoothing = [20.0] }
curvature = { points = [[300, 0.0], [320, 0.02], [400, 0.02], [420, 0.0]] }
[sensors.gnss]
rate = 0.0
```

Keys are the fields of `Scenario` and of what it holds. A profile is a number or a table: `points`
(knots), or `kind` = sine, hills, tour, stop_and_go or launches with that class's fields.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from roadlog import toml
from roadlog.errors import ConfigError, near
from roadlog.simulate.fuel import FuelSender
from roadlog.simulate.gnss import Barometer, GnssReceiver
from roadlog.simulate.imu import ImuSensor
from roadlog.simulate.profiles import Hills, Knots, Sine
from roadlog.simulate.scenario import Chirp, Load, RoadShape, Scenario, Wave, Wind, converted
from roadlog.simulate.sensors import CanSensors, Sensors
from roadlog.simulate.speeds import Launches, StopAndGo, Tour
from roadlog.simulate.straight import PitchModel

PARTS: dict[str, type] = {
    "road": RoadShape,
    "steering": Chirp,
    "wind": Wind,
    "load": Load,
    "straight": PitchModel,
    "sensors": Sensors,
    "imu": ImuSensor,
    "can": CanSensors,
    "gnss": GnssReceiver,
    "barometer": Barometer,
    "fuel": FuelSender,
}
KINDS: dict[str, type] = {
    "knots": Knots,
    "sine": Sine,
    "hills": Hills,
    "tour": Tour,
    "stop_and_go": StopAndGo,
    "launches": Launches,
}
PROFILES = ("speed", "grade", "bank", "curvature", "friction", "cruise")


def load(path: Path, shipped: Mapping[str, Scenario]) -> Scenario:
    """Read a scenario file. Raises ConfigError naming file and key."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: scenario file cannot be read: {error}") from error
    document = toml.loads(text, str(path))
    base = None
    if "base" in document:
        name = document.pop("base")
        if name not in shipped:
            raise ConfigError(f"{path}: base: no scenario '{name}'. {near(str(name), shipped)}")
        base = shipped[name]
    document = {"name": path.stem, "summary": f"from {path.name}"} | document
    scenario = _part(Scenario, document, str(path), base)
    assert isinstance(scenario, Scenario)
    return scenario


def _part(kind: type, table: dict[str, Any], where: str, base: Any) -> Any:
    """A dataclass from its table, on top of `base` where there is one."""
    names = {field.name: field for field in fields(kind)}
    values: dict[str, Any] = {}
    for key, value in table.items():
        here = f"{where}: {key}"
        if key not in names:
            raise ConfigError(f"{where}: unknown key '{key}'. {near(key, names)}")
        old = getattr(base, key) if base is not None else names[key].default
        if key in PROFILES:
            values[key] = _profile(value, here)
        elif key in PARTS:
            if not isinstance(value, dict):
                raise ConfigError(f"{here} = {value!r}: must be a table")
            values[key] = _part(PARTS[key], value, here, old if _is_instance(old, key) else None)
        elif key == "waves":
            values[key] = tuple(_part(Wave, wave, here, None) for wave in value)
        elif isinstance(old, (int, float, str)):
            values[key] = converted(old, value, here)
        else:
            values[key] = _tuples(value)
    try:
        return replace(base, **values) if base is not None else kind(**values)
    except TypeError as error:
        missing = str(error).partition(": ")[2] or str(error)
        raise ConfigError(f"{where}: {kind.__name__} needs {missing}") from None


def _is_instance(value: Any, key: str) -> bool:
    return isinstance(value, PARTS[key])


def _profile(value: Any, where: str) -> Any:
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if not isinstance(value, dict):
        raise ConfigError(f"{where} = {value!r}: must be a number or a table")
    table = dict(value)
    kind = table.pop("kind", "knots")
    if kind not in KINDS:
        raise ConfigError(f"{where}: no kind '{kind}'. {near(str(kind), KINDS)}")
    if where.endswith(": speed") and kind == "knots":
        table["over"] = "time"
    return _part(KINDS[kind], table, where, None)


def _tuples(value: Any) -> Any:
    """Lists as tuples, all the way down."""
    return tuple(map(_tuples, value)) if isinstance(value, list) else value
