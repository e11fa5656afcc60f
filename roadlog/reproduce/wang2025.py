"""Wang 2025 run again: inclination on both drives, and fuel in a tilted tank.

`paper`: the paper's table 2; `documented`: docs/methods/common.md#prototype-figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.wang2025.fuel_level import LITERS
from roadlog.reproduce import Claim, Reproduction, ResultTable, Row
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.types import Floats

SEEDS = range(1, 6)
SCENARIOS = ("up9", "down12")
SCORED_AFTER = 1.0  # s; docs/methods/wang2025.md#scenarios
FUEL_SCORED_AFTER = 20.0  # s, two time constants of the low-pass


@dataclass(frozen=True)
class Variant:
    """A row of the table; paper and documented: RMSE in deg on up9 and down12."""

    method: str
    settings: Mapping[str, Any]
    mount: str  # of the accelerometer in the scenario
    paper: tuple[float | None, float | None] = (None, None)
    documented: tuple[float | None, float | None] = (None, None)


CAUSAL = {"smooth": False}
ROAD = {"mount": "road"}
VARIANTS: dict[str, Variant] = {
    "ekf_suspension, road": Variant(
        "ekf_suspension", CAUSAL | ROAD, "road", (0.371, 0.348), (0.303, 0.319)
    ),
    "ekf_suspension, body": Variant("ekf_suspension", CAUSAL, "body", (None, None), (0.294, 0.310)),
    "ekf_suspension, body, smoothed": Variant(
        "ekf_suspension", {}, "body", (None, None), (0.124, 0.106)
    ),
    "ekf_suspension, body, smoothed, q_a = 0.3": Variant(
        "ekf_suspension", {"accel_noise": 0.3}, "body", (None, None), (0.124, 0.106)
    ),
    "ekf_suspension, no drive force": Variant(
        "ekf_suspension", CAUSAL | {"use_drive_force": False}, "body", (None, None), (0.30, 0.31)
    ),
    "ekf_suspension, wrong mount": Variant("ekf_suspension", CAUSAL | ROAD, "body"),
    "ekf_suspension, printed W (no noise of the grade)": Variant(
        "ekf_suspension", CAUSAL | {"grade_noise": 0.0}, "body", (None, None), (4.4, 5.4)
    ),
    "lowpass_attitude 0.1 Hz": Variant(
        "lowpass_attitude", CAUSAL, "road", (2.138, 0.838), (1.011, 1.161)
    ),
    "lowpass_attitude 0.5 Hz, road": Variant(
        "lowpass_attitude", CAUSAL | {"cutoff": 0.5}, "road", (None, None), (0.553, 0.540)
    ),
    "lowpass_attitude 0.5 Hz, body": Variant(
        "lowpass_attitude", CAUSAL | {"cutoff": 0.5}, "body", (None, None), (0.365, 0.377)
    ),
    "ls_attitude 6 s": Variant("ls_attitude", CAUSAL, "road", (1.544, 2.023), (1.64, 1.95)),
}

# on the full car, whose accelerometer is on the body
FULL_CAR = (
    "ekf_suspension, body",
    "ekf_suspension, body, smoothed",
    "ekf_suspension, body, smoothed, q_a = 0.3",
    "ekf_suspension, no drive force",
    "ekf_suspension, wrong mount",
    "lowpass_attitude 0.1 Hz",
    "lowpass_attitude 0.5 Hz, body",
    "ls_attitude 6 s",
)

TILT_SOURCES = ("attitude", "attitude_accel", "specific_force")
FUEL_DOCUMENTED: tuple[dict[str, float], ...] = (
    {"attitude": 1.45, "attitude_accel": 0.33, "specific_force": 0.33},
    {"attitude": 1.01, "attitude_accel": 0.29, "specific_force": 0.15},
)


@dataclass(frozen=True)
class Case:
    """One simulated drive; truth of the inclination on its clock, rad; fuel in liters."""

    drive: Drive
    inclination: Floats
    fuel: float
    vehicle: Vehicle


def case(scenario: str, mount: str, seed: int, full: bool = False) -> Case:
    """`up9` or `down12` with the accelerometer on the body or parallel to the road.

    full: the full car with its sensors, its accelerometer on the body.
    """
    mounts = {} if full else {"imu.mount": mount}
    simulation = simulate(f"wang2025-{scenario}", seed=seed, full=full, overrides=mounts)
    drive = Drive.from_tables(simulation.tables)
    truth = simulation.table(TRUTH_TOPIC)
    own = (truth.time - drive.start_ns) * 1e-9
    inclination = np.interp(drive.time, own, truth.columns["inclination"])
    fuel = float(simulation.metadata["simulation"]["fuel_volume"]) * LITERS
    return Case(drive, inclination, fuel, simulation.vehicle)


def rms(values: Floats) -> float:
    """Root mean square of what is known."""
    return float(np.sqrt(np.nanmean(values**2)))


def reproduce() -> Reproduction:
    """Both drives over the seeds, and on the full car."""
    tables, errors = [], {}
    for k, scenario in enumerate(SCENARIOS):
        cases = {m: [case(scenario, m, seed) for seed in SEEDS] for m in ("road", "body")}
        rows = []
        for name, variant in VARIANTS.items():
            found = np.stack([_errors(c, variant) for c in cases[variant.mount]])
            errors[scenario, name] = found
            rows.append(
                Row(
                    name,
                    "inclination RMSE",
                    "deg",
                    variant.paper[k],
                    variant.documented[k],
                    rms(found),
                )
            )
        tables.append(ResultTable(f"{scenario}, {len(SEEDS)} seeds", rows))
        body = cases["body"][0]
        fuel = f"fuel at {body.fuel:.0f} L"
        tables.append(ResultTable(f"{scenario}, {fuel}", _fuel(body, FUEL_DOCUMENTED[k])))
        full = [case(scenario, "body", seed, full=True) for seed in SEEDS]
        rows = []
        for name in FULL_CAR:
            now = rms(np.stack([_errors(c, VARIANTS[name]) for c in full]))
            rows.append(Row(name, "inclination RMSE", "deg", None, None, now))
        tables.append(ResultTable(f"{scenario} on the full car, {len(SEEDS)} seeds", rows))
        tables.append(ResultTable(f"{scenario} on the full car, {fuel}", _fuel(full[0])))
    return Reproduction("wang2025", tables, _claims(errors))


def _errors(one: Case, variant: Variant) -> Floats:
    """deg, after the first second."""
    found = estimators.run(variant.method, one.drive, one.vehicle, variant.settings).inclination
    return np.degrees(found - one.inclination)[one.drive.time > SCORED_AFTER]


def _fuel(one: Case, documented: Mapping[str, float] | None = None) -> list[Row]:
    rows = []
    for source in TILT_SOURCES:
        settings = {"tilt_source": source}
        found = estimators.run("fuel_level", one.drive, one.vehicle, settings)
        volume = found.details["fuel"].columns["volume"][one.drive.time > FUEL_SCORED_AFTER]
        expected = documented[source] if documented else None
        rows.append(Row(source, "volume RMSE", "L", None, expected, rms(volume - one.fuel)))
    return rows


def _claims(errors: Mapping[tuple[str, str], Floats]) -> list[Claim]:
    ekf = {s: errors[s, "ekf_suspension, road"] for s in SCENARIOS}
    smooth = {s: errors[s, "ekf_suspension, body, smoothed"] for s in SCENARIOS}
    baselines = ("lowpass_attitude 0.1 Hz", "ls_attitude 6 s")
    best = {s: min(rms(errors[s, b]) for b in baselines) for s in SCENARIOS}
    kept = {s: float(np.mean(np.abs(ekf[s]) < 0.5)) for s in SCENARIOS}

    def both(values: Mapping[str, float], unit: str) -> str:
        return ", ".join(f"{s} {value:.3g} {unit}" for s, value in values.items())

    worst = {s: float(np.abs(ekf[s]).max()) for s in SCENARIOS}
    smooth_worst = {s: float(np.abs(smooth[s]).max()) for s in SCENARIOS}
    return [
        Claim(
            "the filter is better than low-pass and least squares",
            all(rms(ekf[s]) < best[s] for s in SCENARIOS),
            f"filter {both({s: rms(ekf[s]) for s in SCENARIOS}, 'deg')}; best other "
            f"{both(best, 'deg')}",
        ),
        Claim(
            "the error stays below 0.5 deg (filter)",
            max(worst.values()) < 0.5,
            f"largest {both(worst, 'deg')}; below 0.5 deg {both(kept, 'of the time')}",
        ),
        Claim(
            "the error stays below 0.6 deg (smoother, ours)",
            max(smooth_worst.values()) < 0.6,
            f"largest {both(smooth_worst, 'deg')}",
        ),
    ]
