"""Seconds of computing for a drive: the compiled filters against filterpy, in the same run.

    python benchmarks/tire_force.py [MINUTES]

Prints microseconds per 100 Hz step, the ratio, and the time of the first, compiling call.
"""

from __future__ import annotations

import dataclasses
import sys
import time
from collections.abc import Callable

import numpy as np

from roadlog import estimators
from roadlog.car.planar_car import planar_car, wheel_loads
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, Samples
from roadlog.estimators.luo2024 import tire_ukf
from roadlog.filters import Engine
from roadlog.units import STANDARD_GRAVITY as G

RATE = 100.0
REFERENCE_STEPS = 1500
NAMES = ("kmbe", "debe", "tfobe", "roll_bank_obs", "split_qs")
WAGON = Vehicle.preset("wagon").with_values(antenna_position=(0.0, 0.0, 0.0))


def synthetic_drive(minutes: float) -> Drive:
    """Every input the five estimators need; consistent enough that none of them diverges."""
    rng = np.random.default_rng(1)
    t = np.arange(round(minutes * 60 * RATE)) / RATE
    v = 12 + 3 * np.sin(t / 20)
    r = 0.1 * np.sin(t / 7)
    f_y, accel = v * r, 0.15 * np.cos(t / 20)
    force = WAGON.mass * accel + 0.5 * WAGON.air_density * WAGON.drag_area * v**2
    torque = (force + WAGON.rolling_resistance * WAGON.mass * G) * WAGON.wheel_radius
    roll = WAGON.roll_gain * f_y
    signals = {
        "imu.accel_x": accel,
        "imu.accel_y": f_y,
        "imu.accel_z": np.full(len(t), G),
        "imu.gyro_x": np.gradient(roll, t),
        "imu.gyro_y": np.zeros(len(t)),
        "imu.gyro_z": r,
        "steering.road_wheel_angle": WAGON.wheelbase * r / v,
        "powertrain.gear_ratio": np.full(len(t), 2.19),
    }
    signals = {role: s + 0.001 * rng.standard_normal(len(t)) for role, s in signals.items()}
    signals["powertrain.gear_ratio"] = np.full(len(t), 2.19)
    for w in ("fl", "fr", "rl", "rr"):
        signals[f"wheel_speeds.{w}"] = v + 0.01 * rng.standard_normal(len(t))
        signals[f"wheel_torques.drive_{w}"] = np.maximum(torque, 0) / 2 * (w[0] == "r")
        signals[f"wheel_torques.brake_{w}"] = np.maximum(-torque, 0) / 4
    heading = np.cumsum(r) / RATE
    fix = slice(None, None, 10)
    gnss = {"speed": v, "course": heading, "climb": 0 * v, "heading": heading, "roll": roll}
    signals |= {f"gnss.{name}": values for name, values in gnss.items()}
    native = {"gnss": Samples(t[fix], {name: values[fix] for name, values in gnss.items()})}
    return Drive(t, 0, RATE, signals, native)


def head(drive: Drive, steps: int) -> Drive:
    signals = {role: values[:steps] for role, values in drive.signals.items()}
    return dataclasses.replace(drive, time=drive.time[:steps], signals=signals)


def seconds(job: Callable[[], object], repeats: int = 3) -> float:
    best = np.inf
    for _ in range(repeats):
        started = time.perf_counter()
        job()
        best = min(best, time.perf_counter() - started)
    return best


def lower_layer(drive: Drive, engine: Engine) -> Callable[[], object]:
    """The 15-state filter alone, on the drive's own signals."""
    n, dt = len(drive), drive.dt
    wheels = ("fl", "fr", "rl", "rr")
    inputs = tire_ukf.TireInputs(
        drive["steering.road_wheel_angle"],
        np.stack([drive[f"wheel_torques.drive_{w}"] for w in wheels], axis=1),
        np.stack([drive[f"wheel_torques.brake_{w}"] for w in wheels], axis=1),
        wheel_loads(drive["imu.accel_x"], drive["imu.accel_y"], WAGON),
        np.full((n, 4), 5.27),
    )
    spin = np.stack([drive[f"wheel_speeds.{w}"] for w in wheels], axis=1) / WAGON.wheel_radius
    v, r, zero = drive.wheel_speed("front"), drive["imu.gyro_z"], np.zeros(n)
    z = np.column_stack([v, v * np.nan, drive["imu.accel_y"], r, spin, zero, zero, zero])
    start = np.column_stack([v, zero, r, spin])
    tune, car = tire_ukf.tuning(dt), planar_car(WAGON, dt)
    frozen = np.zeros(n, np.bool_)
    return lambda: tire_ukf.tire_ukf(z, start, frozen, inputs, tune, car, engine)


def row(name: str, compiled: float, reference: float, first: float | None = None) -> str:
    compiling = "" if first is None else f"{first:10.1f}"
    return f"{name:26}{compiled:10.2f}{reference:12.0f}{reference / compiled:9.0f}x{compiling}"


def main(minutes: float) -> None:
    """Print the table."""
    drive = synthetic_drive(minutes)
    short = head(drive, REFERENCE_STEPS)
    print(f"{minutes:g} min at {RATE:g} Hz; filterpy on {REFERENCE_STEPS} steps of it")
    print(f"{'':26}{'us/step':>10}{'filterpy':>12}{'ratio':>10}{'first, s':>10}")
    total = total_first = 0.0
    for name in NAMES:
        first = seconds(lambda name=name: estimators.run(name, short, WAGON), 1)
        whole = seconds(lambda name=name: estimators.run(name, drive, WAGON))
        plain = seconds(lambda name=name: estimators.run(name, short, WAGON, engine="reference"), 1)
        total, total_first = total + whole, total_first + first
        compiled, reference = whole / len(drive) * 1e6, plain / len(short) * 1e6
        print(row(name, compiled, reference, first))
    lower = seconds(lower_layer(drive, "compiled")) / len(drive) * 1e6
    print(
        row(
            "lower filter alone",
            lower,
            seconds(lower_layer(short, "reference"), 1) / len(short) * 1e6,
        )
    )
    print(f"all five on an hour: {total * 60 / minutes:.1f} s; first calls: {total_first:.1f} s")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 10.0)
