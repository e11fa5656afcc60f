"""The vocabulary: every signal's role, unit, frame, topic and message field, in one table.

Roles are `section.field`, e.g. `imu.accel_x`. Frames and signs: ISO 8855 vehicle axes (x forward,
y left, z up), specific force, nose-up rate = -gyro_y. Nothing else in roadlog spells a topic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

SampleKind = Literal["analog", "hold", "angle", "degrees"]

SLOPES = ("grade", "bank")  # of the road: the angles that are also given in percent
SEPARATED = ("grade", "bank", "pitch", "roll")  # road and body; the other two are their sums
ANGLES = (*SEPARATED, "inclination", "roll_total")

FLAGS = {
    "missing": 1,  # input missing or stale
    "held": 2,  # last value held
    "excitation": 4,  # low excitation
    "standstill": 8,  # standstill or below the method's speed
    "model": 16,  # outside the method's model (cornering, nonlinear tires)
    "converging": 32,  # after start or reset
    "rejected": 64,  # by a consistency test
    "saturated": 128,  # or clipped
    "repaired": 256,  # covariance
    "uncertain": 512,  # uncertainty above limit
    "powertrain": 1024,  # gear or torque unknown
}

DECELERATION, ACCELERATION = 1, 2  # roadlog.v1.StopEvent.Kind


@dataclass(frozen=True)
class Signal:
    """One field of one message."""

    role: str
    field: str
    unit: str  # SI, or deg for latitude and longitude
    kind: SampleKind  # how to put it on a grid: interpolate, hold, unwrap, or interpolate degrees


@dataclass(frozen=True)
class Section:
    """One message: signals that share a clock and a topic."""

    name: str
    topic: str
    schema: str
    signals: tuple[Signal, ...]

    @property
    def fields(self) -> tuple[str, ...]:
        return tuple(signal.field for signal in self.signals)


def _section(
    name: str, topic: str, schema: str, units: dict[str, str], **kinds: SampleKind
) -> Section:
    signals = (Signal(f"{name}.{f}", f, unit, kinds.get(f, "analog")) for f, unit in units.items())
    return Section(name, topic, f"roadlog.v1.{schema}", tuple(signals))


WHEELS = ("fl", "fr", "rl", "rr")
AXES = ("x", "y", "z")
_TORQUES = [f"{kind}_{wheel}" for kind in ("drive", "brake") for wheel in WHEELS]


def _held(fields: list[str]) -> dict[str, SampleKind]:
    return dict.fromkeys(fields, "hold")


SECTIONS: dict[str, Section] = {
    section.name: section
    for section in (
        _section(
            "imu",
            "/imu",
            "Imu",
            {f"accel_{a}": "m/s^2" for a in "xyz"} | {f"gyro_{a}": "rad/s" for a in "xyz"},
        ),
        _section("wheel_speeds", "/wheel_speeds", "WheelSpeeds", dict.fromkeys(WHEELS, "m/s")),
        _section("speed", "/speed", "Speed", {"v": "m/s"}),
        _section(
            "steering",
            "/steering",
            "Steering",
            {"road_wheel_angle": "rad"},
            road_wheel_angle="hold",
        ),
        _section(
            "wheel_torques",
            "/wheel_torques",
            "WheelTorques",
            dict.fromkeys(_TORQUES, "N m"),
            **_held(_TORQUES),
        ),
        _section(
            "powertrain",
            "/powertrain",
            "Powertrain",
            {"engine_torque": "N m", "gear_ratio": "-", "drive_force": "N"},
            engine_torque="hold",
            gear_ratio="hold",
            drive_force="hold",
        ),
        _section(
            "gnss",
            "/gnss",
            "Gnss",
            {
                "latitude": "deg",
                "longitude": "deg",
                "altitude": "m",
                "speed": "m/s",
                "course": "rad",
                "climb": "m/s",
                "heading": "rad",
                "roll": "rad",
                "horizontal_accuracy": "m",
                "vertical_accuracy": "m",
                "speed_accuracy": "m/s",
                "course_accuracy": "rad",
                "climb_accuracy": "m/s",
                "heading_accuracy": "rad",
                "roll_accuracy": "rad",
            },
            latitude="degrees",
            longitude="degrees",
            course="angle",
            heading="angle",
        ),
        _section("barometer", "/barometer", "Barometer", {"altitude": "m"}),
        _section("fuel", "/fuel", "FuelLevel", {"sender": "m"}),
        _section(
            "truth",
            "/truth/angles",
            "RoadAngles",
            dict.fromkeys([*ANGLES, *(f"{angle}_sd" for angle in ANGLES)], "rad"),
        ),
    )
}

SIGNALS: dict[str, Signal] = {
    signal.role: signal for section in SECTIONS.values() for signal in section.signals
}

INPUTS = tuple(section for section in SECTIONS.values() if section.name != "truth")

ANGLES_SCHEMA = SECTIONS["truth"].schema
IMU_TOPIC = SECTIONS["imu"].topic
GNSS_TOPIC = SECTIONS["gnss"].topic
TRUTH_TOPIC = SECTIONS["truth"].topic
TRUTH_PREFIX = "/truth/"
FIX_TOPIC = "/gnss/fix"  # the same fix as foxglove.LocationFix, for maps
ESTIMATES_PREFIX = "/estimates/"


def unit_of(column: str) -> str:
    """Unit of a role, an angle or its sd, or of `time`; empty where it has none."""
    if column == "time":
        return "s"
    if column in SIGNALS:
        return SIGNALS[column].unit
    return "rad" if column.removesuffix("_sd") in ANGLES else ""


def estimate_topic(name: str, detail: str = "angles") -> str:
    """Topic of one output of one estimator."""
    return f"{ESTIMATES_PREFIX}{name}/{detail}"


def split_estimate_topic(topic: str) -> tuple[str, str] | None:
    """Estimator and detail of a topic; None when it is no estimate."""
    if not topic.startswith(ESTIMATES_PREFIX):
        return None
    name, _, detail = topic[len(ESTIMATES_PREFIX) :].partition("/")
    return (name, detail) if name and detail else None


def is_truth(topic: str) -> bool:
    """Whether a topic is truth: the angles, or what is beside them."""
    return topic.startswith(TRUTH_PREFIX)


def truth_topic(detail: str) -> str:
    """Topic of truth beside the angles (tire forces, sideslip, ...)."""
    return f"{TRUTH_PREFIX}{detail}"
