"""Columns to ROS 2 messages (CDR): for results that go into a bag, so that it stays one.

Each message type of roadlog is a ROS 2 type of the same name and fields in the package
`roadlog_msgs`, behind a std_msgs/Header; its definition stands in the file.
"""

from __future__ import annotations

import numpy as np

from roadlog.storage import records, schemas
from roadlog.storage.messages import HEAD, Wire
from roadlog.storage.protobuf import SCALARS
from roadlog.storage.table import Table

PACKAGE = "roadlog_msgs"
FRAME = "base_link"
NS = 10**9
_TYPES = {
    "f8": "float64", "f4": "float32", "u4": "uint32", "i4": "int32", "u8": "uint64",
    "i8": "int64", "b1": "bool",
}  # fmt: skip
_HEADER = f"""{"=" * 80}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{"=" * 80}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def type_name(schema: str) -> str:
    """`roadlog_msgs/msg/RoadAngles` of `roadlog.v1.RoadAngles`."""
    return f"{PACKAGE}/msg/{schema.rpartition('.')[2]}"


def definition(table: Table) -> str:
    """The ROS 2 message definition of a table, with those it uses."""
    units = schemas.units(table.schema)
    lines = [f"# {table.schema}; NaN where a value is unknown", "std_msgs/Header header"]
    for name, dtype, count in _fields(table):
        array = "" if count is None else f"[{count}]"
        unit = f"  # {units[name]}" if name in units else ""
        lines.append(f"{_TYPES[dtype.str[1:]]}{array} {name}{unit}")
    return "\n".join(lines) + "\n" + _HEADER


def _fields(table: Table) -> list[tuple[str, np.dtype, int | None]]:
    """Name, type and count of elements of each field that the table fills."""
    found: list[tuple[str, np.dtype, int | None]] = []
    for field in schemas.descriptor(table.schema).fields:
        code = SCALARS.get(field.type, (0, ""))[1]
        inside = [name for name in table.columns if name.startswith(f"{field.name}.")]
        if not code:
            continue
        dtype = np.dtype(code)
        if field.is_repeated and inside:
            found.append((field.name, dtype, len(inside)))
        elif not field.is_repeated:
            found.append((field.name, dtype, None))
    return found


class Ros2Wire(Wire):
    """How the messages of one table look as CDR: all equally long, little-endian."""

    def __init__(self, table: Table, channel: int) -> None:
        self.time = table.time
        template = np.zeros(1, np.dtype([*HEAD, *_payload(table)]))
        template["opcode"] = records.MESSAGE
        template["length"] = template.itemsize - records.PREFIX.size
        template["channel"] = channel
        template["encapsulation"] = np.void(b"\0\1\0\0")
        template["frame_size"] = len(FRAME) + 1
        template["frame"] = np.void(FRAME.encode() + b"\0")
        self._values = {"sec": (table.time // NS).astype("<i4"), "nanosec": table.time % NS}
        for name, dtype, count in _fields(table):
            if count is not None:
                columns = [np.asarray(table.columns[f"{name}.{k}"]) for k in range(count)]
                self._values[name] = np.stack(columns, axis=1)
            elif name in table.columns:
                self._values[name] = np.asarray(table.columns[name])
            elif dtype.kind == "f":
                template[name] = np.nan
        self.size = template.itemsize
        self._records = template


def _payload(table: Table) -> list[tuple]:
    """Name and type of all that is in a payload, with what stands between for alignment."""
    frame = len(FRAME) + 1
    found: list[tuple] = [
        ("encapsulation", "V4"), ("sec", "<i4"), ("nanosec", "<u4"), ("frame_size", "<u4"),
        ("frame", f"V{frame}"),
    ]  # fmt: skip
    offset = 12 + frame
    for name, dtype, count in _fields(table):
        if gap := -offset % dtype.itemsize:
            found.append((f"before_{name}", f"V{gap}"))
        found.append((name, dtype) if count is None else (name, dtype, (count,)))
        offset += gap + dtype.itemsize * (count or 1)
    return found
