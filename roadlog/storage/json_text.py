"""JSON payloads, message by message: text has no layout."""

from __future__ import annotations

import json
from typing import Any

from roadlog.storage import values
from roadlog.storage.encodings import Codec, Encoding
from roadlog.storage.records import Schema
from roadlog.storage.walk import MAX_DEPTH, MAX_ELEMENTS


class Json(Codec):
    """Codec of JSON objects, with any schema or none."""

    def __init__(self, schema: Schema) -> None:
        del schema

    def decode(self, payload: bytes) -> dict[str, Any]:
        return dict(values.numbers(self._loaded(payload)))

    def unread(self, payload: bytes) -> frozenset[str]:
        is_small = payload.count(b",") < MAX_ELEMENTS
        is_flat = payload.count(b"{") + payload.count(b"[") < MAX_DEPTH
        if is_small and is_flat:  # most messages are: do not read them twice
            return frozenset()
        return frozenset(values.unread(self._loaded(payload)))

    def texts(self, payload: bytes) -> dict[str, str]:
        return dict(values.texts(self._loaded(payload)))

    @staticmethod
    def _loaded(payload: bytes) -> dict[str, Any]:
        try:
            value = json.loads(payload)
        except RecursionError as error:
            raise ValueError("nested too deep") from error
        if not isinstance(value, dict):
            raise ValueError("no object")
        return value


ENCODING = Encoding("json", ("jsonschema", ""), Json)
