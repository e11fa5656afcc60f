"""ROS 2 payloads: where each field lies in CDR (OMG DDS-XTypes, XCDR version 1), for `columns`.

What is dynamic (strings, sequences) is part of the layout: its length is in the mask, so messages
with other lengths have another layout.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from roadlog.storage.encodings import Codec, Encoding, Layout, Value
from roadlog.storage.records import Damage, Schema

ENCAPSULATION = 4  # bytes: 0, endianness, options; alignment counts from behind it
MAX_ELEMENTS = 64  # of an array that become columns
MAX_VALUES = 4096  # columns of one message
MAX_DEPTH = 16  # of nested messages

PRIMITIVES = {
    "bool": "?", "byte": "u1", "char": "u1", "int8": "i1", "uint8": "u1", "int16": "i2",
    "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8",
    "float32": "f4", "float64": "f8",
}  # fmt: skip

# types that schemas use without defining them
BUILTIN = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
}

_SEPARATOR = re.compile(r"^=+\n", re.MULTILINE)
_TYPE = re.compile(r"([\w/]+)(?:<=\d+)?(\[(<=)?(\d*)\])?$")


@dataclass(frozen=True)
class _Member:
    """One field. count: elements of a fixed array, -1 for a sequence, None for a single value."""

    name: str
    type: str
    count: int | None


class Unfit(Exception):
    """A payload that is not what its schema says."""


@dataclass
class _Walk:
    """Goes through one payload."""

    payload: bytes
    order: str
    mask: bytearray
    position: int = ENCAPSULATION
    values: dict[str, Value] = field(default_factory=dict)

    def align(self, size: int) -> None:
        self.position += -(self.position - ENCAPSULATION) % size

    def skip(self, size: int) -> None:
        self.position += size
        if self.position > len(self.payload):
            raise Unfit(f"a payload of {len(self.payload)} bytes is too short for its schema")

    def length(self) -> int:
        """A length of four bytes, which all messages of the layout share."""
        self.align(4)
        start = self.position
        self.skip(4)
        self.mask[start : start + 4] = b"\xff" * 4
        order = "little" if self.order == "<" else "big"
        return int.from_bytes(self.payload[start : start + 4], order)  # type: ignore[arg-type]

    def numbers(self, path: str, code: str, count: int | None) -> None:
        dtype = np.dtype(self.order + code)
        if count == 0:
            return
        self.align(dtype.itemsize)
        start = self.position
        self.skip((1 if count is None else count) * dtype.itemsize)
        if len(self.values) >= MAX_VALUES:
            return
        if count is None:
            self.values[path] = Value(start, dtype)
        else:
            for k in range(min(count, MAX_ELEMENTS)):
                self.values[f"{path}.{k}"] = Value(start + k * dtype.itemsize, dtype)


class Cdr(Codec):
    """Codec of a `ros2msg` schema. Raises Damage when the schema cannot be used."""

    def __init__(self, schema: Schema) -> None:
        try:
            self._types, self._root = _definitions(schema)
        except (UnicodeDecodeError, ValueError) as error:
            raise Damage(f"its schema cannot be used: {error}") from error
        self.dtypes: dict[str, np.dtype] = {}
        self._declare(self._root, "", 0)

    def _declare(self, type_: str, parent: str, depth: int) -> None:
        """Columns that every message has: all that is in no sequence."""
        if depth > MAX_DEPTH:
            raise Damage(f"its schema nests messages more than {MAX_DEPTH} deep")
        for member in self._types[type_]:
            if member.count == -1:
                continue
            many = range(min(member.count or 0, MAX_ELEMENTS))
            paths = [f"{parent}{member.name}.{k}" for k in many]
            for path in paths if member.count is not None else [f"{parent}{member.name}"]:
                if len(self.dtypes) >= MAX_VALUES:
                    return
                if member.type in PRIMITIVES:
                    dtype = np.dtype(PRIMITIVES[member.type])
                    self.dtypes[path] = np.dtype(np.float64) if dtype.kind == "f" else dtype
                elif member.type in self._types:
                    self._declare(member.type, f"{path}.", depth + 1)

    def layout(self, payload: bytes) -> Layout | None:
        try:
            return self._layout(payload)
        except Unfit:
            return None

    def decode(self, payload: bytes) -> Mapping[str, Any]:
        try:
            layout = self._layout(payload)
        except Unfit as error:
            raise ValueError(str(error)) from error
        return {
            name: np.frombuffer(payload, value.dtype, 1, value.offset)[0].item()
            for name, value in layout.values.items()
        }

    def _layout(self, payload: bytes) -> Layout:
        if len(payload) < ENCAPSULATION or payload[0] or payload[1] > 1:
            raise Unfit("its encapsulation is not plain CDR")
        walk = _Walk(payload, "<" if payload[1] else ">", bytearray(len(payload)))
        walk.mask[:2] = b"\xff\xff"
        self._walk(walk, self._root, "")
        return Layout(walk.values, {}, bytes(walk.mask))

    def _walk(self, walk: _Walk, type_: str, parent: str) -> None:
        members = self._types[type_]
        if not members:
            walk.skip(1)  # ROS puts one byte where a message has no field
        for member in members:
            path = f"{parent}{member.name}"
            count = walk.length() if member.count == -1 else member.count
            if member.type in PRIMITIVES:
                walk.numbers(path, PRIMITIVES[member.type], count)
                continue
            if (count or 0) > len(walk.payload):
                raise Unfit(f"{path}: {count} elements in {len(walk.payload)} bytes")
            for k in range(1 if count is None else count):
                if member.type == "string":
                    walk.skip(walk.length())
                elif member.type in self._types:
                    is_shown = count is None or k < MAX_ELEMENTS
                    inner = path if count is None else f"{path}.{k}"
                    kept = walk.values if is_shown else dict(walk.values)
                    self._walk(walk, member.type, f"{inner}.")
                    walk.values = kept
                else:
                    raise Unfit(f"{path}: type {member.type} is not supported")


def _definitions(schema: Schema) -> tuple[dict[str, list[_Member]], str]:
    """Type -> members, of a message definition with the definitions it uses behind it."""
    root = _short(schema.name)
    first, *others = _SEPARATOR.split(schema.data.decode().replace("\r\n", "\n"))
    texts = dict(BUILTIN)
    for other in others:
        head, _, text = other.partition("\n")
        if not head.startswith("MSG:"):
            raise ValueError(f"'{head[:40]}' where 'MSG: package/Type' should be")
        texts[_short(head[4:].strip())] = text
    texts[root] = first
    return {name: _members(text, name, texts) for name, text in texts.items()}, root


def _members(text: str, name: str, types: Mapping[str, str]) -> list[_Member]:
    result = []
    for line in text.splitlines():
        words = line.partition("#")[0].split(maxsplit=1)
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
        if type_ not in PRIMITIVES and type_ not in ("string", "wstring"):
            type_ = _short(type_)
            package = name.rpartition("/")[0]
            if type_ == "Header" and "std_msgs/Header" in types:
                type_ = "std_msgs/Header"
            elif "/" not in type_:
                type_ = f"{package}/{type_}"
            if type_ not in types:
                raise ValueError(f"type {type_} is not defined")
        count = None
        if array:
            count = -1 if bounded or not size else int(size)
        result.append(_Member(field_name.group(), type_, count))
    return result


def _short(name: str) -> str:
    """`package/msg/Type` as `package/Type`."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


ENCODING = Encoding("cdr", ("ros2msg",), Cdr)
