"""Units of every field of roadlog's own messages: the one table that schemas and docs follow.

Inputs and angles have theirs in `signals`; here are what estimators and simulated truth put beside.
"""

from __future__ import annotations

from roadlog.signals import ANGLES, AXES, SECTIONS, WHEELS


def _all(names: list[str], unit: str) -> dict[str, str]:
    return dict.fromkeys(names, unit)


def _along(kind: str, unit: str) -> dict[str, str]:
    return _all([f"{kind}_{axis}" for axis in AXES], unit)


def _with_sd(fields: dict[str, str]) -> dict[str, str]:
    return {name + end: unit for name, unit in fields.items() for end in ("", "_sd")}


_FORCES = [f"f{axis}_{wheel}" for axis in AXES for wheel in WHEELS] + ["fy_front", "fy_rear"]

_BESIDE: dict[str, dict[str, str]] = {
    "AnglesDeg": {f"{angle}_deg": "deg" for angle in ANGLES},
    "CarMotion": _along("force", "m/s^2")  # specific force
    | _along("rate", "rad/s")
    | _all([*AXES, "distance", "offset"], "m")
    | _all(["heading", "static_pitch"], "rad"),
    "FuelEstimate": {"volume_raw": "L", "volume": "L", "level_fraction": "-", "tilt": "rad"}
    | {"consumption": "L/km", "remaining_range": "km"},
    "FusionConstants": _with_sd(
        _along("gyro_bias", "rad/s")
        | _along("accel_bias", "m/s^2")
        | _all(["mounting_roll", "mounting_pitch", "mounting_yaw"], "rad")
        | _all(
            ["pitch_gradient", "pitch_gradient_side", "roll_gradient", "slip_gradient"],
            "rad/(m/s^2)",
        )
        | {"speed_scale": "-", "speed_delay": "s", "rear_axle_x": "m", "speed_offset_y": "m"}
    ),
    "FusionShape": {"grade_shape_sd": "rad", "bank_shape_sd": "rad"},
    "PitchRegression": {"excitation": "m/s^2", "inclination_squared": "rad^2"},
    "Sideslip": {"beta": "rad", "beta_sd": "rad", "v_x": "m/s", "v_y": "m/s"},
    "StopEvent": _all(
        ["inclination", "roll_total", "grade", "pitch", "pitch_sd", "pitch_mean", "pitch_mean_sd"],
        "rad",
    )
    | {"leveling": "rad"}
    | {"chord_deviation": "m", "duration": "s", "standstill": "s", "gravity": "m/s^2"}
    | _along("gyro_bias", "rad/s"),
    "StopWindow": _all(["s", *AXES], "m") | {"inclination": "rad"},
    "SuspensionFilter": {"speed": "m/s", "speed_innovation": "m/s", "nis": "-"}
    | _all(["along_road", "accel_innovation"], "m/s^2"),
    "TiRlsWeights": {"ti_share": "-", "excitation": "m/s^2"},
    "TireForces": _with_sd(_all(_FORCES, "N")),
}

UNITS: dict[str, dict[str, str]] = {
    section.schema: {signal.field: signal.unit for signal in section.signals}
    for section in SECTIONS.values()
} | {f"roadlog.v1.{message}": fields for message, fields in _BESIDE.items()}


def units(schema: str) -> dict[str, str]:
    """Field -> unit of a message, "-" for a number without one; empty for a type of others."""
    return UNITS.get(schema, {})
