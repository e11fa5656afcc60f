"""Lists in protobuf messages are what mcap-protobuf-support reads; what is left out is said."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import build_file_descriptor_set
from mcap_protobuf.writer import Writer as ProtobufWriter
from support.drives import EPOCH_NS
from support.protobuf_values import bits, message_class, numbers
from support.vehicle_messages import ALTITUDE, LATITUDE, LONGITUDE, RADIUS, TIME, V

from roadlog.export import export
from roadlog.ingest import ingest
from roadlog.log import DriveLog
from roadlog.storage import LogReader, Table
from roadlog.summary import summarize

TYPES = {
    "Point": "double x, double y, optional double z",
    "Part": "string name, double value, sint32 count, optional float load, Point at, "
            "repeated double covariance, repeated Point corners, oneof int64 id, oneof Point place",
    "Root": "int32 first, repeated Part parts, repeated sint64 numbers, repeated bool flags, "
            "repeated fixed32 words, oneof Inner inner, oneof uint32 plain, repeated string texts",
    "Inner": "repeated Part parts, repeated uint64 numbers",
    "Tree": "double value, repeated Tree branches, Tree stem",
    "Scan": "repeated float ranges",
}  # fmt: skip
Root, Tree, Scan = (message_class(TYPES, name) for name in ("Root", "Tree", "Scan"))


def write(path: Path, messages: Sequence[Any]) -> Path:
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for k, message in enumerate(messages):
            writer.write_message("/x", message, EPOCH_NS + k, EPOCH_NS + k)
    return path


def write_payloads(path: Path, payloads: Sequence[bytes]) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = build_file_descriptor_set(Root).SerializeToString()
        id_ = writer.register_schema(Root.DESCRIPTOR.full_name, "protobuf", schema)
        channel = writer.register_channel("/x", "protobuf", id_)
        for k, payload in enumerate(payloads):
            writer.add_message(channel, EPOCH_NS + k, payload, EPOCH_NS + k)
        writer.finish()
    return path


def equal(path: Path) -> Table:
    """The table, after every value of it was found by the reference library, and no other."""
    with LogReader(path) as log:
        table = log.read()["/x"]
        assert log.losses == []
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        rows = [dict(numbers(m)) for *_, m in reader.iter_decoded_messages()]
    always = {name for name, values in table.columns.items() if np.isnan(values).all()}
    assert {name for row in rows for name in row} == table.columns.keys() - always
    for name, column in table.columns.items():
        theirs = [float(row.get(name, np.nan)) for row in rows]
        assert bits(column.astype(np.float64)) == bits(theirs), name
    return table


def part(k: int, name: str = "", **more: Any) -> dict[str, Any]:
    return {"name": name, "value": k / 3, "count": -k, **more}


def test_lists_of_messages(tmp_path: Path, slow: list[int]) -> None:
    """Zeros that are not on the wire, messages in elements, a oneof in them."""
    choices = [{"id": 7}, {"place": {"x": 1.0}}, {}]
    rows = [
        {"parts": [part(k % 3 * n, load=0.0, at={"x": 0.0, "z": k}, **choices[(k + n) % 3])
                   for n in range(3)]}
        for k in range(40)
    ]  # fmt: skip
    table = equal(write(tmp_path / "x.mcap", [Root(**row) for row in rows]))
    assert {"parts.2.value", "parts.0.at.z", "parts.1.place.x"} <= table.columns.keys()
    assert slow == [0]
    assert table.unread == ""


def test_lists_of_other_lengths_in_each_message(tmp_path: Path) -> None:
    """Some empty, the first among them; numbers of any width; beyond the number of layouts."""
    rng = np.random.default_rng(1)
    rows = [
        {"parts": [part(n, covariance=[0.5] * (k % 4)) for n in range(k % 5)],
         "numbers": [int(v) for v in rng.integers(-(2**40), 2**40, k % 7)],
         "flags": [bool(n % 2) for n in range(k % 3)],
         "words": list(range(k % 6))}
        for k in range(300)
    ]  # fmt: skip
    table = equal(write(tmp_path / "x.mcap", [Root(**row) for row in rows]))
    assert table.columns["numbers.5"].dtype == np.float64
    assert np.isnan(table.columns["numbers.0"][0])


def test_elements_by_name_where_the_order_varies(tmp_path: Path, slow: list[int]) -> None:
    """Of two with one name it is the first, whatever that leaves out."""
    rows = []
    for k in range(60):
        parts = [part(k + 1, "left"), part(-k, "right"), part(9, "left", load=2.0)]
        rows.append({"parts": parts if k % 3 else [parts[1], {"name": "left"}, parts[2]]})
    columns = equal(write(tmp_path / "x.mcap", [Root(**row) for row in rows])).columns
    k = np.arange(60)
    expected = np.where(k % 3, (k + 1) / 3, 0.0)
    np.testing.assert_array_equal(columns["parts[name=left].value"], expected)
    np.testing.assert_array_equal(columns["parts[name=right].value"], -k / 3)
    assert "parts[name=left].load" not in columns
    assert slow == [0]


@pytest.mark.parametrize("encoded", ["packed", "alone", "both"])
def test_packed_and_alone(tmp_path: Path, encoded: str, slow: list[int]) -> None:
    """Fields 3 (sint64) and 5 (fixed32), as a proto2 writer and others may put them."""
    payloads = []
    for k in range(64):
        varints = [bytes([0x80 | k, 1 + n]) for n in range(3)]
        words = [(1000 * k + n).to_bytes(4, "little") for n in range(3)]
        packed = b"\x1a\x06" + b"".join(varints) + b"\x2a\x0c" + b"".join(words)
        alone = b"".join(b"\x18" + v + b"\x2d" + w for v, w in zip(varints, words, strict=True))
        payloads.append({"packed": packed, "alone": alone, "both": packed + alone}[encoded])
    columns = equal(write_payloads(tmp_path / "x.mcap", payloads)).columns
    assert ("words.5" in columns, "numbers.5" in columns) == (encoded == "both",) * 2
    assert slow == [0]


def test_a_list_that_another_member_of_its_oneof_replaces(tmp_path: Path) -> None:
    inner = Root(inner={"parts": [part(1, "a"), {}], "numbers": [5, 6]}).SerializeToString()
    plain = Root(plain=4).SerializeToString()
    again = Root(inner={"parts": [{"name": "a"}]}).SerializeToString()
    payloads = [inner, inner + plain, inner + plain + again, inner + again, plain + inner]
    columns = equal(write_payloads(tmp_path / "x.mcap", payloads)).columns
    assert np.isnan(columns["inner.parts.0.value"][1])


@pytest.mark.parametrize(
    ("message", "said"),
    [
        (Root(parts=[part(1, corners=[{"x": 1.0}])]), "parts.corners"),
        (Root(numbers=range(65)), "numbers after the first 64"),
        (Root(parts=[part(1)] * 70, words=range(99)),
         "parts after the first 64, words after the first 64"),
        (Root(parts=[part(1, covariance=range(65))]), "parts.covariance after the first 64"),
        (Tree(branches=[{"value": 1.0, "branches": [{"value": 2.0}]}]), "branches.branches"),
        (Tree(branches=[{"value": 1.0, "stem": {"value": 2.0}}]), "branches.stem"),
        (Tree(stem={"stem": {"value": 2.0}}), "stem.stem"),
        (Scan(ranges=range(1080)), "ranges after the first 64"),
        (Scan(ranges=range(64)), ""),
        (Root(texts=["a"] * 70), ""),
    ],
)  # fmt: skip
def test_what_is_not_read_is_said(tmp_path: Path, message: Any, said: str) -> None:
    with LogReader(write(tmp_path / "x.mcap", [message] * 3)) as log:
        table = log.read()["/x"]
    assert table.unread == (f"/x: numbers that were not read: {said}" if said else "")


def test_a_schema_that_multiplies_is_read_in_part_and_said(tmp_path: Path) -> None:
    """Lists of messages with as many messages in each: 8 in 8 in 8 ... are no columns."""
    types = {f"M{n}": ", ".join(f"M{n + 1} m{k}" for k in range(8)) for n in range(7)}
    types |= {"M7": "double value", "Many": "repeated M0 all, double own"}
    many = message_class(types, "Many")
    message = many(own=2.0)
    inside = message.all.add()
    for _ in range(7):
        inside = inside.m7
    inside.value = 1.0
    with LogReader(write(tmp_path / "x.mcap", [message])) as log:
        table = log.read()["/x"]
    assert table.columns["own"].tolist() == [2.0]
    assert table.unread.startswith("/x: numbers that were not read: all")


def foxglove(name: str) -> Any:
    """As Foxglove publishes them (schemas of 2025)."""
    types = {
        "JointState": "string name, optional double position, optional double velocity",
        "JointStates": "google.protobuf.Timestamp timestamp, repeated JointState joints",
        "LocationFix": "double latitude, double longitude, double altitude, "
                       "repeated double position_covariance",
        "LocationFixes": "repeated LocationFix fixes",
    }  # fmt: skip
    return message_class(types, name, "foxglove")


def write_drive(path: Path, *, scan: bool = False) -> Path:
    """Wheels and fixes; with a lidar, of which only a part can be columns."""
    states, fixes = foxglove("JointStates"), foxglove("LocationFixes")
    corners = ["front_left", "front_right", "rear_left", "rear_right"]
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for k, ns in enumerate(TIME.tolist()):
            joints = [{"name": f"wheel_{c}", "velocity": V[k] / RADIUS} for c in corners]
            joints.insert(k % 3, {"name": "steer_front", "position": 0.1})
            writer.write_message("/joints", states(joints=joints), ns, ns)
            fix = {"latitude": LATITUDE[k], "longitude": LONGITUDE[k], "altitude": ALTITUDE[k]}
            seen = fixes(fixes=[fix, {"latitude": 1.0}][: 1 + k % 2])
            writer.write_message("/fixes", seen, ns, ns)
            if scan:
                writer.write_message("/scan", Scan(ranges=[1.0] * 70), ns, ns)
    return path


def test_joint_states_and_location_fixes_are_signals(tmp_path: Path) -> None:
    result = ingest([write_drive(tmp_path / "x.mcap")])
    assert result.losses == []
    tables = {table.schema: table.columns for table in result.tables}
    np.testing.assert_allclose(tables["roadlog.v1.Gnss"]["latitude"], LATITUDE, rtol=1e-9)
    assert not any("not read" in note for note in result.notes)
    speed = tables["roadlog.v1.WheelSpeeds"]
    for corner in ("fl", "fr", "rl", "rr"):
        np.testing.assert_allclose(speed[corner] / speed[corner][0], V / V[0], rtol=1e-3)


def test_info_ingest_and_export_say_what_is_not_read(tmp_path: Path) -> None:
    path = write_drive(tmp_path / "x.mcap", scan=True)
    said = "/scan: numbers that were not read: ranges after the first 64"
    assert ingest([path]).notes.count(f"x.mcap: {said}") == 1
    with DriveLog(path) as log:
        summary = summarize(log)
        assert {"wheel_speeds.fl", "gnss.latitude"} <= {signal.role for signal in summary.signals}
        assert [f.found for f in summary.checks if "not read" in f.found] == [said]
        assert log.losses == []
    alone = write(tmp_path / "alone.mcap", [Scan(ranges=[1.0] * 70)] * 3)
    with DriveLog(alone) as log:
        assert said.replace("/scan", "/x") in [f.found for f in summarize(log).checks]
    assert export(path, tmp_path / "x.csv", ["/scan"])[2] == [said]
    assert export(path, tmp_path / "x.csv", ["/joints"])[2] == []
