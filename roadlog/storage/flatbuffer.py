"""FlatBuffers payloads with a binary schema (`.bfbs`): where each field lies, for `columns`.

A table says in its vtable where each field is; offsets and vtables are in the mask, so messages
built alike share a layout (flatbuffers.dev, "Internals" and reflection.fbs).
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from roadlog.storage.encodings import Codec, Encoding, Layout, Value
from roadlog.storage.records import Damage, Schema
from roadlog.storage.walk import ELEMENT, MAX_DEPTH, MAX_ELEMENTS, MAX_VALUES, Unfit

# reflection.BaseType -> dtype
_SCALARS = {
    2: "?", 3: "<i1", 4: "<u1", 5: "<i2", 6: "<u2", 7: "<i4", 8: "<u4", 9: "<i8", 10: "<u8",
    11: "<f4", 12: "<f8",
}  # fmt: skip
_STRING, _VECTOR, _OBJECT, _UNION, _ARRAY = 13, 14, 15, 16, 17
_OCTET = 4  # raw data, no numbers


class _Table:
    """A table of the schema itself: its fields by their id."""

    def __init__(self, data: bytes, at: int) -> None:
        self.data, self.at = data, at
        self.vtable = at - struct.unpack_from("<i", data, at)[0]
        self.size = struct.unpack_from("<H", data, self.vtable)[0]

    def place(self, number: int) -> int:
        """Where a field lies, 0 where it is not there."""
        entry = 4 + 2 * number
        if entry >= self.size:
            return 0
        offset = struct.unpack_from("<H", self.data, self.vtable + entry)[0]
        return self.at + offset if offset else 0

    def number(self, number: int, code: str, default: Any = 0) -> Any:
        place = self.place(number)
        return struct.unpack_from(code, self.data, place)[0] if place else default

    def inner(self, number: int) -> int:
        """Where an offset leads."""
        place = self.place(number)
        return place + struct.unpack_from("<I", self.data, place)[0] if place else 0

    def text(self, number: int) -> str:
        at = self.inner(number)
        size = struct.unpack_from("<I", self.data, at)[0]
        return self.data[at + 4 : at + 4 + size].decode()

    def tables(self, number: int) -> list[_Table]:
        at = self.inner(number)
        if not at:
            return []
        count = struct.unpack_from("<I", self.data, at)[0]
        places = [at + 4 + 4 * k for k in range(count)]
        return [_Table(self.data, p + struct.unpack_from("<I", self.data, p)[0]) for p in places]


@dataclass(frozen=True)
class _Field:
    """One field. slot: of the vtable, or the offset in a struct. kind, element: BaseType."""

    name: str
    slot: int
    kind: int
    element: int
    object: int
    count: int
    default: float


@dataclass(frozen=True)
class _Object:
    fields: tuple[_Field, ...]
    is_struct: bool
    size: int


@dataclass
class _Walk:
    """Goes through one payload."""

    objects: list[_Object]
    payload: bytes
    mask: bytearray = field(init=False)
    values: dict[str, Value] = field(default_factory=dict)
    absent: dict[str, float] = field(default_factory=dict)
    places: dict[str, tuple[int, int]] = field(default_factory=dict)
    unread: set[str] = field(default_factory=set)
    visits: int = 0  # of tables

    def __post_init__(self) -> None:
        self.mask = bytearray(len(self.payload))

    def fixed(self, code: str, at: int) -> int:
        """A number that all messages of the layout share."""
        size = struct.calcsize(code)
        if at < 0 or at + size > len(self.payload):
            raise Unfit(f"a payload of {len(self.payload)} bytes is too short for its schema")
        self.mask[at : at + size] = b"\xff" * size
        return struct.unpack_from(code, self.payload, at)[0]

    def offset(self, at: int) -> int:
        return at + self.fixed("<I", at)

    def table(self, index: int, at: int, parent: str, depth: int) -> None:
        self.visits += 1
        if self.visits > len(self.payload):  # tables that hold each other
            raise Unfit(f"more tables than its {len(self.payload)} bytes can hold")
        vtable = at - self.fixed("<i", at)
        size = self.fixed("<H", vtable)
        for entry in self.objects[index].fields:
            place = self.fixed("<H", vtable + entry.slot) if entry.slot < size else 0
            path = f"{parent}{entry.name}"
            if place:
                self.field(entry, at + place, path, depth)
            elif entry.kind in _SCALARS:
                self.absent[path] = entry.default

    def struct(self, index: int, at: int, parent: str, depth: int) -> None:
        for entry in self.objects[index].fields:
            self.field(entry, at + entry.slot, f"{parent}{entry.name}", depth, inside=True)

    def field(self, entry: _Field, at: int, path: str, depth: int, inside: bool = False) -> None:
        if depth > MAX_DEPTH:
            return
        if entry.kind in _SCALARS:
            self.number(entry.kind, at, path)
        elif entry.kind == _STRING:
            start = self.offset(at)
            self.places[path] = start + 4, self.fixed("<I", start)
        elif entry.kind == _OBJECT and self.objects[entry.object].is_struct:
            self.struct(entry.object, at, f"{path}.", depth + 1)
        elif entry.kind == _OBJECT and not inside:
            self.table(entry.object, self.offset(at), f"{path}.", depth + 1)
        elif entry.kind == _UNION:
            self.unread.add(ELEMENT.sub("", path))
        elif entry.kind == _ARRAY:
            self.elements(entry, at, entry.count, path, depth)
        elif entry.kind == _VECTOR:
            start = self.offset(at)
            self.elements(entry, start + 4, self.fixed("<I", start), path, depth)

    def elements(self, entry: _Field, at: int, count: int, path: str, depth: int) -> None:
        """Those of a vector, or of an array in a struct, which begin at `at`."""
        if count > MAX_ELEMENTS and entry.element not in (_STRING, _OCTET):
            self.unread.add(f"{ELEMENT.sub('', path)} after the first {MAX_ELEMENTS}")
        for k in range(min(count, MAX_ELEMENTS)):
            inner = f"{path}.{k}"
            if entry.element in _SCALARS:
                size = np.dtype(_SCALARS[entry.element]).itemsize
                self.number(entry.element, at + k * size, inner)
            elif entry.element == _OBJECT and self.objects[entry.object].is_struct:
                size = self.objects[entry.object].size
                self.struct(entry.object, at + k * size, f"{inner}.", depth + 1)
            elif entry.element == _OBJECT:
                self.table(entry.object, self.offset(at + 4 * k), f"{inner}.", depth + 1)

    def number(self, kind: int, at: int, path: str) -> None:
        dtype = np.dtype(_SCALARS[kind])
        if at + dtype.itemsize > len(self.payload):
            raise Unfit(f"a payload of {len(self.payload)} bytes is too short for its schema")
        if len(self.values) < MAX_VALUES:
            self.values[path] = Value(at, dtype)


class Flatbuffer(Codec):
    """Codec of a binary FlatBuffers schema. Raises Damage for one of no use."""

    def __init__(self, schema: Schema) -> None:
        try:
            self._objects, self._root = _objects(schema)
        except (struct.error, IndexError, UnicodeDecodeError, ValueError) as error:
            raise Damage(f"its schema cannot be used: {error}") from error
        self.dtypes: dict[str, np.dtype] = {}
        self._declare(self._root, "", ())

    def _declare(self, index: int, parent: str, above: tuple[int, ...]) -> None:
        if index in above or len(above) > MAX_DEPTH or len(self.dtypes) > MAX_VALUES:
            return
        for entry in self._objects[index].fields:
            if entry.kind in _SCALARS:
                dtype = np.dtype(_SCALARS[entry.kind])
                self.dtypes[f"{parent}{entry.name}"] = (
                    np.dtype(np.float64) if dtype.kind == "f" else dtype
                )
            elif entry.kind == _OBJECT:
                self._declare(entry.object, f"{parent}{entry.name}.", (*above, index))

    def layout(self, payload: bytes) -> Layout | None:
        try:
            return self._layout(payload)
        except (Unfit, struct.error):
            return None

    def decode(self, payload: bytes) -> Mapping[str, Any]:
        try:
            layout = self._layout(payload)
        except struct.error as error:
            raise ValueError(str(error)) from error
        found = {
            name: np.frombuffer(payload, value.dtype, 1, value.offset)[0].item()
            for name, value in layout.values.items()
        }
        return dict(layout.absent) | found

    def unread(self, payload: bytes) -> frozenset[str]:
        try:
            return frozenset(self._walk(payload).unread)
        except (Unfit, struct.error):
            return frozenset()

    def texts(self, payload: bytes) -> dict[str, str]:
        walk = self._walk(payload)
        return {
            path: payload[at : at + size].decode(errors="replace")
            for path, (at, size) in walk.places.items()
        }

    def _layout(self, payload: bytes) -> Layout:
        walk = self._walk(payload)
        return Layout(walk.values, walk.absent, bytes(walk.mask))

    def _walk(self, payload: bytes) -> _Walk:
        walk = _Walk(self._objects, payload)
        walk.table(self._root, walk.offset(0), "", 0)
        return walk


def _objects(schema: Schema) -> tuple[list[_Object], int]:
    """Tables and structs of a schema (reflection.Schema), and which the messages are."""
    data = schema.data
    root = _Table(data, struct.unpack_from("<I", data, 0)[0])
    found, names = [], []
    for table in root.tables(0):
        is_struct = bool(table.number(2, "<?", False))
        fields = [_field(entry) for entry in table.tables(1)]
        names.append(table.text(0))
        found.append(_Object(tuple(fields), is_struct, table.number(4, "<i")))
    if schema.name not in names:
        raise ValueError(f"no table {schema.name} in it")
    return found, names.index(schema.name)


def _field(entry: _Table) -> _Field:
    kind = _Table(entry.data, entry.inner(1))
    base = kind.number(0, "<b")
    integer, real = entry.number(4, "<q"), entry.number(5, "<d", 0.0)
    return _Field(
        entry.text(0),
        entry.number(3, "<H"),
        base,
        kind.number(1, "<b"),
        kind.number(2, "<i", -1),
        kind.number(3, "<H"),
        real if base in (11, 12) else float(integer),
    )


ENCODING = Encoding("flatbuffer", ("flatbuffer",), Flatbuffer)
