"""CBOR payloads (RFC 8949), message by message, by cbor2."""

from __future__ import annotations

from typing import Any

from roadlog.errors import MissingExtraError
from roadlog.storage import values
from roadlog.storage.encodings import Codec, Encoding
from roadlog.storage.records import Schema


class Cbor(Codec):
    """Codec of CBOR maps, with any schema or none. Raises MissingExtraError."""

    def __init__(self, schema: Schema) -> None:
        del schema
        try:
            import cbor2
        except ModuleNotFoundError:
            raise MissingExtraError("CBOR", "cbor") from None
        self._loads = cbor2.loads

    def decode(self, payload: bytes) -> dict[str, Any]:
        return dict(values.numbers(self._loaded(payload)))

    def unread(self, payload: bytes) -> frozenset[str]:
        return frozenset(values.unread(self._loaded(payload)))

    def texts(self, payload: bytes) -> dict[str, str]:
        return dict(values.texts(self._loaded(payload)))

    def _loaded(self, payload: bytes) -> dict[str, Any]:
        try:
            value = self._loads(payload)
        except Exception as error:  # of many types
            raise ValueError(f"no CBOR: {error}") from error
        if not isinstance(value, dict):
            raise ValueError("no map")
        return value


ENCODING = Encoding("cbor", ("", "jsonschema", "cddl"), Cbor)
