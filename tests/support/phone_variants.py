"""Recordings of the same apps as other settings, versions and restarts leave them."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
from support.phone_formats import DRIVE, moment, sensor_logger, sensorlog, times, torque


def sensor_logger_of_gravity(folder: Path) -> Path:
    """Without TotalAcceleration: gravity stands in a table of its own, a little later."""
    path = sensor_logger(folder)
    total = (path / "TotalAcceleration.csv").read_text().splitlines()
    (path / "TotalAcceleration.csv").unlink()
    accel, gravity = [total[0]], [total[0]]
    for line in total[1:]:
        stamp, second, *force = line.split(",")
        down = np.array([9.6, 1.2, -0.8])  # z, y, x
        late = f"{int(stamp) + 3_000_000},{second}"
        accel.append(f"{stamp},{second},{','.join(f'{x:.9g}' for x in np.float64(force) - down)}")
        gravity.append(f"{late},{','.join(f'{x:.9g}' for x in down)}")
    (path / "Accelerometer.csv").write_text("\n".join(accel) + "\n")
    (path / "Gravity.csv").write_text("\n".join(gravity) + "\n")
    return path


def sensorlog_without_units(folder: Path) -> Path:
    path = sensorlog(folder)
    head, rest = path.read_text(encoding="utf-8").split("\n", 1)
    path.write_text(re.sub(r"\([^)]*\)", "", head) + "\n" + rest, encoding="utf-8")
    return path


def torque_restarted(folder: Path) -> Path:
    """The app writes its names again where it was restarted."""
    path = torque(folder)
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:90], lines[0], *lines[90:]]) + "\n")
    return path


def gpslogger(folder: Path) -> Path:
    fix = DRIVE.fixes(times(1))
    lines = ["time,lat,lon,elevation,accuracy,bearing,speed,satellites,provider,hdop,annotation"]
    names = ("latitude", "longitude", "altitude")
    for k, x in enumerate(times(1)):
        place = ",".join(f"{fix[n][k]:.9g}" for n in names)
        stamp = moment(x, "%Y-%m-%dT%H:%M:%S.%f")[:-3] + "Z"
        lines.append(f"{stamp},{place},4.0,{fix['course'][k]:.6g},{fix['speed'][k]:.6g},9,gps,,")
    path = folder / "20260301.txt"
    path.write_text("\n".join(lines) + "\n")
    return path


VARIANTS: dict[str, Callable[[Path], Path]] = {
    writer.__name__: writer
    for writer in (
        sensor_logger_of_gravity,
        sensorlog_without_units,
        torque_restarted,
        gpslogger,
    )
}
