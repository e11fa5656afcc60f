"""Message encodings. To add one: a module with an `ENCODING`, and its line in `BUILT_IN`.

Plug-ins come through the entry points `roadlog.encodings`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import numpy as np

from roadlog import plugins
from roadlog.errors import MissingExtraError
from roadlog.storage.records import Damage, Schema

ENTRY_POINTS = "roadlog.encodings"

# message encoding -> the module of its ENCODING
BUILT_IN = {
    "protobuf": "protobuf",
    "cdr": "cdr",
    "ros1": "ros1",
    "json": "json_text",
    "flatbuffer": "flatbuffer",
    "cbor": "cbor",
}


@dataclass(frozen=True)
class Value:
    """Where a value lies in a payload.

    dtype: of the stored value. varint: its bytes, 0 for fixed width. zigzag: as in protobuf sint.
    """

    offset: int
    dtype: np.dtype
    varint: int = 0
    zigzag: bool = False


@dataclass(frozen=True)
class Layout:
    """What messages of one length have in common.

    values: column -> place. absent: columns whose value is not in the message -> their value (NaN
    or a default). mask: bytes of the payload that must be equal under it.
    """

    values: Mapping[str, Value]
    absent: Mapping[str, float]
    mask: bytes


class Codec(ABC):
    """Reads the payloads of one channel: `decode` is enough, `layout` makes it fast.

    dtypes: the columns that every message has, as far as the schema says so. units: of columns,
    as the schema states them.
    """

    dtypes: Mapping[str, np.dtype] = {}
    units: Mapping[str, str] = {}

    @abstractmethod
    def decode(self, payload: bytes) -> Mapping[str, Any]:
        """Column path (`twist.linear.x`, `cells.0`) -> number. Raises ValueError."""

    def layout(self, payload: bytes) -> Layout | None:
        """Where the numbers lie in payloads like this one; None to have each decoded."""
        del payload
        return None

    def unread(self, payload: bytes) -> frozenset[str]:
        """What has numbers that `decode` leaves out: fields, or the end of a list."""
        del payload
        return frozenset()

    def texts(self, payload: bytes) -> Mapping[str, str]:
        """Field path -> text, of fields that are no numbers. Raises ValueError."""
        del payload
        return {}


@dataclass(frozen=True)
class Encoding:
    """A message encoding as the MCAP registry names it.

    schemas: the schema encodings that say what its messages mean, "" for none. codec: of one
    schema; raises Damage where that cannot be used, MissingExtraError.
    """

    name: str
    schemas: tuple[str, ...]
    codec: Callable[[Schema], Codec]


def encoding_of(name: str) -> Encoding | None:
    """The encoding of that name; plug-ins are looked up for unknown names only."""
    if name in BUILT_IN:
        return import_module(f"roadlog.storage.{BUILT_IN[name]}").ENCODING
    return plugins.installed(ENTRY_POINTS, Encoding).get(name)


@lru_cache(maxsize=256)
def codec_of(encoding: str, schema: Schema) -> Codec:
    """The codec of a channel; it holds nothing of any message. Raises Damage."""
    found = encoding_of(encoding)
    if found is None or schema.encoding not in found.schemas:
        raise Damage(f"'{encoding}' with schema '{schema.encoding}' is not understood")
    try:
        return found.codec(schema)
    except Damage:
        raise
    except MissingExtraError as error:
        raise Damage(str(error)) from error
    except Exception as error:
        if encoding in BUILT_IN:
            raise
        raise Damage(f"plug-in {found.name}: {type(error).__name__}: {error}") from error
