"""JSON payloads, message by message: text has no layout."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from roadlog.storage.encodings import Codec, Encoding
from roadlog.storage.records import Schema

MAX_ELEMENTS = 64  # of an array that become columns
MAX_DEPTH = 16  # of nested objects


class Json(Codec):
    """Codec of JSON objects, with any schema or none."""

    def __init__(self, schema: Schema | None) -> None:
        del schema

    def decode(self, payload: bytes) -> dict[str, Any]:
        try:
            value = json.loads(payload)
        except RecursionError as error:
            raise ValueError("nested too deep") from error
        if not isinstance(value, dict):
            raise ValueError("no object")
        return dict(_numbers(value, "", 0))


def _numbers(value: Any, path: str, depth: int) -> Iterator[tuple[str, float]]:
    if isinstance(value, (bool, int, float)):
        yield path, value
    elif isinstance(value, (dict, list)) and depth < MAX_DEPTH:
        items = value.items() if isinstance(value, dict) else enumerate(value[:MAX_ELEMENTS])
        for key, inner in items:
            yield from _numbers(inner, f"{path}.{key}" if path else str(key), depth + 1)


ENCODING = Encoding("json", ("jsonschema", ""), Json)
