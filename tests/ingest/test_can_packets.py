"""Messages that span frames or share one are decoded whole, as cantools decodes their payload."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from support.autosar import HEADER, description
from support.can_cases import COUNT, PROFILE, candump, motion

from roadlog.ingest import ingest
from roadlog.ingest.formats import can
from roadlog.ingest.formats.can_database import EXTENDED

cantools = pytest.importorskip("cantools")

LONG = """VERSION ""

BU_: X

BO_ 2566841342 EC1: 39 X
 SG_ Speed : 120|16@1+ (0.00390625,0) [0|250] "km/h" X
 SG_ Torque : 152|16@1+ (1,0) [0|64255] "Nm" X

BO_ 2381841918 Position: 43 X
 SG_ Latitude : 64|64@1- (1E-16,0) [0|0] "deg" X
 SG_ Altitude : 192|64@1- (1E-6,0) [0|0] "m" X

BA_DEF_ BO_  "VFrameFormat" ENUM  "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_  "VFrameFormat" "J1939PG";
BA_ "VFrameFormat" BO_ 2566841342 3;
BA_ "VFrameFormat" BO_ 2381841918 3;
"""
GROUP, FIX = 0xFEE3, 0x1F805  # J1939 engine configuration, NMEA 2000 position


def frames_of(rows: Sequence[tuple[int, int, bytes]]) -> can.CanFrames:
    """(ns, identifier, payload) as columns."""
    widest = max(len(data) for *_, data in rows)
    padded = b"".join(data.ljust(widest, b"\xff") for *_, data in rows)
    return can.CanFrames(
        np.array([time for time, *_ in rows]),
        np.array([identifier for _, identifier, _ in rows], np.uint32),
        np.frombuffer(padded, np.uint8).reshape(-1, widest),
        np.array([len(data) for *_, data in rows], np.uint8),
    )


def database(folder: Path, text: str, kind: str = "dbc") -> list[can.Known]:
    path = folder / f"car.{kind}"
    path.write_text(text)
    return can.load([path])


def transported(time: int, source: int, payload: bytes, to: int = 0xFF) -> Iterator[tuple]:
    """An announcement and its packets, 50 ms apart; to one receiver with a request."""
    control, packets = (32 if to == 0xFF else 16), -(-len(payload) // 7)
    head = struct.pack("<BHBB", control, len(payload), packets, 0xFF) + GROUP.to_bytes(3, "little")
    yield time, EXTENDED | 0x18EC0000 | to << 8 | source, head
    for k in range(packets):
        part = payload[7 * k : 7 * k + 7].ljust(7, b"\xff")
        yield (
            time + (k + 1) * 50_000_000,
            EXTENDED | 0x18EB0000 | to << 8 | source,
            bytes([k + 1]) + part,
        )


def engine(k: int) -> bytes:
    return bytes(15) + struct.pack("<H2sH", 256 * (50 + k), b"", 300 + k) + bytes(18)


@pytest.mark.parametrize("to", [0xFF, 0x03])
def test_messages_of_several_packets_are_put_together(tmp_path, to):
    payloads = {(k, source): engine(k + source) for k in range(5) for source in (0, 11)}
    rows = sorted(
        row
        for (k, source), payload in payloads.items()
        for row in transported(k * 10**9 + source, source, payload, to)
    )
    known = database(tmp_path, LONG)
    found = can.decode(frames_of(rows), known, "x")
    by_name = {frame.name: frame for frame in found.frames}
    assert set(by_name) == {"EC1@0x00", "EC1@0x0B"}
    assert not found.losses
    assert not any("unknown identifiers" in note for note in found.notes)
    for (k, source), payload in payloads.items():
        values = known[0].message.decode(payload)
        frame = by_name[f"EC1@0x{source:02X}"]
        assert frame.time[k] == k * 10**9 + source
        assert {name: column[k] for name, column in frame.columns.items()} == values


def test_a_lost_packet_loses_its_message_and_says_so(tmp_path):
    rows = [row for k in range(4) for row in transported(k * 10**9, 0, engine(k))]
    del rows[3]
    found = can.decode(frames_of(rows), database(tmp_path, LONG), "x")
    np.testing.assert_array_equal(found.frames[0].time, [10**9, 2 * 10**9, 3 * 10**9])
    assert found.losses == ("x: J1939: 1 messages of several frames are not whole",)


def test_fast_packets_are_put_together(tmp_path):
    payloads = [struct.pack("<8xqq8xq3x", k * 10**16, 0, k * 10**6) for k in range(6)]
    rows = []
    for k, payload in enumerate(payloads):
        parts = [bytes([len(payload)]) + payload[:6]]
        parts += [payload[j : j + 7].ljust(7, b"\xff") for j in range(6, len(payload), 7)]
        rows += [
            (k * 10**9 + j, EXTENDED | 3 << 26 | FIX << 8 | 0x21, bytes([(k % 8) << 5 | j]) + part)
            for j, part in enumerate(parts)
        ]
    known = database(tmp_path, LONG)
    (frame,) = can.decode(frames_of(rows), known, "x").frames
    expected = [known[1].message.decode(payload) for payload in payloads]
    for name, column in frame.columns.items():
        np.testing.assert_array_equal(column, [values[name] for values in expected])


def test_an_arxml_file_is_a_database(tmp_path):
    other = tmp_path / "car.arxml"
    other.write_text(description())
    (tmp_path / "car.toml").write_text(PROFILE)
    path = candump(tmp_path / "car.log", [(k / 50, "can0", 100, motion(k)) for k in range(COUNT)])
    result = ingest([path], tmp_path / "car.toml", [other])
    speed = next(t for t in result.tables if t.topic == "/speed").columns["v"]
    np.testing.assert_allclose(speed * 3.6, 50 + np.arange(COUNT) / 100)


def test_messages_in_a_container_join_those_that_come_alone(tmp_path):
    def held(*payloads: bytes) -> bytes:
        return b"".join(HEADER.to_bytes(3, "big") + bytes([len(p)]) + p for p in payloads)

    rows = [(k, 100, motion(k)) for k in range(0, 40, 2)]
    rows += [(k, 101, held(motion(k)) + b"\x01\x02\x03\x01\xff") for k in range(1, 40, 2)]
    rows += [(40, 101, held(motion(40)) + HEADER.to_bytes(3, "big") + b"\x08\x01")]
    known = database(tmp_path, description(), "arxml")
    found = can.decode(frames_of(rows), known, "x")
    (frame,) = found.frames
    np.testing.assert_array_equal(frame.time, np.arange(41))
    np.testing.assert_allclose(frame.columns["VehicleSpeed"], 50 + np.arange(41) / 100)
    assert found.losses == ("x: 0x65: 1 messages of several parts are not whole",)
    assert {"Motion.AccelX", "VehicleSpeed"} <= can.names(known)
