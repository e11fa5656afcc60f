"""Protobuf payloads: where each field lies, for `columns` (wire format of protobuf.dev)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import DecodeError

from roadlog.storage.encodings import Codec, Encoding, Layout, Value
from roadlog.storage.records import Damage, Schema

VARINT, FIXED64, LENGTH, FIXED32 = 0, 1, 2, 5  # wire types; groups (3, 4) have no layout
MAX_DEPTH = 16  # of nested messages whose fields become columns
MAX_ELEMENTS = 64  # of a repeated field that become columns
MAX_COLUMNS = 4096  # of one message; a schema with more is refused

# field type -> wire type and column dtype of what has a fixed width; the rest is below
_F = FieldDescriptor
SCALARS: dict[int, tuple[int, str]] = {
    _F.TYPE_DOUBLE: (FIXED64, "<f8"),
    _F.TYPE_FLOAT: (FIXED32, "<f4"),
    _F.TYPE_FIXED64: (FIXED64, "<u8"),
    _F.TYPE_SFIXED64: (FIXED64, "<i8"),
    _F.TYPE_FIXED32: (FIXED32, "<u4"),
    _F.TYPE_SFIXED32: (FIXED32, "<i4"),
    _F.TYPE_INT64: (VARINT, "<i8"),
    _F.TYPE_UINT64: (VARINT, "<u8"),
    _F.TYPE_SINT64: (VARINT, "<i8"),
    _F.TYPE_INT32: (VARINT, "<i4"),
    _F.TYPE_UINT32: (VARINT, "<u4"),
    _F.TYPE_SINT32: (VARINT, "<i4"),
    _F.TYPE_ENUM: (VARINT, "<i4"),
    _F.TYPE_BOOL: (VARINT, "?"),
}
ZIGZAG = (_F.TYPE_SINT32, _F.TYPE_SINT64)


class Unfit(Exception):
    """A payload that has no layout: broken, or with a group in it."""


@dataclass(frozen=True)
class _Field:
    """One field of a message on its path from the root.

    wire: expected wire type. dtype: of a number, None for everything else. oneof: its other
    members are cleared when this one is set.
    """

    path: str
    name: str
    wire: int
    dtype: np.dtype | None
    zigzag: bool
    is_repeated: bool
    has_presence: bool
    oneof: str
    children: Mapping[int, _Field] | None = None


@dataclass
class _Found:
    """What one payload holds: values by column, present messages, elements so far, and the mask."""

    mask: bytearray
    values: dict[str, Value] = dataclass_field(default_factory=dict)
    present: set[str] = dataclass_field(default_factory=lambda: {""})
    elements: dict[str, int] = dataclass_field(default_factory=dict)


class Protobuf(Codec):
    """Codec of a protobuf schema. Raises Damage when the schema cannot be used."""

    def __init__(self, schema: Schema) -> None:
        try:
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data).file
            pool = descriptor_pool.DescriptorPool()
            _add_files(pool, {file.name: file for file in files})
            self._descriptor = pool.FindMessageTypeByName(schema.name)
        except (DecodeError, TypeError, KeyError, ValueError) as error:
            raise Damage(f"its schema cannot be used: {str(error).strip()}") from error
        self.dtypes: dict[str, np.dtype] = {}
        self._presence: dict[str, tuple[str, bool]] = {}  # column -> message it is in, presence
        self._fields = self._tree(self._descriptor, "", ())

    def _tree(
        self, descriptor: Descriptor, parent: str, above: tuple[str, ...]
    ) -> dict[int, _Field]:
        result = {}
        for field in descriptor.fields:
            path = f"{parent}.{field.name}" if parent else field.name
            wire, code = SCALARS.get(field.type, (LENGTH, ""))
            dtype = np.dtype(code) if code else None
            children = None
            if field.message_type is not None and not field.is_repeated:
                name = field.message_type.full_name
                if field.type == _F.TYPE_MESSAGE and name not in above and len(above) < MAX_DEPTH:
                    children = self._tree(field.message_type, path, (*above, name))
            if dtype is not None and not field.is_repeated:
                self.dtypes[path] = np.dtype(np.float64) if dtype.kind == "f" else dtype
                self._presence[path] = parent, field.has_presence
            if len(self.dtypes) > MAX_COLUMNS:
                raise Damage(f"its schema has more than {MAX_COLUMNS} numbers")
            oneof = field.containing_oneof.name if field.containing_oneof is not None else ""
            result[field.number] = _Field(
                path, field.name, wire, dtype, field.type in ZIGZAG, field.is_repeated,
                field.has_presence, oneof, children,
            )  # fmt: skip
        return result

    def layout(self, payload: bytes) -> Layout | None:
        found = _Found(bytearray(len(payload)))
        try:
            self._parse(self._fields, payload, 0, len(payload), found)
        except (Unfit, IndexError):
            return None
        absent = {}
        for name, (parent, has_presence) in self._presence.items():
            if name not in found.values:
                is_default = parent in found.present and not has_presence
                absent[name] = 0.0 if is_default else np.nan
        return Layout(found.values, absent, bytes(found.mask))

    def _parse(
        self, fields: Mapping[int, _Field], data: bytes, position: int, end: int, found: _Found
    ) -> None:
        while position < end:
            tag, position = _fixed_varint(data, position, found.mask)
            wire = tag & 7
            field = fields.get(tag >> 3)
            start, size = position, 0
            if wire == VARINT:
                while data[position] & 0x80:
                    found.mask[position] = 0x80
                    position += 1
                found.mask[position] = 0x80
                position += 1
                size = position - start
                if size > 10:
                    raise Unfit
            elif wire == LENGTH:
                size, start = _fixed_varint(data, position, found.mask)
                position = start + size
            elif wire in (FIXED64, FIXED32):
                size = 8 if wire == FIXED64 else 4
                position += size
            else:
                raise Unfit
            if position > end or not tag >> 3:
                raise Unfit
            if field is not None:
                self._note(fields, field, wire, data, start, size, found)

    def _note(
        self, fields: Mapping[int, _Field], field: _Field, wire: int, data: bytes, start: int,
        size: int, found: _Found,
    ) -> None:  # fmt: skip
        """One occurrence of a field whose value lies at `start`."""
        if field.is_repeated:
            if field.dtype is not None and field.wire != VARINT and wire in (field.wire, LENGTH):
                self._elements(field, start, size, found)
            return
        if wire != field.wire:
            return  # as protobuf does: a field that it does not know
        if field.oneof:
            for other in fields.values():
                if other.oneof == field.oneof and other is not field:
                    _forget(other.path, found)
        if field.children is not None:
            found.present.add(field.path)
            self._parse(field.children, data, start, start + size, found)
        elif field.dtype is not None:
            varint = size if wire == VARINT else 0
            found.values[field.path] = Value(start, field.dtype, varint, field.zigzag)

    @staticmethod
    def _elements(field: _Field, start: int, size: int, found: _Found) -> None:
        assert field.dtype is not None
        if size % field.dtype.itemsize:
            raise Unfit
        for offset in range(start, start + size, field.dtype.itemsize):
            k = found.elements.get(field.path, 0)
            if k == MAX_ELEMENTS:
                return
            found.values[f"{field.path}.{k}"] = Value(offset, field.dtype)
            found.elements[field.path] = k + 1

    @cached_property
    def _class(self) -> Any:
        return message_factory.GetMessageClass(self._descriptor)

    def decode(self, payload: bytes) -> dict[str, Any]:
        try:
            message = self._class.FromString(payload)
        except DecodeError as error:
            raise ValueError(str(error)) from error
        return dict(_numbers(message, self._fields))


def _numbers(message: Any, fields: Mapping[int, _Field]) -> Iterator[tuple[str, Any]]:
    for field in fields.values():
        if field.is_repeated:
            if field.dtype is not None and field.wire != VARINT:
                values = getattr(message, field.name)[:MAX_ELEMENTS]
                yield from ((f"{field.path}.{k}", value) for k, value in enumerate(values))
        elif field.children is not None:
            if message.HasField(field.name):
                yield from _numbers(getattr(message, field.name), field.children)
        elif field.dtype is not None and not (
            field.has_presence and not message.HasField(field.name)
        ):
            yield field.path, getattr(message, field.name)


def _fixed_varint(data: bytes, position: int, mask: bytearray) -> tuple[int, int]:
    """A varint that must be the same in every message (a tag, a length), and what is behind it."""
    value = shift = 0
    while True:
        byte = data[position]
        mask[position] = 0xFF
        position += 1
        value |= (byte & 0x7F) << shift
        shift += 7
        if not byte & 0x80:
            return value, position
        if shift > 63:
            raise Unfit


def _forget(path: str, found: _Found) -> None:
    """A member of a oneof that another one replaced."""
    inside = path + "."
    for name in [n for n in found.values if n == path or n.startswith(inside)]:
        del found.values[name]
    for name in [n for n in found.elements if n.startswith(inside)]:
        del found.elements[name]
    found.present -= {n for n in found.present if n == path or n.startswith(inside)}


def _add_files(
    pool: descriptor_pool.DescriptorPool, files: Mapping[str, descriptor_pb2.FileDescriptorProto]
) -> None:
    """Add files after those that they import, in whatever order they come."""
    added: set[str] = set()

    def add(name: str, above: tuple[str, ...]) -> None:
        if name in added or name not in files or name in above:
            return
        for dependency in files[name].dependency:
            add(dependency, (*above, name))
        pool.Add(files[name])
        added.add(name)

    for name in files:
        add(name, ())


ENCODING = Encoding("protobuf", ("protobuf",), Protobuf)
