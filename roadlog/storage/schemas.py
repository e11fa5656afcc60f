"""The message types that ship with roadlog, out of the descriptor set compiled from schemas/."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool
from google.protobuf.descriptor import Descriptor, FieldDescriptor

from roadlog.errors import RoadlogError, near

# protobuf field type -> column dtype; nothing else appears in our schemas
DTYPES: dict[int, np.dtype] = {
    FieldDescriptor.TYPE_DOUBLE: np.dtype("<f8"),
    FieldDescriptor.TYPE_FLOAT: np.dtype("<f4"),
    FieldDescriptor.TYPE_FIXED32: np.dtype("<u4"),
    FieldDescriptor.TYPE_SFIXED32: np.dtype("<i4"),
    FieldDescriptor.TYPE_FIXED64: np.dtype("<u8"),
    FieldDescriptor.TYPE_SFIXED64: np.dtype("<i8"),
    FieldDescriptor.TYPE_BOOL: np.dtype("?"),
    FieldDescriptor.TYPE_ENUM: np.dtype("<i4"),
}


@cache
def shipped() -> descriptor_pb2.FileDescriptorSet:
    """Every schema of roadlog with its imports and comments."""
    data = files("roadlog").joinpath("schemas.binpb").read_bytes()
    return descriptor_pb2.FileDescriptorSet.FromString(data)


@cache
def pool() -> descriptor_pool.DescriptorPool:
    """A pool that holds the shipped schemas."""
    result = descriptor_pool.DescriptorPool()
    for file in shipped().file:
        result.Add(file)
    return result


@cache
def names() -> frozenset[str]:
    """Full names of the shipped top-level messages."""
    return frozenset(f"{f.package}.{m.name}" for f in shipped().file for m in f.message_type)


@cache
def descriptor(schema: str) -> Descriptor:
    """Descriptor of one shipped message; RoadlogError with near names for an unknown one."""
    if schema not in names():
        raise RoadlogError(f"no shipped schema '{schema}'. {near(schema, names())}")
    return pool().FindMessageTypeByName(schema)


@cache
def descriptor_set(schema: str) -> bytes:
    """Serialized FileDescriptorSet with only what one message needs: what an MCAP schema holds."""
    by_name = {file.name: file for file in shipped().file}
    wanted: dict[str, descriptor_pb2.FileDescriptorProto] = {}

    def add(name: str) -> None:
        for dependency in by_name[name].dependency:
            add(dependency)
        wanted.setdefault(name, by_name[name])

    add(descriptor(schema).file.name)
    return descriptor_pb2.FileDescriptorSet(file=wanted.values()).SerializeToString()


@cache
def columns(schema: str) -> dict[str, np.dtype]:
    """Field name -> dtype of one flat shipped message."""
    fields = descriptor(schema).fields
    return {field.name: DTYPES[field.type] for field in fields if field.type in DTYPES}
