"""The urban drive: Table 2, convergence (Fig 26), and the same on the full car."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators import run as run_estimator
from roadlog.reproduce import Form, ResultRow, ResultTable, over
from roadlog.reproduce.kim2023.motions import PRINTED, said
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.types import Floats

DRIVES = range(1, 9)
LOADS_DEG = (0.3, 1.2)
# the full car: drives (scenario, seed), and two loads that pitch it by about 0.2 and 1.1 deg
FULL_DRIVES = tuple(("kim2023-urban", seed) for seed in range(1, 6))
FULL_LOADS = ("family", "trunk")
CONVERGED = 0.2  # deg, what a headlamp forgives
METHODS: dict[str, tuple[str, Form, dict[str, Any]]] = {
    "static_slope": ("static_slope", "printed", PRINTED),
    "static_slope, position given": ("static_slope", "mended", {}),
    "static_slope, no position": ("static_slope", "mended", {}),
    "static_slope, by variance": ("static_slope", "mended", {"weights": "variance"}),
    "static_slope, bias left in": ("static_slope", "mended", {"accel_bias": "none"}),
    "kasaba": ("kasaba", "", {}),
    "grade_pitch_ekf": ("grade_pitch_ekf", "", {}),
}
BASELINES = ("kasaba", "grade_pitch_ekf")
OURS = "static_slope, no position"
TRIED = ("static_slope, by variance", "static_slope, bias left in")
SETTINGS = (
    f"printed: {said(PRINTED)}; by variance: weights=variance; bias left in: accel_bias=none; "
)
SETTINGS += "no imu_position but where it is given"
TABLE_2 = {"static_slope": (0.04, 0.11), "kasaba": (0.38, 0.19), "grade_pitch_ekf": (0.53, 1.1)}


@dataclass(frozen=True)
class Job:
    """A drive; load: deg on the simple car, a name on the full one."""

    scenario: str
    seed: int
    load: float | str


@dataclass(frozen=True)
class Found:
    """Of one method on one drive: final error and spread of its events, deg; s until it stays
    within CONVERGED, NaN if never; share of its events that are valid."""

    error: float
    spread: float
    converged: float
    valid: float


Runs = dict[Job, dict[str, Found]]


def jobs(full: bool) -> list[Job]:
    """Every drive with every load."""
    if full:
        return [Job(name, seed, load) for load in FULL_LOADS for name, seed in FULL_DRIVES]
    return [Job("kim2023-urban", seed, load) for load in LOADS_DEG for seed in DRIVES]


def run(full: bool) -> Runs:
    """All methods over all drives."""
    found = jobs(full)
    return dict(zip(found, over(run_drive, found), strict=True))


def run_drive(job: Job) -> dict[str, Found]:
    """All methods over one drive, against the pitch of the standing body."""
    if isinstance(job.load, str):
        straight = {"misalignment_deg": [0.0, 0.0, 0.0]}
        simulation = simulate(
            job.scenario, seed=job.seed, full=True, load=job.load, overrides=straight
        )
    else:
        overrides = {"straight.load": float(np.radians(job.load))}
        simulation = simulate(job.scenario, seed=job.seed, overrides=overrides)
    drive = Drive.from_tables(simulation.tables)
    true = float(job.load) if not isinstance(job.load, str) else _true(simulation, drive)
    nowhere = simulation.vehicle.with_values("default", imu_position=None)
    found = {}
    for name, (estimator, _, settings) in METHODS.items():
        vehicle = simulation.vehicle if "given" in name else nowhere
        found[name] = _found(run_estimator(estimator, drive, vehicle, settings), true)
    return found


def _true(simulation: Any, drive: Drive) -> float:
    """deg, mean pitch of the standing car."""
    table = simulation.table(TRUTH_TOPIC)
    pitch = np.interp(drive.time_ns, table.time, table.columns["pitch"])
    return float(np.degrees(pitch[drive.standstill].mean()))


def _found(estimate: Estimate, true: float) -> Found:
    pitch = np.degrees(estimate.pitch) - true
    known = np.flatnonzero(np.isfinite(pitch))
    if not len(known):
        return Found(np.nan, np.nan, np.nan, 0.0)
    off = known[np.abs(pitch[known]) > CONVERGED]
    first = known[0] if not len(off) else off[-1] + 1
    converged = float(estimate.time[first]) if first < len(pitch) else np.nan
    if "events" not in estimate.details:
        return Found(float(pitch[known[-1]]), np.nan, converged, 1.0)
    columns = estimate.details["events"].columns
    valid = columns["valid"]
    spread = float(np.degrees(columns["pitch"][valid]).std(ddof=1)) if valid.sum() > 1 else np.nan
    return Found(float(pitch[known[-1]]), spread, converged, float(valid.mean()))


def errors(runs: Mapping[Job, dict[str, Found]], name: str, load: float | str) -> Floats:
    """deg, final error of each drive with that load."""
    return np.array([found[name].error for job, found in runs.items() if job.load == load])


def table(runs: Runs, loads: tuple[float | str, ...], title: str) -> ResultTable:
    """Table 2 in the paper's metric, and what it does not show."""
    rows: list[ResultRow] = []
    for k, load in enumerate(loads):
        unit = "" if isinstance(load, str) else " deg"
        for name, (_, form, _) in METHODS.items():
            case = f"{name}, load {load}{unit}"
            paper = TABLE_2.get(name.split(",")[0]) if name not in TRIED else None
            own = [found[name] for job, found in runs.items() if job.load == load]
            rows += _rows(case, form, None if paper is None or unit == "" else paper[k], own)
    return ResultTable(title, rows, SETTINGS)


def _rows(case: str, form: Form, paper: float | None, own: list[Found]) -> list[ResultRow]:
    error = np.array([one.error for one in own])
    known = error[np.isfinite(error)]
    if not len(known):
        return [ResultRow(case, form, "|mean error|", "deg", paper, None)]
    rows = [
        ResultRow(case, form, "|mean error|", "deg", paper, abs(float(known.mean())), _sd(known)),
        ResultRow(case, form, "mean |error| of a drive", "deg", None, float(np.abs(known).mean())),
        ResultRow(case, form, "largest error of a drive", "deg", None, float(np.abs(known).max())),
    ]
    late = [one.converged for one in own]
    if np.isfinite(late).all():
        mean = float(np.mean(late))
        rows.append(
            ResultRow(case, form, f"within {CONVERGED} deg after", "s", None, mean, _sd(late))
        )
    else:
        never = 100 * float(np.mean(~np.isfinite(late)))
        rows.append(
            ResultRow(case, form, f"never within {CONVERGED} deg", "% of drives", None, never)
        )
    if np.isfinite([one.spread for one in own]).all():
        spread = [one.spread for one in own]
        rows.append(
            ResultRow(case, form, "spread of the events", "deg", None, float(np.mean(spread)))
        )
        share = 100 * float(np.mean([one.valid for one in own]))
        rows.append(ResultRow(case, form, "events valid", "%", None, share))
    return rows


def _sd(values: Any) -> float | None:
    return float(np.std(values, ddof=1)) if len(values) > 1 else None
