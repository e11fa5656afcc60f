"""Wang 2025's two drives in simulation: up to 9 deg and down to 12 deg.

Methods, Massel/Kim/Wang chapter, section 4.5. The paper gives the shapes only in words; the
pieces are the chapter's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.filters.kernels import odd_window, parabolic_mean
from roadlog.signals import ANGLES, ANGLES_SCHEMA, SECTIONS, TRUTH_TOPIC
from roadlog.simulate import Simulation
from roadlog.simulate.straight import StraightDrive, drive_straight
from roadlog.storage.table import Table
from roadlog.types import Floats, Stamps
from roadlog.units import STANDARD_GRAVITY as G
from roadlog.vehicle import Vehicle

EPOCH_NS = 1_735_689_600_000_000_000  # 2025-01-01 UTC; simulated drives start here
RATE = 100.0  # Hz
DURATION = 100.0  # s


@dataclass(frozen=True)
class Drive2025:
    """initial_speed m/s; pieces (from s, to s, m/s2); knots (s, deg)."""

    initial_speed: float
    pieces: tuple[tuple[float, float, float], ...]
    knots: tuple[tuple[float, float], ...]


DRIVES = {
    "wang2025-up9": Drive2025(
        0.5,
        (
            (1, 5, 3),
            (6, 8, -4),
            (9, 12, 3.5),
            (13, 15, -3.5),
            (16, 18, 2.5),
            (22, 24, 1),
            (28, 30, -1.5),
            (33, 35, 1.5),
            (45, 47, 2.5),
            (52, 54, -3),
            (60, 63, 2),
            (70, 72, -2.5),
            (80, 84, 1.5),
            (90, 92, -2),
        ),
        (
            (0, 0),
            (20, 0),
            (24, 9),
            (28, 9),
            (32, 3),
            (36, 9),
            (60, 9),
            (66, 4),
            (75, 4),
            (80, 0),
            (100, 0),
        ),
    ),
    "wang2025-down12": Drive2025(
        12.0,
        (
            (2, 4, 2),
            (10, 13, -1.5),
            (18, 21, -3.5),
            (21.5, 24.5, 3.5),
            (30, 32, -2),
            (45, 48, 1.5),
            (58, 60, -2.5),
            (66, 69, 2),
            (80, 82, -2),
            (88, 91, 1.5),
        ),
        (
            (0, 0),
            (2, 0),
            (6, -12),
            (36, -12),
            (42, -3),
            (55, -3),
            (60, -6),
            (72, -6),
            (78, 0),
            (100, 0),
        ),
    ),
}

ACCELERATION_SMOOTHING = 0.5  # s, Hann
GRADE_SMOOTHING = 1.0  # s, Hann
SPEED_NOISE = 0.03  # m/s
ACCEL_NOISE = 0.08  # m/s2, white
ACCEL_COLORED_NOISE = 0.15  # m/s2, white smoothed by the parabola of COLOR_WINDOW
COLOR_WINDOW = 0.3  # s
FORCE_NOISE = 60.0  # N
GYRO_NOISE = 2e-3  # rad/s; the paper has no gyro


def wang2025(name: str, seed: int, ideal: bool) -> Simulation:
    """Sensors and truth of `wang2025-up9` or `wang2025-down12`."""
    vehicle = Vehicle.preset("wang2025")
    shape = DRIVES[name]
    time = np.arange(round(DURATION * RATE) + 1) / RATE
    acceleration = np.zeros(len(time))
    for start, stop, value in shape.pieces:
        acceleration[(time >= start) & (time < stop)] = value
    knots = np.array(shape.knots, np.float64)
    grade = np.radians(np.interp(time, knots[:, 0], knots[:, 1]))
    drive = drive_straight(
        hann(acceleration, ACCELERATION_SMOOTHING),
        hann(grade, GRADE_SMOOTHING),
        shape.initial_speed,
        RATE,
        vehicle,
    )
    stamps: Stamps = EPOCH_NS + np.round(time * 1e9).astype(np.int64)
    tables = [*_sensors(drive, stamps, vehicle, None if ideal else seed), _truth(drive, stamps)]
    record = {"simulation": {"scenario": name, "seed": str(seed), "ideal": str(ideal).lower()}}
    return Simulation(tables, vehicle, record)


def hann(values: Floats, duration: float) -> Floats:
    """Smoothed by a Hann window of `duration` seconds, ends padded."""
    n = odd_window(duration, 1 / RATE)
    window = np.hanning(n + 2)[1:-1]
    return np.convolve(np.pad(values, n // 2, mode="edge"), window / window.sum(), mode="valid")


def _sensors(
    drive: StraightDrive, stamps: Stamps, vehicle: Vehicle, seed: int | None
) -> list[Table]:
    rng = np.random.default_rng(seed)
    n = len(stamps)

    def noise(sd: float) -> Floats:
        return np.zeros(n) if seed is None else rng.normal(0.0, sd, n)

    def accel_noise() -> Floats:
        # the colored part keeps its 0.15 m/s2 after smoothing
        color = parabolic_mean(noise(1.0), odd_window(COLOR_WINDOW, 1 / RATE))
        scale = ACCEL_COLORED_NOISE / color.std() if seed is not None else 0.0
        return noise(ACCEL_NOISE) + scale * color

    f_x, f_z = drive.specific_force()
    drag = 0.5 * vehicle.air_density * vehicle.drag_area * drive.speed * np.abs(drive.speed)
    rolling = vehicle.rolling_resistance * vehicle.mass * G * np.cos(drive.grade)
    force = vehicle.mass * drive.along_road + drag + rolling * (drive.speed > 0.05)
    imu = {
        "accel_x": f_x + accel_noise(),
        "accel_y": noise(ACCEL_NOISE),
        "accel_z": f_z + accel_noise(),
        "gyro_x": noise(GYRO_NOISE),
        "gyro_y": -(drive.pitch_rate + drive.grade_rate) + noise(GYRO_NOISE),
        "gyro_z": noise(GYRO_NOISE),
    }
    return [
        _table("imu", stamps, imu),
        _table("speed", stamps, {"v": drive.speed + noise(SPEED_NOISE)}),
        _table("powertrain", stamps, {"drive_force": force + noise(FORCE_NOISE)}),
    ]


def _truth(drive: StraightDrive, stamps: Stamps) -> Table:
    zero = np.zeros(len(stamps))
    columns = dict.fromkeys(ANGLES, zero) | {
        "grade": drive.grade,
        "pitch": drive.pitch,
        "inclination": drive.grade + drive.pitch,
    }
    columns |= {f"{angle}_sd": np.full(len(stamps), np.nan) for angle in ANGLES}
    columns |= {"flags": zero.astype(np.uint32), "valid": np.ones(len(stamps), np.bool_)}
    return Table(TRUTH_TOPIC, ANGLES_SCHEMA, stamps, columns)


def _table(section: str, stamps: Stamps, columns: dict[str, Floats]) -> Table:
    return Table(SECTIONS[section].topic, SECTIONS[section].schema, stamps, columns)
