"""Scenario: a drive as data; in Python, in TOML, and changed by overrides."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any

import numpy as np

from roadlog.errors import ConfigError, near
from roadlog.simulate.motion import HOME
from roadlog.simulate.profiles import Knots, Profile
from roadlog.simulate.sensors import Sensors
from roadlog.simulate.speeds import Launches, StopAndGo, Tour
from roadlog.simulate.straight import PitchModel
from roadlog.types import Floats


@dataclass(frozen=True)
class Wave:
    """Sinusoidal undulation of the surface: amplitude sin(2 pi x' / length + phase)."""

    amplitude: float  # m
    length: float  # m
    direction: float  # rad, of x' from east, ccw
    phase: float  # rad


@dataclass(frozen=True)
class RoadShape:
    """A road over distance; slopes are tangents, grade uphill +, bank right side down +."""

    grade: Profile | float = 0.0
    bank: Profile | float = 0.0
    curvature: Profile | float = 0.0  # 1/m, left +
    bank_wave: tuple[float, float] = (0.0, 50.0)  # rad amplitude and m length, on top of bank
    slope_north: float = 0.0  # tangent of a plane under everything, rising to the north
    waves: tuple[Wave, ...] = ()
    slalom: tuple[float, float, float] | None = None  # m: start, wavelength, amplitude
    roughness: float = 0.0  # m3, ISO 8608 G_d at 0.1 cycles/m; class A 16e-6
    friction: Profile | float = 1.0  # of dry asphalt
    heading: float = 0.0  # rad, at its beginning, ccw from east
    home: tuple[float, float, float] = HOME  # deg, deg, m: its beginning


@dataclass(frozen=True)
class Chirp:
    """Open-loop steering: frequency rises linearly over the drive."""

    amplitude: float = float(np.radians(1.5))  # rad at the road wheels
    first: float = 0.3  # Hz
    last: float = 1.8  # Hz
    duration: float = 30.0  # s


@dataclass(frozen=True)
class Wind:
    """Mean and gusts (first-order Gauss-Markov); another seed, other gusts."""

    speed: float = 0.0  # m/s
    direction: float = 0.0  # rad, that it blows to, from east, ccw
    gust_sd: float = 0.0  # m/s, each horizontal axis
    gust_time: float = 3.0  # s


@dataclass(frozen=True)
class Load:
    """Something in the car; position from the empty car's CG, vehicle axes."""

    mass: float  # kg
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)  # m


@dataclass(frozen=True)
class Scenario:
    """One drive. straight: the paper's simple truth, where the paper has one.

    speed: m/s over time, s. duration: s; 0 = as long as the speed's points say. lead_in: s that
    the car drives before the log begins. gears: shift, with torque interruption; else second gear.
    """

    name: str
    summary: str
    speed: Profile | StopAndGo | Launches | Tour | float
    road: RoadShape = field(default_factory=RoadShape)
    duration: float = 0.0
    start: float = 5.0  # m along the road at the beginning of the lead-in
    lead_in: float = 5.0
    steering: Chirp | None = None
    gears: bool = False
    hold_torque: float = 1500.0  # N m, brakes while the car stands
    wind: Wind = field(default_factory=Wind)
    load: Load | None = None
    straight: PitchModel | None = None
    vehicle: str = "wagon"  # preset whose data sheet goes with the simple truth
    sensors: Sensors = field(default_factory=Sensors)


def with_overrides(scenario: Scenario, overrides: Mapping[str, Any]) -> Scenario:
    """Some fields changed: `sensors.imu.rate`, or the last part alone where only one has it.

    Raises ConfigError naming the key and the near ones.
    """
    for key, value in overrides.items():
        paths = [path for path in _paths(scenario) if path == key or path.endswith("." + key)]
        exact = [path for path in paths if path == key]
        if not paths:
            raise ConfigError(f"no scenario parameter '{key}'. {near(key, _paths(scenario))}")
        if len(paths) > 1 and not exact:
            raise ConfigError(f"'{key}' may be any of {', '.join(paths)}: say which")
        scenario = _set(scenario, (exact or paths)[0].split("."), value, key)
    return scenario


def _paths(part: Any, prefix: str = "") -> list[str]:
    result = []
    for entry in fields(part):
        value = getattr(part, entry.name)
        result.append(prefix + entry.name)
        if is_dataclass(value):
            result += _paths(value, f"{prefix}{entry.name}.")
    return result


def _set(part: Any, path: list[str], value: Any, key: str) -> Any:
    old = getattr(part, path[0])
    new = converted(old, value, key) if len(path) == 1 else _set(old, path[1:], value, key)
    return replace(part, **{path[0]: new})


def converted(old: Any, value: Any, key: str) -> Any:
    """The override in the type of what it replaces; texts come from the command line."""
    if isinstance(value, str) and not isinstance(old, str):
        try:
            value = tomllib.loads(f"x = {value}")["x"]
        except tomllib.TOMLDecodeError:
            raise ConfigError(f"{key} = {value}: must be a number or a list of them") from None
    if isinstance(value, list):
        value = tuple(value)
    if isinstance(old, tuple) and (not isinstance(value, tuple) or len(value) != len(old)):
        raise ConfigError(f"{key} = {value!r}: must be {len(old)} numbers")
    if isinstance(old, bool) and value in (0, 1):
        return bool(value)
    if isinstance(old, int) and not isinstance(old, bool) and float(value).is_integer():
        return int(value)
    if isinstance(old, (int, float)) and not isinstance(old, bool):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise ConfigError(f"{key} = {value!r}: must be a number")
        return float(value)
    return value


def speed_of(scenario: Scenario, rng: np.random.Generator) -> tuple[Profile | float, float]:
    """The speed profile with its chances drawn, and the drive's duration in s."""
    speed = scenario.speed
    if isinstance(speed, (StopAndGo, Launches)):
        speed = speed.knots(rng)
    elif isinstance(speed, Tour):
        speed = speed.over(scenario.road.curvature, scenario.start)
    duration = scenario.duration
    if not duration:
        if not isinstance(speed, Knots):
            raise ConfigError(f"scenario {scenario.name}: needs a duration")
        duration = speed.points[-1][0]
    return speed, duration


def distance_of(time: Floats, speed: Floats) -> Floats:
    """m driven since time 0."""
    steps = np.diff(time) * (speed[1:] + speed[:-1]) / 2
    distance = np.concatenate([[0.0], np.cumsum(steps)])
    result: Floats = distance - np.interp(0.0, time, distance)
    return result
