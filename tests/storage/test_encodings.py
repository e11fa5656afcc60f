"""Message encodings against the libraries that write and read them."""

from __future__ import annotations

import json
import struct
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from support.ros_messages import ROS1, ROS2, leaves, random_message, write_mcap

from roadlog.storage import LogReader, Table
from roadlog.storage.records import Schema

COUNT = 25
TYPES = [
    "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "sensor_msgs/msg/JointState",
    "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Joy",
    "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/MagneticField", "sensor_msgs/msg/PointCloud2",
    "sensor_msgs/msg/Range", "sensor_msgs/msg/Temperature", "sensor_msgs/msg/CameraInfo",
    "sensor_msgs/msg/MultiDOFJointState", "sensor_msgs/msg/TimeReference",
    "geometry_msgs/msg/AccelStamped", "geometry_msgs/msg/TwistStamped",
    "geometry_msgs/msg/TwistWithCovarianceStamped", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/TransformStamped", "geometry_msgs/msg/PolygonStamped",
    "geometry_msgs/msg/Vector3Stamped", "geometry_msgs/msg/QuaternionStamped",
    "nav_msgs/msg/Odometry", "nav_msgs/msg/Path", "nav_msgs/msg/OccupancyGrid",
    "diagnostic_msgs/msg/DiagnosticArray", "std_msgs/msg/Float64", "std_msgs/msg/Byte",
    "std_msgs/msg/ByteMultiArray", "std_msgs/msg/UInt8MultiArray", "std_msgs/msg/Empty",
    "trajectory_msgs/msg/JointTrajectory",
]  # fmt: skip


def read(path: Path) -> Table:
    with LogReader(path) as log:
        table = log.read()["/x"]
        assert not log.losses
    return table


def assert_same(table: Table, messages: list) -> None:
    """Every number of every message, no other; names of elements are further names of the same."""
    columns = {n: v for n, v in table.columns.items() if "[" not in n}
    rows = [dict(leaves(message)) for message in messages]
    assert set(columns) == {name for row in rows for name in row}
    for name, values in columns.items():
        expected = [row.get(name, np.nan) for row in rows]
        np.testing.assert_array_equal(values.astype(np.float64), np.array(expected, np.float64))


@pytest.mark.parametrize("name", TYPES)
def test_ros_messages_as_the_libraries_of_each_read_them(tmp_path, name):
    """mcap-ros2-support, mcap-ros1-support and rosbags, value by value."""
    from mcap_ros1.decoder import DecoderFactory as Ros1Decoder
    from mcap_ros2.decoder import DecoderFactory as Ros2Decoder

    for store, version in ((ROS2, 2), (ROS1, 1)):
        if name not in store.fielddefs:
            continue
        rng = np.random.default_rng(1)
        messages = [random_message(store, name, rng) for _ in range(COUNT)]
        text, _ = store.generate_msgdef(name, ros_version=version)
        if version == 2:
            payloads = [store.serialize_cdr(m, name, little_endian=k % 2 == 0)
                        for k, m in enumerate(messages)]  # fmt: skip
            schema, encoding, decoder = (name, "ros2msg", text.encode()), "cdr", Ros2Decoder
        else:
            payloads = [store.serialize_ros1(m, name) for m in messages]
            short = name.replace("/msg/", "/")
            schema, encoding, decoder = (short, "ros1msg", text.encode()), "ros1", Ros1Decoder
        path = write_mcap(tmp_path / f"{version}.mcap", encoding, schema, payloads)
        table = read(path)
        assert_same(table, messages)
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[decoder()])
            decoded = [message for *_, message in reader.iter_decoded_messages()]
        assert_same(table, decoded)


IDL = """\
================================================================================
IDL: my_msgs/msg/Wheels
#include "my_msgs/msg/Wheel.idl"
module my_msgs { module msg {
  module Wheels_Constants { const uint8 FRONT = 1; };
  typedef double double__3[3];
  @verbatim (language="comment", text="Speeds; of { all } wheels")
  struct Wheels {
    std_msgs::msg::Header header;
    @unit (value="rad/s") double speed;  // of the shaft
    double__3 fixed;
    sequence<my_msgs::msg::Wheel, 4> wheels;
    octet raw;
    boolean ok;
  };
}; };
================================================================================
IDL: my_msgs/msg/Wheel
module my_msgs { module msg {
  struct Wheel { float speed; /* m/s */ unsigned short ticks; string label; };
}; };
================================================================================
IDL: std_msgs/msg/Header
module std_msgs { module msg {
  struct Header { builtin_interfaces::msg::Time stamp; string frame_id; };
}; };
================================================================================
IDL: builtin_interfaces/msg/Time
module builtin_interfaces { module msg { struct Time { int32 sec; uint32 nanosec; }; }; };
"""
MSG = """\
std_msgs/Header header
float64 speed
float64[3] fixed
my_msgs/Wheel[<=4] wheels
byte raw
bool ok
================================================================================
MSG: my_msgs/Wheel
float32 speed
uint16 ticks
string label
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def test_ros2idl_is_what_the_same_message_definition_is(tmp_path):
    from mcap_ros2.writer import Writer as Ros2Writer

    rows = [
        {
            "header": {"stamp": {"sec": k, "nanosec": k}, "frame_id": "b" * (k % 5)},
            "speed": k / 3, "fixed": [1.0 * k, 2.0, 3.0],
            "wheels": [{"speed": 0.5 * n, "ticks": n, "label": "w"} for n in range(k % 3)],
            "raw": k % 256, "ok": k % 2 == 0,
        }
        for k in range(COUNT)
    ]  # fmt: skip
    with (tmp_path / "msg.mcap").open("wb") as file:
        writer = Ros2Writer(file)
        schema = writer.register_msgdef("my_msgs/msg/Wheels", MSG)
        for k, row in enumerate(rows):
            writer.write_message("/x", schema, row, k * 10**6, k * 10**6)
        writer.finish()
    with (tmp_path / "msg.mcap").open("rb") as file:
        payloads = [message.data for *_, message in make_reader(file).iter_messages()]
    own = read(tmp_path / "msg.mcap")
    idl = ("my_msgs/msg/Wheels", "ros2idl", IDL.encode())
    path = write_mcap(tmp_path / "idl.mcap", "cdr", idl, payloads)
    table = read(path)
    assert set(table.columns) == set(own.columns)
    for name, values in own.columns.items():
        np.testing.assert_array_equal(table.columns[name], values)
        assert table.columns[name].dtype == values.dtype
    with LogReader(path) as log:
        assert log.units("/x") == {"speed": "rad/s"}
        assert log.texts("/x") == {"header.frame_id": ""}


@pytest.mark.parametrize("version", [1, 2])
def test_omgidl_in_both_versions_of_cdr(tmp_path, version):
    """By hand: an enum, an optional and an appendable inner struct; version 2 aligns to 4."""
    text = """module car { enum Gear { P, R, D };
    @appendable struct Inner { double x; };
    @final struct State { uint8 a; double v; Gear gear; Inner inner; sequence<float> more; }; };"""

    def payload(k: int) -> bytes:
        data = bytearray(b"\0\x01\0\0" if version == 1 else b"\0\x07\0\0")

        def put(code: str, value: float) -> None:
            size = struct.calcsize(code)
            size = min(size, 8 if version == 1 else 4)
            data.extend(bytes(-(len(data) - 4) % size) + struct.pack(f"<{code}", value))

        put("B", k)
        put("d", 0.5 * k)
        put("I", k % 3)
        if version == 2:
            put("I", 8)
        put("d", -1.0 * k)
        put("I", 2)
        put("f", 1.5)
        put("f", 2.5)
        return bytes(data)

    schema = ("car::State", "omgidl", text.encode())
    path = write_mcap(tmp_path / "x.mcap", "cdr", schema, map(payload, range(COUNT)))
    columns = read(path).columns
    k = np.arange(COUNT)
    for name, expected in {
        "a": k, "v": 0.5 * k, "gear": k % 3, "inner.x": -1.0 * k, "more.1": 0 * k + 2.5
    }.items():  # fmt: skip
        np.testing.assert_array_equal(columns[name], expected)


MUTABLE = """module car { enum Gear { P, R, D };
@appendable struct Inner { double x; uint8 n; };
@final struct Point { float x; double y; };
@mutable struct State {
  uint8 a; @id(40) double v; Gear gear; sequence<Gear> gears; Inner inner; sequence<Point> points;
  sequence<float> more; @optional double o; string name; short tail;
}; };"""
# as Cyclone DDS 11.0.1 writes them, by version of CDR
CYCLONE = {
    1: [
        "00030000017f0800000000000400000000000000017f080028000000080000000000000000000000017f0800"
        "290000000400000002000000017f08002a0000000400000000000000017f08002b0000000c00000000000000"
        "0000000007000000017f08002c00000020000000020000000000c03f00000000000000000000c03f00000000"
        "0000000000000000017f08002d0000000c000000020000000000c03f00002040017f08002f00000008000000"
        "0100000000000000017f0800300000000400000000000000027f0000",
        "00030000017f0800000000000400000001000000017f08002800000008000000000000000000e03f017f0800"
        "290000000400000002000000017f08002a000000080000000100000001000000017f08002b0000000c000000"
        "000000000000f0bf07000000017f08002c00000020000000020000000000c03f00000000000004400000c03f"
        "000000000000000000000440017f08002d0000000c000000020000000000c03f00002040017f08002e000000"
        "080000000000000000000a40017f08002f000000080000000300000068690000017f08003000000004000000"
        "ffff0000027f0000",
        "00030000017f0800000000000400000002000000017f08002800000008000000000000000000f03f017f0800"
        "290000000400000002000000017f08002a0000000c000000020000000100000001000000017f08002b000000"
        "0c00000000000000000000c007000000017f08002c00000020000000020000000000c03f0000000000001440"
        "0000c03f000000000000000000001440017f08002d0000000c000000020000000000c03f00002040017f0800"
        "2e000000080000000000000000000a40017f08002f0000000c000000050000006869686900000000017f0800"
        "3000000004000000feff0000027f0000",
    ],
    2: [
        "000b000086000000000000000000000028000030000000000000000029000020020000002a00005004000000"
        "000000002b0000400d000000090000000000000000000000070000002c0000501c000000020000000000c03f"
        "00000000000000000000c03f00000000000000002d000060020000000000c03f000020402f00005001000000"
        "00000000300000100000",
        "000b000096000000000000000100000028000030000000000000e03f29000020020000002a00005008000000"
        "01000000010000002b0000400d00000009000000000000000000f0bf070000002c0000501c00000002000000"
        "0000c03f00000000000004400000c03f00000000000004402d000060020000000000c03f000020402e000030"
        "0000000000000a402f000050030000006869000030000010ffff",
        "000b00009e000000000000000200000028000030000000000000f03f29000020020000002a0000500c000000"
        "0200000001000000010000002b0000400d0000000900000000000000000000c0070000002c0000501c000000"
        "020000000000c03f00000000000014400000c03f00000000000014402d000060020000000000c03f00002040"
        "2e0000300000000000000a402f00005005000000686968690000000030000010feff",
    ],
}


@pytest.mark.parametrize("version", CYCLONE)
def test_mutable_and_optional_members(tmp_path, version):
    payloads = map(bytes.fromhex, CYCLONE[version])
    schema = ("car::State", "omgidl", MUTABLE.encode())
    columns = read(write_mcap(tmp_path / "x.mcap", "cdr", schema, payloads)).columns
    k, nan = np.arange(3), np.nan
    for name, expected in {
        "a": k, "v": 0.5 * k, "gear": [2, 2, 2], "gears.1": [nan, nan, 1], "inner.x": -k,
        "inner.n": [7, 7, 7], "points.1.y": 2.5 * k, "more.1": [2.5] * 3, "o": [nan, 3.25, 3.25],
        "tail": -k,
    }.items():  # fmt: skip
        np.testing.assert_array_equal(columns[name], expected)


def test_flatbuffers(tmp_path):
    """Tables, structs with arrays, vectors, a default; as flatc writes them."""
    folder = Path(__file__).parents[1] / "data" / "flatbuffers"
    schema = ("car.State", "flatbuffer", (folder / "car.bfbs").read_bytes())
    payloads = [(folder / f"{name}.bin").read_bytes() for name in ("short", "long")]
    table = read(write_mcap(tmp_path / "x.mcap", "flatbuffer", schema, payloads))
    nan = np.nan
    for name, expected in {
        "stamp": [7, 8], "speed": [1.5, 1.5], "gear": [2, 0], "front.speed": [2.5, nan],
        "front.slip.2": [3.0, nan], "wheels.1.slip.0": [7.0, nan], "parts.1.torque": [0.0, nan],
        "codes.2": [3, 2], "codes.63": [nan, 63],
    }.items():  # fmt: skip
        np.testing.assert_array_equal(table.columns[name], expected)
    assert table.unread == "/x: numbers that were not read: codes after the first 64, more"


def test_what_becomes_no_column_is_said(tmp_path):
    """Ends of long lists; raw data as of a camera is no number."""
    cbor2 = pytest.importorskip("cbor2")
    text = b"float32[] ranges\nP[] points\nuint8[] data\n" + b"=" * 80 + b"\nMSG: a/P\nfloat32 x"
    said = "/x: numbers that were not read: points after the first 64, ranges after the first 64"
    long = np.zeros(100, "<f4").tobytes()
    payload = b"d\0\0\0" + long + b"d\0\0\0" + long + b"d\0\0\0" + bytes(100)
    value = {"ranges": [0.5] * 100, "points": [{"x": 1}] * 100, "names": ["a"] * 100}
    for encoding, kind, schema, message in (
        ("ros1", "ros1msg", text, payload),
        ("cdr", "ros2msg", text, b"\0\1\0\0" + payload),
        ("json", "", b"", json.dumps(value).encode()),
        ("cbor", "", b"", cbor2.dumps(value)),
    ):
        path = write_mcap(tmp_path / encoding, encoding, ("a/T", kind, schema), [message])
        table = read(path)
        assert table.unread == said
        assert "points.63" in str(list(table.columns))


@pytest.mark.parametrize("encoding", ["json", "cbor"])
def test_objects(tmp_path, encoding):
    cbor2 = pytest.importorskip("cbor2")
    dumps = cbor2.dumps if encoding == "cbor" else lambda value: json.dumps(value).encode()
    rows = [
        {
            "v": 0.1 * k, "n": k, "ok": k % 2 == 0, "text": "t", "list": [k, {"x": -k}],
            "name": ["fl", "fr"] if k % 2 else ["fr", "fl"], "velocity": [1.0 * k, 2.0 * k],
        }
        for k in range(COUNT)
    ]  # fmt: skip
    columns = read(
        write_mcap(tmp_path / "x.mcap", encoding, ("", "", b""), map(dumps, rows))
    ).columns
    k = np.arange(COUNT)
    np.testing.assert_array_equal(columns["v"], [row["v"] for row in rows])
    np.testing.assert_array_equal(columns["list.1.x"], -k)
    np.testing.assert_array_equal(columns["velocity.0"], k)
    np.testing.assert_array_equal(columns["velocity[name=fl]"], np.where(k % 2, k, 2 * k))


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_byte_is_an_octet_by_every_route(tmp_path, encoding):
    """As rclpy and the IDL of ROS 2 say; rosbags and mcap-ros1-support read it signed in ROS 1."""
    kind = "ros2msg" if encoding == "cdr" else "ros1msg"
    head = b"\0\1\0\0" if encoding == "cdr" else b""
    schema = ("m/T", kind, b"byte a\nuint8 b\nbyte[2] c")
    columns = read(write_mcap(tmp_path / "x.mcap", encoding, schema, [head + b"\xf3" * 4])).columns
    assert {name: int(values[0]) for name, values in columns.items()} == {
        "a": 243, "b": 243, "c.0": 243, "c.1": 243
    }  # fmt: skip


def test_elements_by_name_where_the_order_varies(tmp_path, slow):
    name = "sensor_msgs/msg/JointState"
    cls = ROS2.types[name]
    stamp = ROS2.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2)
    head = ROS2.types["std_msgs/msg/Header"](stamp=stamp, frame_id="b")
    payloads = []
    for k in range(COUNT):
        order = ["left", "right"] if k % 3 else ["right", "left"]
        values = np.array([k if side == "left" else -k for side in order], np.float64)
        message = cls(
            header=head, name=order, position=values, velocity=2 * values, effort=values[:0]
        )
        payloads.append(ROS2.serialize_cdr(message, name))
    text, _ = ROS2.generate_msgdef(name, ros_version=2)
    path = write_mcap(tmp_path / "x.mcap", "cdr", (name, "ros2msg", text.encode()), payloads)
    columns = read(path).columns
    np.testing.assert_array_equal(columns["velocity[name=left]"], 2 * np.arange(COUNT))
    np.testing.assert_array_equal(columns["position[name=right]"], -np.arange(COUNT))
    assert slow == [0]


@pytest.mark.parametrize(
    ("encoding", "kind", "text", "said"),
    [
        ("cdr", "ros2idl", b"struct A { long x", "where"),
        ("cdr", "omgidl", b"union U switch (long) { case 1: long a; };", "no struct a/T in it"),
        ("ros1", "ros1msg", b"Header header", "type a/Header is not defined"),
        ("flatbuffer", "flatbuffer", b"\x04\0\0\0", "its schema cannot be used"),
        ("other", "", b"", "'other' with schema '' is not understood"),
    ],
)
def test_schema_of_no_use_is_said(tmp_path, encoding, kind, text, said):
    path = write_mcap(tmp_path / "x.mcap", encoding, ("a/T", kind, text), [b"1234"])
    with LogReader(path) as log:
        assert len(log.read(["/x"])["/x"]) == 1
        (loss,) = log.losses
        assert said in loss


@pytest.mark.parametrize(
    ("encoding", "kind", "text", "head"),
    [
        ("cdr", "omgidl", b"struct T { sequence<T> a; double x; };", b"\0\1\0\0"),
        ("ros1", "ros1msg", b"T[] a\nfloat64 x", b""),
    ],
)
def test_a_type_that_holds_itself(tmp_path, encoding, kind, text, head):
    """A payload may nest as deep as it is long: such a one cannot be decoded, others can."""
    deep = head + b"\1\0\0\0" * 5000 + bytes(80_000)
    flat = head + bytes(4 if encoding == "ros1" else 8) + np.float64(2.5).tobytes()
    name = "T" if encoding == "cdr" else "m/T"
    path = write_mcap(tmp_path / "x.mcap", encoding, (name, kind, text), [flat, deep, flat])
    with LogReader(path) as log:
        np.testing.assert_array_equal(log.read()["/x"].columns["x"], [2.5, np.nan, 2.5])
        assert log.losses == ["/x: 1 of 3 messages cannot be decoded"]


def test_a_payload_that_claims_more_than_it_holds(tmp_path):
    """Messages without a field cost no byte: how many there are is bounded by the payload."""
    text = b"B[] b\n" + b"=" * 80 + b"\nMSG: m/B\nE[] e\n" + b"=" * 80 + b"\nMSG: m/E\n"
    payload = b"\x88\x13\0\0" + b"\x20\x4e\0\0" * 5000
    path = write_mcap(tmp_path / "x.mcap", "ros1", ("m/A", "ros1msg", text), [payload])
    start = time.process_time()
    with LogReader(path) as log:
        log.read()
        assert log.losses == ["/x: 1 of 1 messages cannot be decoded"]
    assert time.process_time() - start < 2


def test_units_that_comments_state():
    from roadlog.storage.encodings import codec_of

    text = b"float32 a # rad\nfloat64 b  # speed of it [m/s]\nfloat64 c # yaw (deg/s)\nint8 d"
    codec = codec_of("cdr", Schema(0, "m/T", "ros2msg", text))
    assert codec.units == {"a": "rad", "b": "m/s", "c": "deg/s"}
