"""Fields of a protobuf schema: which of them become columns, and what these are called."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool
from google.protobuf.descriptor import Descriptor, FieldDescriptor

from roadlog.storage.records import Damage
from roadlog.storage.walk import MAX_ELEMENTS, NAMES

VARINT, FIXED64, LENGTH, FIXED32 = 0, 1, 2, 5  # wire types; groups (3, 4) have no layout
MAX_DEPTH = 16  # of nested messages whose fields become columns
MAX_COLUMNS = 4096  # of one message; a schema with more is refused, a list of messages cut

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


@dataclass(frozen=True)
class Field:
    """One field of a message on its path from the root, or from the element of a list it is in.

    wire: expected wire type. dtype: of a number, None for everything else. oneof: its other
    members are cleared when this one is set. limit: elements that become columns. is_label: names
    the element. is_cut: a message with numbers that become no columns.
    """

    path: str
    name: str
    wire: int
    dtype: np.dtype | None
    zigzag: bool
    is_repeated: bool
    has_presence: bool
    oneof: str
    children: Mapping[int, Field] | None
    limit: int
    is_label: bool
    is_cut: bool


@dataclass
class Tree:
    """The fields of a message and of those in it.

    dtypes: of the columns that every message has. presence: of such a column, the message that it
    is in and whether it can be left out. listed: fields of messages that are in lists, so far.
    Raises Damage for a schema with too many numbers.
    """

    root: Descriptor
    dtypes: dict[str, np.dtype] = dataclass_field(default_factory=dict)
    presence: dict[str, tuple[str, bool]] = dataclass_field(default_factory=dict)
    listed: int = 0

    def __post_init__(self) -> None:
        self.fields = self._tree(self.root, "", ())

    def _tree(
        self, descriptor: Descriptor, parent: str, above: tuple[str, ...], in_list: bool = False
    ) -> dict[int, Field]:
        result = {}
        for member in descriptor.fields:
            path = f"{parent}.{member.name}" if parent else member.name
            wire, code = SCALARS.get(member.type, (LENGTH, ""))
            dtype = np.dtype(code) if code else None
            self.listed += in_list
            children = self._children(member, path, above, in_list)
            if dtype is not None and not member.is_repeated and not in_list:
                self.dtypes[path] = np.dtype(np.float64) if dtype.kind == "f" else dtype
                self.presence[path] = parent, member.has_presence
            if len(self.dtypes) > MAX_COLUMNS:
                raise Damage(f"its schema has more than {MAX_COLUMNS} numbers")
            oneof = member.containing_oneof.name if member.containing_oneof is not None else ""
            room = MAX_COLUMNS // max(_count(children or {}), 1)
            is_label = in_list and path in NAMES and member.type == _F.TYPE_STRING
            is_cut = children is None and _holds_numbers(member.message_type, set())
            result[member.number] = Field(
                path, member.name, wire, dtype, member.type in ZIGZAG, member.is_repeated,
                member.has_presence, oneof, children, min(MAX_ELEMENTS, room), is_label, is_cut,
            )  # fmt: skip
        return result

    def _children(
        self, field: FieldDescriptor, path: str, above: tuple[str, ...], in_list: bool
    ) -> dict[int, Field] | None:
        """The fields of a message whose numbers become columns."""
        if field.type != _F.TYPE_MESSAGE or field.message_type.full_name in above:
            return None
        listed = in_list or field.is_repeated
        is_inner_list = in_list and field.is_repeated  # a list for each element of another
        if len(above) >= MAX_DEPTH or is_inner_list or (listed and self.listed >= MAX_COLUMNS):
            return None
        above = (*above, field.message_type.full_name)
        return self._tree(field.message_type, "" if field.is_repeated else path, above, listed)


def implicit(fields: Mapping[int, Field]) -> Iterator[tuple[str, str]]:
    """Message and path of the numbers that are zero where it leaves them out."""
    for field in fields.values():
        if field.is_repeated:
            continue
        if field.children is not None:
            yield from implicit(field.children)
        elif field.dtype is not None and not field.has_presence:
            yield field.path.rpartition(".")[0], field.path


def _count(fields: Mapping[int, Field]) -> int:
    """Numbers in a message; a list of them is one."""
    return sum((f.dtype is not None) + _count(f.children or {}) for f in fields.values())


def _holds_numbers(descriptor: Descriptor | None, seen: set[str]) -> bool:
    if descriptor is None or descriptor.full_name in seen:
        return False
    seen.add(descriptor.full_name)
    return any(f.type in SCALARS or _holds_numbers(f.message_type, seen) for f in descriptor.fields)


def add_files(
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
