"""Make the sample logs anew: simulated drives with truth, and one CSV with its profile.

Run: python sample_logs/make.py
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from roadlog.log import create
from roadlog.signals import TRUTH_PREFIX, TRUTH_TOPIC
from roadlog.simulate import Simulation, simulate

FOLDER = Path(__file__).parent
CSV_RATE = 50.0  # Hz
CSV_LENGTH = 60.0  # s


@dataclass(frozen=True)
class Sample:
    """One log: a scenario and how it is driven."""

    scenario: str
    seed: int
    overrides: Mapping[str, float] = field(default_factory=dict)
    full: bool = False
    load: str | None = None
    details: bool = True  # the truth beside the angles as well


SAMPLES = {
    "ramps": Sample("luo2024-s3b", 1, {"duration": 80.0}),
    "slalom": Sample("ryu2004-slalom", 2),
    "stops": Sample("kim2023-testroad", 3, {"speed.motions": 5}, full=True, load="trunk"),
    "hill": Sample("wang2025-up9", 4),
    "pass": Sample("mountain", 5, {"duration": 130.0}, details=False),
}


def drive(sample: Sample) -> Simulation:
    """The simulated drive of a sample."""
    return simulate(
        sample.scenario,
        seed=sample.seed,
        full=sample.full,
        load=sample.load,
        overrides=sample.overrides,
    )


def write_csv(simulation: Simulation, path: Path) -> None:
    """A minute as a small logger would write it: its own names and units, sensor turned."""
    imu, wheels = simulation.table("/imu"), simulation.table("/wheel_speeds")
    truth = simulation.table(TRUTH_TOPIC)
    start = imu.time[0]
    t = np.arange(round(CSV_LENGTH * CSV_RATE)) / CSV_RATE

    def on_clock(table: object, field: str) -> np.ndarray:
        return np.interp(t, (table.time - start) * 1e-9, table.columns[field])  # type: ignore[attr-defined]

    wheel = np.mean([on_clock(wheels, w) for w in ("rl", "rr")], axis=0)
    columns = {  # the sensor's x points left, its y backward
        "time_ms": 1000 * t,
        "ax_g": on_clock(imu, "accel_y") / 9.80665,
        "ay_g": -on_clock(imu, "accel_x") / 9.80665,
        "az_g": on_clock(imu, "accel_z") / 9.80665,
        "wx_dps": np.degrees(on_clock(imu, "gyro_y")),
        "wy_dps": -np.degrees(on_clock(imu, "gyro_x")),
        "wz_dps": np.degrees(on_clock(imu, "gyro_z")),
        "speed_kmh": 3.6 * wheel,
        "true_grade_deg": np.degrees(on_clock(truth, "grade")),
    }
    header = ",".join(columns)
    rows = np.stack(list(columns.values()), axis=1)
    np.savetxt(path, rows, "%.5f", ",", header=header, comments="")


def main() -> None:
    for name, sample in SAMPLES.items():
        simulation = drive(sample)
        tables = [
            table
            for table in simulation.tables
            if sample.details
            or table.topic == TRUTH_TOPIC
            or not table.topic.startswith(TRUTH_PREFIX)
        ]
        create(FOLDER / f"{name}.mcap", tables, simulation.metadata, simulation.vehicle)
        if name == "ramps":
            write_csv(simulation, FOLDER / "small_logger.csv")


if __name__ == "__main__":
    main()
