"""The comma2k19 folder layout: NumPy arrays without the extension, and a global pose.

Schafer et al. 2018, "A Commute in Data: The comma2k19 Dataset", arXiv:1812.05752.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile
from roadlog.rotation import from_quaternions
from roadlog.types import Floats, Stamps

GPS_EPOCH = 315_964_800  # s, 1980-01-06 in Unix time
LEAP_SECONDS = 18  # GPS - UTC since 2017; the data set is of 2018
WEEK = 604_800  # s
POLAR_FLATTENING = 0.99330562  # 1 - e^2 of WGS 84: (b / a)^2
HEADING_SPEED = 3.0  # m/s; above it the velocity points where the car does

_FIELDS = {
    "IMU/accelerometer": ("x", "y", "z"),
    "IMU/gyro": ("x", "y", "z"),
    "CAN/speed": ("v",),
    "CAN/wheel_speed": ("fl", "fr", "rl", "rr"),
    "CAN/steering_angle": ("angle",),
    "GNSS/live_gnss_ublox": ("latitude", "longitude", "speed", "utc", "altitude", "bearing"),
}


def recognizes(path: Path) -> bool:
    """Whether a folder is one segment of the data set."""
    return (path / "processed_log").is_dir() or (path / "global_pose").is_dir()


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Every signal of a segment, and angles from its pose. Raises LogReadError."""
    del profile, dbc  # the arrays are small: all are read
    pose = path / "global_pose"
    epoch = _epoch(pose)
    frames, losses = [], []
    for name, fields in _FIELDS.items():
        folder = path / "processed_log" / name
        if not (folder / "t").is_file():
            losses.append(f"{name}: not in the folder")
            continue
        values = _load(folder / "value").reshape(-1, len(fields))
        time = _stamps(_load(folder / "t"), epoch)
        columns = {field: values[:, k] for k, field in enumerate(fields)}
        frames.append(Frame(name, path.name, time, columns))
    if (pose / "frame_times").is_file():
        time = _stamps(_load(pose / "frame_times"), epoch)
        frames.append(Frame("global_pose", path.name, time, angles_of_pose(pose)))
    if not frames:
        raise LogReadError(f"{path}: holds none of {', '.join(_FIELDS)}")
    return Recording(tuple(frames), tuple(losses))


def _epoch(pose: Path) -> int:
    """ns to add to the device's clock to get UTC; 0 where the pose is missing."""
    if not (pose / "frame_gps_times").is_file():
        return 0
    week, second = _load(pose / "frame_gps_times").T
    gps = GPS_EPOCH - LEAP_SECONDS + week * WEEK + second
    return int(np.median(gps - _load(pose / "frame_times")) * 1e9)


def _stamps(seconds: Floats, epoch: int) -> Stamps:
    return np.rint(seconds * 1e9).astype(np.int64) + epoch


def _load(path: Path) -> Floats:
    try:
        return np.load(path, allow_pickle=False).astype(np.float64)
    except (OSError, ValueError, EOFError) as error:
        raise LogReadError(f"{path}: cannot be read as a NumPy array: {error}") from error


def angles_of_pose(pose: Path) -> dict[str, Floats]:
    """grade, inclination and roll_total [rad] of the car, and its speed [m/s].

    grade = asin(v_up / |v|) of the ECEF velocity. The orientation is the device's; its forward
    direction in the car is the mean direction of travel that it sees, and its roll in the car is
    taken as zero, so that inclination has the mean of grade and roll_total keeps an offset.
    """
    position = _load(pose / "frame_positions")
    velocity = _load(pose / "frame_velocities")
    device = from_quaternions(_load(pose / "frame_orientations"))  # device FRD -> ECEF
    up = position * [POLAR_FLATTENING, POLAR_FLATTENING, 1.0]  # normal of the ellipsoid
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    speed = np.linalg.norm(velocity, axis=1)
    moving = speed > HEADING_SPEED
    grade = np.full(len(speed), np.nan)
    grade[moving] = np.arcsin(np.sum(velocity * up, axis=1)[moving] / speed[moving])
    columns = {"grade": grade, "speed": speed}
    if moving.any():
        seen = np.einsum("nji,nj->ni", device, velocity)[moving] / speed[moving, None]
        forward = seen.mean(axis=0) / np.linalg.norm(seen.mean(axis=0))
        left = np.cross([0.0, 0.0, -1.0], forward)  # up is -z of the device
        left /= np.linalg.norm(left)
        ahead, aside, above = (
            np.einsum("nij,j,ni->n", device, axis, up)
            for axis in (forward, left, np.cross(forward, left))
        )
        columns["inclination"] = np.arcsin(np.clip(ahead, -1.0, 1.0))
        columns["roll_total"] = np.arctan2(aside, above)
    return columns


FORMAT = Format(
    name="comma2k19",
    about="comma2k19 segments",
    recognizes=recognizes,
    read=read,
    profile="comma2k19",
)
