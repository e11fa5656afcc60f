"""Logs of ROS 2 and of other protobuf users, written by the reference libraries, come back equal.

Where the layouts are few no message takes the slow path.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
from mcap.reader import make_reader
from mcap.writer import Writer as McapWriter
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as BagWriter
from rosbags.typesys import Stores, get_typestore
from support.drives import EPOCH_NS

from roadlog.storage import LogReader, Table

COUNT = 300
STORE = get_typestore(Stores.ROS2_HUMBLE)

PLAIN = {  # type -> values of its k-th message
    "sensor_msgs/msg/Imu": lambda k: {
        "header": header(k, "imu_link"),
        "orientation": {"x": 0.1, "y": math.nan, "z": -0.0, "w": k * 1e-3},
        "orientation_covariance": [float(n * k) for n in range(9)],
        "angular_velocity": {"x": 0.1 * k, "y": math.inf, "z": 5e-324},
        "angular_velocity_covariance": [-1.0] + [0.0] * 8,
        "linear_acceleration": {"x": math.sin(k), "y": math.cos(k), "z": 9.81},
        "linear_acceleration_covariance": [0.0] * 9,
    },
    "sensor_msgs/msg/NavSatFix": lambda k: {
        "header": header(k, "gps"),
        "status": {"status": -1 + k % 4, "service": 1 + k % 9},
        "latitude": 48.1 + k * 1e-6,
        "longitude": 11.5 - k * 1e-6,
        "altitude": 500.0 + k,
        "position_covariance": [float(n + k) for n in range(9)],
        "position_covariance_type": k % 4,
    },
    "geometry_msgs/msg/TwistStamped": lambda k: {
        "header": header(k, "base_link"),
        "twist": {
            "linear": {"x": 0.01 * k, "y": 0.0, "z": 0.0},
            "angular": {"x": 0.0, "y": 0.0, "z": -0.001 * k},
        },
    },
    "std_msgs/msg/Float64": lambda k: {"data": k / 7},
}

CUSTOM = "my_msgs/msg/Everything"
CUSTOM_TEXT = """\
# constants and defaults are no values
uint8 MODE_A=1
string GREETING = "a = b"
std_msgs/Header header
bool ok
int8 small -3
string name "none"  # between numbers, so that what follows moves
uint64 large
float32[3] fixed
Wheel[2] wheels
int16 after
float64[] samples
string<=8[] labels
uint8 mode
Wheel[<=3] spare
float32 last
================================================================================
MSG: my_msgs/Wheel
float64 speed
uint16 ticks
string label
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def header(k: int, frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": 1_700_000_000 + k // 100, "nanosec": k % 100}, "frame_id": frame}


def custom(k: int) -> dict[str, Any]:
    wheels = [{"speed": k + 0.25, "ticks": 60_000 + n, "label": "w" * n} for n in range(2)]
    return {
        "header": header(k, ""),
        "ok": k % 3 == 0,
        "small": -(k % 100),
        "name": "abcdefgh"[: k % 6],
        "large": 2**64 - 1 - k,
        "fixed": [0.5, 1.5, float(k)],
        "wheels": wheels,
        "after": -k,
        "samples": [k / 3] * (k % 4),
        "labels": ["x" * n for n in range(k % 3)],
        "mode": k % 256,
        "spare": wheels[: k % 3],
        "last": -float(k),
    }


def leaves(value: Any, path: str = "") -> Iterable[tuple[str, float]]:
    """The numbers of a message with their paths: what its columns should hold."""
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield from leaves(inner, f"{path}.{name}" if path else name)
    elif isinstance(value, list | tuple):
        for k, inner in enumerate(value):
            yield from leaves(inner, f"{path}.{k}")
    elif not isinstance(value, str):
        yield path, value


def assert_equal(table: Table, messages: list[Mapping[str, Any]]) -> None:
    """Each column holds what the messages hold, bit for bit; NaN where a message has no value."""
    expected = [dict(leaves(message)) for message in messages]
    assert set(table.columns) == {name for values in expected for name in values}
    for name, column in table.columns.items():
        values = [row.get(name, math.nan) for row in expected]
        np.testing.assert_array_equal(column, np.array(values, column.dtype), name)
        if column.dtype.kind == "f":
            np.testing.assert_array_equal(np.signbit(column), np.signbit(values), name)
        else:
            assert column.tolist() == values


def read(path: Path) -> dict[str, Table]:
    """All tables of a log in which nothing is lost."""
    with LogReader(path) as log:
        tables = log.read()
        assert log.losses == []
    return tables


def write_ros2(path: Path, texts: Mapping[str, str], messages: Mapping[str, list]) -> None:
    """Interleaved, by mcap-ros2-support; topic `/0`, `/1`, ... for each type."""
    with path.open("wb") as file:
        writer = Ros2Writer(file)
        schemas = {name: writer.register_msgdef(name, text) for name, text in texts.items()}
        for k in range(COUNT):
            for n, (name, rows) in enumerate(messages.items()):
                stamp = EPOCH_NS + k
                writer.write_message(f"/{n}", schemas[name], rows[k], stamp, stamp, k)
        writer.finish()


def test_ros2_messages(tmp_path: Path, slow: list[int]) -> None:
    messages = {name: [make(k) for k in range(COUNT)] for name, make in PLAIN.items()}
    messages[CUSTOM] = [custom(k) for k in range(COUNT)]
    texts = {name: STORE.generate_msgdef(name, ros_version=2)[0] for name in PLAIN}
    write_ros2(tmp_path / "x.mcap", texts | {CUSTOM: CUSTOM_TEXT}, messages)
    tables = read(tmp_path / "x.mcap")
    for n, (name, rows) in enumerate(messages.items()):
        table = tables[f"/{n}"]
        assert table.schema == name
        assert_equal(table, rows)
        assert table.time.tolist() == [EPOCH_NS + k for k in range(COUNT)]
    assert slow == [0] * len(messages)


def instance(name: str, values: Mapping[str, Any]) -> Any:
    """A message object of rosbags."""
    made = {}
    for field, (kind, detail) in STORE.get_msgdef(name).fields:
        value = values[field]
        if kind.name == "NAME":
            made[field] = instance(detail, value)
        elif isinstance(value, list):
            made[field] = np.array(value, np.float64)
        else:
            made[field] = value
    return STORE.types[name](**made)


def test_bag_of_rosbags(tmp_path: Path, slow: list[int]) -> None:
    with BagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        for n, (name, make) in enumerate(PLAIN.items()):
            connection = bag.add_connection(f"/{n}", name, typestore=STORE)
            for k in range(COUNT):
                payload = STORE.serialize_cdr(instance(name, make(k)), name)
                bag.write(connection, EPOCH_NS + k, payload)
    (path,) = (tmp_path / "bag").glob("*.mcap")
    tables = read(path)
    for n, make in enumerate(PLAIN.values()):
        assert_equal(tables[f"/{n}"], [make(k) for k in range(COUNT)])
    assert slow == [0] * len(PLAIN)


def test_both_byte_orders_in_one_channel(tmp_path: Path, slow: list[int]) -> None:
    name = "sensor_msgs/msg/NavSatFix"
    rows = [PLAIN[name](k) for k in range(COUNT)]
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        text = STORE.generate_msgdef(name, ros_version=2)[0].encode()
        channel = writer.register_channel(
            "/fix", "cdr", writer.register_schema(name, "ros2msg", text)
        )
        for k, row in enumerate(rows):
            payload = STORE.serialize_cdr(instance(name, row), name, little_endian=k % 2 == 0)
            writer.add_message(channel, EPOCH_NS + k, bytes(payload), EPOCH_NS + k)
        writer.finish()
    assert_equal(read(tmp_path / "x.mcap")["/fix"], rows)
    assert slow == [0]


def test_layouts_beyond_the_limit_are_read_by_hand_with_the_same_result(
    tmp_path: Path, slow: list[int]
) -> None:
    """Two strings whose lengths vary against each other: 41 layouts of one length."""
    text = "string a\nstring b\nfloat64 x\nuint8[] more"
    rows = [
        {"a": "a" * (4 * k % 164), "b": "b" * (160 - 4 * k % 164), "x": float(k), "more": [k % 256]}
        for k in range(COUNT)
    ]
    write_ros2(tmp_path / "x.mcap", {"m/msg/T": text}, {"m/msg/T": rows})
    assert_equal(read(tmp_path / "x.mcap")["/0"], rows)
    assert slow[0] > 0


def test_payload_too_short_for_its_schema_is_said(tmp_path: Path) -> None:
    with (tmp_path / "x.mcap").open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema("m/msg/T", "ros2msg", b"float64 x")
        channel = writer.register_channel("/x", "cdr", schema)
        writer.add_message(channel, EPOCH_NS, b"\0\1\0\0" + np.float64(3.0).tobytes(), EPOCH_NS)
        writer.add_message(channel, EPOCH_NS + 1, b"\0\1\0\0" + bytes(5), EPOCH_NS)
        writer.finish()
    with LogReader(tmp_path / "x.mcap") as log:
        found = log.read()["/x"].columns["x"]
        assert log.losses == ["/x: 1 of 2 messages cannot be decoded"]
    np.testing.assert_array_equal(found, [3.0, np.nan])


def test_reference_reader_agrees(tmp_path: Path) -> None:
    """What mcap-ros2-support decodes out of its own file is what our columns hold."""
    rows = [custom(k) for k in range(COUNT)]
    write_ros2(tmp_path / "x.mcap", {CUSTOM: CUSTOM_TEXT}, {CUSTOM: rows})
    with (tmp_path / "x.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = [message for *_, message in reader.iter_decoded_messages()]
    with LogReader(tmp_path / "x.mcap") as log:
        columns = log.read()["/0"].columns
    assert columns["last"].tolist() == [m.last for m in decoded]
    assert columns["wheels.1.speed"].tolist() == [m.wheels[1].speed for m in decoded]
    assert columns["large"].tolist() == [m.large for m in decoded]


_F = descriptor_pb2.FieldDescriptorProto


def foreign_class() -> Any:
    """A message as other people make them: proto3 with what makes the length of it vary."""
    file = descriptor_pb2.FileDescriptorProto(
        name="drive.proto", package="other", syntax="proto3",
        dependency=["google/protobuf/timestamp.proto"],
    )  # fmt: skip
    gear = file.enum_type.add(name="Gear")
    for number, name in enumerate(["NONE", "FIRST", "SECOND"]):
        gear.value.add(name=name, number=number)
    pose = file.message_type.add(name="Pose")
    for number, name in enumerate(["x", "y", "yaw"], 1):
        pose.field.add(name=name, number=number, type=_F.TYPE_DOUBLE, label=_F.LABEL_OPTIONAL)
    state = file.message_type.add(name="State")
    fields = [
        ("stamp", _F.TYPE_MESSAGE, ".google.protobuf.Timestamp"),
        ("frame", _F.TYPE_STRING, ""),
        ("speed", _F.TYPE_DOUBLE, ""),
        ("count", _F.TYPE_UINT64, ""),
        ("delta", _F.TYPE_SINT32, ""),
        ("signed", _F.TYPE_INT64, ""),
        ("gear", _F.TYPE_ENUM, ".other.Gear"),
        ("ok", _F.TYPE_BOOL, ""),
        ("pose", _F.TYPE_MESSAGE, ".other.Pose"),
        ("wide", _F.TYPE_FLOAT, ""),
        ("grade", _F.TYPE_DOUBLE, ""),
        ("laps", _F.TYPE_INT32, ""),
    ]
    for number, (name, kind, type_) in enumerate(fields, 1):
        field = state.field.add(name=name, number=number, type=kind, label=_F.LABEL_OPTIONAL)
        if type_:
            field.type_name = type_
        if name in ("grade", "laps"):
            field.proto3_optional = True
            field.oneof_index = len(state.oneof_decl)
            state.oneof_decl.add(name=f"_{name}")
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("other.State"))


def state(k: int) -> dict[str, Any]:
    """Values of one message; zeros are omitted on the wire, None is not set at all."""
    return {
        "stamp": {"seconds": 1_700_000_000 + k // 10, "nanos": k % 10 * 100_000_000},
        "frame": "base" if k % 5 else "",
        "speed": 0.0 if k % 7 == 0 else k / 3,
        "count": k * k,
        "delta": (-1) ** k * k,
        "signed": -k if k % 2 else k << 40,
        "gear": k % 3,
        "ok": k % 2 == 0,
        "pose": None if k % 4 == 0 else {"x": float(k % 3), "y": 0.0, "yaw": -0.5},
        "wide": 0.25 * k,
        "grade": None if k % 3 == 0 else 0.0,
        "laps": None if k % 11 == 0 else k % 2,
    }


def test_foreign_protobuf(tmp_path: Path, slow: list[int]) -> None:
    cls = foreign_class()
    rows = [state(k) for k in range(COUNT)]
    with (tmp_path / "x.mcap").open("wb") as file, ProtobufWriter(file) as writer:
        for k, row in enumerate(rows):
            message = cls(**{name: value for name, value in row.items() if value is not None})
            writer.write_message("/state", message, EPOCH_NS + k, EPOCH_NS + k)
    table = read(tmp_path / "x.mcap")["/state"]
    given = [{name: v for name, v in row.items() if v is not None} for row in rows]
    assert_equal(table, given)
    assert slow == [0]
    assert table.columns["count"].dtype == np.uint64
    assert table.columns["laps"].dtype == np.float64  # it is missing at times
