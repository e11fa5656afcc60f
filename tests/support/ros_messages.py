"""Messages of ROS with random values, and MCAP files of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)
START = 1_700_000_000_000_000_000


def random_message(store: Any, name: str, rng: np.random.Generator) -> Any:
    """One message of a type, its strings and sequences of random length."""
    if name.startswith("builtin_interfaces/"):  # libraries differ in the sign of seconds
        return store.types[name](sec=int(rng.integers(2**31)), nanosec=int(rng.integers(10**9)))
    values = {}
    for field, description in store.get_msgdef(name).fields:
        values[field] = _value(store, description, rng)
    return store.types[name](**values)


def _value(store: Any, description: Any, rng: np.random.Generator) -> Any:
    node, what = description
    if node == Nodetype.BASE:
        return _base(what[0], rng)
    if node == Nodetype.NAME:
        return random_message(store, what, rng)
    inner, size = what
    count = size if node == Nodetype.ARRAY else int(rng.integers(0, 4))
    values = [_value(store, inner, rng) for _ in range(count)]
    if inner[0] == Nodetype.BASE and inner[1][0] != "string":
        return np.array(values, _dtype(inner[1][0]))
    return values


def _dtype(base: str) -> np.dtype:
    octets = {"bool": np.bool_, "byte": np.uint8, "char": np.uint8, "octet": np.uint8}
    return np.dtype(octets.get(base, base))


def _base(base: str, rng: np.random.Generator) -> Any:
    if base == "string":
        return "x" * int(rng.integers(0, 6))
    if base == "byte":  # rosbags writes it signed for ROS 1
        return int(rng.integers(128))
    dtype = _dtype(base)
    if dtype.kind == "f":
        return float(dtype.type(rng.normal()))
    if dtype.kind == "b":
        return bool(rng.integers(2))
    limits = np.iinfo(dtype)
    return int(rng.integers(limits.min, limits.max, dtype=dtype, endpoint=True))


def write_mcap(
    path: Path, encoding: str, schema: tuple[str, str, bytes], payloads: Iterable[bytes]
) -> Path:
    """One topic, /x, a message a millisecond. schema: name, encoding, data."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        name, kind, data = schema
        number = writer.register_schema(name, kind, data) if kind else 0
        channel = writer.register_channel("/x", encoding, number)
        for k, payload in enumerate(payloads):
            writer.add_message(channel, START + k * 10**6, bytes(payload), START + k * 10**6)
        writer.finish()
    return path


def leaves(value: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Path -> number of a decoded message, as columns are named (time of ROS 1 as of ROS 2)."""
    if isinstance(value, (bool, int, float, np.number, np.bool_)):
        yield path, value
    elif isinstance(value, (bytes, bytearray, list, tuple, np.ndarray)):
        for k, inner in enumerate(list(value)[:64]):
            yield from leaves(inner, f"{path}.{k}")
    elif not isinstance(value, str) and value is not None:
        names = getattr(value, "__slots__", None) or list(getattr(value, "__dict__", {}))
        for name in names:
            if name.startswith(("_", "structure_needs")) or (name.isupper() and len(name) > 1):
                continue  # a constant, or what ROS 2 puts into empty messages
            own = {"secs": "sec", "nsecs": "nanosec", "nsec": "nanosec"}.get(name, name)
            inner = getattr(value, name)
            yield from leaves(inner, f"{path}.{own}" if path else own)
