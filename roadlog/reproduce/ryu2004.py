"""Ryu 2004 run again: bank and roll separated in a slalom and on laps; docs/methods/ryu2004.md.

The paper shows pictures only, so what is compared are its claims. Its observer is run as printed
(causal inputs; the two misprints of the text are not in its matrix) and with smoothed inputs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.reproduce import (
    Claim,
    Form,
    Reproduction,
    ResultTable,
    bank_by_place,
    over,
    over_seeds,
    rms,
)
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.types import Bools, Floats

SKIP = 5.0  # s, before which filters converge
SEEDS = range(1, 6)
CASES = ("slalom", "laps", "laps-var", "chirp")
RUNS: dict[str, tuple[str, Form, Mapping[str, Any]]] = {
    "roll_bank_obs, causal": ("roll_bank_obs", "printed", {"smooth": False}),
    "roll_bank_obs, smoothed inputs": ("roll_bank_obs", "mended", {}),
    "split_qs": ("split_qs", "", {"smooth": False}),
}
SETTINGS = "smooth=false but where it says smoothed"
PRINTED = "roll_bank_obs, causal"
SMALL_TOTAL = np.radians(0.5)
MODEL = 0.25  # of the signal: how near the vehicle model must be
DRIVEN = ("slalom", "laps", "chirp")


@dataclass(frozen=True)
class Found:
    """Of one drive: (run, angle) -> RMSE in deg, and what the claims say of the printed run."""

    rmse: dict[tuple[str, str], float]
    said: dict[str, float]


@dataclass(frozen=True)
class Job:
    """One drive."""

    case: str
    seed: int


def reproduce() -> Reproduction:
    """The table, the paper's claims, and bank by place."""
    jobs = [Job(case, seed) for case in CASES for seed in SEEDS]
    found = dict(zip(jobs, over(run, jobs), strict=True))
    rows = [
        over_seeds(
            f"{case}, {name}",
            form,
            f"{angle} RMSE",
            "deg",
            None,
            [found[Job(case, seed)].rmse[name, angle] for seed in SEEDS],
        )
        for case in CASES
        for name, (_, form, _) in RUNS.items()
        for angle in ("bank", "roll")
    ]
    title = f"Fig 5 and others: bank and roll, with sensors, {len(SEEDS)} seeds"
    table, crawled = bank_by_place.reproduce()
    tables = [ResultTable(title, rows, SETTINGS), table]
    said = {
        case: {
            key: float(np.mean([found[Job(case, seed)].said[key] for seed in SEEDS]))
            for key in found[Job(case, SEEDS[0])].said
        }
        for case in CASES
    }
    return Reproduction("ryu2004", tables, [*_claims(said), crawled])


def run(job: Job) -> Found:
    """Every variant over one drive."""
    simulation = simulate(f"ryu2004-{job.case}", seed=job.seed)
    drive = Drive.from_tables(simulation.tables)
    table = simulation.table(TRUTH_TOPIC)
    late = drive.time > SKIP
    truth = {a: np.interp(drive.time_ns, table.time, table.columns[a]) for a in ("bank", "roll")}
    rmse, said = {}, {}
    for name, (estimator, _, settings) in RUNS.items():
        estimate = estimators.run(estimator, drive, simulation.vehicle, settings)
        for angle, true in truth.items():
            rmse[name, angle] = rms(np.degrees((estimate.angles[angle] - true)[late]))
        if name == PRINTED:
            bank, roll = estimate.bank[late], estimate.roll[late]
            level = np.abs(bank + roll) < SMALL_TOTAL
            said = {
                "flat": float((np.abs(bank) < np.radians(1.0)).mean()),
                "side force": float(np.corrcoef(roll, drive["imu.accel_y"][late])[0, 1]),
                "level bank": float(np.degrees(bank[level].mean())) if level.any() else 0.0,
                "total up": float((bank + roll > 0).mean()),
                "bank up": float((bank > 0).mean()),
            }
            said |= _beside_model(drive, simulation.vehicle, late)
    return Found(rmse, said)


def _beside_model(drive: Drive, vehicle: Vehicle, late: Bools) -> dict[str, float]:
    """deg and deg/s, RMS: sideslip by GNSS/INS and yaw rate, and how far the model's lie off."""
    ins = estimators.run("gnss_ins", drive, vehicle, {"smooth": False})
    beta, rate = ins.details["sideslip"].columns["beta"], drive["imu.gyro_z"]
    model = single_track(drive, vehicle)
    return {
        "beta": rms(np.degrees(beta[late])),
        "model beta": rms(np.degrees((model[:, 0] - beta)[late])),
        "yaw rate": rms(np.degrees(rate[late])),
        "model yaw rate": rms(np.degrees((model[:, 1] - rate)[late])),
    }


def single_track(drive: Drive, vehicle: Vehicle) -> Floats:
    """(n, 2) rad and rad/s: sideslip at the CG and yaw rate of the linear single-track car.

    From steering and speed alone, by exact steps; what the paper's Fig 4 holds against GNSS/INS.
    """
    a, b, m = vehicle.cg_to_front_axle, vehicle.cg_to_rear_axle, vehicle.mass
    front, rear = vehicle.front_cornering_stiffness, vehicle.rear_cornering_stiffness
    c0, c1 = front + rear, a * front - b * rear
    c2 = a * a * front + b * b * rear
    steer = np.nan_to_num(drive["steering.road_wheel_angle"])
    speed = np.maximum(np.nan_to_num(drive.speed), 1.0)
    x, states = np.zeros(2), np.empty((len(drive), 2))
    for k, (u, delta) in enumerate(zip(speed, steer, strict=True)):
        A = np.array(
            [
                [-c0 / (m * u), -1 - c1 / (m * u * u)],
                [-c1 / vehicle.yaw_inertia, -c2 / (vehicle.yaw_inertia * u)],
            ]
        )
        B = np.array([front / (m * u), a * front / vehicle.yaw_inertia]) * delta
        # the trapezoidal rule is stable at any step
        half = 0.5 * drive.dt * A
        x = np.linalg.solve(np.eye(2) - half, (np.eye(2) + half) @ x + drive.dt * B)
        states[k] = x
    return states


def _claims(said: Mapping[str, Mapping[str, float]]) -> list[Claim]:
    slalom, laps = said["slalom"], said["laps"]
    driven = [said[name] for name in DRIVEN]
    return [
        Claim(
            "Fig 4: sideslip and yaw rate are those of the vehicle model",
            all(m[f"model {k}"] < MODEL * m[k] for m in driven for k in ("yaw rate", "beta")),
            "; ".join(
                f"{name}: yaw rate {m['model yaw rate']:.2f} of {m['yaw rate']:.2f} deg/s apart, "
                f"sideslip {m['model beta']:.2f} of {m['beta']:.2f} deg (RMS)"
                for name, m in zip(DRIVEN, driven, strict=True)
            ),
            "single-track car on steering and speed alone; in the chirp it is a quarter of "
            "a degree, and the tires' relaxation is not in the model",
        ),
        Claim(
            "slalom on a flat road: |bank| < 1 deg",
            slalom["flat"] == 1.0,
            f"{slalom['flat']:.1%} of samples",
            "the body's own dynamics explain the lean, so little of it is left for the bank",
        ),
        Claim(
            "slalom: roll follows the side force",
            slalom["side force"] > 0.99,
            f"correlation {slalom['side force']:.3f}",
            "at 0.3 Hz a body on springs leans as if it stood in the side force",
        ),
        Claim(
            "Fig 5: on the laps the total roll is mostly positive, the bank as often up as down",
            laps["total up"] > 0.7 and abs(laps["bank up"] - 0.5) < 0.1,
            f"total roll > 0 for {laps['total up']:.1%}, bank > 0 for {laps['bank up']:.1%}",
            "the car leans outward all the way around, the tilted plane falls to both sides",
        ),
        Claim(
            "laps: bank and roll are separated where the total roll is small",
            abs(laps["level bank"]) > 1.0,
            f"bank {laps['level bank']:.2f} deg on average where |total roll| < 0.5 deg",
            "there bank and roll cancel: a sensor of the total alone would say level",
        ),
    ]
