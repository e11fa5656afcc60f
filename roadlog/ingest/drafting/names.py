"""What a name says: which signal a column is, and in which unit."""

from __future__ import annotations

import re
from contextlib import suppress

from roadlog.errors import ConfigError
from roadlog.ingest.drafting.abroad import in_english
from roadlog.ingest.drafting.vocabulary import (
    AROUND,
    NAMES,
    OTHER,
    REFERENCES,
    SATELLITE,
    TRUE,
    TURNS,
    WORDED,
)
from roadlog.ingest.formats.text import plain
from roadlog.ingest.frame import Frame
from roadlog.signals import SIGNALS
from roadlog.units import SLOPES, UNITS, canonical

TIME = re.compile(
    r"(?:log|gps|utc|epoch|unix|sys|device|system|elapsed|mess|lauf|uhr|abs|rel|sample)*"
    r"(?:t|time|timestamp|timestamps|epoch|zeit|zeitstempel|stempel|zeitpunkt|uhrzeit|temps|tiempo"
    r"|tempo|hora|clock|seconds|secs|sec|millis|micros|elapsed|runtime|timeofday|tod|tow|horodatage|heure|orario"
    r"|(?:date|datum|fecha|data|jour)(?:time|zeit|uhrzeit|hora|ora|heure|et?heure)?)"
    r"(?:utc|s|ms|us|ns|sec|hms|stamp|local|relative|absolute|elapsed|rel|abs|since\w*)?"
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
    "grad": ["deg"],
    "cdeg": ["cdeg"],
    "mdeg": ["mdeg"],
    "mdps": ["mdeg/s"],
    "cdps": ["cdeg/s"],
    "rad": ["rad"],
    "percent": ["%"],
    "pct": ["%"],
    "prozent": ["%"],
    "m": ["m"],
    "mm": ["mm"],
    "cm": ["cm"],
    "cms": ["cm/s"],
    "mms": ["mm/s"],
    "meters": ["m"],
    "ft": ["ft"],
    "nm": ["N m"],
    "s": ["s"],
    "sec": ["s"],
    "us": ["us"],
    "ns": ["ns"],
    "rpm": ["rpm"],
}
_DEVICE = re.compile(r"\\\w+(?::\d+)?$")
_BRACKETS = re.compile(r"[\[({<]([^\])}>]*)[\])}>]\s*$")
_APART = re.compile(r"\s((?:°|[a-z]+[/²³^])\S*)\s*$")  # `Yaw °/s`, `Speed km/h`
_OTHER = re.compile(OTHER)
_ANGULAR = re.compile(r"angular|omega|gyro|rotation|yaw|pitch|roll")  # never a speed of the car
POWER = re.compile(r"_(?:1?e|deg_?1?e)_?([5-7])$")  # lat_e7: times 10^7
_RELATIVE = re.compile(r"baro|relative|pressure")


def roles_of(frame: Frame, column: str) -> list[str]:
    """The signals that a column may be: several of one word for all wheels, else one at most.

    One whose stated unit measures something else is none.
    """
    place = folded(f"{frame.name}_{column}")
    kind = frame.kind.rpartition("/")[2]
    if kind in ("Odometry", "TwistStamped", "TwistWithCovarianceStamped"):
        return ["speed.v"] if column.endswith("linear.x") and "covariance" not in column else []
    words = bare(column).split("_")
    if _OTHER.search("_".join(words)):
        return _torque(frame, column, words)
    found = _named(words)
    if any(map(TRUE.fullmatch, place.split("_"))):
        found = _of(REFERENCES, _core(words)) or [r for r in found if r.startswith("gnss.")]
    if "gnss.altitude" in found and _RELATIVE.search(place):
        found = ["barometer.altitude"]
    if "pressure" in place:  # only an altitude is made of one
        found = [role for role in found if role.endswith(".altitude")]
    if _ANGULAR.search("_".join(words)):
        found = [role for role in found if role != "speed.v"]
    if "speed.v" in found and any(map(SATELLITE.fullmatch, place.split("_"))):
        found = ["gnss.speed"]
    if not found and UNITS.get(any_unit(frame, column) or "", ("",))[0] == "angular rate":
        found = _of(TURNS, _core(words))
    if not any(role.startswith("wheel_speeds") for role in found):
        found = found[:1]
    return [role for role in found if not contradicts(frame, column, role)]


def _named(words: list[str]) -> list[str]:
    """Roles by the whole name, or by the frame of words around it taken off."""
    for core in dict.fromkeys((_core(words), "".join(words))):
        for table in (NAMES, WORDED):
            if found := _of(table, core):
                return found
    return []


def _of(table: dict[str, tuple[str, ...]], core: str) -> list[str]:
    found = [role for role, forms in table.items() if any(re.fullmatch(f, core) for f in forms)]
    wheels = [role for role in found if role.startswith("wheel_speeds")]
    return wheels or found


def _core(words: list[str]) -> str:
    """The name without the words around it that say where it was measured."""

    def around(word: str) -> bool:
        alone = word.rstrip("0123456789")
        return not alone or any(table.fullmatch(alone) for table in (AROUND, SATELLITE, TRUE))

    kept = list(words)
    while len(kept) > 1 and around(kept[-1]):
        kept.pop()
    while len(kept) > 1 and around(kept[0]):
        kept.pop(0)
    return "".join(kept)


def _torque(frame: Frame, column: str, words: list[str]) -> list[str]:
    """Engine torque, where its unit says that it is one: in percent it needs a reference."""
    found = [role for role in _named(words) if role == "powertrain.engine_torque"]
    return found if found and any_unit(frame, column) in ("N m", "kN m") else []


def is_worded(column: str) -> bool:
    """Whether a name is in the car's words for its axes, so that its sensor is turned to them."""
    core = _core(bare(column).split("_"))
    return bool(_of(WORDED, core) or _of(TURNS, core))


def is_time(column: str) -> bool:
    """Whether a name is one of a time."""
    return bool(TIME.fullmatch(bare(column).replace("_", "")))


def any_unit(frame: Frame, column: str) -> str | None:
    """The unit that the source or the name states, as it is spelled here; None for none.

    A unit that is none of ours stays as it is: what it measures is none of ours either.
    """
    stated = frame.units.get(column, "").strip(" []()")
    inside = _BRACKETS.search(column) or _APART.search(column)
    for text in (stated, inside[1].strip() if inside else ""):
        if text and text not in ("-", "1"):
            try:
                return canonical(text)
            except ConfigError:
                return text
    return None


def contradicts(frame: Frame, column: str, role: str) -> bool:
    """Whether a stated unit measures something else than the role."""
    unit = any_unit(frame, column)
    if unit is None or unit == "":
        return False
    expected = SIGNALS[role].unit
    if role in ("gnss.latitude", "gnss.longitude"):
        return unit not in MINUTES and UNITS.get(unit, ("", 0.0))[0] not in ("angle", "number")
    if role.startswith("truth.") and unit in SLOPES:
        return False
    return UNITS.get(unit, ("", 0.0))[0] != UNITS[canonical(expected)][0]


MINUTES = ("min", "'", "arcmin", "minutes", "minute", "Minuten")  # of arc, of positions


def stated_unit(frame: Frame, column: str, role: str) -> tuple[str, bool]:
    """Unit by the source or the name, or the SI unit, and whether it was stated."""
    expected = SIGNALS[role].unit
    if expected == "-":
        return "", True
    unit = any_unit(frame, column)
    if unit is not None and role.startswith("truth.") and unit in SLOPES:
        return unit, True
    if unit in UNITS and UNITS[unit][0] == UNITS[canonical(expected)][0]:
        return str(unit), True
    unit = unit_of(column, expected)
    if not unit and role.startswith("truth."):
        unit = "%" if folded(column).endswith(("percent", "pct", "prozent")) else ""
    return (unit, True) if unit else (canonical(expected), expected == "deg")


def unit_of(name: str, expected: str) -> str:
    """Unit of the right quantity that a name ends with; empty for none."""
    quantity = UNITS[canonical(expected)][0]
    inside = _BRACKETS.search(name) or _APART.search(name)
    if inside:
        with suppress(ConfigError):
            unit = canonical(inside[1])
            if UNITS[unit][0] == quantity:
                return unit
    words = folded(name).split("_")
    for size in (2, 1):
        if len(words) >= size:  # `knots` alone is both
            for unit in _ENDINGS.get("".join(words[-size:]), []):
                if UNITS[unit][0] == quantity:
                    return unit
    return ""


def bare(name: str) -> str:
    """A name in lower case without its unit."""
    name = _leaf(_BRACKETS.sub("", name) or name)
    inside = _APART.search(name)
    words = POWER.sub("", folded(name[: inside.start()] if inside else name)).split("_")
    for size in (2, 1):
        ending = "".join(words[-size:])
        if ending == "g" and len(words) > 1 and words[-2] in ("av", "ar"):
            break  # avant gauche, not in g
        if len(words) > size and ending in _ENDINGS:
            return "_".join(words[:-size])
    return "_".join(words)


def _leaf(name: str) -> str:
    """`vVeh\\ETKC:1` (ETAS), `CAN1::ESP_02::v` (Vector), `Model/car/v` (dSPACE): the name alone."""
    name = _DEVICE.sub("", name).rpartition("::")[2]
    return name.rstrip("/").rpartition("/")[2] if name.count("/") > 1 else name


def folded(name: str) -> str:
    """`AccelX(g)`, `accel.x` and `accel_x` alike: words in lower case between underscores."""
    name = in_english(name).replace("ß", "ss")
    for letter, written in (
        ("ä", "ae"),
        ("ö", "oe"),
        ("ü", "ue"),
        ("Ä", "Ae"),
        ("Ö", "Oe"),
        ("Ü", "Ue"),
    ):
        name = name.replace(letter, written)
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", plain(apart)).strip("_")
