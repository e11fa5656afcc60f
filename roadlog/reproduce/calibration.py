"""What calibrated constants are worth to each method; docs/calibration.md#what-it-is-worth.

One car that no data sheet describes drives through a town, over a pass and through a slalom; from
these three drives everything is calibrated. Then every method runs over another pass, three times:
as it is for an unknown car, with the gradients and stiffnesses found, and with the sensors'
corrections as well. The biases of that drive are another turn-on's: they are not those found.
"""

from __future__ import annotations

import numpy as np

from roadlog import estimators
from roadlog.calibrate import SENSORS, calibrate
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.base import Estimator
from roadlog.reproduce import Claim, Reproduction, ResultRow, ResultTable
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import Simulation, simulate

SKIP = 5.0  # s, before which filters converge
CAR = {  # a tall, heavy front-driven car
    "mass": 1950.0,
    "cg_height": 0.68,
    "cg_to_front_axle": 1.30,
    "cg_to_rear_axle": 1.50,
    "driven": "front",
}
LOGGER = {
    "imu.misalignment_deg": (1.0, -1.5, 2.0),
    "imu.position": (0.4, -0.3, 0.1),
    "can.latency": 0.10,
    "can.wheel_scale": 0.985,
    "gnss.two_antennas": False,
}
LEARNT = (("city", 240.0, 11), ("mountain", 240.0, 12), ("ryu2004-slalom", 40.0, 13))
JUDGED = ("mountain", 240.0, 14)
# methods that only work at stops or that need what this log does not have
LEFT_OUT = ("fuel_level", "kasaba")


def calibration() -> Reproduction:
    """The table and what it says; about a minute."""
    drives = {f"{name} {seed}": _drive(_simulated(name, t, seed)) for name, t, seed in LEARNT}
    found = calibrate(drives, Vehicle()).vehicle
    cars = {"unknown car": Vehicle(), "gains": _without_sensors(found), "calibrated": found}
    judged = _simulated(*JUDGED)
    drive = _drive(judged)
    rows, better, total = [], 0, 0
    for estimator in estimators.runnable(drive)[0]:
        if estimator.name in LEFT_OUT:
            continue
        runs = {label: _rmse_deg(estimator, drive, car, judged) for label, car in cars.items()}
        for angle in estimator.gives:
            case = f"{estimator.name}, {angle}"
            figures = {label: errors.get(angle) for label, errors in runs.items()}
            rows += [ResultRow(case, "", f"RMSE, {k}", "deg", None, v) for k, v in figures.items()]
            before, after = figures["unknown car"], figures["calibrated"]
            if before is not None and after is not None:
                total += 1
                better += after < before
    claim = Claim(
        "calibration makes most angles of most methods better",
        better > 0.75 * total,
        f"{better} of {total}",
        "what is not observable in a drive, like the mounting's roll, is only assumed",
    )
    return Reproduction("calibration", [ResultTable("over another pass", rows)], [], [claim])


def _simulated(name: str, duration: float, seed: int) -> Simulation:
    car = Vehicle.preset("wagon").with_values("given", **CAR)
    return simulate(name, seed=seed, vehicle=car, overrides={**LOGGER, "duration": duration})


def _drive(simulation: Simulation) -> Drive:
    return Drive.from_tables(simulation.tables)


def _without_sensors(vehicle: Vehicle) -> Vehicle:
    """The car as found, the logger as if nothing were known of it."""
    names = (*SENSORS, "imu_position")
    plain = {name: getattr(Vehicle(), name) for name in names}
    return vehicle.with_values("default", **plain)


def _rmse_deg(
    estimator: Estimator, drive: Drive, car: Vehicle, judged: Simulation
) -> dict[str, float]:
    """Angle -> RMSE where the estimate may be used."""
    estimate = estimators.run(estimator.name, drive, car)
    truth = judged.table(TRUTH_TOPIC)
    result = {}
    for angle, values in estimate.angles.items():
        true = np.interp(drive.time_ns, truth.time, truth.columns[angle])
        use = (drive.time > SKIP) & estimate.valid & np.isfinite(values)
        if use.any():
            result[angle] = float(np.degrees(np.sqrt(np.mean((values - true)[use] ** 2))))
    return result
