"""`fusion` beside two published libraries on simulated drives: accuracy and time per sample.

vqf (Laidig and Seel 2023): inclination from the IMU alone, offline. pyins (PyPI `python-ins`): an
error state Kalman filter, forward, fed with GNSS position and velocity and with the car's speed as
velocity in body axes. Needs `pip install vqf python-ins`; neither is a dependency of roadlog.

Run: python benchmarks/peers.py [SCENARIO ...]
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import pandas as pd
from pyins import filters, measurements, strapdown
from pyins.inertial_sensor import EstimationModel
from vqf import offlineVQF

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import Simulation, simulate
from roadlog.storage import Table
from roadlog.types import Floats

SCENARIOS = ("wang2025-up9",)
DURATION = 30.0  # s of each drive: pyins takes milliseconds a sample
WARM_UP = 2.0  # s of a drive
SKIP = 5.0  # s, filters converge
TO_DOWN = np.array([1.0, -1.0, -1.0])  # vehicle axes to forward right down


def by_vqf(drive: Drive) -> tuple[Floats, float]:
    """Inclination in rad, and s per sample."""
    gyro, accel = _imu(drive)
    started = time.process_time()
    quaternion = offlineVQF(gyro, accel, None, drive.dt)["quat6D"]
    spent = time.process_time() - started
    w, x, y, z = quaternion.T
    return np.arcsin(np.clip(2 * (x * z - w * y), -1, 1)), spent / len(drive)


def by_pyins(drive: Drive) -> tuple[Floats, float]:
    """Inclination in rad, and s per sample."""
    gyro, accel = _imu(drive)
    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    imu = pd.DataFrame(np.hstack([gyro * TO_DOWN, accel * TO_DOWN]), drive.time, columns)
    gnss = drive.native["gnss"]
    at, fix = gnss.time, gnss.columns
    velocity = pd.DataFrame(
        {
            "VN": fix["speed"] * np.sin(fix["course"]),
            "VE": fix["speed"] * np.cos(fix["course"]),
            "VD": -fix["climb"],
        },
        at,
    )
    place = pd.DataFrame(
        {"lat": fix["latitude"], "lon": fix["longitude"], "alt": fix["altitude"]}, at
    )
    wheels = drive.native["wheel_speeds"]
    speed = np.mean([wheels.columns["fl"], wheels.columns["fr"]], axis=0)
    body = pd.DataFrame({"VX": speed, "VY": 0.0, "VZ": 0.0}, wheels.time)
    heading = 90.0 - np.degrees(fix["course"][0])
    start = pd.concat(
        [
            place.iloc[0],
            velocity.iloc[0],
            pd.Series({"roll": 0.0, "pitch": 0.0, "heading": heading}),
        ]
    )
    start.name = drive.time[0]
    started = time.process_time()
    result = filters.run_feedback_filter(
        start,
        5.0,
        0.5,
        3.0,
        5.0,
        strapdown.compute_increments_from_imu(imu, "rate"),
        EstimationModel(bias_sd=np.radians(0.3), noise=np.radians(0.02), bias_walk=5e-6),
        EstimationModel(bias_sd=0.05, noise=0.03, bias_walk=1e-4),
        measurements=[
            measurements.NedVelocity(velocity, 0.1),
            measurements.Position(place, 2.0),
            measurements.BodyVelocity(body, 0.15),
        ],
    )
    spent = time.process_time() - started
    pitch = np.radians(result.trajectory.pitch)
    return np.interp(drive.time, pitch.index, pitch), spent / len(drive)


def errors_of(simulation: Simulation) -> dict[str, dict[str, float]]:
    """Per method: RMSE in deg of inclination and of grade, and microseconds per sample."""
    inputs = [
        cut(t, DURATION) for t in simulation.tables if t.topic in ("/imu", "/wheel_speeds", "/gnss")
    ]
    drive = Drive.from_tables(inputs)
    truth = simulation.table(TRUTH_TOPIC)
    at = (truth.time - drive.start_ns) * 1e-9
    true = {a: np.interp(drive.time, at, truth.columns[a]) for a in ("inclination", "grade")}
    # the peers know no body: the data sheet's pitch gradient takes it off
    vehicle = simulation.vehicle
    body = vehicle.pitch_gain * np.nan_to_num(drive["imu.accel_x"])
    estimators.run("fusion", drive, vehicle)  # compiles
    started = time.process_time()
    estimate = estimators.run("fusion", drive, vehicle)
    spent = (time.process_time() - started) / len(drive)
    results = {"fusion": (estimate.inclination, estimate.grade, spent)}
    for name, method in (("vqf", by_vqf), ("pyins", by_pyins)):
        method(Drive.from_tables([cut(table, WARM_UP) for table in inputs]))  # compiles
        inclination, cost = method(drive)
        results[name] = inclination, inclination - body, cost
    counted = drive.time > SKIP
    return {
        name: {
            "inclination_deg": _rms(inclination - true["inclination"], counted),
            "grade_deg": _rms(grade - true["grade"], counted),
            "microseconds": round(1e6 * cost, 2),
        }
        for name, (inclination, grade, cost) in results.items()
    }


def cut(table: Table, duration: float) -> Table:
    """The first seconds of a channel."""
    keep = (table.time - table.time[0]) * 1e-9 <= duration
    columns = {name: values[keep] for name, values in table.columns.items()}
    return Table(table.topic, table.schema, table.time[keep], columns)


def _imu(drive: Drive) -> tuple[Floats, Floats]:
    gyro, accel = (
        np.ascontiguousarray(np.stack([drive[f"imu.{kind}_{a}"] for a in "xyz"], axis=1))
        for kind in ("gyro", "accel")
    )
    return np.nan_to_num(gyro), np.nan_to_num(accel)


def _rms(error: Floats, counted: Floats) -> float:
    known = error[counted & np.isfinite(error)]
    return round(float(np.degrees(np.sqrt(np.mean(known**2)))), 4)


def main() -> None:
    """Print the errors of every scenario and their means as JSON."""
    names = sys.argv[1:] or SCENARIOS
    result = {name: errors_of(simulate(name, full=True)) for name in names}
    first = next(iter(result.values()))
    result["mean"] = {
        method: {
            key: round(float(np.mean([result[n][method][key] for n in names])), 4)
            for key in figures
        }
        for method, figures in first.items()
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
