"""CAN frames in a bag or MCAP go through the one CAN decoder."""

from __future__ import annotations

import numpy as np
import pytest
from mcap.writer import Writer
from support.drive_formats import DBC, IMU, SPEED, TIME, payloads, profile_of

from roadlog.ingest import ingest

rosbags = pytest.importorskip("rosbags")
FRAME = """std_msgs/Header header
uint32 id
bool is_rtr
bool is_extended
bool is_error
uint8 dlc
uint8[8] data"""
FD = """std_msgs/Header header
uint32 id
bool is_extended
bool is_error
uint8 len
uint8[<=64] data"""


@pytest.mark.parametrize(
    ("name", "text"),
    [("can_msgs/msg/Frame", FRAME), ("ros2_socketcan_msgs/msg/FdFrame", FD)],
)
def test_frames_of_a_bus(tmp_path, name, text):
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(text, name))
    types = store.types
    with (tmp_path / "drive.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        definition, _ = store.generate_msgdef(name, ros_version=2)
        schema = writer.register_schema(name, "ros2msg", definition.encode())
        channel = writer.register_channel("/can0", "cdr", schema)
        for ns, identifier, data in payloads():
            stamp = types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
            head = types["std_msgs/msg/Header"](stamp=stamp, frame_id="can")
            size = {"len": len(data)} if "Fd" in name else {"dlc": len(data), "is_rtr": False}
            made = types[name](
                header=head, id=identifier, is_extended=False, is_error=False,
                data=np.frombuffer(data, np.uint8), **size,
            )  # fmt: skip
            writer.add_message(channel, ns, bytes(store.serialize_cdr(made, name)), ns)
        writer.finish()
    (tmp_path / "car.dbc").write_text(DBC)
    result = ingest([tmp_path / "drive.mcap"], profile_of(tmp_path), [tmp_path / "car.dbc"])
    tables = {table.topic: table for table in result.tables}
    np.testing.assert_array_equal(tables["/imu"].time, TIME)
    for role, values in IMU.items():
        np.testing.assert_allclose(tables["/imu"].columns[role], values, atol=1e-9)
    np.testing.assert_allclose(tables["/speed"].columns["v"], SPEED, atol=1e-9)
