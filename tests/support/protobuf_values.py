"""What the reference libraries hold in a message, to compare with columns."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2

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


VARINTS = (
_F.TYPE_INT64, _F.TYPE_UINT64, _F.TYPE_INT32, _F.TYPE_UINT32, _F.TYPE_SINT32, _F.TYPE_SINT64,
    _F.TYPE_BOOL,
)  # fmt: skip


MAX_ELEMENTS = 64  # of a repeated field that become columns


def numbers(message: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """What the reference library says that a message holds; no entry where it has no value."""
    for field in message.DESCRIPTOR.fields:
        name, value = f"{path}{field.name}", getattr(message, field.name)
        is_number = field.message_type is None and not isinstance(value, str | bytes)
        if field.is_repeated:
            has_columns = field.type in NUMBERS and field.type not in VARINTS
            if has_columns:
                yield from ((f"{name}.{k}", v) for k, v in enumerate(value[:MAX_ELEMENTS]))
        elif field.message_type is not None:
            if message.HasField(field.name):
                yield from numbers(value, f"{name}.")
        elif is_number and (not field.has_presence or message.HasField(field.name)):
            yield name, value


def bits(values: Any) -> list[bytes]:
    """Of float64; one NaN is like another."""
    return [struct.pack("<d", np.nan if value != value else value) for value in values]
