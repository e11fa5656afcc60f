"""What a name says: which signal a column is, and in which unit."""

from __future__ import annotations

import re
from contextlib import suppress

from roadlog.errors import ConfigError
from roadlog.ingest.frame import Frame
from roadlog.signals import AXES
from roadlog.units import UNITS, canonical

TIME = re.compile(
    r"^(?:log_?|gps_?|utc_?|epoch_?|unix_?|sys_?|device_?)*(?:t|time|timestamp|epoch)"
)

# endings of names, and the units that they may mean
_ENDINGS = {
    "g": ["g"],
    "mg": ["mg"],
    "ms2": ["m/s^2"],
    "mss": ["m/s^2"],
    "mps2": ["m/s^2"],
    "dps": ["deg/s"],
    "degs": ["deg/s"],
    "degps": ["deg/s"],
    "degsec": ["deg/s"],
    "rads": ["rad/s"],
    "radps": ["rad/s"],
    "radsec": ["rad/s"],
    "kmh": ["km/h"],
    "kph": ["km/h"],
    "kmph": ["km/h"],
    "mph": ["mph"],
    "mps": ["m/s"],
    "ms": ["m/s", "ms"],
    "kn": ["kn"],
    "kt": ["kn"],
    "knots": ["kn"],
    "deg": ["deg"],
    "rad": ["rad"],
    "percent": ["%"],
    "pct": ["%"],
    "m": ["m"],
    "meters": ["m"],
    "ft": ["ft"],
    "nm": ["N m"],
    "s": ["s"],
    "sec": ["s"],
    "us": ["us"],
    "ns": ["ns"],
}
_CORNERS = {
    "fl": r"fl|lf|front_?left|left_?front",
    "fr": r"fr|rf|front_?right|right_?front",
    "rl": r"rl|lr|rear_?left|left_?rear",
    "rr": r"rr|rear_?right|right_?rear",
}
_ACCEL = r"(?:^|_)(?:a|acc|accel|acceleration|accelerometer|specific_force|f|g_?f)"
_GYRO = (
    r"(?:^|_)(?:w|g|gyr|gyro|gyroscope|omega|angular_?(?:rate|velocity)|rotation_?rate|"
    r"ang_?(?:rate|vel))"
)
_SPEED = r"(?:^|_)(?:v|vel|velocity|spd|speed)(?:_x)?$|^(?:veh|vehicle)(?:spd|speed)$"
_NAMED: dict[str, str] = {
    **{f"imu.accel_{a}": rf"{_ACCEL}_?{a}$" for a in AXES},
    **{f"imu.gyro_{a}": rf"{_GYRO}_?{a}$" for a in AXES},
    **{
        f"wheel_speeds.{w}": rf"(?:wheel|whl|ws|w_spd).*(?:^|_|speed|spd|ws)(?:{c})(?:$|_)"
        rf"|^(?:{c})_?(?:wheel|whl)"
        for w, c in _CORNERS.items()
    },
    "gnss.latitude": r"(?:^|_)lat(?:itude)?$",
    "gnss.longitude": r"(?:^|_)(?:lon|long|lng|longitude)$",
    "gnss.altitude": r"(?:^|_)(?:alt|altitude|height|elevation)$",
    "gnss.course": r"(?:^|_)(?:course|bearing|cog|track)$",
    "speed.v": _SPEED,
    "steering.road_wheel_angle": r"(?:steer|steering|swa)(?:.*angle)?$|steer.*_(?:angle|position)",
    "truth.grade": r"(?:true|truth|ref|reference)_(?:grade|slope)$",
}
# by the car's words for its axes; the sensor then is in vehicle axes but for signs
WORDED = {
    "imu.accel_x": r"^long\w*_acc\w*$|^acc\w*_long\w*$",
    "imu.accel_y": r"^lat\w*_acc\w*$|^acc\w*_lat\w*$",
    "imu.accel_z": r"^vert\w*_acc\w*$|^acc\w*_vert\w*$",
    "imu.gyro_x": r"(?:^|_)roll_?rate$",
    "imu.gyro_y": r"(?:^|_)pitch_?rate$",
    "imu.gyro_z": r"(?:^|_)yaw_?rate$",
}
# words of names that are something else
_OTHER = re.compile(
    r"valid|accuracy|status|quality|std|cov|count|limit|target|setpoint|engine|fan|wind|rpm|turbine"
)
_RELATIVE = re.compile(r"baro|relative|pressure")
_SATELLITE = re.compile(r"gps|gnss|fix|nav")


def roles_of(frame: Frame, column: str) -> list[str]:
    """The signals that a column may be: several of one word for all wheels, else one at most."""
    base = bare(column)
    place = folded(f"{frame.name}_{column}")
    kind = frame.kind.rpartition("/")[2]
    if kind in ("Odometry", "TwistStamped", "TwistWithCovarianceStamped"):
        return ["speed.v"] if column.endswith("linear.x") and "covariance" not in column else []
    if _OTHER.search(folded(column)):
        return []
    named = [*_NAMED.items(), *WORDED.items()]
    found = [role for role, pattern in named if re.search(pattern, base)]
    if "gnss.altitude" in found and _RELATIVE.search(place):
        return ["barometer.altitude"]
    if any(role.startswith("wheel_speeds") for role in found):
        return [role for role in found if role.startswith("wheel_speeds")]
    if "speed.v" in found:
        return ["gnss.speed"] if _SATELLITE.search(place) else ["speed.v"]
    return found[:1]


def stated_unit(frame: Frame, column: str, expected: str) -> tuple[str, bool]:
    """Unit by the source or the name, or the SI unit, and whether it was stated."""
    if expected == "-":
        return "", True
    with suppress(ConfigError):
        unit = canonical(frame.units.get(column, ""))
        if unit and UNITS[unit][0] == UNITS[canonical(expected)][0]:
            return unit, True
    unit = unit_of(column, expected)
    return (unit, True) if unit else (canonical(expected), expected == "deg")


def unit_of(name: str, expected: str) -> str:
    """Unit of the right quantity that a name ends with; empty for none."""
    quantity = UNITS[canonical(expected)][0]
    inside = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    if inside:
        with suppress(ConfigError):
            unit = canonical(inside[1])
            if UNITS[unit][0] == quantity:
                return unit
    words = folded(name).split("_")
    for size in (2, 1):
        if len(words) > size:
            for unit in _ENDINGS.get("".join(words[-size:]), []):
                if UNITS[unit][0] == quantity:
                    return unit
    return ""


def bare(name: str) -> str:
    """A name in lower case without its unit."""
    words = folded(re.sub(r"[\[(][^\])]*[\])]\s*$", "", name)).split("_")
    for size in (2, 1):
        if len(words) > size and "".join(words[-size:]) in _ENDINGS:
            return "_".join(words[:-size])
    return "_".join(words)


def folded(name: str) -> str:
    """`AccelX(g)`, `accel.x` and `accel_x` alike: words in lower case between underscores."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", apart.lower()).strip("_")
