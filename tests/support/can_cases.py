"""Databases, traces and MDF bus logs of every kind, written by other libraries or as they stand."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

MOTION = """VERSION ""

BU_: X

BO_ 100 Motion: 8 X
 SG_ VehicleSpeed : 0|16@1+ (0.01,0) [0|300] "km/h" X
 SG_ AccelX : 16|16@1- (0.001,0) [-30|30] "m/s^2" X
 SG_ AccelZ : 32|16@1- (0.001,0) [-30|30] "m/s^2" X
"""
PROFILE = """[imu]
accel_x = { from = "Motion.AccelX", unit = "m/s^2" }
[speed]
v = { from = "Motion.VehicleSpeed", unit = "km/h" }
"""
START = 1_700_000_000
COUNT = 60


def motion(k: int) -> bytes:
    """Speed 50.00 km/h and up by 0.01, 0.1 m/s2 forward, 9.807 m/s2 up."""
    return struct.pack("<Hhhh", 5000 + k, 100, 9807, 0)


def files(folder: Path, database: str = MOTION, profile: str = PROFILE) -> tuple[Path, Path]:
    """The database and the profile."""
    dbc, toml = folder / "car.dbc", folder / "car.toml"
    dbc.write_text(database)
    toml.write_text(profile)
    return dbc, toml


def candump(path: Path, frames: Sequence[tuple[float, str, int, bytes]]) -> Path:
    """(s, bus, identifier, payload): a log of `candump -L`; 29-bit identifiers above 0x7FF."""
    lines = [
        f"({START + t:.6f}) {bus} {i:0{3 if i < 0x800 else 8}X}#{data.hex().upper()}"
        for t, bus, i, data in frames
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


class _Mdf:
    """MDF 4.11 blocks, for what asammdf does not write: virtual channels of a bus log."""

    def __init__(self) -> None:
        head = (b"MDF     ", b"4.11    ", b"test    ", b"", 411, b"", 0, 0)
        self.bytes = bytearray(struct.pack("<8s8s8s4sH30sHH", *head))

    def block(self, kind: bytes, links: Sequence[int], data: bytes = b"") -> int:
        self.bytes += b"\0" * (-len(self.bytes) % 8)
        at = len(self.bytes)
        size = 24 + 8 * len(links) + len(data)
        self.bytes += struct.pack("<4sIQQ", kind, 0, size, len(links))
        self.bytes += struct.pack(f"<{len(links)}Q", *links) + data
        return at

    def text(self, text: str) -> int:
        raw = text.encode() + b"\0"
        return self.block(b"##TX", [], raw + b"\0" * (-len(raw) % 8))

    def constant(self, value: float) -> int:
        data = struct.pack("<BBHHHdddd", 1, 0, 0, 0, 2, 0.0, 0.0, value, 0.0)
        return self.block(b"##CC", [0, 0, 0, 0], data)

    def channel(self, name: str, kind: int, dtype: int, byte: int, bits: int, **links: int) -> int:
        place = [links.get("next", 0), links.get("parts", 0), self.text(name), 0]
        place += [links.get("conversion", 0), 0, 0, 0]
        sync = 1 if kind == 2 else 0
        data = struct.pack(
            "<BBBBIIIIBBH6d", kind, sync, dtype, 0, byte, bits, 0, 0, 0, 0, 0, *[0.0] * 6
        )
        return self.block(b"##CN", place, data)


def mdf_bus(path: Path, groups: Sequence[dict], virtual: Sequence[str]) -> Path:
    """A bus log: each group has one kind of identifier.

    groups: `frames` [(s, identifier, payload)], `extended`, `bus`. virtual: fields that are said by
    a conversion instead of being stored, among IDE, BusChannel, Dir, DataLength.
    """
    file = _Mdf()
    head = struct.pack("<QhhBBBBdd", START * 10**9, 0, 0, 0, 0, 0, 0, 0.0, 0.0)
    at_head = file.block(b"##HD", [0] * 6, head)
    below: list[int] = []
    records: list[bytes] = []
    for group in groups:
        rows = group["frames"]
        width = max(len(data) for *_, data in rows)
        fixed = {
            "BusChannel": group["bus"],
            "IDE": int(group["extended"]),
            "DataLength": width,
            "Dir": 0,
        }
        record = bytearray()
        for t, identifier, data in rows:
            record += struct.pack("<dIBBBB", t, identifier, *fixed.values())
            record += data.ljust(width, b"\xff")
        fields = [("ID", 8, 32), *((name, 12 + k, 8) for k, name in enumerate(fixed))]
        following = 0
        for name, byte, bits in [*fields, ("DataBytes", 16, 8 * width)]:
            said = name in virtual
            following = file.channel(
                f"CAN_DataFrame.{name}",
                6 if said else 0,
                10 if name == "DataBytes" else 0,
                0 if said else byte,
                0 if said else bits,
                next=following,
                conversion=file.constant(float(fixed[name])) if said else 0,
            )
        frame = file.channel("CAN_DataFrame", 0, 10, 8, 8 * (8 + width), parts=following)
        time = file.channel("Timestamp", 2, 4, 0, 64, next=frame)
        size = struct.pack("<QQHHIII", 0, len(rows), 6, ord("."), 0, 16 + width, 0)
        channels = file.block(b"##CG", [0, time, file.text("bus"), 0, 0, 0], size)
        below.append(file.block(b"##DG", [0, channels, 0, 0], struct.pack("<B7s", 0, b"")))
        records.append(bytes(record))
    for at, record in zip(below, records, strict=True):  # the data last, as loggers write them
        struct.pack_into("<Q", file.bytes, at + 40, file.block(b"##DT", [], record))
    for at, following in zip([at_head, *below], below, strict=False):
        struct.pack_into("<Q", file.bytes, at + 24, following)
    path.write_bytes(file.bytes)
    return path
