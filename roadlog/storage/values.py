"""Objects as JSON, CBOR and MessagePack give them: their numbers and texts by path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from roadlog.storage.walk import MAX_DEPTH, MAX_ELEMENTS, NAME_LISTS, NAMES


def numbers(value: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Path (`twist.linear.x`, `velocity.0`, `velocity[name=fl]`) -> number, one after another."""
    if isinstance(value, (bool, int, float)):
        yield path, value
    if depth >= MAX_DEPTH:
        return
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from numbers(inner, f"{path}.{key}" if path else str(key), depth + 1)
        yield from _by_names(value, path)
    elif isinstance(value, (list, tuple)):
        for k, inner in enumerate(value[:MAX_ELEMENTS]):
            yield from numbers(inner, f"{path}.{k}" if path else str(k), depth + 1)
            for name in NAMES:
                label = inner.get(name) if isinstance(inner, Mapping) else None
                if isinstance(label, str):
                    yield from numbers(inner, f"{path}[{name}={label}]", depth + 1)


def unread(value: Any, path: str = "", depth: int = 0) -> Iterator[str]:
    """What has numbers that `numbers` leaves out; elements of a list are not told apart."""
    if depth >= MAX_DEPTH:
        if isinstance(value, (Mapping, list, tuple)) and value:
            yield f"{path}, which nests too deep"
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from unread(inner, f"{path}.{key}" if path else str(key), depth + 1)
    elif isinstance(value, (list, tuple)):
        rest = [one for inner in value[MAX_ELEMENTS:] for one in numbers(inner, path, depth + 1)]
        if rest:
            yield f"{path} after the first {MAX_ELEMENTS}"
        for inner in value[:MAX_ELEMENTS]:
            yield from unread(inner, path, depth + 1)


def texts(value: Any, path: str = "", depth: int = 0) -> Iterator[tuple[str, str]]:
    """Path -> text of what is in no list."""
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, Mapping) and depth < MAX_DEPTH:
        for key, inner in value.items():
            yield from texts(inner, f"{path}.{key}" if path else str(key), depth + 1)


def _by_names(value: Mapping[Any, Any], path: str) -> Iterator[tuple[str, float]]:
    """Elements of a list of numbers by those of a list of texts beside it."""
    lists = {key: inner for key, inner in value.items() if isinstance(inner, (list, tuple))}
    before = f"{path}." if path else ""
    for name in lists.keys() & set(NAME_LISTS):
        labels = lists[name]
        if not labels or len(labels) > MAX_ELEMENTS or not all(isinstance(x, str) for x in labels):
            continue
        for key, inner in lists.items():
            if len(inner) == len(labels):
                for label, number in zip(labels, inner, strict=True):
                    if isinstance(number, (bool, int, float)):
                        yield f"{before}{key}[{name}={label}]", number
