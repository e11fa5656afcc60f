"""`fusion` beside published libraries on simulated drives: accuracy and time per sample.

vqf (Laidig and Seel 2023): inclination from the IMU alone, offline. pyins (PyPI `python-ins`): an
error state Kalman filter, forward, fed with GNSS position and velocity and with the car's speed as
velocity in body axes. GTSAM: a factor graph of the whole drive, a state at every fix, with
preintegrated IMU factors (Forster 2017), fixes, and the wheels' way between two of them as a
relative pose, which says where the car went along its own axes and nothing of how it turned.
Needs `pip install vqf python-ins gtsam`; none is a dependency of roadlog.

Run: python benchmarks/peers.py [SCENARIO ...]
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import gtsam
import numpy as np
import pandas as pd
from pyins import filters, measurements, strapdown
from pyins.inertial_sensor import EstimationModel
from vqf import offlineVQF

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.geo import TransverseMercator
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import SCENARIOS, Simulation, simulate
from roadlog.storage import Table
from roadlog.types import Floats

DURATION = 20.0  # s of each drive: pyins takes milliseconds a sample
WARM_UP = 2.0  # s of a drive
SKIP = 5.0  # s, filters converge
# 1 sd, of GTSAM's factors: what the simulator's sensors have, as pyins is told above
NOISE: dict[str, Any] = {
    "gyro": 0.02,  # deg/s/sqrt(Hz)
    "accel": 0.03,  # m/s2/sqrt(Hz)
    "velocity": 0.1,  # m/s
    "place": np.array([2.0, 2.0, 3.0]),  # m: east, north, up
    "start": np.array([0.2, 0.2, 0.1, 5.0, 5.0, 5.0]),  # rad: roll, pitch, yaw; m
    "way": np.array([0.015, 0.015, 0.015]),  # m between two fixes: along, left, up
}
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


def by_gtsam(drive: Drive) -> tuple[Floats, float]:
    """Inclination in rad, and s per sample."""
    gyro, accel = _imu(drive)
    gnss = drive.native["gnss"]
    fixes = gnss.time[(gnss.time >= drive.time[0]) & (gnss.time <= drive.time[-1])]
    at = np.searchsorted(drive.time, fixes).clip(max=len(drive) - 1)
    place = _east_north_up(gnss.columns)[: len(fixes)]
    way = np.cumsum(_wheel_speed(drive)) * drive.dt
    started = time.process_time()
    settings = gtsam.PreintegrationParams.MakeSharedU(9.81)
    settings.setGyroscopeCovariance(np.eye(3) * np.radians(NOISE["gyro"]) ** 2)
    settings.setAccelerometerCovariance(np.eye(3) * NOISE["accel"] ** 2)
    settings.setIntegrationCovariance(np.eye(3) * 1e-8)
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    pose, velocity, bias = (gtsam.symbol(letter, 0) for letter in "xvb")
    x, v, b = (lambda k, base=base: base + k for base in (pose, velocity, bias))
    course = gnss.columns["course"]
    fix = gtsam.noiseModel.Diagonal.Sigmas(NOISE["place"])
    odometry = gtsam.noiseModel.Diagonal.Sigmas(np.array([9.0, 9.0, 9.0, *NOISE["way"]]))
    walk = gtsam.noiseModel.Isotropic.Sigma(6, 1e-4)
    still = gtsam.imuBias.ConstantBias()
    first = gtsam.noiseModel.Diagonal.Sigmas(np.array([*3 * [0.05], *3 * [np.radians(0.3)]]))
    graph.addPriorConstantBias(b(0), still, first)
    graph.addPriorPose3(
        x(0), _pose(place[0], course[0]), gtsam.noiseModel.Diagonal.Sigmas(NOISE["start"])
    )
    for k in range(len(at)):
        speed = gnss.columns["speed"][k]
        heading = np.array([np.cos(course[k]), np.sin(course[k]), 0.0])
        start.insert(x(k), _pose(place[k], course[k]))
        start.insert(v(k), speed * heading)
        start.insert(b(k), still)
        graph.add(gtsam.GPSFactor(x(k), place[k], fix))
        moved = speed * heading + gnss.columns["climb"][k] * np.array([0.0, 0.0, 1.0])
        graph.addPriorVector(v(k), moved, gtsam.noiseModel.Isotropic.Sigma(3, NOISE["velocity"]))
        if k == 0:
            continue
        integral = gtsam.PreintegratedImuMeasurements(settings, still)
        for i in range(at[k - 1], at[k]):
            integral.integrateMeasurement(accel[i], gyro[i], drive.dt)
        graph.add(gtsam.ImuFactor(x(k - 1), v(k - 1), x(k), v(k), b(k - 1), integral))
        graph.add(gtsam.BetweenFactorConstantBias(b(k - 1), b(k), still, walk))
        ahead = gtsam.Pose3(gtsam.Rot3(), np.array([way[at[k]] - way[at[k - 1]], 0.0, 0.0]))
        graph.add(gtsam.BetweenFactorPose3(x(k - 1), x(k), ahead, odometry))
    found = gtsam.LevenbergMarquardtOptimizer(graph, start).optimize()
    spread = gtsam.Marginals(graph, found)  # the others give an sd too
    for k in range(len(at)):
        spread.marginalCovariance(x(k))
    spent = time.process_time() - started
    rotations = [found.atPose3(x(k)).rotation().matrix() for k in range(len(at))]
    pitch = np.arcsin([rotation[2, 0] for rotation in rotations])  # the x axis's part upward
    return np.interp(drive.time, drive.time[at], pitch), spent / len(drive)


def _pose(place: Floats, course: float) -> gtsam.Pose3:
    return gtsam.Pose3(gtsam.Rot3.Yaw(course), place)


def _east_north_up(fix: dict[str, Floats]) -> Floats:
    """m, (n, 3), around the first fix."""
    latitude, longitude = fix["latitude"], fix["longitude"]
    plane = TransverseMercator(latitude[0], longitude[0])
    east, north = plane.forward(latitude, longitude)
    return np.stack([east, north, fix["altitude"] - fix["altitude"][0]], axis=1)


def _wheel_speed(drive: Drive) -> Floats:
    return np.nan_to_num(0.5 * (drive["wheel_speeds.fl"] + drive["wheel_speeds.fr"]))


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
    for name, method in (("vqf", by_vqf), ("gtsam", by_gtsam), ("pyins", by_pyins)):
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
    names = sys.argv[1:] or list(SCENARIOS)
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
