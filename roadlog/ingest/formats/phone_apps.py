"""What each phone app calls what, and in which unit: one `App` for each of its tables.

phyphox (CSV, xlsx, zip), Sensor Logger (CSV, JSON, zip; Android and iOS), SensorLog (iOS),
AndroSensor, Physics Toolbox, Torque, Car Scanner (long and wide), OBD Fusion, TrackAddict 4.3.5,
RaceChrono CSV v2 and v3 (9.1.3), GPSLogger (mendhak), UAH-DriveSet v1, PVS (Menegazzo 2020). By
their published descriptions and public files; tried with files made after these, none of them
recorded by us.

Accelerometers of Android show the reaction (+9.81 up at rest); those of iOS the opposite, in g.
Rates: IMU 10 to 400 Hz as chosen in the app, location 1 Hz, OBD one row for each answer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

GRAVITY = "by gravity"  # unit: m/s2 or g, whichever makes the mean that of gravity
GRAVITY_FRAME = "gravity"  # what an app takes off its accelerations, in a table of its own
STATED = "in brackets"  # unit: as the name says in brackets


@dataclass(frozen=True)
class App:
    """One table of one app.

    columns: pattern of a column's name -> (frame.column of the vocabulary, unit). Names are
    compared in lower case with single blanks. clocks: patterns of time columns and their units, the
    best first; without a unit dates, or numbers of a size that tells it. needs: pattern of a column
    that only this app has, `sheet` of the file, sheet or sensor where columns alone do not tell.
    sign: -1 for accelerometers that show minus the specific force. rank: of several that give a
    frame the lowest counts.
    """

    name: str
    clocks: tuple[tuple[str, str], ...]
    columns: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    needs: str = ""
    sheet: str = ""
    sign: float = 1.0
    rank: int = 0


def _xyz(pattern: str, frame: str, unit: str, axes: str = "xyz") -> dict[str, tuple[str, str]]:
    """Three columns, `@` for the axis."""
    return {
        pattern.replace("@", axis): (f"{frame}.{own}", unit)
        for axis, own in zip(axes, "xyz", strict=True)
    }


_ACCEL, _GYRO = "accelerometer", "gyroscope"
_PHYPHOX = (("time \\(s\\)", "s"),)
_LOGGER = (("time", "ns"), ("seconds_elapsed", "s"))
_RACE = (("timestamp( \\(s\\))?", "s"), ("time \\(s\\)", "s"))

APPS = (
    App(
        "phyphox",
        _PHYPHOX,
        _xyz("@ \\(m/s\\^?2\\)", _ACCEL, "m/s^2"),
        sheet="accelerometer|acceleration with g",
    ),
    App("phyphox", _PHYPHOX, _xyz("(absolute )?acceleration @ \\(m/s\\^?2\\)", _ACCEL, "m/s^2")),
    App("phyphox", _PHYPHOX, _xyz("@ \\(rad/s\\)", _GYRO, "rad/s"), sheet="gyroscope"),
    App("phyphox", _PHYPHOX, _xyz("gyroscope @ \\(rad/s\\)", _GYRO, "rad/s")),
    App("phyphox", _PHYPHOX, {"x \\(hpa\\)|pressure \\(hpa\\)": ("barometer.altitude", "hPa")}),
    App(
        "phyphox",
        _PHYPHOX,
        {
            "latitude \\(°\\)": ("location.latitude", "deg"),
            "longitude \\(°\\)": ("location.longitude", "deg"),
            "height \\(m\\)": ("location.altitude", "m"),
            "velocity \\(m/s\\)": ("location.speed", "m/s"),
            "direction \\(°\\)": ("location.course", "deg"),
            "horizontal accuracy \\(m\\)": ("location.horizontal_accuracy", "m"),
            "vertical accuracy \\((m|°)\\)": ("location.vertical_accuracy", "m"),
        },
        needs="latitude \\(°\\)",
    ),
    App("Sensor Logger", _LOGGER, _xyz("@", _ACCEL, GRAVITY), sheet="totalacceleration"),
    App(
        "Sensor Logger",
        _LOGGER,
        _xyz("@", _ACCEL, GRAVITY),
        sheet="accelerometeruncalibrated",
        rank=1,
    ),
    App("Sensor Logger", _LOGGER, _xyz("@", _ACCEL, GRAVITY), sheet="accelerometer", rank=2),
    App("Sensor Logger", _LOGGER, _xyz("@", GRAVITY_FRAME, GRAVITY), sheet="gravity"),
    App("Sensor Logger", _LOGGER, _xyz("@", _GYRO, "rad/s"), sheet="gyroscope"),
    App("Sensor Logger", _LOGGER, _xyz("@", _GYRO, "rad/s"), sheet="gyroscopeuncalibrated", rank=1),
    App(
        "Sensor Logger",
        _LOGGER,
        {"relativealtitude": ("barometer.altitude", "m")},
        sheet="barometer",
    ),
    App(
        "Sensor Logger",
        _LOGGER,
        {
            "latitude": ("location.latitude", "deg"),
            "longitude": ("location.longitude", "deg"),
            "altitude": ("location.altitude", "m"),
            "speed": ("location.speed", "m/s"),
            "bearing": ("location.course", "deg"),
            "horizontalaccuracy": ("location.horizontal_accuracy", "m"),
            "verticalaccuracy": ("location.vertical_accuracy", "m"),
            "speedaccuracy": ("location.speed_accuracy", "m/s"),
            "bearingaccuracy": ("location.course_accuracy", "deg"),
        },
        sheet="location(gps)?",
    ),
    App(
        "SensorLog",
        (("loggingtime(\\(txt\\))?", ""), ("accelerometertimestamp_sincereboot(\\(s\\))?", "s")),
        _xyz("accelerometeracceleration@(\\(g\\))?", _ACCEL, "g")
        | _xyz("(gyrorotation|motionrotationrate)@(\\(rad/s\\))?", _GYRO, "rad/s")
        | {
            "locationlatitude(\\(wgs84\\))?": ("location.latitude", "deg"),
            "locationlongitude(\\(wgs84\\))?": ("location.longitude", "deg"),
            "locationaltitude(\\(m\\))?": ("location.altitude", "m"),
            "locationspeed(\\(m/s\\))?": ("location.speed", "m/s"),
            "locationcourse(\\(°\\))?": ("location.course", "deg"),
            "locationhorizontalaccuracy(\\(m\\))?": ("location.horizontal_accuracy", "m"),
            "locationverticalaccuracy(\\(m\\))?": ("location.vertical_accuracy", "m"),
            "altimeterrelativealtitude(\\(m\\))?": ("barometer.altitude", "m"),
        },
        needs="loggingtime(\\(txt\\))?",
        sign=-1.0,
    ),
    App(
        "AndroSensor",
        (("yyyy-mo-dd hh-mi-ss_sss", ""), ("time since start in ms", "ms")),
        _xyz("accelerometer @ \\(m/s(²|\\^?2)\\)", _ACCEL, "m/s^2")
        | _xyz("gyroscope @ \\(rad/s\\)", _GYRO, "rad/s")
        | {
            "location latitude ?:?": ("location.latitude", "deg"),
            "location longitude ?:?": ("location.longitude", "deg"),
            "location altitude \\( ?m\\)": ("location.altitude", "m"),
            "location speed \\( ?kmh\\)": ("location.speed", "km/h"),
            "location accuracy \\( ?m\\)": ("location.horizontal_accuracy", "m"),
            "location orientation \\(°\\)": ("location.course", "deg"),
            "atmospheric pressure \\(hpa\\)": ("barometer.altitude", "hPa"),
        },
        needs="yyyy-mo-dd hh-mi-ss_sss|time since start in ms",
    ),
    App(
        "Physics Toolbox",
        (("time", ""),),
        _xyz("gf@", _ACCEL, "g")
        | _xyz("w@", _GYRO, "rad/s")
        | {
            "latitude": ("location.latitude", "deg"),
            "longitude": ("location.longitude", "deg"),
            "speed \\(m/s\\)": ("location.speed", "m/s"),
            "altitude \\(m\\)": ("location.altitude", "m"),
            "p": ("barometer.altitude", "hPa"),
        },
        needs="gfx",
    ),
    App(
        "Torque",
        (("device time", ""), ("gps time", "")),
        _xyz("g\\(@\\)", _ACCEL, GRAVITY)
        | {
            "longitude": ("location.longitude", "deg"),
            "latitude": ("location.latitude", "deg"),
            "gps speed ?\\(meters/second\\)": ("location.speed", "m/s"),
            "altitude": ("location.altitude", "m"),
            "bearing": ("location.course", "deg"),
            "speed \\(obd\\) ?\\((km/h|mph)\\)": ("obd.speed", STATED),
        },
        needs="device time",
    ),
    App(
        "TrackAddict",
        (("utc time", "s"), ("time", "s")),
        _xyz("accel @", _ACCEL, "g")
        | {
            "latitude": ("location.latitude", "deg"),
            "longitude": ("location.longitude", "deg"),
            "altitude \\(m\\)": ("location.altitude", "m"),
            "speed \\((km/h|mph)\\)": ("location.speed", STATED),
            "heading": ("location.course", "deg"),
            "accuracy \\(m\\)": ("location.horizontal_accuracy", "m"),
            "vehicle speed \\((km/h|mph)\\)( \\*obd)?": ("obd.speed", STATED),
        },
        needs="utc time",
    ),
    App(
        "RaceChrono",
        _RACE,
        _xyz("@_acc", _ACCEL, "g")
        | _xyz("@_rate_of_rotation", _GYRO, "deg/s")
        | {
            "latitude( \\(deg\\))?": ("location.latitude", "deg"),
            "longitude( \\(deg\\))?": ("location.longitude", "deg"),
            "altitude( \\(m\\))?": ("location.altitude", "m"),
            "speed( \\(m/s\\))?": ("location.speed", "m/s"),
            "bearing( \\(deg\\))?": ("location.course", "deg"),
            "accuracy( \\(m\\))?": ("location.horizontal_accuracy", "m"),
        },
        needs="fragment_id|lap #",
    ),
    App(
        "OBD Fusion",
        (("time \\(sec\\)", "s"),),
        _xyz("acceler(ation|ometer) @ \\((m/s²|m/s\\^?2|g)\\)", _ACCEL, STATED)
        | {
            "vehicle speed \\((km/h|mph)\\)": ("obd.speed", STATED),
            "latitude \\(deg\\)": ("location.latitude", "deg"),
            "longitude \\(deg\\)": ("location.longitude", "deg"),
            "altitude \\((m|ft)\\)": ("location.altitude", STATED),
            "bearing \\(deg\\)": ("location.course", "deg"),
            "gps speed \\((km/h|mph|m/s)\\)": ("location.speed", STATED),
        },
        needs="time \\(sec\\)",
    ),
    App(
        "Car Scanner",
        (("time|seconds", ""),),
        {
            "vehicle speed \\((km/h|mph)\\)": ("obd.speed", STATED),
            "speed \\(gps\\) \\((km/h|mph)\\)": ("location.speed", STATED),
            "altitude \\(gps\\) \\((m|ft)\\)": ("location.altitude", STATED),
            "latitude": ("location.latitude", "deg"),
            "long(t)?itude": ("location.longitude", "deg"),
        },
        needs="vehicle speed \\((km/h|mph)\\)",
    ),
    App(
        "GPSLogger",
        (("time", ""),),
        {
            "lat": ("location.latitude", "deg"),
            "lon": ("location.longitude", "deg"),
            "elevation": ("location.altitude", "m"),
            "speed": ("location.speed", "m/s"),
            "bearing": ("location.course", "deg"),
            "accuracy": ("location.horizontal_accuracy", "m"),
        },
        needs="provider",
    ),
    App(
        "PVS",
        (("timestamp", "s"),),
        _xyz("acc_@_dashboard", _ACCEL, "m/s^2")
        | _xyz("gyro_@_dashboard", _GYRO, "deg/s")
        | {"speed": ("location.speed", "m/s")}
        | {f"{n}": (f"location.{n}", "deg") for n in ("latitude", "longitude")},
        needs="acc_x_dashboard",
    ),
    App(
        "PVS",
        (("timestamp", "s"),),
        {
            "latitude": ("location.latitude", "deg"),
            "longitude": ("location.longitude", "deg"),
            "elevation": ("location.altitude", "m"),
            "bearing": ("location.course", "deg"),
            "speed_meters_per_second": ("location.speed", "m/s"),
            "accuracy": ("location.horizontal_accuracy", "m"),
        },
        rank=1,
        needs="speed_meters_per_second",
    ),
    # numbers without names: time, valid, acceleration of x, y, z, the same filtered, attitude
    App(
        "UAH-DriveSet",
        (("column 1|1", "s"),),
        {f"column {k + 3}|{k + 3}": (f"accelerometer.{a}", "g") for k, a in enumerate("xyz")},
        sheet="raw_accelerometers",
    ),
    App(
        "UAH-DriveSet",
        (("column 1|1", "s"),),
        {
            "column 2|2": ("location.speed", "km/h"),
            "column 3|3": ("location.latitude", "deg"),
            "column 4|4": ("location.longitude", "deg"),
            "column 5|5": ("location.altitude", "m"),
            "column 6|6": ("location.vertical_accuracy", "m"),
            "column 7|7": ("location.horizontal_accuracy", "m"),
            "column 8|8": ("location.course", "deg"),
        },
        sheet="raw_gps",
    ),
)
