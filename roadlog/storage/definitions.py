"""What a schema text says of a message: ROS message definitions and OMG IDL become `Types`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from roadlog.storage.records import Schema

# `byte` is an octet, as the IDL that ROS 2 makes of it says; other libraries differ
PRIMITIVES = {
    "bool": "?", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2",
    "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float32": "f4", "float64": "f8", "enum8": "u1", "enum16": "u2", "enum": "u4", "enum64": "u8",
}  # fmt: skip
TEXTS = ("string", "wstring")

# types that definitions use without defining them; ROS 1 counts seconds without a sign
BUILTIN = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
}
ROS1_BUILTIN = {"time": "uint32 sec\nuint32 nanosec", "duration": "int32 sec\nint32 nanosec"}

_SEPARATOR = re.compile(r"^=+\n", re.MULTILINE)
_TYPE = re.compile(r"\A([\w/]+)(?:<=\d+)?(\[(<=)?(\d*)\])?$")
_UNIT = re.compile(r"[\[(]([^\[(\])]+)[\])]")


@dataclass(frozen=True)
class Member:
    """One field. count: elements of a fixed array, -1 for a sequence, None for a single value.

    unit: what its comment or annotation states. optional: whether it may be left out. number: of
    the field in a mutable struct.
    """

    name: str
    type: str
    count: int | None = None
    unit: str = ""
    optional: bool = False
    number: int = 0


@dataclass(frozen=True)
class Struct:
    """The fields of a type. extensible: final, appendable or mutable, empty where nothing says."""

    members: tuple[Member, ...]
    extensible: str = ""


@dataclass(frozen=True)
class Types:
    """Every type of a schema by name, and which of them the messages are."""

    structs: Mapping[str, Struct]
    root: str


def of_ros(schema: Schema) -> Types:
    """Of a `ros1msg` or `ros2msg` schema. Raises ValueError for what is no definition."""
    root = short(schema.name)
    first, *others = _SEPARATOR.split(schema.data.decode().replace("\r\n", "\n"))
    texts = dict(BUILTIN)
    if schema.encoding == "ros1msg":
        texts |= ROS1_BUILTIN
    for other in others:
        head, _, text = other.partition("\n")
        if not head.startswith("MSG:"):
            raise ValueError(f"'{head[:40]}' where 'MSG: package/Type' should be")
        texts[short(head[4:].strip())] = text
    texts[root] = first
    structs = {name: Struct(tuple(_members(text, name, texts))) for name, text in texts.items()}
    return Types(structs, root)


def _members(text: str, name: str, types: Mapping[str, str]) -> Iterator[Member]:
    for line in text.splitlines():
        code, _, comment = line.partition("#")
        words = code.split(maxsplit=1)
        if len(words) < 2:
            continue
        field_name = re.match(r"\w+", words[1])
        behind = words[1][field_name.end() :].lstrip() if field_name else ""
        found = _TYPE.match(words[0])
        if field_name is None or found is None:
            raise ValueError(f"'{line.strip()[:40]}' is no field")
        if behind.startswith("=") and not behind.startswith("=="):
            continue  # a constant
        type_, array, bounded, size = found.groups()
        if type_ not in PRIMITIVES and type_ not in TEXTS:
            type_ = _resolved(type_, name.rpartition("/")[0], types)
        count = None
        if array:
            count = -1 if bounded or not size else int(size)
        yield Member(field_name.group(), type_, count, stated_unit(comment))


def _resolved(type_: str, package: str, types: Mapping[str, str]) -> str:
    """The full name of a type that a definition uses."""
    if type_ in types and "/" not in type_:
        return type_  # ROS 1: time, duration
    type_ = short(type_)
    if type_ == "Header" and "std_msgs/Header" in types:
        return "std_msgs/Header"
    if "/" not in type_:
        type_ = f"{package}/{type_}"
    if type_ not in types:
        raise ValueError(f"type {type_} is not defined")
    return type_


def stated_unit(comment: str) -> str:
    """The unit in a comment: `# m/s`, `# speed [m/s]`, `# yaw rate (deg/s)`; empty for none.

    What is no unit is harmless: it is looked up before it is used.
    """
    inside = [text for text in _UNIT.findall(comment) if text.strip()]
    if inside:
        return inside[-1].strip()
    head = comment.strip().split(",")[0]
    return head if len(head.split()) <= 2 and len(head) <= 12 else ""


def short(name: str) -> str:
    """`package/msg/Type` as `package/Type`."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name
