"""Columns to ROS 2 messages (CDR): for results that go into a bag, so that it stays one.

A message type of roadlog is a ROS 2 type of the same name and fields in the package `roadlog_msgs`,
behind a std_msgs/Header; types of `STANDARD` are those of ROS. The definition stands in the file.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from roadlog import field_units
from roadlog.signals import FLAGS
from roadlog.storage import definitions, records, schemas
from roadlog.storage.definitions import PRIMITIVES, Types
from roadlog.storage.messages import HEAD, Wire
from roadlog.storage.protobuf_fields import SCALARS
from roadlog.storage.records import Schema
from roadlog.storage.table import Table

PACKAGE = "roadlog_msgs"
FRAME = "base_link"
NS = 10**9
_TYPES = {
    "f8": "float64", "f4": "float32", "u4": "uint32", "i4": "int32", "u8": "uint64",
    "i8": "int64", "b1": "bool",
}  # fmt: skip
_LINE = "=" * 80
_HEADER = f"""{_LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
STANDARD = {
    "std_msgs/msg/Float64": "float64 data\n",
    "geometry_msgs/msg/TransformStamped": f"""std_msgs/Header header
string child_frame_id
Transform transform
{_LINE}
MSG: geometry_msgs/Transform
Vector3 translation
Quaternion rotation
{_LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{_LINE}
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
{_HEADER}""",
}


def type_name(schema: str) -> str:
    """`roadlog_msgs/msg/RoadAngles` of `roadlog.v1.RoadAngles`; a type of ROS as it is."""
    return schema if schema in STANDARD else f"{PACKAGE}/msg/{schema.rpartition('.')[2]}"


def definition(table: Table) -> str:
    """The ROS 2 message definition of a table, with those it uses."""
    if table.schema in STANDARD:
        return STANDARD[table.schema]
    units = field_units.units(table.schema)
    lines = [f"# {table.schema}; NaN where a value is unknown", "std_msgs/Header header"]
    for field in schemas.descriptor(table.schema).fields:
        code = SCALARS.get(field.type, (0, ""))[1]
        inside = [name for name in table.columns if name.startswith(f"{field.name}.")]
        if not code or (field.is_repeated and not inside):
            continue
        array = f"[{len(inside)}]" if field.is_repeated else ""
        if field.name == "flags":  # viewers show a value that is a constant before it by its name
            lines += [f"uint32 {name.upper()}={bit}" for name, bit in FLAGS.items()]
        unit = f"  # {units[field.name]}" if field.name in units else ""
        lines.append(f"{_TYPES[np.dtype(code).str[1:]]}{array} {field.name}{unit}")
    return "\n".join(lines) + "\n" + _HEADER


class Ros2Wire(Wire):
    """How the messages of one table look as CDR: all equally long, little-endian.

    Floating-point fields that the table does not know are NaN, other unknown ones 0. Texts that it
    does not give are empty, the frame of a header is `FRAME`.
    """

    def __init__(self, table: Table, channel: int) -> None:
        self.time = table.time
        schema = Schema(0, type_name(table.schema), "ros2msg", definition(table).encode())
        types = definitions.of_ros(schema)
        parts = list(_parts(types, types.root, "", table))
        template = np.zeros(1, np.dtype([*HEAD, *_aligned(parts)]))
        template["opcode"] = records.MESSAGE
        template["length"] = template.itemsize - records.PREFIX.size
        template["channel"] = channel
        template["encapsulation"] = np.void(b"\0\1\0\0")
        columns = {
            "header.stamp.sec": table.time // NS,
            "header.stamp.nanosec": table.time % NS,
            **table.columns,
        }
        self._values: dict[str, NDArray] = {}
        for name, value in parts:
            if isinstance(value, bytes):
                template[name] = np.void(value)
            elif isinstance(value, int):
                template[name] = value
            elif value.shape:
                inside = [np.asarray(columns[f"{name}.{k}"]) for k in range(value.shape[0])]
                self._values[name] = np.stack(inside, axis=1)
            elif name in columns:
                self._values[name] = np.asarray(columns[name])
            elif value.kind == "f":
                template[name] = np.nan
        self.size = template.itemsize
        self._records = template


_Part = tuple[str, np.dtype | bytes | int]  # path, and a number's type, a text or its length


def _parts(types: Types, type_: str, parent: str, table: Table) -> Iterator[_Part]:
    """All that is in a payload, in its order."""
    for member in types.structs[type_].members:
        path = f"{parent}{member.name}"
        if member.type in types.structs:
            yield from _parts(types, member.type, f"{path}.", table)
        elif member.type in PRIMITIVES:
            shape = () if member.count is None else (member.count,)
            yield path, np.dtype((np.dtype(PRIMITIVES[member.type]).newbyteorder("<"), shape))
        else:
            text = table.texts.get(path, FRAME if path == "header.frame_id" else "")
            yield f"{path} size", len(text.encode()) + 1
            yield path, text.encode() + b"\0"


def _aligned(parts: list[_Part]) -> list[tuple]:
    """The fields of a structured type, with what stands between for alignment."""
    found: list[tuple] = [("encapsulation", "V4")]
    offset = 0
    for name, value in parts:
        if isinstance(value, bytes):
            found.append((name, f"V{len(value)}"))
            offset += len(value)
            continue
        dtype = np.dtype("<u4") if isinstance(value, int) else value
        if gap := -offset % dtype.base.itemsize:
            found.append((f"before {name}", f"V{gap}"))
        found.append((name, dtype))
        offset += gap + dtype.itemsize
    return found
