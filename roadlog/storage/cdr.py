"""ROS 2 and DDS payloads: CDR, versions 1 and 2 (OMG DDS-XTypes 1.3), for `columns`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import zstandard

from roadlog.storage import definitions, idl
from roadlog.storage.encodings import Encoding
from roadlog.storage.records import Schema
from roadlog.storage.walk import Unfit, Walk, Walked

ZSTD = b"\x28\xb5\x2f\xfd"  # a zstd frame; CDR begins with a zero
LARGEST = 1 << 26  # bytes of a message that was compressed on its own
ENCAPSULATION = 4  # bytes: 0, representation, options; alignment counts from behind it
# representation -> largest alignment, whether XCDR 2, what a struct is that does not say it
_KINDS = {
    0x00: (8, False, "final"),
    0x02: (8, False, "mutable"),
    0x06: (4, True, "final"),
    0x08: (4, True, "appendable"),
    0x0A: (4, True, "mutable"),
}
_KINDS |= {kind + more: _KINDS[kind] for kind, more in ((6, 10), (8, 12), (10, 8))}  # of XTypes


class Cdr(Walked):
    """Codec of `ros2msg`, `ros2idl` and `omgidl` schemas. Raises Damage for one of no use."""

    def __init__(self, schema: Schema) -> None:
        super().__init__(schema, definitions.of_ros if schema.encoding == "ros2msg" else idl.of_idl)

    def decode(self, payload: bytes) -> Mapping[str, Any]:
        return super().decode(_inflated(payload))

    def unread(self, payload: bytes) -> frozenset[str]:
        return super().unread(_inflated(payload))

    def texts(self, payload: bytes) -> dict[str, str]:
        return super().texts(_inflated(payload))

    def walk(self, payload: bytes) -> Walk:
        """Ready to walk a payload. Raises Unfit."""
        kind = _KINDS.get(payload[1] & 0xFE) if len(payload) >= ENCAPSULATION else None
        if kind is None or payload[0]:
            raise Unfit("its encapsulation is not plain CDR")
        order: Literal["little", "big"] = "little" if payload[1] & 1 else "big"
        walk = Walk(self.types, payload, order, ENCAPSULATION, ENCAPSULATION, *kind)
        walk.mask[:2] = b"\xff\xff"
        return walk


def _inflated(payload: bytes) -> bytes:
    """A message as it is; rosbag2 may have compressed each one. Raises Unfit."""
    if not payload.startswith(ZSTD):
        return payload
    try:
        return zstandard.ZstdDecompressor().decompress(payload, max_output_size=LARGEST)
    except zstandard.ZstdError as error:
        raise Unfit(f"compressed, but {error}") from error


ENCODING = Encoding("cdr", ("ros2msg", "ros2idl", "omgidl"), Cdr)
