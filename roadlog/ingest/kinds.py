"""What messages mean by their type: the table `message_kinds.toml`, and the profile it makes.

Two messages of one type may mean different things (a velocity of the car, or one to the east and
north); where the type does not tell, their frame, their topic or the data does.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from roadlog.ingest.formats.derived import derived
from roadlog.ingest.frame import Frame
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY

NEAR_GRAVITY = 0.15  # share by which the median specific force may miss 1 g (bias, grade)
SIDEWAYS = 0.2  # share of a velocity that no car has across its axis, but one to the north has
CREEP = 2.0  # m/s; below it a direction means nothing
CORNERS = {
    "fl": r"(?:fl|lf|front_?left|left_?front)",
    "fr": r"(?:fr|rf|front_?right|right_?front)",
    "rl": r"(?:rl|lr|bl|(?:rear|back)_?left|left_?(?:rear|back))",
    "rr": r"(?:rr|br|(?:rear|back)_?right|right_?(?:rear|back))",
}
MAP_FRAME = re.compile(r"map|enu|ned|world|earth|utm|gps|gnss|ecef|navsat|local", re.I)
MAP_TOPIC = re.compile(r"gps|gnss|fix|ublox|novatel|nmea|septentrio|navsat|filter/velocity", re.I)

NED_FRAME = re.compile(r"(?:^|[^a-z])(?:ned|frd)(?:$|[^a-z])", re.I)
# a topic of what is wanted of the car, not of what it does
COMMANDED = re.compile(
    r"(?:^|[/_])(?:cmd|commands?|commanded|setpoints?|target|desired|goal)(?:[/_]|$)", re.I
)

# what messages without a schema are (JSON of a web bridge, CBOR): the type whose fields they have
SHAPES = {
    "sensor_msgs/Imu": ("linear_acceleration.x", "linear_acceleration.z", "angular_velocity.z"),
    "sensor_msgs/NavSatFix": ("latitude", "longitude", "altitude", "position_covariance.0"),
    "nav_msgs/Odometry": ("pose.pose.position.x", "twist.twist.linear.x"),
    "geometry_msgs/TwistWithCovarianceStamped": ("twist.twist.linear.x", "twist.covariance.0"),
    "geometry_msgs/TwistStamped": ("twist.linear.x", "twist.angular.z"),
    "geometry_msgs/AccelStamped": ("accel.linear.x", "accel.angular.z"),
    "geometry_msgs/Vector3Stamped": ("header.stamp.sec", "vector.x", "vector.z"),
}

_UNIT = re.compile(r"^(.*?)\s*\[([^\[\]]+)\]$")
_NAMED = re.compile(r"\[name~(fl|fr|rl|rr)\]")
_WORD = re.compile(r"[A-Za-z_][\w.]*")


@dataclass(frozen=True)
class RoleFields:
    """One signal of a kind: fields that may hold it, the first that is there counts."""

    fields: tuple[str, ...]
    unit: str
    scale: float = 1.0
    offset: float = 0.0
    valid: str = ""


@dataclass(frozen=True)
class Kind:
    """One entry of the table; see there. lines: role -> where it is."""

    types: tuple[str, ...]
    lines: Mapping[str, RoleFields]
    frame: str = ""
    topic: str = ""
    when: str = ""
    offer: bool = False

    def fits(self, frame: Frame) -> bool:
        """Whether messages of this type, on this topic and with this data, are of this kind."""
        if not any(fnmatchcase(frame.kind, type_) for type_ in self.types):
            return False
        if COMMANDED.search(frame.name):
            return False
        if self.topic and not re.search(self.topic, frame.name, re.I):
            return False
        return not self.when or _shows(self, frame)


@dataclass(frozen=True)
class Meaning:
    """A column that is a signal by its type. line: as the profile has it. doubt: on its unit."""

    role: str
    frame: Frame
    column: str
    line: RoleFields
    kind: Kind
    doubt: str = ""

    @property
    def source(self) -> str:
        """Topic and field."""
        return f"{self.frame.name}.{self.column}"


@cache
def table() -> tuple[Kind, ...]:
    """Every kind, the most trusted first."""
    text = files("roadlog").joinpath("ingest/message_kinds.toml").read_text("utf-8")
    result = []
    for entry in tomllib.loads(text)["kind"]:
        own = {key: entry.pop(key) for key in ("frame", "topic", "when", "offer") if key in entry}
        types = tuple(entry.pop("types"))
        lines = {
            f"{section}.{name}": _line(value)
            for section, signals in entry.items()
            for name, value in signals.items()
        }
        result.append(Kind(types, lines, **own))
    return tuple(result)


def _line(value: Any) -> RoleFields:
    if isinstance(value, str):
        match = _UNIT.match(value)
        assert match is not None, value
        value = {"from": match[1], "unit": match[2]}
    rest = {key: value[key] for key in ("unit", "scale", "offset", "valid") if key in value}
    return RoleFields(tuple(name.strip() for name in value["from"].split(" | ")), **rest)


def by_fields(fields: Collection[str]) -> str:
    """The type of messages that do not name one, empty where no shape fits."""
    shapes = SHAPES.items()
    return next((type_ for type_, own in shapes if all(name in fields for name in own)), "")


def wants(type_: str, column: str) -> bool:
    """Whether a kind of this type has, or is made of, this field."""
    return _folded(column) in _wanted(type_) or _named(column, type_)


@cache
def _wanted(type_: str) -> frozenset[str]:
    """Folded names of all fields that the kinds of a type mention."""
    found: set[str] = set()
    for kind in table():
        if any(fnmatchcase(type_, pattern) for pattern in kind.types):
            for line in kind.lines.values():
                for text in (*line.fields, line.valid, kind.when):
                    for word in _WORD.findall(text):
                        head, _, angle = word.rpartition(".")
                        axes = [f"{head}.{a}" for a in "xyzw"] if angle in ("roll", "pitch") else []
                        found.update(_folded(name) for name in (word, *axes))
    return frozenset(found)


def _named(column: str, type_: str) -> bool:
    is_named = "[name=" in column and _folded(column.rpartition("]")[0].partition("[")[0])
    return bool(is_named) and is_named in _wanted(type_)


def meanings(frames: Iterable[Frame]) -> dict[str, list[Meaning]]:
    """Role -> the columns that are it by their type, the one to take first."""
    found: dict[str, list[tuple[tuple, Meaning]]] = {}
    for place, frame in enumerate(f for f in frames if f.kind and len(f)):
        for rank, kind in enumerate(table()):
            if not kind.fits(frame):
                continue
            for meaning in _of(kind, frame):
                heavy = "accel" not in meaning.role or _weighs(frame)
                score = (kind.offer, not heavy, rank, -_rate(frame), place)
                found.setdefault(meaning.role, []).append((score, meaning))
    return {
        role: [meaning for _, meaning in sorted(ranked, key=lambda item: item[0])]
        for role, ranked in found.items()
    }


def _of(kind: Kind, frame: Frame) -> Iterator[Meaning]:
    for role, line in kind.lines.items():
        column = next((c for c in (_column(f, frame) for f in line.fields) if c), "")
        own = values(frame, column) if column else np.empty(0)
        if not np.isfinite(own).any() or (kind.offer and np.nanmin(own) == np.nanmax(own)):
            continue
        stated = frame.units.get(column, "")
        if line.scale == 1.0 and {stated, line.unit} in ({"deg", "rad"}, {"deg/s", "rad/s"}):
            line = replace(line, unit=stated)  # another version of the definition
        valid = _condition(line.valid, frame)
        if valid is None:
            continue
        yield Meaning(role, frame, column, replace(line, valid=valid), kind)


def _condition(text: str, frame: Frame) -> str | None:
    """The condition in the frame's own names; empty without, None where no row fulfils it."""
    words = text.split()
    name = _column(words[0], frame) if words else ""
    if not name:
        return ""
    given = values(frame, name)
    holds = {">=": given >= float(words[2]), "==": given == float(words[2])}[words[1]]
    return f"{name} {words[1]} {words[2]}" if holds.any() else None


def values(frame: Frame, column: str) -> Floats:
    """The values of a column, or of what is made of several."""
    if column in frame.columns:
        return np.asarray(frame.columns[column], np.float64)
    made = derived(column, frame.columns)
    return np.full(len(frame), np.nan) if made is None else made.of(frame.columns)


def _column(text: str, frame: Frame) -> str:
    """A field of the table in the frame's own spelling; empty where it is not there."""
    named = _NAMED.search(text)
    if named:
        head, tail = _folded(text[: named.start()]), _folded(text[named.end() :])
        inside = re.compile(rf"(?:^|[^a-z]){CORNERS[named[1]]}(?:$|[^a-z])", re.I)
        for name in frame.columns:
            before, _, rest = name.partition("[name=")
            label, _, behind = rest.partition("]")
            if _folded(before) == head and _folded(behind) == tail and inside.search(label):
                return "" if "steer" in label.lower() else name
        return ""
    own = {_folded(name): name for name in reversed(list(frame.columns))}
    spelled = _WORD.sub(lambda match: own.get(_folded(match[0]), match[0]), text)
    if spelled in frame.columns:
        return spelled
    return spelled if derived(spelled, frame.columns) is not None else ""


def _folded(name: str) -> str:
    return name.replace("_", "").lower()


def _rate(frame: Frame) -> int:
    """Hz, coarsely: what is nearly as fast is as good."""
    span = max(1e-9, float(np.ptp(frame.time)) * 1e-9)
    return round(len(frame) / span / 10) * 10


def _shows(kind: Kind, frame: Frame) -> bool:
    """Whether the data and the names of frames say that it is this kind."""
    if kind.when == "gravity":
        return _weighs(frame)
    is_ned = bool(NED_FRAME.search(frame.frame_id))
    if kind.when in ("body", "map", "ned"):
        what = ("ned" if is_ned else "map") if _is_map_velocity(frame) else "body"
        return kind.when == what
    if kind.when == "frd":
        column = _column("linear_acceleration.z", frame)
        return is_ned and bool(column) and float(np.nanmedian(values(frame, column))) < 0
    name, compare, number = kind.when.split()
    column = _column(name, frame)
    if not column:
        return False
    middle = float(np.nanmedian(values(frame, column)))
    return middle < float(number) if compare == "<" else middle > float(number)


def _weighs(frame: Frame) -> bool:
    """Whether three of its components are gravity in the median."""
    triads = {name[:-1] for name in frame.columns if name[-1:] in "xyz" and "angular" not in name}
    accel = [head for head in triads if re.search("acc|vector", head, re.I)]
    for head in accel:
        if all(f"{head}{axis}" in frame.columns for axis in "xyz"):
            parts = [float(np.nanmedian(values(frame, f"{head}{axis}"))) for axis in "xyz"]
            if abs(np.linalg.norm(parts) / STANDARD_GRAVITY - 1) < NEAR_GRAVITY:
                return True
    return not accel


def _is_map_velocity(frame: Frame) -> bool:
    """Whether a velocity is to the east and north, not along the car."""
    own = frame.frame_id
    if own and re.search("base|body|imu|vehicle|car|rear|wheel", own, re.I):
        return False
    if MAP_TOPIC.search(frame.name) or (own and MAP_FRAME.search(own)):
        return True
    heads = [n[:-1] for n in frame.columns if n.endswith(("linear.x", "velocity.x", "vector.x"))]
    if not heads or f"{heads[0]}y" not in frame.columns:
        return False
    x, y = values(frame, f"{heads[0]}x"), values(frame, f"{heads[0]}y")
    moving = np.hypot(x, y) > CREEP
    if not moving.any():
        return False
    return bool(np.median(np.abs(y[moving]) / np.hypot(x, y)[moving]) > SIDEWAYS)
