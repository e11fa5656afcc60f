"""Vehicle: parameters with unit, default and where each came from; presets; TOML in and out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from roadlog import toml
from roadlog.car.vehicle_rows import Axis, consumption_map, rotation_rows
from roadlog.errors import ConfigError, near

if TYPE_CHECKING:
    from roadlog.types import Floats

ValueKind = Literal["given", "calibrated", "preset", "default"]


@dataclass(frozen=True)
class ValueSource:
    """Where a parameter's value comes from; sd in the parameter's own unit, None when unknown.

    axis_sd: the same of a parameter with three axes (of a rotation: rad about each).
    """

    kind: ValueKind
    sd: float | None = None
    axis_sd: tuple[float, float, float] | None = None


STATED_MOUNTING = 0.0052  # rad (0.3 deg), sd of a mounting that somebody measured and gave no sd
DEFAULT = ValueSource("default")


def _parameter(default: Any, unit: str, doc: str, key: str = "") -> Any:
    """A parameter; `key` is its place in the TOML file where that is not its own name."""
    return field(default=default, metadata={"unit": unit, "doc": doc, "key": key})


@dataclass(frozen=True)
class Vehicle:
    """What the estimators know of a car; docs/calibration.md#the-constants-in-the-vehicle-file.

    The defaults describe a middle-class car and are good enough for methods that need only an
    order of magnitude; `sources` tells which values were given. None: not known, derived where a
    method needs it (`pitch_gain`, `roll_gain`, ...).
    """

    name: str = _parameter("default", "", "name of the car")
    mass: float = _parameter(1600.0, "kg", "as driven")
    cg_to_front_axle: float = _parameter(1.25, "m", "center of gravity to front axle")
    cg_to_rear_axle: float = _parameter(1.45, "m", "center of gravity to rear axle")
    cg_height: float = _parameter(0.55, "m", "center of gravity over the ground")
    track: float = _parameter(1.55, "m", "mean of both axles")
    roll_inertia: float = _parameter(600.0, "kg m2", "sprung mass about its CG", "inertia.roll")
    pitch_inertia: float = _parameter(2600.0, "kg m2", "about the CG", "inertia.pitch")
    yaw_inertia: float = _parameter(2800.0, "kg m2", "about the CG", "inertia.yaw")
    wheel_radius: float = _parameter(0.31, "m", "effective rolling radius")
    wheel_inertia: float = _parameter(1.1, "kg m2", "per wheel")
    drag_area: float = _parameter(0.70, "m2", "drag coefficient times frontal area")
    air_density: float = _parameter(1.2, "kg/m3", "")
    rolling_resistance: float = _parameter(0.011, "-", "rolling resistance coefficient")
    front_cornering_stiffness: float = _parameter(
        110e3, "N/rad", "front axle", "cornering_stiffness.front"
    )
    rear_cornering_stiffness: float = _parameter(
        110e3, "N/rad", "rear axle", "cornering_stiffness.rear"
    )
    pitch_gradient: float | None = _parameter(
        None, "rad/(m/s2)", "body pitch per longitudinal specific force"
    )
    roll_gradient: float | None = _parameter(
        None, "rad/(m/s2)", "body roll per lateral specific force"
    )
    pitch_stiffness: float | None = _parameter(None, "N m/rad", "suspension in pitch")
    pitch_damping: float | None = _parameter(None, "N m s/rad", "suspension in pitch")
    roll_stiffness: float | None = _parameter(None, "N m/rad", "suspension in roll")
    roll_damping: float | None = _parameter(None, "N m s/rad", "suspension in roll")
    roll_arm: float = _parameter(0.45, "m", "CG over the roll axis")
    driven: str = _parameter("front", "", "front, rear or all")
    final_drive: float = _parameter(3.5, "-", "axle ratio")
    driveline_efficiency: float = _parameter(0.92, "-", "engine to wheels")
    engine_inertia: float = _parameter(0.18, "kg m2", "engine and gearbox input")
    steering_ratio: float = _parameter(15.0, "-", "steering wheel angle / road wheel angle")
    imu_position: tuple[float, float, float] | None = _parameter(None, "m", "from the CG")
    antenna_position: tuple[float, float, float] | None = _parameter(None, "m", "from the CG")
    imu_mount: tuple[Axis, Axis, Axis] | None = _parameter(
        None, "", "forward, left and up in the log's IMU axes, one a row"
    )
    accel_bias: tuple[float, float, float] | None = _parameter(None, "m/s2", "subtracted")
    gyro_bias: tuple[float, float, float] | None = _parameter(None, "rad/s", "subtracted")
    accel_zero: tuple[float, float, float] | None = _parameter(None, "m/s2", "of its own axes")
    accel_scale: tuple[float, float, float] | None = _parameter(None, "-", "true / shown")
    gyro_zero: tuple[float, float, float] | None = _parameter(None, "rad/s", "as accel_zero")
    gyro_scale: tuple[float, float, float] | None = _parameter(None, "-", "as accel_scale")
    speed_scale: float = _parameter(1.0, "-", "true speed / what wheel speeds and /speed say")
    speed_delay: float = _parameter(0.0, "s", "the car's own messages lag the IMU")
    gnss_delay: float = _parameter(0.0, "s", "the receiver lags the IMU")
    tank_length: float = _parameter(0.70, "m", "box along x", "tank.length")
    tank_width: float = _parameter(0.45, "m", "box along y", "tank.width")
    tank_height: float = _parameter(0.15, "m", "box along z", "tank.height")
    tank_sender: tuple[float, float] = _parameter(
        (0.15, 0.0), "m", "sender from the tank center, x and y", "tank.sender"
    )
    consumption: tuple[Axis, ...] | None = _parameter(
        None,
        "m/s, N, L/h",
        "speed, force at the wheels, fuel: all points of a grid",
        "tank.consumption",
    )
    sources: Mapping[str, ValueSource] = field(default_factory=dict, metadata={"key": None})

    def source(self, parameter: str) -> ValueSource:
        """Where a parameter comes from."""
        return self.sources.get(parameter, DEFAULT)

    @property
    def states_mounting(self) -> bool:
        """Whether somebody said how the IMU lies, beyond which of its axes points where."""
        source = self.source("imu_mount")
        turned = any(0.0 < abs(value) < 1.0 for row in self.imu_mount or () for value in row)
        return source.sd is not None or source.axis_sd is not None or turned

    def with_stated_mounting(self, sd: float = STATED_MOUNTING) -> Vehicle:
        """A copy whose IMU lies as the log has it, to `sd` (rad, each axis)."""
        return replace(self, sources={**self.sources, "imu_mount": ValueSource("given", sd)})

    def with_values(self, kind: ValueKind = "given", **values: Any) -> Vehicle:
        """A copy with some parameters set, and their source noted."""
        marks = {name: ValueSource(kind) for name in values}
        return replace(self, sources={**self.sources, **marks}, **values)

    def mounted(self, rotation: Floats) -> Vehicle:
        """A copy whose IMU lies so: rows forward, left and up in the IMU's axes, (3, 3)."""
        return self.with_values(imu_mount=tuple(tuple(float(v) for v in row) for row in rotation))

    # What follows from the parameters. ------------------------------------------------------

    @property
    def wheelbase(self) -> float:
        """m."""
        return self.cg_to_front_axle + self.cg_to_rear_axle

    @property
    def pitch_gain(self) -> float:
        """rad/(m/s2), K_theta: given, or m h / K_pitch, or the mean of passenger cars."""
        if self.pitch_gradient is not None:
            return self.pitch_gradient
        if self.pitch_stiffness is not None:
            return self.mass * self.cg_height / self.pitch_stiffness
        return 0.005  # docs/methods/common.md#suspension-gains

    @property
    def roll_gain(self) -> float:
        """rad/(m/s2), K_phi: given, or m h / k_r, or the mean of passenger cars."""
        if self.roll_gradient is not None:
            return self.roll_gradient
        if self.roll_stiffness is not None:
            return self.mass * self.roll_arm / self.roll_stiffness
        return 0.0095  # docs/methods/common.md#suspension-gains

    # TOML ---------------------------------------------------------------------------------

    @classmethod
    def load(cls, path: Path) -> Vehicle:
        """Read a vehicle file. Raises ConfigError naming the file and the key."""
        try:
            text = Path(path).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise ConfigError(f"{path}: vehicle file cannot be read: {why}") from error
        return cls.from_toml(text, str(path))

    @classmethod
    def from_toml(cls, text: str, where: str = "vehicle") -> Vehicle:
        """Parse a vehicle file's text; unknown keys are errors that offer the near names."""
        document = toml.loads(text, where)
        for section in document:
            if section not in ("vehicle", "tank", "sources"):
                raise ConfigError(
                    f"{where}: unknown section [{section}]. "
                    + near(section, ("vehicle", "tank", "sources"))
                )
        flat = {**_flat(document.get("vehicle", {})), **_flat(document.get("tank", {}), "tank.")}
        by_key = _keys()
        values: dict[str, Any] = {}
        for key, value in flat.items():
            if key not in by_key:
                raise ConfigError(f"{where}: unknown key '{key}'. {near(key, by_key)}")
            values[by_key[key]] = _checked(by_key[key], value, f"{where}: {key}")
        sources = {name: ValueSource("given") for name in values}
        for key, entry in document.get("sources", {}).items():
            if key not in by_key:
                raise ConfigError(f"{where}: [sources] unknown key '{key}'. {near(key, by_key)}")
            kind = entry.get("source") if isinstance(entry, dict) else entry
            if kind not in ("given", "calibrated", "preset", "default"):
                raise ConfigError(
                    f"{where}: [sources] {key}: '{kind}' is none of "
                    f"given, calibrated, preset, default"
                )
            sd = entry.get("sd") if isinstance(entry, dict) else None
            sources[by_key[key]] = _source(kind, sd, f"{where}: [sources] {key}")
        return cls(sources=sources, **values)

    def to_toml(self) -> str:
        """The vehicle file that gives this vehicle back; parameters left at default stay out."""
        lines = {"vehicle": ["[vehicle]"], "tank": ["[tank]"], "sources": ["[sources]"]}
        for parameter in fields(self):
            name, value = parameter.name, getattr(self, parameter.name)
            if name == "sources" or self.source(name) == DEFAULT:
                continue
            key = parameter.metadata["key"] or name
            if value is None:
                if self.source(name).sd is not None:  # stated, as it is
                    lines["sources"].append(_toml_source(key, self.source(name)))
                continue
            section = "tank" if key.startswith("tank.") else "vehicle"
            unit = f"  # {parameter.metadata['unit']}" if parameter.metadata["unit"] else ""
            lines[section].append(f"{key.removeprefix('tank.')} = {_toml(value)}{unit}")
            source = self.source(name)
            if source != ValueSource("given"):
                lines["sources"].append(_toml_source(key, source))
        return "\n\n".join("\n".join(block) for block in lines.values() if len(block) > 1) + "\n"

    @classmethod
    def preset(cls, name: str) -> Vehicle:
        """A vehicle that ships with roadlog. Raises ConfigError with near names."""
        if name not in PRESETS:
            raise ConfigError(f"no vehicle preset '{name}'. {near(name, PRESETS)}")
        return cls().with_values("preset", name=name, **PRESETS[name])


def _keys() -> dict[str, str]:
    """TOML key -> parameter name."""
    return {f.metadata["key"] or f.name: f.name for f in fields(Vehicle) if f.name != "sources"}


def _flat(table: Any, prefix: str = "") -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            result |= _flat(value, f"{prefix}{key}.")
        else:
            result[prefix + key] = value
    return result


_VECTORS = dict.fromkeys(("accel_zero", "accel_scale", "gyro_zero", "gyro_scale"), 3) | {
    "imu_position": 3,
    "antenna_position": 3,
    "tank_sender": 2,
    "accel_bias": 3,
    "gyro_bias": 3,
}
_SIGNED = ("speed_delay", "gnss_delay")
_MAY_BE_ZERO = ("drag_area", "rolling_resistance", "pitch_gradient", "roll_gradient")


def _source(kind: ValueKind, sd: Any, where: str) -> ValueSource:
    """Raises ConfigError."""
    if sd is None:
        return ValueSource(kind)
    values = sd if isinstance(sd, list) else [sd]
    if len(values) not in (1, 3) or not all(toml.is_number(v) and v >= 0 for v in values):
        raise ConfigError(f"{where}: sd = {sd!r}: must be a number or three, not negative")
    if isinstance(sd, list) and len(values) == 3:
        return ValueSource(kind, axis_sd=(float(values[0]), float(values[1]), float(values[2])))
    return ValueSource(kind, float(values[0]))


def _checked(name: str, value: Any, where: str) -> Any:
    """The value in the parameter's type. Raises ConfigError."""
    if name == "name":
        return str(value)
    if name == "driven":
        if value not in ("front", "rear", "all"):
            raise ConfigError(f"{where} = {value!r}: must be front, rear or all")
        return value
    if name == "imu_mount":
        return rotation_rows(value, where)
    if name == "consumption":
        return consumption_map(value, where)
    if name in _VECTORS:
        size = _VECTORS[name]
        unit = next(f.metadata["unit"] for f in fields(Vehicle) if f.name == name)
        if not isinstance(value, list) or len(value) != size or not all(map(toml.is_number, value)):
            raise ConfigError(f"{where} = {value!r}: must be {size} numbers [{unit}]")
        return tuple(float(v) for v in value)
    if not toml.is_number(value):
        raise ConfigError(f"{where} = {value!r}: must be a number")
    if name in _SIGNED:
        return float(value)
    if value < 0 or (value == 0 and name not in _MAY_BE_ZERO):
        raise ConfigError(f"{where} = {value!r}: must be positive")
    return float(value)


def _toml_source(key: str, source: ValueSource) -> str:
    spread = source.sd if source.axis_sd is None else source.axis_sd
    sd = "" if spread is None else f", sd = {_toml(spread)}"
    quoted = f'"{key}"' if "." in key else key
    return f'{quoted} = {{ source = "{source.kind}"{sd} }}'


def _toml(value: Any) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return repr(value)


PRESETS: dict[str, dict[str, Any]] = {
    # docs/methods/common.md#preset-cars: late-1990s E-class estate, rounded catalogue values;
    # stiffnesses and gains identified from the simulated car by circle and chirp tests
    "wagon": {
        "mass": 1850.0,
        "cg_to_front_axle": 1.40,
        "cg_to_rear_axle": 1.43,
        "cg_height": 0.58,
        "track": 1.54,
        "roll_inertia": 634.0,
        "pitch_inertia": 3000.0,
        "yaw_inertia": 3300.0,
        "wheel_radius": 0.3165,
        "wheel_inertia": 1.2,
        "drag_area": 0.726,
        "air_density": 1.2258,
        "rolling_resistance": 0.011,
        "front_cornering_stiffness": 138e3,
        "rear_cornering_stiffness": 165e3,
        "pitch_gradient": 0.0045,
        "roll_gradient": 0.0113,
        "roll_stiffness": 76.7e3,
        "roll_damping": 3000.0,
        "roll_arm": 0.468,
        "driven": "rear",
        "final_drive": 3.07,
        "driveline_efficiency": 0.92,
        "engine_inertia": 0.18,
        "imu_position": (-0.3, 0.1, -0.15),
    },
    # CommonRoad vehicle models, parameters_vehicle2 (BMW 320i), converted to SI there
    "commonroad_2": {
        "mass": 1093.30,
        "cg_to_front_axle": 1.1562,
        "cg_to_rear_axle": 1.4227,
        "cg_height": 0.5749,
        "track": 1.3754,
        "roll_inertia": 207.27,
        "pitch_inertia": 1565.8,
        "yaw_inertia": 1791.6,
        "wheel_radius": 0.344,
        "wheel_inertia": 1.7,
        "front_cornering_stiffness": 129.6e3,
        "rear_cornering_stiffness": 105.4e3,
        "roll_stiffness": 43.8e3,
        "roll_damping": 3252.0,
        "roll_gradient": 0.0135,
        "roll_arm": 0.6137,
        "driven": "rear",
    },
    # Wang 2025, table of the paper; axle spring rates 50 and 56 kN/m and zeta 0.30 are ours
    "wang2025": {
        "mass": 1980.0,
        "cg_to_front_axle": 1.421,
        "cg_to_rear_axle": 1.579,
        "cg_height": 0.504,
        "pitch_inertia": 4443.0,
        "wheel_radius": 0.3515,
        "drag_area": 0.735,
        "air_density": 1.2,
        "rolling_resistance": 0.012,
        "pitch_stiffness": 240584.0,
        "pitch_damping": 19616.0,
    },
    # Massel 2004 gives no car; docs/methods/common.md#preset-cars
    "massel2004": {
        "mass": 1600.0,
        "cg_height": 0.55,
        "pitch_inertia": 2600.0,
        "pitch_stiffness": 251e3,
        "pitch_damping": 17.9e3,
    },
}
