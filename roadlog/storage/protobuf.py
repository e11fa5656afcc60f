"""Protobuf payloads: where each field lies, for `columns` (wire format of protobuf.dev)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from functools import cached_property
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

from roadlog.storage.encodings import Codec, Encoding, Layout, Value
from roadlog.storage.protobuf_fields import (
    FIXED32,
    FIXED64,
    LENGTH,
    VARINT,
    Field,
    Tree,
    add_files,
    implicit,
)
from roadlog.storage.records import Damage, Schema
from roadlog.storage.walk import NAMES

MAX_VARINT = 10  # bytes of 64 bits, seven each


class NoLayout(Exception):
    """A payload that has no layout: broken, or with a group in it."""


@dataclass
class _Found:
    """What one payload holds: values by column, present messages, elements so far, and the mask."""

    mask: bytearray
    values: dict[str, Value] = dataclass_field(default_factory=dict)
    present: set[str] = dataclass_field(default_factory=lambda: {""})
    elements: dict[str, int] = dataclass_field(default_factory=dict)
    zeros: set[str] = dataclass_field(default_factory=set)  # columns that elements may leave out
    labels: dict[str, str] = dataclass_field(default_factory=dict)  # of elements


class Protobuf(Codec):
    """Codec of a protobuf schema. Raises Damage when the schema cannot be used."""

    def __init__(self, schema: Schema) -> None:
        try:
            files = descriptor_pb2.FileDescriptorSet.FromString(schema.data).file
            pool = descriptor_pool.DescriptorPool()
            add_files(pool, {file.name: file for file in files})
            self._descriptor = pool.FindMessageTypeByName(schema.name)
        except (DecodeError, TypeError, KeyError, ValueError) as error:
            raise Damage(f"its schema cannot be used: {str(error).strip()}") from error
        tree = Tree(self._descriptor)
        self.dtypes, self._presence, self._fields = tree.dtypes, tree.presence, tree.fields

    def layout(self, payload: bytes) -> Layout | None:
        found = _Found(bytearray(len(payload)))
        try:
            self._parse(self._fields, payload, 0, len(payload), found)
        except (NoLayout, IndexError):
            return None
        absent = {}
        for name, (parent, has_presence) in self._presence.items():
            if name not in found.values:
                is_default = parent in found.present and not has_presence
                absent[name] = 0.0 if is_default else np.nan
        absent |= {name: 0.0 for name in found.zeros if name not in found.values}
        return Layout(found.values, absent, bytes(found.mask))

    def _parse(
        self, fields: Mapping[int, Field], data: bytes, position: int, end: int, found: _Found,
        prefix: str = "",
    ) -> None:  # fmt: skip
        """prefix: of the paths, in an element of a list."""
        while position < end:
            tag, position = _fixed_varint(data, position, found.mask)
            wire = tag & 7
            field = fields.get(tag >> 3)
            start, size = position, 0
            if wire == VARINT:
                position = _past_varint(data, position, found.mask)
                size = position - start
            elif wire == LENGTH:
                size, start = _fixed_varint(data, position, found.mask)
                position = start + size
            elif wire in (FIXED64, FIXED32):
                size = 8 if wire == FIXED64 else 4
                position += size
            else:
                raise NoLayout
            if position > end or not tag >> 3:
                raise NoLayout
            if field is not None:
                self._note(fields, field, wire, data, start, size, found, prefix)

    def _note(
        self, fields: Mapping[int, Field], field: Field, wire: int, data: bytes, start: int,
        size: int, found: _Found, prefix: str,
    ) -> None:  # fmt: skip
        """One occurrence of a field whose value lies at `start`."""
        path = prefix + field.path
        if field.is_repeated:
            if field.children is not None and wire == LENGTH:
                self._element(field, path, data, start, size, found)
            elif field.dtype is not None and wire in (field.wire, LENGTH):
                self._numbers(field, path, data, start, size, found)
            return
        if wire != field.wire:
            return  # as protobuf does: a field that it does not know
        if field.oneof:
            for other in fields.values():
                if other.oneof == field.oneof and other is not field:
                    _forget(prefix + other.path, found)
        if field.children is not None:
            found.present.add(path)
            self._parse(field.children, data, start, start + size, found, prefix)
        elif field.dtype is not None:
            varint = size if wire == VARINT else 0
            found.values[path] = Value(start, field.dtype, varint, field.zigzag)
        elif field.is_label:
            found.mask[start : start + size] = b"\xff" * size
            found.labels[path] = data[start : start + size].decode(errors="replace")

    def _element(
        self, field: Field, path: str, data: bytes, start: int, size: int, found: _Found
    ) -> None:
        """One message of a list: by its number and, where it has a name, by that too."""
        k = found.elements.get(path, 0)
        if field.children is None or k == field.limit:
            return
        found.elements[path] = k + 1
        prefix = f"{path}.{k}."
        self._parse(field.children, data, start, start + size, found, prefix)
        zeros = [
            name
            for parent, name in implicit(field.children)
            if not parent or prefix + parent in found.present
        ]
        found.zeros.update(prefix + name for name in zeros)
        inside = [key[len(prefix) :] for key in found.values if key.startswith(prefix)]
        for name in NAMES:
            alias = f"{path}[{name}={found.labels.get(prefix + name, '')}]"
            if alias in found.present or not found.labels.get(prefix + name):
                continue
            found.present.add(alias)
            found.values.update({f"{alias}.{key}": found.values[prefix + key] for key in inside})
            found.zeros.update(f"{alias}.{key}" for key in zeros)

    @staticmethod
    def _numbers(
        field: Field, path: str, data: bytes, start: int, size: int, found: _Found
    ) -> None:
        """Elements of a list of numbers, packed or one alone."""
        assert field.dtype is not None
        position, end = start, start + size
        while position < end:
            k = found.elements.get(path, 0)
            if k == field.limit:
                return
            first, varint = position, 0
            if field.wire == VARINT:
                position = _past_varint(data, position, found.mask)
                varint = position - first
            else:
                position += field.dtype.itemsize
            if position > end:
                raise NoLayout
            found.values[f"{path}.{k}"] = Value(first, field.dtype, varint, field.zigzag)
            found.elements[path] = k + 1

    @cached_property
    def _class(self) -> Any:
        return message_factory.GetMessageClass(self._descriptor)

    def decode(self, payload: bytes) -> dict[str, Any]:
        try:
            message = self._class.FromString(payload)
        except DecodeError as error:
            raise ValueError(str(error)) from error
        return dict(_numbers(message, self._fields))

    def unread(self, payload: bytes) -> frozenset[str]:
        try:
            return frozenset(_unread(self._class.FromString(payload), self._fields))
        except DecodeError:
            return frozenset()


def _numbers(
    message: Any, fields: Mapping[int, Field], prefix: str = ""
) -> Iterator[tuple[str, Any]]:
    for field in fields.values():
        path = prefix + field.path
        if field.is_repeated:
            values = getattr(message, field.name)[: field.limit]
            if field.children is not None:
                yield from _of_elements(values, field.children, path)
            elif field.dtype is not None:
                yield from ((f"{path}.{k}", value) for k, value in enumerate(values))
        elif field.children is not None:
            if message.HasField(field.name):
                yield from _numbers(getattr(message, field.name), field.children, prefix)
        elif field.dtype is not None and not (
            field.has_presence and not message.HasField(field.name)
        ):
            yield path, getattr(message, field.name)


def _of_elements(
    elements: Sequence[Any], fields: Mapping[int, Field], path: str
) -> Iterator[tuple[str, Any]]:
    """By number and by name; of elements with one name it is the first."""
    aliases: set[str] = set()
    for k, element in enumerate(elements):
        values = list(_numbers(element, fields))
        labels = [(f.name, getattr(element, f.name)) for f in fields.values() if f.is_label]
        names = {f"{path}[{name}={label}]" for name, label in labels if label} - aliases
        aliases |= names
        for owner in (f"{path}.{k}", *names):
            yield from ((f"{owner}.{key}", value) for key, value in values)


def _unread(message: Any, fields: Mapping[int, Field], prefix: str = "") -> Iterator[str]:
    """What of a message has numbers that are in no column; elements are not told apart."""
    for field in fields.values():
        path, values = prefix + field.path, getattr(message, field.name)
        if not field.is_repeated:
            if field.wire != LENGTH or not field.has_presence or not message.HasField(field.name):
                continue
            values = [values]
        if field.is_cut and len(values):
            yield path
        if (field.children or field.dtype) and len(values) > field.limit:
            yield f"{path} after the first {field.limit}"
        if field.children is not None:
            inside = f"{path}." if field.is_repeated else prefix
            for value in values[: field.limit]:
                yield from _unread(value, field.children, inside)


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
            raise NoLayout


def _past_varint(data: bytes, position: int, mask: bytearray) -> int:
    """What is behind a varint that must be as long, of any value, in every message."""
    start = position
    while data[position] & 0x80:
        mask[position] = 0x80
        position += 1
    mask[position] = 0x80
    if position - start >= MAX_VARINT:
        raise NoLayout
    return position + 1


def _forget(path: str, found: _Found) -> None:
    """A member of a oneof that another one replaced."""
    inside = path + "."
    for name in [n for n in found.values if n == path or n.startswith(inside)]:
        del found.values[name]
    for name in [n for n in found.elements if n.startswith(inside)]:
        del found.elements[name]
    for name in [n for n in found.labels if n == path or n.startswith(inside)]:
        del found.labels[name]
    found.present -= {n for n in found.present if n == path or n.startswith(inside)}
    found.zeros -= {n for n in found.zeros if n.startswith(inside)}


ENCODING = Encoding("protobuf", ("protobuf",), Protobuf)
