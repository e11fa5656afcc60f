"""`PhoneDrive` as a comma device logs it, written by pycapnp with the schema of the reader."""

from __future__ import annotations

import bz2
from pathlib import Path

import numpy as np
from support.phone_drive import EPOCH, PhoneDrive

DRIVE = PhoneDrive()
BOOT = 5_000_000_000  # ns, of the device's clock at the start
MOUNTED = 0.02  # rad, device nose up in the car


def write(path: Path) -> Path:
    """An rlog at 20 Hz, plain or packed by its suffix."""
    import capnp
    import zstandard

    schema = Path(__file__).parents[2] / "roadlog" / "ingest" / "formats" / "openpilot.capnp"
    event = capnp.load(str(schema)).Event
    t = np.arange(0, DRIVE.duration, 0.05)
    force, rate = DRIVE.imu(t)
    fixes = DRIVE.fixes(t)
    packed = []

    def put(kind: str, k: int, late: float = 0.0):
        message = event.new_message()
        message.logMonoTime = BOOT + round((t[k] + late) * 1e9)
        packed.append(message)
        return message.init(kind)

    for k in range(len(t)):
        for kind, field, v in (
            ("accelerometer", "acceleration", force),
            ("gyroscope", "gyro", rate),
        ):
            x, y, z = v[k].tolist()
            put(kind, k, 0.004 if kind == "gyroscope" else 0.0).init(field).v = [z, y, -x]
        car = put("carState", k)
        car.vEgoRaw, car.steeringAngleDeg = float(DRIVE.speed(t[k])), 30.0
        pose = put("livePose", k).init("orientationNED")
        pose.y, pose.valid = float(DRIVE.grade(t[k])) + MOUNTED, True
        put("liveParameters", k).roll = 0.01
        if k % 20 == 0:
            put("liveCalibration", k).rpyCalib = [0.0, MOUNTED, 0.0]
            fix = put("gpsLocationExternal", k)
            fix.unixTimestampMillis = round(1000 * (EPOCH + t[k]))
            for name in ("latitude", "longitude", "altitude", "speed"):
                setattr(fix, name, float(fixes[name][k]))
            fix.bearingDeg, fix.verticalAccuracy = float(fixes["course"][k]), 2.0
            fix.vNED = [0.0, 0.0, -float(fixes["climb"][k])]
    data = b"".join(message.to_bytes() for message in packed)
    if path.suffix == ".bz2":
        data = bz2.compress(data)
    elif path.suffix == ".zst":
        data = zstandard.ZstdCompressor().compress(data)
    path.write_bytes(data)
    return path
