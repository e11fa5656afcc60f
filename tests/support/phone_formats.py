"""`PhoneDrive` as each phone app writes it, after the apps' published descriptions."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import numpy as np
from support.phone_drive import EPOCH, START, PhoneDrive

from roadlog.units import STANDARD_GRAVITY as G

DRIVE = PhoneDrive()


def times(rate: float, late: float = 0.0) -> np.ndarray:
    return np.arange(0, DRIVE.duration, 1 / rate) + late


def table(path: Path, header: str, rows: np.ndarray, delimiter: str = ",") -> Path:
    lines = [header, *(delimiter.join(f"{v:.9g}" for v in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def moment(t: float, form: str) -> str:
    return (START + timedelta(seconds=float(t))).strftime(form)


def held(t: np.ndarray) -> dict[str, np.ndarray]:
    """The newest fix of a 1 Hz receiver at each time."""
    return DRIVE.fixes(np.floor(t))


def phyphox(folder: Path, linear: bool = True) -> Path:
    folder = folder / "phyphox"
    folder.mkdir()
    t, w = times(50, 0.003), times(50, 0.0081)
    force, rate = DRIVE.phone(t)[0], DRIVE.phone(w)[1]
    head = '"Time (s)","X ({u})","Y ({u})","Z ({u})"'
    acceleration = head.format(u="m/s^2")
    table(folder / "Accelerometer.csv", acceleration, np.column_stack([t, force]))
    table(folder / "Gyroscope.csv", head.format(u="rad/s"), np.column_stack([w, rate]))
    if linear:
        flat = np.column_stack([t, force - [0, 0, G]])
        table(folder / "Linear Accelerometer.csv", acceleration, flat)
    fixes = DRIVE.fixes(times(1))
    names = ("latitude", "longitude", "altitude", "speed", "course")
    table(
        folder / "Location.csv",
        '"Time (s)","Latitude (°)","Longitude (°)","Height (m)","Velocity (m/s)","Direction (°)",'
        '"Horizontal Accuracy (m)","Vertical Accuracy (m)"',
        np.column_stack([times(1), *(fixes[n] for n in names), *np.full((2, len(times(1))), 4.0)]),
    )
    return folder


def phyphox_zip(folder: Path) -> Path:
    return zipped(phyphox(folder), folder / "phyphox.zip")


def phyphox_workbook(folder: Path) -> Path:
    import openpyxl

    source = phyphox(folder)
    book = openpyxl.Workbook()
    book.remove(book.active)
    for file in sorted(source.iterdir()):
        sheet = book.create_sheet(file.stem)
        header, *rows = file.read_text("utf-8").splitlines()
        sheet.append([name.strip('"') for name in header.split('","')])
        for row in rows:
            sheet.append([float(cell) for cell in row.split(",")])
    path = folder / "phyphox.xlsx"
    book.save(path)
    return path


def zipped(folder: Path, path: Path, inside: str = "") -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        for file in sorted(folder.iterdir()):
            packed.write(file, inside + file.name)
    return path


def _logger_samples(ios: bool) -> dict[str, tuple[np.ndarray, dict[str, np.ndarray]]]:
    t, w, f = times(50), times(50, 0.004), times(1)
    force, rate = DRIVE.phone(t)[0], DRIVE.phone(w)[1]
    fixes = DRIVE.fixes(f)
    total = -force / G if ios else force
    place = {"latitude": "latitude", "longitude": "longitude", "altitude": "altitude"}
    place |= {"speed": "speed", "bearing": "course"}
    location = {name: fixes[own] for name, own in place.items()}
    location |= {"horizontalAccuracy": np.full(len(f), 4.0), "speedAccuracy": np.full(len(f), 0.5)}
    triads = {
        "Accelerometer": (t, force - [0, 0, G]),
        "TotalAcceleration": (t, total),
        "Gyroscope": (w, rate),
    }
    zyx = {name: (x, dict(zip("zyx", v.T[::-1], strict=True))) for name, (x, v) in triads.items()}
    return zyx | {"Location": (f, location)}


def sensor_logger(folder: Path, ios: bool = False) -> Path:
    folder = folder / "sensor_logger"
    folder.mkdir()
    for name, (t, columns) in _logger_samples(ios).items():
        stamps = [f"{round(EPOCH) * 10**9 + round(x * 1e9)},{x:.9f}" for x in t]
        rows = zip(*columns.values(), strict=True)
        lines = [
            f"{s},{','.join(f'{v:.9g}' for v in r)}" for s, r in zip(stamps, rows, strict=True)
        ]
        head = ",".join(["time", "seconds_elapsed", *columns])
        (folder / f"{name}.csv").write_text("\n".join([head, *lines]) + "\n")
    platform = "ios" if ios else "android"
    words = f"version,platform,standardisation\n3,{platform},false\n"
    (folder / "Metadata.csv").write_text(words)
    return folder


def sensor_logger_ios(folder: Path) -> Path:
    return sensor_logger(folder, ios=True)


def sensor_logger_zip(folder: Path) -> Path:
    return zipped(sensor_logger(folder), folder / "2026-03-01_09-00-00.zip", "2026-03-01_09-00-00/")


def sensor_logger_json(folder: Path) -> Path:
    samples = []
    for name, (t, columns) in _logger_samples(False).items():
        for k, x in enumerate(t):
            row = {"sensor": name, "time": str(round(EPOCH) * 10**9 + round(x * 1e9))}
            row["seconds_elapsed"] = f"{x:.9f}"
            samples.append(row | {c: f"{v[k]:.9g}" for c, v in columns.items()})
    path = folder / "2026-03-01_09-00-00.json"
    path.write_text(json.dumps(samples))
    return path


def sensorlog(folder: Path) -> Path:
    t = times(25)
    force, rate = DRIVE.phone(t)
    fix = held(t)
    head = (
        "loggingTime(txt),locationLatitude(WGS84),locationLongitude(WGS84),locationAltitude(m),"
        "locationSpeed(m/s),locationCourse(°),locationHorizontalAccuracy(m),"
        "accelerometerAccelerationX(G),accelerometerAccelerationY(G),accelerometerAccelerationZ(G),"
        "gyroRotationX(rad/s),gyroRotationY(rad/s),gyroRotationZ(rad/s)"
    )
    names = ("latitude", "longitude", "altitude", "speed", "course")
    five = np.full(len(t), 5.0)
    values = np.column_stack([*(fix[n] for n in names), five, -force / G, rate])
    lines = [
        ",".join([moment(x, "%Y-%m-%dT%H:%M:%S.%f")[:-3] + "+00:00", *(f"{v:.9g}" for v in row)])
        for x, row in zip(t, values, strict=True)
    ]
    path = folder / "2026-03-01_09_00_00_phone.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def androsensor(folder: Path) -> Path:
    t = times(10)
    force, rate = DRIVE.phone(t)
    fix = held(t)
    head = (
        "sep=;\nACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);"
        "LINEAR ACCELERATION X (m/s²);LINEAR ACCELERATION Y (m/s²);LINEAR ACCELERATION Z (m/s²);"
        "GYROSCOPE X (rad/s);GYROSCOPE Y (rad/s);GYROSCOPE Z (rad/s);LOCATION Latitude : ;"
        "LOCATION Longitude : ;LOCATION Altitude ( m);LOCATION Speed ( Kmh);LOCATION Accuracy ( m);"
        "LOCATION ORIENTATION (°);Satellites in range;Time since start in ms ;"
        "YYYY-MO-DD HH-MI-SS_SSS"
    )
    four = np.full(len(t), 4.0)
    place = [fix["latitude"], fix["longitude"], fix["altitude"], 3.6 * fix["speed"], four]
    values = np.column_stack([force, force - [0, 0, G], rate, *place, fix["course"]])
    lines = [
        ";".join(f"{v:.9g}" for v in row)
        + f";11 / 20;{round(1000 * x)};{moment(x, '%Y-%m-%d %H:%M:%S:%f')[:-3]}"
        for x, row in zip(t, values, strict=True)
    ]
    path = folder / "Sensor_record_20260301_090000_AndroSensor.csv"
    path.write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    return path


def physics_toolbox(folder: Path) -> Path:
    t = times(20)
    force, rate = DRIVE.phone(t)
    fix = held(t)
    place = [fix[n] for n in ("latitude", "longitude", "speed", "altitude")]
    values = np.column_stack([force / G, force - [0, 0, G], rate, *place])
    head = "time;gFx;gFy;gFz;ax;ay;az;wx;wy;wz;Latitude;Longitude;Speed (m/s);Altitude (m)"
    lines = [
        f"{moment(x, '%H:%M:%S:%f')[:-2]};{';'.join(f'{v:.9g}' for v in row)}".replace(".", ",")
        for x, row in zip(t, values, strict=True)
    ]
    path = folder / "2026-03-0109.00.00.csv"
    path.write_text("\n".join([head, *lines]) + "\n")
    return path


def torque(folder: Path, gravity: float = 1.0) -> Path:
    t = times(2)
    force = DRIVE.phone(t)[0] / gravity
    fix = DRIVE.fixes(t)
    head = (
        "GPS Time, Device Time, Longitude, Latitude,GPS Speed (Meters/second), Altitude, Bearing,"
        " G(x), G(y), G(z), Speed (OBD)(km/h)"
    )
    names = ("longitude", "latitude", "speed", "altitude", "course")
    lines = [head]
    for k, x in enumerate(t):
        place = ["-"] * 6
        if x >= 5:  # before the first fix
            place = [
                moment(x, "%a %b %d %H:%M:%S GMT+08:00 %Y"),
                *(f"{fix[n][k]:.9g}" for n in names),
            ]
        forces = ",".join(f"{v:.6f}" for v in force[k])
        device = moment(x, "%d-%b-%Y %H:%M:%S.%f")[:-3]
        speed = round(3.6 * float(DRIVE.speed(x)))
        lines.append(f"{place[0]},{device},{','.join(place[1:])},{forces},{speed}")
    path = folder / "trackLog.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def torque_in_g(folder: Path) -> Path:
    return torque(folder, G)


def car_scanner(folder: Path) -> Path:
    lines = ['"SECONDS";"PID";"VALUE";"UNITS";"LATITUDE";"LONGTITUDE";']
    fix = DRIVE.fixes(times(2))
    for k, t in enumerate(times(2)):
        where = f'"{fix["latitude"][k]:.9g}";"{fix["longitude"][k]:.9g}"'
        values = [
            ("Vehicle speed", 3.6 * fix["speed"][k], "km/h"),
            ("Engine RPM", 1500, "rpm"),
            ("Altitude (GPS)", fix["altitude"][k], "m"),
            ("Speed (GPS)", 3.6 * fix["speed"][k], "km/h"),
        ]
        for m, (name, value, unit) in enumerate(values):
            lines.append(f'"{32400 + t + 1e-4 * m:.6f}";"{name}";"{value:.6g}";"{unit}";{where};')
    path = folder / "2026-03-01 09-00-00.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def obd_fusion(folder: Path) -> Path:
    t = times(5)
    fix = DRIVE.fixes(t)
    names = ("latitude", "longitude", "course")
    rows = [t, fix["speed"] / 0.44704, *(fix[n] for n in names), fix["altitude"] / 0.3048]
    head = (
        "# StartTime = 03/01/2026 09:00:00.0000 AM\nTime (sec), Vehicle speed (MPH),"
        " Latitude (deg), Longitude (deg), Bearing (deg), Altitude (ft)"
    )
    return table(folder / "CSVLog.csv", head, np.column_stack(rows))


def trackaddict(folder: Path) -> Path:
    t = times(5)
    force = DRIVE.phone(t)[0] / G
    fix = DRIVE.fixes(t)
    lines = [
        "# RaceRender Data: TrackAddict 4.3.5 on Android 9 [made up] (Mode: 0)",
        "# GPS: Android; Mode: Android",
        '"Time","UTC Time","Lap","GPS_Update","Latitude","Longitude","Altitude (m)",'
        '"Altitude (ft)","Speed (Km/h)","Heading","Accuracy (m)","Accel X","Accel Y","Accel Z"',
    ]
    for k, x in enumerate(t):
        if k in (200, 450):
            lines.append(f"# Lap {k // 200}: 00:00:50.000")
        place = f"{fix['latitude'][k]:.9g},{fix['longitude'][k]:.9g},{fix['altitude'][k]:.4f}"
        motion = f"{3.6 * fix['speed'][k]:.4f},{fix['course'][k]:.3f}"
        forces = ",".join(f"{v:.5f}" for v in force[k])
        lines.append(f"{x:.3f},{EPOCH + x:.3f},{k > 200:d},1,{place},0,{motion},6.0,{forces}")
    path = folder / "Log.csv"
    path.write_text("\n".join([*lines, "# Session End"]) + "\n")
    return path


def racechrono(folder: Path) -> Path:
    t = times(10)
    force, rate = DRIVE.phone(t)
    fix = DRIVE.fixes(t)
    lines = [
        "This file is created using RaceChrono v9.1.3 ( http://racechrono.com/ ).",
        "Format,3",
        'Session title,"A road"',
        "Session type,Lap timing",
        "Created,01/03/2026,09:00",
        "",
        "timestamp,fragment_id,lap_number,elapsed_time,accuracy,altitude,bearing,"
        "device_update_rate,latitude,longitude,speed,device_update_rate,lateral_acc,"
        "longitudinal_acc,speed,device_update_rate,x_acc,y_acc,z_acc,device_update_rate,"
        "x_rate_of_rotation,y_rate_of_rotation,z_rate_of_rotation",
        "unix time,,,s,m,m,deg,Hz,deg,deg,m/s,Hz,G,G,m/s,Hz,G,G,G,Hz,deg/s,deg/s,deg/s",
        ",,,," + ",".join(["100: gps"] * 7 + ["calc"] * 4 + ["101: acc"] * 4 + ["102: gyro"] * 4),
    ]
    for k, x in enumerate(t):
        place = [4.0, fix["altitude"][k], fix["course"][k], 10]
        place += [fix["latitude"][k], fix["longitude"][k], fix["speed"][k]]
        motion = [10, 0.1, 0.1, 0.98 * fix["speed"][k]]
        row = [*place, *motion, 10, *(force[k] / G), 10, *np.degrees(rate[k])]
        cells = ",".join(f"{v:.9g}" for v in row)
        lines.append(f"{EPOCH + x:.3f},0,,{x:.3f},{cells}")
    path = folder / "session.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def uah(folder: Path) -> Path:
    folder = folder / "20151110175712-16km-D1-NORMAL1-SECONDARY"
    folder.mkdir()
    t, f = times(10), times(1)
    force = DRIVE.phone(t)[0] / G
    zero = np.zeros(len(t))
    fix = DRIVE.fixes(f)
    rows = np.column_stack([t, zero, force, force, zero, zero, zero])
    np.savetxt(folder / "RAW_ACCELEROMETERS.txt", rows, "%.6f")
    place = [fix["latitude"], fix["longitude"], fix["altitude"]]
    rest = [np.full(len(f), 4.0), np.full(len(f), 5.0), fix["course"], *np.zeros((4, len(f)))]
    rows = np.column_stack([f, 3.6 * fix["speed"], *place, *rest])
    np.savetxt(folder / "RAW_GPS.txt", rows, "%.7f")
    return folder


def pvs(folder: Path) -> Path:
    folder = folder / "PVS 1"
    folder.mkdir()
    t, f = times(50), times(1)
    force, rate = DRIVE.phone(t)
    fix = DRIVE.fixes(f)
    acc, gyro = (",".join(f"{k}_{a}_dashboard" for a in "xyz") for k in ("acc", "gyro"))
    rows = np.column_stack([t, force, np.degrees(rate)])
    lines = [f"timestamp,{acc},{gyro}"]
    lines += [f"{EPOCH + r[0]:.6f}," + ",".join(f"{v:.9g}" for v in r[1:]) for r in rows]
    (folder / "dataset_mpu_left.csv").write_text("\n".join(lines) + "\n")
    names = ("latitude", "longitude", "altitude", "course", "speed")
    lines = ["timestamp,latitude,longitude,elevation,bearing,speed_meters_per_second,accuracy"]
    for k, x in enumerate(f):
        lines.append(f"{EPOCH + x:.3f}," + ",".join(f"{fix[n][k]:.9g}" for n in names) + ",4.0")
    (folder / "dataset_gps.csv").write_text("\n".join(lines) + "\n")
    return folder


def gnsslogger(folder: Path) -> Path:
    t = times(20)
    force, rate = DRIVE.phone(t)
    fix = DRIVE.fixes(t)
    raw = "{0},utcTimeMillis,elapsedRealtimeNanos,{0}X{1},{0}Y{1},{0}Z{1},BiasX,BiasY,BiasZ"
    lines = [
        "# ",
        "# Header Description:",
        "# Version: v3.1.0.0 Platform: 13",
        "# " + raw.format("UncalAccel", "Mps2"),
        "# " + raw.format("UncalGyro", "RadPerSec"),
        "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,"
        "BearingDegrees,UnixTimeMillis,SpeedAccuracyMps,BearingAccuracyDegrees,"
        "elapsedRealtimeNanos,VerticalAccuracyMeters",
        "# ",
    ]
    for k, x in enumerate(t):
        ms, ns = round(1000 * (EPOCH + x)), round((x + 1000) * 1e9)
        for name, values, late in (("UncalAccel", force[k], 0), ("UncalGyro", rate[k], 2)):
            cells = ",".join(f"{v:.9g}" for v in values)
            lines.append(f"{name},{ms + late},{ns + late * 1_000_000},{cells},0.0,0.0,0.0")
        if k % 20 == 0:
            place = ",".join(f"{fix[n][k]:.9g}" for n in ("latitude", "longitude", "altitude"))
            lines.append(
                f"Fix,GPS,{place},{fix['speed'][k]:.6f},3.8,{fix['course'][k]:.4f},{ms},0.3,2.0,"
                f"{ns},4.0"
            )
    path = folder / "gnss_log_2026_03_01_09_00_00.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


APPS: dict[str, Callable[[Path], Path]] = {
    writer.__name__: writer
    for writer in (
        phyphox,
        phyphox_zip,
        phyphox_workbook,
        sensor_logger,
        sensor_logger_ios,
        sensor_logger_zip,
        sensor_logger_json,
        sensorlog,
        androsensor,
        physics_toolbox,
        torque,
        torque_in_g,
        car_scanner,
        obd_fusion,
        trackaddict,
        racechrono,
        uah,
        pvs,
        gnsslogger,
    )
}
