"""Message encodings against the libraries that write and read them."""

from __future__ import annotations

import json
import struct
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


def test_units_that_comments_state():
    from roadlog.storage.encodings import codec_of

    text = b"float32 a # rad\nfloat64 b  # speed of it [m/s]\nfloat64 c # yaw (deg/s)\nint8 d"
    codec = codec_of("cdr", Schema(0, "m/T", "ros2msg", text))
    assert codec.units == {"a": "rad", "b": "m/s", "c": "deg/s"}
