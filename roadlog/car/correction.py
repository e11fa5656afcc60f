"""What a vehicle file knows of a log's sensors, applied to the drive: once, before any estimator.

Mounting, biases, speed scale and delays are properties of the logger in the car, not of a method:
an estimator sees signals in vehicle axes, on one clock, in true units.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, Resampled, Samples
from roadlog.errors import ConfigError
from roadlog.signals import AXES
from roadlog.types import Floats

OF_IMU = (
    *("accel_zero", "accel_scale", "gyro_zero", "gyro_scale"),  # of its own axes
    *("imu_mount", "accel_bias", "gyro_bias"),
)
CAR_SPEEDS = ("wheel_speeds", "speed")  # sections that speed_scale is of
CAR_OTHERS = ("steering", "wheel_torques", "powertrain")  # that come the same way, as late


def applied(vehicle: Vehicle, drive: Drive) -> list[str]:
    """The vehicle parameters that change what this drive's sensors say."""
    found = []
    if "imu" in drive.native:
        found += [name for name in OF_IMU if getattr(vehicle, name)]
    if any(section in drive.native for section in CAR_SPEEDS):
        found += ["speed_scale"] if vehicle.speed_scale != 1.0 else []
        found += ["speed_delay"] if vehicle.speed_delay else []
    if "gnss" in drive.native and vehicle.gnss_delay:
        found.append("gnss_delay")
    return found


def corrected(drive: Drive, vehicle: Vehicle) -> Drive:
    """The drive as it would be with the IMU in vehicle axes and every channel on time.

    The IMU's zeros are subtracted and its axes scaled, it is turned by `imu_mount`, then biases are
    subtracted; wheel speeds and /speed are
    multiplied by `speed_scale` and, with everything else that the car itself sends, moved
    `speed_delay` earlier; GNSS `gnss_delay` earlier. The drive itself comes back when the vehicle
    says nothing of the kind. Raises ConfigError when the mounting would turn an axis that the log
    does not have.
    """
    changes = applied(vehicle, drive)
    if not changes:
        return drive
    native = dict(drive.native)
    if set(OF_IMU) & set(changes):
        native["imu"] = _imu(drive.native["imu"], vehicle)
    for section in CAR_SPEEDS:
        if section in native:
            samples = native[section]
            columns = {name: vehicle.speed_scale * v for name, v in samples.columns.items()}
            native[section] = Samples(samples.time - vehicle.speed_delay, columns)
    for section in CAR_OTHERS:
        if section in native and "speed_delay" in changes:
            samples = native[section]
            native[section] = Samples(samples.time - vehicle.speed_delay, samples.columns)
    if "gnss_delay" in changes:
        gnss = native["gnss"]
        native["gnss"] = Samples(gnss.time - vehicle.gnss_delay, gnss.columns)
    changed = {name: s for name, s in native.items() if s is not drive.native[name]}
    return replace(drive, native=native, signals=Resampled(changed, drive.time, drive.signals))


def _imu(samples: Samples, vehicle: Vehicle) -> Samples:
    columns = dict(samples.columns)
    for kind, bias in (("accel", vehicle.accel_bias), ("gyro", vehicle.gyro_bias)):
        names = [f"{kind}_{axis}" for axis in AXES]
        there = [name for name in names if name in columns]
        zeros, scales = getattr(vehicle, f"{kind}_zero"), getattr(vehicle, f"{kind}_scale")
        for k, name in enumerate(names):
            if name in columns and (zeros or scales):
                shown = columns[name] - (zeros[k] if zeros else 0.0)
                columns[name] = shown * (scales[k] if scales else 1.0)
        if vehicle.imu_mount is not None and there:
            if len(there) < len(names):
                lacking = ", ".join(f"imu.{name}" for name in names if name not in columns)
                raise ConfigError(
                    f"vehicle: imu_mount turns all axes, but the log has no {lacking}. Map it in "
                    f"the profile, or leave imu_mount out"
                )
            turned: Floats = np.array(vehicle.imu_mount) @ np.stack([columns[n] for n in names])
            columns |= dict(zip(names, turned, strict=True))
        for name, offset in zip(names, bias or (0.0, 0.0, 0.0), strict=True):
            if name in columns:
                columns[name] = columns[name] - offset
    return Samples(samples.time, columns)
