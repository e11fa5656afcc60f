"""Messages that are a C struct: the schema has a line `TYPE NAME` for each of its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from roadlog.storage.encodings import Codec, Encoding, Layout, Value
from roadlog.storage.records import Damage, Schema


class Packed(Codec):
    """Numbers one after another, without gaps, little endian."""

    def __init__(self, schema: Schema) -> None:
        try:
            lines = [line.split() for line in schema.data.decode("ascii").splitlines()]
            self._type = np.dtype([(name, f"<{code}") for code, name in lines])
        except (TypeError, ValueError) as error:
            raise Damage(f"its schema cannot be used: {error}") from error
        self.dtypes = {name: self._type[name] for name in self._type.names or ()}

    def decode(self, payload: bytes) -> Mapping[str, Any]:
        """One message."""
        row = np.frombuffer(payload, self._type, 1)[0]
        return {name: row[name].item() for name in self.dtypes}

    def layout(self, payload: bytes) -> Layout | None:
        """Numbers are at the same place in every message: columns without a loop over messages."""
        if len(payload) != self._type.itemsize:
            return None
        places = {
            name: Value(offset, dtype)
            for name, (dtype, offset, *_) in (self._type.fields or {}).items()
        }
        return Layout(places, {}, bytes(len(payload)))


ENCODING = Encoding("packed", ("struct",), Packed)
