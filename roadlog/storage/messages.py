"""Columns to protobuf messages: one structured array whose rows are whole message records.

Every message of a channel gets the same bytes but for the values: numbers of fixed width, varints
padded to their full length (legal protobuf), one layout for all.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from numpy.typing import NDArray

from roadlog.errors import ConfigError, near
from roadlog.spool import release
from roadlog.storage import records, schemas
from roadlog.storage.protobuf_fields import LENGTH, SCALARS, VARINT, ZIGZAG
from roadlog.storage.table import Table

HEAD = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]


class Wire:
    """How the messages of one table look as bytes. Raises ConfigError where a column cannot be.

    Floating-point fields with explicit presence that the table does not know are NaN, other
    unknown fields are left out.
    """

    def __init__(self, table: Table, channel: int) -> None:
        self.time = table.time
        parts = list(_parts(schemas.descriptor(table.schema), "", table))
        used = {name for name, _, _ in parts}
        for name in table.columns:
            if name not in used:
                raise ConfigError(
                    f"{table.topic}: {table.schema} has no number '{name}'. "
                    f"{near(name, schemas.columns(table.schema))}"
                )
        fields: list[tuple] = list(HEAD)
        for k, (_, prefix, values) in enumerate(parts):
            fields.append((f"tag{k}", f"V{len(prefix)}"))
            if values is not None:
                fields.append((f"value{k}", values.dtype, values.shape[1:]))
        template = np.zeros(1, np.dtype(fields))
        template["opcode"] = records.MESSAGE
        template["length"] = template.itemsize - records.PREFIX.size
        template["channel"] = channel
        self._values: dict[str, NDArray] = {}
        for k, (name, prefix, values) in enumerate(parts):
            template[f"tag{k}"] = np.void(prefix)
            if values is not None and len(values) == len(table) and name in table.columns:
                self._values[f"value{k}"] = values
            elif values is not None:
                template[f"value{k}"] = values
        self.size = template.itemsize  # bytes of one message record
        self._records = template

    def rows(self, rows: slice) -> NDArray:
        """The message records of these rows of the table, until the next call."""
        time = self.time[rows]
        if len(time) > len(self._records):
            self._records = np.repeat(self._records[:1], len(time))
        result = self._records[: len(time)]
        result["sequence"] = np.arange(rows.start, rows.start + len(time))
        result["log_time"] = time
        result["publish_time"] = time
        for name, values in self._values.items():
            result[name] = values[rows]
        release([self.time, *self._values.values()])
        return result


_Part = tuple[str, bytes, NDArray | None]  # column, bytes before its value, all values


def _parts(descriptor: Descriptor, parent: str, table: Table) -> Iterator[_Part]:
    for field in sorted(descriptor.fields, key=lambda field: field.number):
        path = f"{parent}{field.name}"
        wire, code = SCALARS.get(field.type, (LENGTH, ""))
        inside = [name for name in table.columns if name.startswith(f"{path}.")]
        if field.is_repeated:
            yield from _elements(field, path, inside, table)
        elif field.message_type is not None:
            if inside:
                parts = list(_parts(field.message_type, f"{path}.", table))
                yield path, _tag(field, LENGTH) + _varint(sum(map(_length, parts))), None
                yield from parts
        elif path in table.texts and field.type == FieldDescriptor.TYPE_STRING:
            text = table.texts[path].encode()
            yield path, _tag(field, LENGTH) + _varint(len(text)) + text, None
        elif path in table.columns and code:
            yield path, _tag(field, wire), _values(field, path, table)
        elif np.dtype(code or "V").kind == "f" and field.has_presence:
            yield path, _tag(field, wire), np.full(1, np.nan, code)


def _elements(
    field: FieldDescriptor, path: str, inside: list[str], table: Table
) -> Iterator[_Part]:
    """A packed repeated field of fixed width, from the columns `path.0`, `path.1`, ..."""
    wire, code = SCALARS.get(field.type, (LENGTH, ""))
    if not inside or wire in (LENGTH, VARINT):
        return
    size = len(inside) * np.dtype(code).itemsize
    yield path, _tag(field, LENGTH) + _varint(size), None
    for k in range(len(inside)):
        name = f"{path}.{k}"
        if name not in table.columns:
            raise ConfigError(f"{table.topic}: '{name}' is missing, but {inside[-1]} is there")
        yield name, b"", np.asarray(table.columns[name], code)


def _length(part: _Part) -> int:
    _, prefix, values = part
    return len(prefix) + (0 if values is None else values[:1].nbytes)


def _values(field: FieldDescriptor, name: str, table: Table) -> NDArray:
    """A column in the type of its field; varints as rows of bytes."""
    wire, code = SCALARS[field.type]
    dtype = np.dtype(code)
    given = np.asarray(table.columns[name])
    values = given.astype(dtype, copy=False)
    if dtype.kind != "f" and not np.array_equal(values, given):
        raise ConfigError(f"{table.topic}.{name}: a value is not {dtype.name}")
    if wire != VARINT:
        return values
    if dtype.kind == "b":
        return values.view(np.uint8)
    if field.type == FieldDescriptor.TYPE_ENUM and (values & 0x7F == values).all():
        return values.astype(np.uint8)
    wide = values.astype(np.int64).view(np.uint64)
    if field.type in ZIGZAG:
        signed = values.astype(np.int64)
        wide = ((signed << 1) ^ (signed >> 63)).view(np.uint64)
    is_short = dtype.itemsize == 4 and (dtype.kind == "u" or field.type in ZIGZAG)
    return _padded(wide, 5 if is_short else 10)


def _padded(values: NDArray[np.uint64], width: int) -> NDArray[np.uint8]:
    """Varints of one length: (n, width) bytes, the continuation bit set in all but the last."""
    shifts = np.arange(0, 7 * width, 7, dtype=np.uint64)
    result = ((values[:, None] >> shifts) & np.uint64(0x7F)).astype(np.uint8)
    result[:, :-1] |= 0x80
    return result


def _tag(field: FieldDescriptor, wire: int) -> bytes:
    return _varint(field.number << 3 | wire)


def _varint(value: int) -> bytes:
    result = bytearray()
    while value > 0x7F:
        result.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*result, value])
