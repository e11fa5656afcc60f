"""One drive, written by the libraries in every format: each gives the same columns."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from roadlog.ingest import ingest

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


def check(result, resolution_ns: int = 0) -> None:
    tables = {table.topic: table for table in result.tables}
    assert set(tables) == {"/imu", "/speed"}
    assert np.abs(tables["/imu"].time - TIME).max() <= resolution_ns
    assert np.abs(tables["/speed"].time - TIME[::5]).max() <= resolution_ns
    for name, values in IMU.items():
        np.testing.assert_allclose(tables["/imu"].columns[name], values, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(tables["/speed"].columns["v"], SPEED, atol=1e-9)
    assert not result.losses


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC)
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


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".trc", ".log"])
def test_can_traces(tmp_path, dbc, suffix):
    can = pytest.importorskip("can")
    path = tmp_path / f"drive{suffix}"
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
    renamed = path.rename(tmp_path / "drive.bin")  # told by what is in it
    # TRC keeps 0.1 ms of offsets and rounds the start to its date's resolution
    check(ingest([renamed], profile_of(tmp_path), [dbc]), 2_000_000 if suffix == ".trc" else 2_000)


def test_mdf_channel_groups(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    from datetime import UTC, datetime

    path = tmp_path / "drive.mf4"
    with asammdf.MDF() as file:
        file.start_time = datetime.fromtimestamp(START * 1e-9, UTC)
        signal = asammdf.Signal
        file.append([signal(v, T, name=NAMES[k], unit=UNITS[k[0]]) for k, v in IMU.items()])
        file.append([signal(SPEED, T[::5], name="v", unit="m/s")])
        file.save(path)
    check(ingest([path], profile_of(tmp_path)), 1_000)


def test_mdf_bus_logging(tmp_path, dbc):
    asammdf = pytest.importorskip("asammdf")
    from datetime import UTC, datetime

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
    path = tmp_path / "drive.mf4"
    with asammdf.MDF() as file:
        file.start_time = datetime.fromtimestamp(START * 1e-9, UTC)
        file.append(asammdf.Signal(rows, times, name="CAN_DataFrame"))
        file.save(path)
    check(ingest([path], profile_of(tmp_path), [dbc]), 1_000)


def test_text_and_parquet(tmp_path):
    v = np.full(N, np.nan)
    v[::5] = SPEED
    columns = {NAMES[k]: values for k, values in IMU.items()} | {"v": v}
    text = tmp_path / "drive.csv"
    rows = zip(TIME.tolist(), *(c.tolist() for c in columns.values()), strict=True)
    lines = [",".join("" if x != x else repr(x) for x in row) for row in rows]
    text.write_text(",".join(["time_ns", *columns]) + "\n" + "\n".join(lines) + "\n")
    check(ingest([text], profile_of(tmp_path)))
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    for time in (TIME, TIME.astype("datetime64[ns]")):
        parquet.write_table(pyarrow.table({"time": time, **columns}), tmp_path / "drive.parquet")
        check(ingest([tmp_path / "drive.parquet"], profile_of(tmp_path)))


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


def write_ros1(path: Path) -> Path:
    pytest.importorskip("rosbags")
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        connections = {}
        for topic, kind, ns, message in ros_messages(store):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], ns, store.serialize_ros1(message, kind))
    return path


def write_ros2(path: Path, storage: str, late: int = 0) -> Path:
    """late: ns by which the recording is later than the header's stamp."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(path, version=9, storage_plugin=StoragePlugin[storage]) as writer:
        connections = {}
        for topic, kind, ns, message in ros_messages(store):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], ns + late, store.serialize_cdr(message, kind))
    return path


def test_ros1_bag(tmp_path):
    bag = write_ros1(tmp_path / "drive.bag")
    check(ingest([bag]))  # the profile is found by the message types
    names = {k: f"/sensors/imu.{v}" for k, v in ROS_NAMES.items()}
    profile = profile_of(tmp_path, "", names)
    profile.write_text(profile.read_text().replace('"v"', '"/car/twist.twist.linear.x"'))
    check(ingest([bag], profile))


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_ros2_bag_folder_and_the_file_in_it(tmp_path, storage):
    bag = write_ros2(tmp_path / "drive", storage)
    check(ingest([bag]))
    inside = next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap"))
    check(ingest([inside]))


@pytest.mark.parametrize("storage", ["SQLITE3", "MCAP"])
def test_the_header_is_the_clock_where_the_profile_says_so(tmp_path, storage):
    from importlib.resources import files

    bag = write_ros2(tmp_path / "drive", storage, late=30_000_000)
    text = files("roadlog").joinpath("profiles/ros.toml").read_text("utf-8")
    profile = tmp_path / "header.toml"
    profile.write_text('[time]\nclock = "header"\n' + text[: text.index("[gnss]")])
    check(ingest([bag], profile))
    inside = next(p for p in bag.iterdir() if p.suffix in (".db3", ".mcap"))
    check(ingest([inside], profile))


def test_foreign_json_in_an_mcap(tmp_path):
    from mcap.writer import Writer

    path = tmp_path / "drive.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("car.Imu", "jsonschema", b'{"type": "object"}')
        imu = writer.register_channel("/car/imu", "json", schema)
        odo = writer.register_channel("/car/odo", "json", schema)
        for k, ns in enumerate(TIME.tolist()):
            row = {NAMES[name]: float(values[k]) for name, values in IMU.items()}
            data = json.dumps({"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, **row})
            writer.add_message(imu, ns, data.encode(), ns)
            if k % 5 == 0:
                writer.add_message(odo, ns, json.dumps({"v": SPEED[k // 5]}).encode(), ns)
        writer.finish()
    names = {k: f"/car/imu.{v}" for k, v in NAMES.items()}
    profile = profile_of(tmp_path, "", names)
    profile.write_text(profile.read_text().replace('"v"', '"/car/odo.v"'))
    check(ingest([path], profile))
