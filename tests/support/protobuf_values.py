"""What the reference libraries hold in a message, to compare with columns."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2

_F = descriptor_pb2.FieldDescriptorProto


NUMBERS = {  # type -> range of its values, None for floating point
    _F.TYPE_DOUBLE: None,
    _F.TYPE_FLOAT: None,
    _F.TYPE_INT64: (-(2**63), 2**63 - 1),
    _F.TYPE_UINT64: (0, 2**64 - 1),
    _F.TYPE_INT32: (-(2**31), 2**31 - 1),
    _F.TYPE_FIXED64: (0, 2**64 - 1),
    _F.TYPE_FIXED32: (0, 2**32 - 1),
    _F.TYPE_BOOL: (0, 1),
    _F.TYPE_UINT32: (0, 2**32 - 1),
    _F.TYPE_SFIXED32: (-(2**31), 2**31 - 1),
    _F.TYPE_SFIXED64: (-(2**63), 2**63 - 1),
    _F.TYPE_SINT32: (-(2**31), 2**31 - 1),
    _F.TYPE_SINT64: (-(2**63), 2**63 - 1),
}


MAX_ELEMENTS = 64  # of a repeated field that become columns


def numbers(message: Any, path: str = "", in_list: bool = False) -> Iterator[tuple[str, Any]]:
    """What the reference library says that a message holds; no entry where it has no value."""
    for field in message.DESCRIPTOR.fields:
        name, value = f"{path}{field.name}", getattr(message, field.name)
        is_number = field.message_type is None and not isinstance(value, str | bytes)
        if field.is_repeated and field.message_type is not None:
            labels: set[str] = set()
            for k, element in enumerate([] if in_list else value[:MAX_ELEMENTS]):
                yield from numbers(element, f"{name}.{k}.", in_list=True)
                label = getattr(element, "name", None)
                if isinstance(label, str) and label and label not in labels:
                    labels.add(label)
                    yield from numbers(element, f"{name}[name={label}].", in_list=True)
        elif field.is_repeated:
            if field.type in NUMBERS or field.type == _F.TYPE_ENUM:
                yield from ((f"{name}.{k}", v) for k, v in enumerate(value[:MAX_ELEMENTS]))
        elif field.message_type is not None:
            if message.HasField(field.name):
                yield from numbers(value, f"{name}.", in_list)
        elif is_number and (not field.has_presence or message.HasField(field.name)):
            yield name, value


def bits(values: Any) -> list[bytes]:
    """Of float64; one NaN is like another."""
    return [struct.pack("<d", np.nan if value != value else value) for value in values]


def message_class(types: Mapping[str, str], name: str, package: str = "t") -> Any:
    """A class of one of these messages, `optional double x, repeated Part parts, oneof bool a`.

    Fields are numbered from 1; all of a `oneof` are members of one.
    """
    file = descriptor_pb2.FileDescriptorProto(name=f"{package}.proto", package=package)
    file.syntax = "proto3"
    file.dependency.append(timestamp_pb2.DESCRIPTOR.name)
    for own, text in types.items():
        message = file.message_type.add(name=own)
        optional = []
        for number, words in enumerate((part.split() for part in text.split(",")), 1):
            *how, kind, field_name = words
            field = message.field.add(name=field_name, number=number, label=_F.LABEL_OPTIONAL)
            if scalar := getattr(_F, f"TYPE_{kind.upper()}", None):
                field.type = scalar
            else:
                field.type = _F.TYPE_MESSAGE
                field.type_name = f".{kind}" if "." in kind else f".{package}.{kind}"
            if how == ["repeated"]:
                field.label = _F.LABEL_REPEATED
            elif how == ["oneof"]:
                if not message.oneof_decl:
                    message.oneof_decl.add(name="choice")
                field.oneof_index = 0
            elif how == ["optional"]:
                field.proto3_optional = True
                optional.append(field)
        for field in optional:  # after the real ones, as protoc puts them
            field.oneof_index = len(message.oneof_decl)
            message.oneof_decl.add(name=f"_{field.name}")
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{package}.{name}"))
