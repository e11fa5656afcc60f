"""ROS 1 payloads: little-endian, packed, strings without a final NUL, for `columns`."""

from __future__ import annotations

from roadlog.storage import definitions
from roadlog.storage.encodings import Encoding
from roadlog.storage.records import Schema
from roadlog.storage.walk import Walk, Walked


class Ros1(Walked):
    """Codec of `ros1msg` schemas. Raises Damage for one of no use."""

    def __init__(self, schema: Schema) -> None:
        super().__init__(schema, definitions.of_ros)

    def walk(self, payload: bytes) -> Walk:
        """Ready to walk a payload."""
        return Walk(self.types, payload, largest=1)


ENCODING = Encoding("ros1", ("ros1msg",), Ros1)
