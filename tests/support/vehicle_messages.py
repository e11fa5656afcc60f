# ruff: noqa: E501 - tables
"""Messages that cars log, of many makers: a drive of known values in each of them.

The definitions name the fields that matter here, as the makers' packages have them; each kind gives
what it says of the drive in the maker's units and frame.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

START = 1_700_000_000_000_000_000
RATE, SECONDS, G, RADIUS = 25, 60, 9.80665, 0.33
T = np.arange(RATE * SECONDS) / RATE
TIME = START + np.round(T * 1e9).astype(np.int64)
V = 12 + 4 * np.sin(2 * np.pi * T / 17)
YAW_RATE = 0.12 * np.sin(2 * np.pi * T / 23)
HEADING = 0.7 + np.cumsum(YAW_RATE) / RATE  # counterclockwise from east
GRADE = np.radians(4) * np.sin(2 * np.pi * T / 40)
CLIMB = V * np.sin(GRADE)
EAST, NORTH = V * np.cos(HEADING), V * np.sin(HEADING)
LATITUDE = 48.0 + np.degrees(np.cumsum(NORTH) / RATE / 6_371_000.0)
LONGITUDE = 11.0 + np.degrees(np.cumsum(EAST) / RATE / 6_371_000.0 / np.cos(np.radians(48.0)))
ALTITUDE = 500 + np.cumsum(CLIMB) / RATE
ROLL = np.radians(2) * np.sin(2 * np.pi * T / 9)
ACCEL = np.array([np.gradient(V, T) + G * np.sin(GRADE), V * YAW_RATE, G * np.cos(GRADE)])
GYRO = np.array([np.gradient(ROLL, T), -np.gradient(GRADE, T), YAW_RATE])

DEFINITIONS = {
    "autoware_vehicle_msgs/msg/VelocityReport":
        "std_msgs/Header header\nfloat32 longitudinal_velocity\nfloat32 lateral_velocity\nfloat32 heading_rate",
    "autoware_vehicle_msgs/msg/SteeringReport":
        "builtin_interfaces/Time stamp\nfloat32 steering_tire_angle",
    "dbw_mkz_msgs/msg/WheelSpeedReport":
        "std_msgs/Header header\nfloat32 front_left\nfloat32 front_right\nfloat32 rear_left\nfloat32 rear_right",
    "dbw_fca_msgs/msg/SteeringReport":
        "std_msgs/Header header\nfloat32 steering_wheel_angle\nfloat32 speed",
    "ds_dbw_msgs/msg/VehicleVelocity": "std_msgs/Header header\nfloat32 vehicle_velocity_brake",
    "pacmod3_msgs/msg/WheelSpeedRpt":
        "std_msgs/Header header\nfloat64 front_left_wheel_speed\nfloat64 front_right_wheel_speed\n"
        "float64 rear_left_wheel_speed\nfloat64 rear_right_wheel_speed",
    "pacmod3_msgs/msg/VehicleSpeedRpt":
        "std_msgs/Header header\nfloat64 vehicle_speed\nbool vehicle_speed_valid",
    "novatel_oem7_msgs/msg/CORRIMU":
        "std_msgs/Header header\nuint32 imu_data_count\nfloat64 pitch_rate\nfloat64 roll_rate\n"
        "float64 yaw_rate\nfloat64 lateral_acc\nfloat64 longitudinal_acc\nfloat64 vertical_acc",
    "novatel_oem7_msgs/msg/SolutionStatus": "uint32 status",
    "novatel_oem7_msgs/msg/BESTPOS":
        "std_msgs/Header header\nnovatel_oem7_msgs/SolutionStatus sol_status\nfloat64 lat\nfloat64 lon\n"
        "float64 hgt\nfloat32 lat_stdev\nfloat32 hgt_stdev",
    "novatel_oem7_msgs/msg/BESTVEL":
        "std_msgs/Header header\nnovatel_oem7_msgs/SolutionStatus sol_status\nfloat64 hor_speed\n"
        "float64 trk_gnd\nfloat64 ver_speed",
    "novatel_oem7_msgs/msg/INSPVA":
        "std_msgs/Header header\nfloat64 latitude\nfloat64 longitude\nfloat64 height\n"
        "float64 north_velocity\nfloat64 east_velocity\nfloat64 up_velocity\nfloat64 roll\n"
        "float64 pitch\nfloat64 azimuth",
    "ublox_msgs/msg/NavPVT":
        "uint32 iTOW\nuint8 fixType\nint32 lon\nint32 lat\nint32 height\nint32 hMSL\nuint32 hAcc\n"
        "int32 velN\nint32 velE\nint32 velD\nint32 gSpeed\nint32 heading",
    "gps_common/msg/GPSStatus": "std_msgs/Header header\nint16 status",
    "gps_common/msg/GPSFix":
        "std_msgs/Header header\ngps_common/GPSStatus status\nfloat64 latitude\nfloat64 longitude\n"
        "float64 altitude\nfloat64 track\nfloat64 speed\nfloat64 climb",
    "septentrio_gnss_driver/msg/PVTGeodetic":
        "std_msgs/Header header\nuint8 error\nfloat64 latitude # rad\nfloat64 longitude # rad\n"
        "float64 height # m\nfloat32 vn\nfloat32 ve\nfloat32 vu\nuint16 h_accuracy\nuint16 v_accuracy",
    "septentrio_gnss_driver/msg/INSNavGeod":
        "std_msgs/Header header\nuint8 error\nfloat64 latitude # rad\nfloat64 longitude # rad\n"
        "float64 height # m\nfloat32 heading\nfloat32 pitch\nfloat32 roll\nfloat32 ve\nfloat32 vn\nfloat32 vu",
    "sbg_driver/msg/SbgImuData":
        "std_msgs/Header header\nuint32 time_stamp\ngeometry_msgs/Vector3 accel\ngeometry_msgs/Vector3 gyro",
    "sbg_driver/msg/SbgGpsPos":
        "std_msgs/Header header\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
        "geometry_msgs/Vector3 position_accuracy",
    "sbg_driver/msg/SbgGpsVel":
        "std_msgs/Header header\ngeometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 velocity_accuracy",
    "septentrio_gnss_driver/msg/ExtSensorMeas":
        "std_msgs/Header header\nfloat64 acceleration_x # m/s^2\nfloat64 acceleration_y # m/s^2\n"
        "float64 acceleration_z # m/s^2\nfloat64 angular_rate_x # deg/s\nfloat64 angular_rate_y # deg/s\n"
        "float64 angular_rate_z # deg/s",
    "ublox_msgs/msg/NavPOSLLH": "uint32 iTOW\nint32 lon\nint32 lat\nint32 height\nuint32 hAcc\nuint32 vAcc",
    "ublox_msgs/msg/NavVELNED": "uint32 iTOW\nint32 velD\nuint32 speed\nuint32 gSpeed\nint32 heading",
    "ublox_msgs/msg/NavATT": "uint32 iTOW\nint32 roll\nint32 pitch\nint32 heading",
    "foxglove_msgs/msg/LocationFix":
        "builtin_interfaces/Time timestamp\nstring frame_id\nfloat64 latitude\nfloat64 longitude\n"
        "float64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type",
    "septentrio_gnss_driver/msg/AttEuler": "std_msgs/Header header\nuint8 error\nfloat32 heading\nfloat32 pitch\nfloat32 roll",
    "sbg_driver/msg/SbgEkfNav":
        "std_msgs/Header header\nfloat64 latitude\nfloat64 longitude\nfloat64 altitude\n"
        "geometry_msgs/Vector3 velocity\ngeometry_msgs/Vector3 position_accuracy",
    "pacmod3_msgs/msg/AngVelRpt": "std_msgs/Header header\nfloat64 yaw_vel\nbool yaw_valid",
    "pacmod3_msgs/msg/YawRateRpt": "std_msgs/Header header\nfloat64 yaw_rate",
}  # fmt: skip

SPEED = {"speed.v": V}
WHEELS = {f"wheel_speeds.{w}": V for w in ("fl", "fr", "rl", "rr")}
IMU = {
    f"imu.{k}_{a}": x[i] for k, x in (("accel", ACCEL), ("gyro", GYRO)) for i, a in enumerate("xyz")
}
ACCELERATIONS = {role: values for role, values in IMU.items() if "accel" in role}
FIX = {"gnss.latitude": LATITUDE, "gnss.longitude": LONGITUDE, "gnss.altitude": ALTITUDE}
VELOCITY = {"gnss.speed": V, "gnss.course": HEADING, "gnss.climb": CLIMB}
ATTITUDE = {"truth.inclination": GRADE, "truth.roll_total": ROLL}

Xyz = Mapping[str, Any]


def xyz(x: float, y: float, z: float) -> Xyz:
    return {"x": x, "y": y, "z": z}


def _wheels(k: int) -> list[float]:
    return [V[k] / RADIUS] * 4


def _named(names: list[str]) -> Callable[[int], Xyz]:
    return lambda k: dict(zip(names, _wheels(k), strict=True))


CORNERS = ["front_left", "front_right", "rear_left", "rear_right"]
Kind = tuple[str, str, Callable[[int], Mapping[str, Any]], Mapping[str, np.ndarray]]

# name -> topic, type, values of message k, and the signals that they are
KINDS: dict[str, Kind] = {
    "imu": ("/imu/data", "sensor_msgs/msg/Imu", lambda k: {
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "angular_velocity": xyz(*GYRO[:, k]), "linear_acceleration": xyz(*ACCEL[:, k])}, IMU),
    "corrimu": ("/novatel/oem7/corrimu", "novatel_oem7_msgs/msg/CORRIMU", lambda k: {
        "longitudinal_acc": ACCEL[0, k], "lateral_acc": -ACCEL[1, k], "vertical_acc": ACCEL[2, k],
        "roll_rate": GYRO[0, k], "pitch_rate": -GYRO[1, k], "yaw_rate": GYRO[2, k]}, IMU),
    "sbg_ned": ("/sbg/imu_data", "sbg_driver/msg/SbgImuData", lambda k: {
        "accel": xyz(ACCEL[0, k], -ACCEL[1, k], -ACCEL[2, k]),
        "gyro": xyz(GYRO[0, k], -GYRO[1, k], -GYRO[2, k])}, IMU),
    "sbg_enu": ("/sbg/imu_data", "sbg_driver/msg/SbgImuData", lambda k: {
        "accel": xyz(-ACCEL[1, k], ACCEL[0, k], ACCEL[2, k]),
        "gyro": xyz(-GYRO[1, k], GYRO[0, k], GYRO[2, k])}, IMU),
    "septentrio_imu": ("/extsensormeas", "septentrio_gnss_driver/msg/ExtSensorMeas", lambda k: {
        **{f"acceleration_{a}": s * ACCEL[i, k] for i, (a, s) in enumerate(zip("xyz", (1, -1, -1), strict=True))},
        **{f"angular_rate_{a}": s * np.degrees(GYRO[i, k])
           for i, (a, s) in enumerate(zip("xyz", (1, -1, -1), strict=True))}}, IMU),
    "velocity_report": ("/vehicle/status/velocity_status", "autoware_vehicle_msgs/msg/VelocityReport",
        lambda k: {"longitudinal_velocity": V[k], "heading_rate": YAW_RATE[k]}, SPEED),
    "steering_report": ("/vehicle/status/steering_status", "autoware_vehicle_msgs/msg/SteeringReport",
        lambda k: {"steering_tire_angle": YAW_RATE[k]}, {"steering.road_wheel_angle": YAW_RATE}),
    "dbw_wheels": ("/vehicle/wheel_speed_report", "dbw_mkz_msgs/msg/WheelSpeedReport",
        _named(CORNERS), WHEELS),
    "dbw_speed": ("/vehicle/steering_report", "dbw_fca_msgs/msg/SteeringReport",
        lambda k: {"speed": V[k], "steering_wheel_angle": YAW_RATE[k]}, SPEED),
    "ds_dbw": ("/vehicle/velocity", "ds_dbw_msgs/msg/VehicleVelocity",
        lambda k: {"vehicle_velocity_brake": V[k]}, SPEED),
    "pacmod_wheels": ("/pacmod/wheel_speed_rpt", "pacmod3_msgs/msg/WheelSpeedRpt",
        _named([f"{corner}_wheel_speed" for corner in CORNERS]), WHEELS),
    "pacmod_speed": ("/pacmod/vehicle_speed_rpt", "pacmod3_msgs/msg/VehicleSpeedRpt",
        lambda k: {"vehicle_speed": V[k], "vehicle_speed_valid": True}, SPEED),
    "twist": ("/vehicle/twist", "geometry_msgs/msg/TwistStamped",
        lambda k: {"twist": {"linear": xyz(V[k], 0.1, 0.0)}}, SPEED),
    "odometry": ("/odom", "nav_msgs/msg/Odometry",
        lambda k: {"twist": {"twist": {"linear": xyz(V[k], 0.0, 0.0)}}}, SPEED),
    "joints": ("/joint_states", "sensor_msgs/msg/JointState", lambda k: {
        "name": ["wheel_front_left", "steer_front_left", "wheel_rear_right"],
        "velocity": np.array([V[k] / RADIUS, 0.01, V[k] / RADIUS])},
        {role: WHEELS[role] for role in ("wheel_speeds.fl", "wheel_speeds.rr")}),
    "fix_velocity": ("/ublox/fix_velocity", "geometry_msgs/msg/TwistWithCovarianceStamped",
        lambda k: {"twist": {"twist": {"linear": xyz(EAST[k], NORTH[k], CLIMB[k])}}}, VELOCITY),
    "map_twist": ("/velocity", "geometry_msgs/msg/TwistStamped",
        lambda k: {"twist": {"linear": xyz(EAST[k], NORTH[k], CLIMB[k])}}, VELOCITY),
    "xsens_velocity": ("/filter/velocity", "geometry_msgs/msg/Vector3Stamped",
        lambda k: {"vector": xyz(EAST[k], NORTH[k], CLIMB[k])}, VELOCITY),
    "fix": ("/gps/fix", "sensor_msgs/msg/NavSatFix", lambda k: {
        "latitude": LATITUDE[k], "longitude": LONGITUDE[k], "altitude": ALTITUDE[k],
        "position_covariance": np.array([4.0, 0, 0, 0, 4.0, 0, 0, 0, 9.0]),
        "position_covariance_type": 2},
        {**FIX, "gnss.horizontal_accuracy": 2 + 0 * T, "gnss.vertical_accuracy": 3 + 0 * T}),
    "navpvt": ("/ublox/navpvt", "ublox_msgs/msg/NavPVT", lambda k: {
        "fixType": 3, "lat": round(1e7 * LATITUDE[k]), "lon": round(1e7 * LONGITUDE[k]),
        "height": round(1e3 * ALTITUDE[k]), "hAcc": 1500, "velD": round(-1e3 * CLIMB[k]),
        "gSpeed": round(1e3 * V[k]), "heading": round(1e5 * (90 - np.degrees(HEADING[k]))),
        }, {**FIX, **VELOCITY, "gnss.horizontal_accuracy": 1.5 + 0 * T}),
    "gpsfix": ("/gps", "gps_common/msg/GPSFix", lambda k: {
        "latitude": LATITUDE[k], "longitude": LONGITUDE[k], "altitude": ALTITUDE[k], "speed": V[k],
        "track": 90 - np.degrees(HEADING[k]), "climb": CLIMB[k]}, {**FIX, **VELOCITY}),
    "bestpos": ("/novatel/bestpos", "novatel_oem7_msgs/msg/BESTPOS", lambda k: {
        "lat": LATITUDE[k], "lon": LONGITUDE[k], "hgt": ALTITUDE[k], "lat_stdev": 2.0,
        "hgt_stdev": 3.0}, {**FIX, "gnss.vertical_accuracy": 3 + 0 * T}),
    "bestvel": ("/novatel/bestvel", "novatel_oem7_msgs/msg/BESTVEL", lambda k: {
        "hor_speed": V[k], "trk_gnd": 90 - np.degrees(HEADING[k]), "ver_speed": CLIMB[k]}, VELOCITY),
    "inspva": ("/novatel/inspva", "novatel_oem7_msgs/msg/INSPVA", lambda k: {
        "latitude": LATITUDE[k], "longitude": LONGITUDE[k], "height": ALTITUDE[k],
        "north_velocity": NORTH[k], "east_velocity": EAST[k], "up_velocity": CLIMB[k],
        "pitch": np.degrees(GRADE[k]), "roll": np.degrees(ROLL[k])}, {**FIX, **VELOCITY, **ATTITUDE}),
    "septentrio": ("/pvtgeodetic", "septentrio_gnss_driver/msg/PVTGeodetic", lambda k: {
        "latitude": np.radians(LATITUDE[k]), "longitude": np.radians(LONGITUDE[k]),
        "height": ALTITUDE[k], "vn": NORTH[k], "ve": EAST[k], "vu": CLIMB[k], "h_accuracy": 150},
        {**FIX, **VELOCITY, "gnss.horizontal_accuracy": 1.5 + 0 * T}),
    "septentrio_ins": ("/insnavgeod", "septentrio_gnss_driver/msg/INSNavGeod", lambda k: {
        "latitude": np.radians(LATITUDE[k]), "longitude": np.radians(LONGITUDE[k]),
        "height": ALTITUDE[k], "vn": NORTH[k], "ve": EAST[k], "vu": CLIMB[k],
        "pitch": np.degrees(GRADE[k]), "roll": np.degrees(ROLL[k])}, {**FIX, **VELOCITY, **ATTITUDE}),
    "sbg_gps": ("/sbg/gps_pos", "sbg_driver/msg/SbgGpsPos", lambda k: {
        "latitude": LATITUDE[k], "longitude": LONGITUDE[k], "altitude": ALTITUDE[k],
        "position_accuracy": xyz(2.0, 2.0, 3.0)}, {**FIX, "gnss.vertical_accuracy": 3 + 0 * T}),
    "accel": ("/imu/accel", "geometry_msgs/msg/AccelStamped", lambda k: {
        "accel": {"linear": xyz(*ACCEL[:, k])}}, ACCELERATIONS),
    "accel_covariance": ("/accel", "geometry_msgs/msg/AccelWithCovarianceStamped", lambda k: {
        "accel": {"accel": {"linear": xyz(*ACCEL[:, k])}}}, ACCELERATIONS),
    "xsens_accel": ("/imu/acceleration", "geometry_msgs/msg/Vector3Stamped", lambda k: {
        "vector": xyz(*ACCEL[:, k])}, ACCELERATIONS),
    "xsens_rates": ("/imu/angular_velocity", "geometry_msgs/msg/Vector3Stamped", lambda k: {
        "vector": xyz(*GYRO[:, k])}, {r: x for r, x in IMU.items() if "gyro" in r}),
    "xsens_lla": ("/filter/positionlla", "geometry_msgs/msg/Vector3Stamped", lambda k: {
        "vector": xyz(LATITUDE[k], LONGITUDE[k], ALTITUDE[k])}, FIX),
    "pacmod_rates": ("/pacmod/ang_vel_rpt", "pacmod3_msgs/msg/AngVelRpt", lambda k: {
        "yaw_vel": YAW_RATE[k], "yaw_valid": True}, {"imu.gyro_z": YAW_RATE}),
    "pacmod_yaw_rate": ("/pacmod/yaw_rate_rpt", "pacmod3_msgs/msg/YawRateRpt", lambda k: {
        "yaw_rate": YAW_RATE[k]}, {"imu.gyro_z": YAW_RATE}),
    "plain_twist": ("/car_speed", "geometry_msgs/msg/Twist",
        lambda k: {"linear": xyz(V[k], 0.0, 0.0)}, SPEED),
    "twist_covariance": ("/vehicle/odometry_speed", "geometry_msgs/msg/TwistWithCovarianceStamped",
        lambda k: {"twist": {"twist": {"linear": xyz(V[k], 0.0, 0.0)}}}, SPEED),
    "map_odometry": ("/gps/odom", "nav_msgs/msg/Odometry",
        lambda k: {"twist": {"twist": {"linear": xyz(EAST[k], NORTH[k], CLIMB[k])}}}, VELOCITY),
    "navposllh": ("/ublox/navposllh", "ublox_msgs/msg/NavPOSLLH", lambda k: {
        "lat": round(1e7 * LATITUDE[k]), "lon": round(1e7 * LONGITUDE[k]),
        "height": round(1e3 * ALTITUDE[k]), "hAcc": 1500}, FIX),
    "navvelned": ("/ublox/navvelned", "ublox_msgs/msg/NavVELNED", lambda k: {
        "gSpeed": round(1e2 * V[k]), "velD": round(-1e2 * CLIMB[k]),
        "heading": round(1e5 * (90 - np.degrees(HEADING[k])))}, VELOCITY),
    "navatt": ("/ublox/navatt", "ublox_msgs/msg/NavATT", lambda k: {
        "pitch": round(1e5 * np.degrees(GRADE[k])), "roll": round(1e5 * np.degrees(ROLL[k]))}, ATTITUDE),
    "foxglove_fix": ("/fix", "foxglove_msgs/msg/LocationFix", lambda k: {
        "latitude": LATITUDE[k], "longitude": LONGITUDE[k], "altitude": ALTITUDE[k],
        "position_covariance": np.array([4.0, 0, 0, 0, 4.0, 0, 0, 0, 9.0]),
        "position_covariance_type": 2}, {**FIX, "gnss.horizontal_accuracy": 2 + 0 * T}),
    "septentrio_attitude": ("/atteuler", "septentrio_gnss_driver/msg/AttEuler", lambda k: {
        "pitch": np.degrees(GRADE[k]), "roll": np.degrees(ROLL[k])}, ATTITUDE),
    "sbg_nav": ("/sbg/ekf_nav", "sbg_driver/msg/SbgEkfNav", lambda k: {
        "latitude": LATITUDE[k], "longitude": LONGITUDE[k], "altitude": ALTITUDE[k],
        "velocity": xyz(EAST[k], NORTH[k], CLIMB[k]), "position_accuracy": xyz(2.0, 2.0, 3.0)},
        {**FIX, "gnss.speed": V, "gnss.vertical_accuracy": 3 + 0 * T}),
    "sbg_velocity": ("/sbg/gps_vel", "sbg_driver/msg/SbgGpsVel", lambda k: {
        "velocity": xyz(EAST[k], NORTH[k], CLIMB[k])}, {"gnss.speed": V}),
}  # fmt: skip


def stores() -> dict[int, Any]:
    """Version of ROS -> its types with those above."""
    found = {}
    for version, store in ((1, Stores.ROS1_NOETIC), (2, Stores.ROS2_HUMBLE)):
        found[version] = get_typestore(store)
        types: dict[str, Any] = {}
        for name, text in DEFINITIONS.items():
            types.update(get_types_from_msg(text, name))
        found[version].register(
            {k: t for k, t in types.items() if k not in found[version].fielddefs}
        )
    return found


def message(store: Any, name: str, values: Mapping[str, Any], ns: int) -> Any:
    """A message with these values, its stamp `ns`, and zeros elsewhere."""
    from rosbags.interfaces import Nodetype

    fields = {}
    for field, (node, what) in store.get_msgdef(name).fields:
        given = values.get(field)
        if node == Nodetype.NAME and what == "builtin_interfaces/msg/Time":
            fields[field] = store.types[what](sec=ns // 10**9, nanosec=ns % 10**9)
        elif node == Nodetype.NAME:
            fields[field] = message(store, what, given or {}, ns)
        elif node == Nodetype.BASE:
            fields[field] = given if given is not None else "" if what[0] == "string" else 0
            fields[field] = _plain(fields[field], what[0])
        elif node == Nodetype.ARRAY:
            fields[field] = given if given is not None else np.zeros(what[1])
        else:
            is_text = what[0] == (Nodetype.BASE, ("string", 0))
            fields[field] = given if given is not None else [] if is_text else np.zeros(0)
    return store.types[name](**fields)


def _plain(value: Any, base: str) -> Any:
    if base == "string":
        return value
    return (
        float(value) if base.startswith("float") else bool(value) if base == "bool" else int(value)
    )


def write(path: Path, names: list[str], container: str) -> Path:
    """The drive in these kinds: as `mcap` (ROS 2), `ros2` (a folder) or `ros1` (a bag)."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2

    store = stores()[1 if container == "ros1" else 2]
    made = [
        (topic, type_, k, message(store, type_, values(k), int(TIME[k])))
        for k in range(len(T))
        for topic, type_, values, _ in (KINDS[name] for name in names)
    ]
    if container == "mcap":
        with path.open("wb") as file:
            writer = McapWriter(file)
            writer.start("ros2")
            channels: dict[str, int] = {}
            for topic, type_, k, filled in made:
                if topic not in channels:
                    text, _ = store.generate_msgdef(type_, ros_version=2)
                    schema = writer.register_schema(type_, "ros2msg", text.encode())
                    channels[topic] = writer.register_channel(topic, "cdr", schema)
                payload = bytes(store.serialize_cdr(filled, type_))
                writer.add_message(channels[topic], int(TIME[k]), payload, int(TIME[k]))
            writer.finish()
        return path
    own = (
        Writer1(path)
        if container == "ros1"
        else Writer2(path, version=9, storage_plugin=StoragePlugin.MCAP)
    )
    serialize = store.serialize_ros1 if container == "ros1" else store.serialize_cdr
    with own as bag:
        connections: dict[str, Any] = {}
        for topic, type_, k, filled in made:
            if topic not in connections:
                connections[topic] = bag.add_connection(topic, type_, typestore=store)
            bag.write(connections[topic], int(TIME[k]), serialize(filled, type_))
    return path
