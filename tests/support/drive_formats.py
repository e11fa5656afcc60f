"""One drive, written by the libraries of each format."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

START = 1_700_000_000_000_000_000
N = 400
T = np.arange(N) / 100  # s
TIME = START + np.round(T * 1e9).astype(np.int64)
IMU = {
    "accel_x": np.round(np.sin(T), 2),
    "accel_y": np.round(0.3 * np.cos(2 * T), 2),
    "accel_z": np.round(9.81 + 0.2 * np.sin(5 * T), 2),
    "gyro_x": np.round(0.02 * np.cos(T), 3),
    "gyro_y": np.round(0.03 * np.sin(3 * T), 3),
    "gyro_z": np.round(0.2 * np.sin(0.5 * T), 3),
}
SPEED = np.round(12 + 3 * np.sin(T[::5]), 2)  # at 20 Hz

DBC = """VERSION ""
BS_:
BU_: ECU
BO_ 256 Accel: 8 ECU
 SG_ ax : 0|16@1- (0.01,0) [0|0] "m/s^2" ECU
 SG_ ay : 16|16@1- (0.01,0) [0|0] "m/s^2" ECU
 SG_ az : 32|16@1- (0.01,0) [0|0] "m/s^2" ECU
BO_ 257 Gyro: 8 ECU
 SG_ wx : 7|16@0- (0.001,0) [0|0] "rad/s" ECU
 SG_ wy : 23|16@0- (0.001,0) [0|0] "rad/s" ECU
 SG_ wz : 39|16@0- (0.001,0) [0|0] "rad/s" ECU
BO_ 258 Odo: 8 ECU
 SG_ v : 0|16@1+ (0.01,0) [0|0] "m/s" ECU
"""
NAMES = dict(zip(IMU, ("ax", "ay", "az", "wx", "wy", "wz"), strict=True))
UNITS = {"a": "m/s^2", "g": "rad/s"}


def profile_of(folder: Path, prefix: str = "", names: dict[str, str] = NAMES) -> Path:
    lines = ["[imu]"]
    lines += [f'{k} = {{ from = "{prefix}{n}", unit = "{UNITS[k[0]]}" }}' for k, n in names.items()]
    lines += ["[speed]", f'v = {{ from = "{prefix}v", unit = "m/s" }}']
    path = folder / "car.toml"
    path.write_text("\n".join(lines))
    return path


def payloads() -> list[tuple[int, int, bytes]]:
    """(ns, identifier, data) of the drive on a bus, in order of time."""
    cantools = pytest.importorskip("cantools")
    database = cantools.database.load_string(DBC, "dbc")
    frames = []
    for k, stamp in enumerate(TIME.tolist()):
        row = {NAMES[name]: float(values[k]) for name, values in IMU.items()}
        for message in ("Accel", "Gyro"):
            definition = database.get_message_by_name(message)
            data = {s.name: row[s.name] for s in definition.signals}
            frames.append((stamp, definition.frame_id, definition.encode(data)))
        if k % 5 == 0:
            odo = database.get_message_by_name("Odo")
            frames.append((stamp, odo.frame_id, odo.encode({"v": float(SPEED[k // 5])})))
    return frames


def write_trace(path: Path) -> Path:
    """BLF, ASC, TRC or candump, by the suffix."""
    can = pytest.importorskip("can")
    with can.Logger(path) as writer:
        for stamp, identifier, data in payloads():
            writer.on_message_received(
                can.Message(
                    timestamp=stamp * 1e-9,
                    arbitration_id=identifier,
                    is_extended_id=False,
                    data=data,
                    channel=0,
                )
            )
    return path


def write_mdf(path: Path, version: str = "4.10") -> Path:
    """MDF with a channel group for each clock."""
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version=version) as file:
        file.start_time = datetime.fromtimestamp(START * 1e-9, UTC)
        signal = asammdf.Signal
        file.append([signal(v, T, name=NAMES[k], unit=UNITS[k[0]]) for k, v in IMU.items()])
        file.append([signal(SPEED, T[::5], name="v", unit="m/s")])
        file.save(path)
    return path


def write_mdf_bus(path: Path) -> Path:
    """MDF 4 with raw CAN frames."""
    asammdf = pytest.importorskip("asammdf")
    frames = payloads()
    dtype = np.dtype(
        [
            ("CAN_DataFrame.BusChannel", "u1"),
            ("CAN_DataFrame.ID", "<u4"),
            ("CAN_DataFrame.IDE", "u1"),
            ("CAN_DataFrame.DLC", "u1"),
            ("CAN_DataFrame.DataLength", "u1"),
            ("CAN_DataFrame.DataBytes", "(8,)u1"),
        ]
    )
    rows = np.zeros(len(frames), dtype)
    rows["CAN_DataFrame.ID"] = [identifier for _, identifier, _ in frames]
    rows["CAN_DataFrame.DLC"] = rows["CAN_DataFrame.DataLength"] = 8
    rows["CAN_DataFrame.DataBytes"] = [list(data) for _, _, data in frames]
    times = np.array([(stamp - START) * 1e-9 for stamp, _, _ in frames])
    with asammdf.MDF() as file:
        file.start_time = datetime.fromtimestamp(START * 1e-9, UTC)
        file.append(asammdf.Signal(rows, times, name="CAN_DataFrame"))
        file.save(path)
    return path


def _table() -> dict[str, np.ndarray]:
    v = np.full(N, np.nan)
    v[::5] = SPEED
    return {NAMES[k]: values for k, values in IMU.items()} | {"v": v}


def write_text(path: Path) -> Path:
    """CSV, blanks where there is no value."""
    columns = _table()
    rows = zip(TIME.tolist(), *(c.tolist() for c in columns.values()), strict=True)
    lines = [",".join("" if x != x else repr(x) for x in row) for row in rows]
    path.write_text(",".join(["time_ns", *columns]) + "\n" + "\n".join(lines) + "\n")
    return path


def write_parquet(path: Path, dates: bool = False) -> Path:
    """Parquet with integer nanoseconds or with dates."""
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    time = TIME.astype("datetime64[ns]") if dates else TIME
    parquet.write_table(pyarrow.table({"time": time, **_table()}), path)
    return path


ROS_NAMES = {
    f"{kind}_{axis}": f"{field}.{axis}"
    for kind, field in (("accel", "linear_acceleration"), ("gyro", "angular_velocity"))
    for axis in "xyz"
}


def ros_messages(store):
    """(topic, type, ns, message): an Imu and a TwistStamped topic."""
    t = store.types
    vector, header, stamp = (
        t[f"{name}"]
        for name in (
            "geometry_msgs/msg/Vector3",
            "std_msgs/msg/Header",
            "builtin_interfaces/msg/Time",
        )
    )
    seq = {"seq": 0} if "seq" in header.__dataclass_fields__ else {}

    def head(ns: int):
        return header(stamp=stamp(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="car", **seq)

    for k, ns in enumerate(TIME.tolist()):
        row = {name: float(values[k]) for name, values in IMU.items()}
        yield (
            "/sensors/imu",
            "sensor_msgs/msg/Imu",
            ns,
            t["sensor_msgs/msg/Imu"](
                header=head(ns),
                orientation=t["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                orientation_covariance=np.zeros(9),
                angular_velocity=vector(x=row["gyro_x"], y=row["gyro_y"], z=row["gyro_z"]),
                angular_velocity_covariance=np.zeros(9),
                linear_acceleration=vector(x=row["accel_x"], y=row["accel_y"], z=row["accel_z"]),
                linear_acceleration_covariance=np.zeros(9),
            ),
        )
        if k % 5 == 0:
            zero = vector(x=0.0, y=0.0, z=0.0)
            moving = vector(x=float(SPEED[k // 5]), y=0.0, z=0.0)
            yield (
                "/car/twist",
                "geometry_msgs/msg/TwistStamped",
                ns,
                t["geometry_msgs/msg/TwistStamped"](
                    header=head(ns),
                    twist=t["geometry_msgs/msg/Twist"](linear=moving, angular=zero),
                ),
            )


def write_ros1(path: Path, compression: str = "none", chunk: int = 1 << 20) -> Path:
    """chunk: bytes of each."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    writer.chunk_threshold = chunk
    if compression != "none":
        writer.set_compression(Writer.CompressionFormat[compression])
    with writer:
        connections = {}
        for topic, kind, ns, message in ros_messages(store):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], ns, store.serialize_ros1(message, kind))
    return path


def write_ros2(path: Path, storage: str, late: int = 0, mode: str = "NONE") -> Path:
    """late: ns by which the recording is later than the header's stamp. mode: of compression."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(path, version=9, storage_plugin=StoragePlugin[storage])
    if mode != "NONE":
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, ns, message in ros_messages(store):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], ns + late, store.serialize_cdr(message, kind))
    return path


def write_kitti(folder: Path, count: int = 50) -> Path:
    """A KITTI drive uphill at 10 m/s to the north, climbing 1 m/s."""
    data = folder / "2011_09_26_drive_0001_sync" / "oxts" / "data"
    data.mkdir(parents=True)
    stamps = []
    for k in range(count):
        position, angles = [49 + 1e-6 * k, 8.4, 112 + 0.1 * k], [0.01, -0.02, np.pi / 2]
        motion = [10.0, 0.0, 10.05, 0.0, 1.0, *[0.1, 0.2, 9.8] * 2, *[0.01, 0.02, 0.03] * 2]
        row = [*position, *angles, *motion, 0.05, 0.03, 4, 9, 5, 5, 5]
        (data / f"{k:010d}.txt").write_text(" ".join(map(str, row)))
        stamps.append(f"2011-09-26 13:02:{25 + k // 10:02d}.{k % 10}00000009")
    (data.parent / "timestamps.txt").write_text("\n".join(stamps) + "\n")
    return data.parent.parent
