"""`fusion` beside the other estimators on every simulated drive; docs/methods/fusion.md."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import EstimatorError
from roadlog.estimate import Estimate
from roadlog.metrics import AngleMetrics, angle_errors, angle_metrics
from roadlog.reproduce import Claim, Reproduction, ResultRow, ResultTable, over
from roadlog.signals import FIX_TOPIC, GNSS_TOPIC, IMU_TOPIC, SECTIONS, SEPARATED, TRUTH_TOPIC
from roadlog.simulate import SCENARIOS, Simulation, simulate
from roadlog.simulate.sampling import mounting
from roadlog.storage import Table

SEEDS = (1, 2, 3, 4, 5)
ANTENNAS = ("heading", "roll", "heading_accuracy", "roll_accuracy")
INPUT_SETS = {"alone": "IMU + wheels", "mounted": "IMU + wheels, mounting known"}
WHEELED = (IMU_TOPIC, SECTIONS["wheel_speeds"].topic)
RECEIVER = (GNSS_TOPIC, FIX_TOPIC)
SMOOTH_SHAPE, ROUGH_SHAPE = 0.06, 0.15  # deg, std of the error of grade
WITH_GNSS, BODY, TWO_ANTENNAS = 0.08, 0.08, 0.05  # deg, RMSE
COVERED = (0.93, 0.98)  # share of errors within 2 sd
MIN_VALID = 0.5  # share of a drive that an estimator must answer for to be compared

Runs = dict[str, dict[str, list[AngleMetrics]]]  # estimator -> angle -> one entry a seed


@dataclass(frozen=True)
class ScenarioRuns:
    """All seeds of one scenario: IMU and wheels, mounting known, with GNSS, with two antennas."""

    name: str
    rough: bool
    alone: Runs
    mounted: Runs
    gnss: Runs
    antennas: Runs


def scenarios() -> list[str]:
    """Those that the full car drives; the others have a truth without roll or sensors."""
    return [
        name
        for name, scenario in SCENARIOS.items()
        if scenario.straight is None or name.startswith("wang2025")
    ]


def fusion(seeds: tuple[int, ...] = SEEDS, names: list[str] | None = None) -> Reproduction:
    """The tables and the goals of the estimator; about five minutes on two cores.

    Every drive has sensors of its own: biases that all drives share would be as many numbers as
    there are seeds, and decide as one who is ahead in an offset.
    """
    every = scenarios()
    own = [tuple(len(seeds) * every.index(name) + k for k in seeds) for name in names or every]
    cases = over(_case, names or every, own)
    tables = [
        ResultTable(f"{angle}, {title}", list(_beside(cases, inputs, angle)))
        for inputs, title in INPUT_SETS.items()
        for angle in SEPARATED
    ]
    tables += [
        ResultTable("fusion with GNSS", list(_alone(cases, "gnss"))),
        ResultTable("fusion with two antennas", list(_alone(cases, "antennas"))),
        ResultTable("honesty with two antennas", list(_honesty(cases))),
    ]
    return Reproduction("fusion", tables, [], _claims(cases))


def _case(name: str, seeds: tuple[int, ...]) -> ScenarioRuns:
    case = ScenarioRuns(name, SCENARIOS[name].road.roughness > 0, {}, {}, {}, {})
    misalignment = SCENARIOS[name].sensors.imu.misalignment_deg
    for seed in seeds:
        drive = simulate(name, seed=seed, full=True)
        wheels = [t for t in drive.tables if t.topic in WHEELED]
        receiver = [t for t in drive.tables if t.topic in RECEIVER]
        mounted = drive.vehicle.mounted(mounting(*np.radians(misalignment)))
        one = wheels + [_one_antenna(table) for table in receiver]
        _run(drive, wheels, drive.vehicle, case.alone)
        _run(drive, wheels, mounted, case.mounted)
        _run(drive, one, drive.vehicle, case.gnss, ["fusion"])
        _run(drive, wheels + receiver, drive.vehicle, case.antennas, ["fusion"])
    return case


def _one_antenna(table: Table) -> Table:
    known = {
        name: np.full(len(table), np.nan) if name in ANTENNAS else values
        for name, values in table.columns.items()
    }
    return replace(table, columns=known)


def _run(
    simulation: Simulation,
    tables: list[Table],
    vehicle: Vehicle,
    runs: Runs,
    names: list[str] | None = None,
) -> None:
    """Add the metrics of every estimator that can run."""
    drive = Drive.from_tables(tables)
    truth = Estimate.from_table(simulation.table(TRUTH_TOPIC))
    for estimator in estimators.runnable(drive)[0]:
        if names is not None and estimator.name not in names:
            continue
        try:
            estimate = estimators.run(estimator.name, drive, vehicle)
        except EstimatorError:
            continue  # the drive has not what the method needs, e.g. no stop
        for angle in SEPARATED:
            errors = angle_errors(estimate, truth, angle)
            if errors is None:
                continue
            metrics = angle_metrics(errors, angle)
            if metrics.n > MIN_VALID * len(errors.time):
                runs.setdefault(estimator.name, {}).setdefault(angle, []).append(metrics)


def _mean(runs: Runs, estimator: str, angle: str, metric: str) -> float:
    values = [getattr(metrics, metric) for metrics in runs[estimator][angle]]
    return float(np.mean(values))


def _best_other(runs: Runs, angle: str) -> tuple[str, float] | None:
    others = [
        (_mean(runs, name, angle, "rmse_deg"), name)
        for name, angles in runs.items()
        if name != "fusion" and len(angles.get(angle, ())) == len(runs["fusion"][angle])
    ]
    return (min(others)[1], min(others)[0]) if others else None


def _beside(cases: list[ScenarioRuns], inputs: str, angle: str) -> Iterator[ResultRow]:
    for case in cases:
        runs = getattr(case, inputs)
        for metric in ("rmse", "std"):
            now = _mean(runs, "fusion", angle, f"{metric}_deg")
            yield ResultRow(f"{case.name}, fusion", "", metric, "deg", None, now)
        other = _best_other(runs, angle)
        if other is not None:
            yield ResultRow(
                f"{case.name}, {other[0]} (next best)", "", "rmse", "deg", None, other[1]
            )


def _alone(cases: list[ScenarioRuns], inputs: str) -> Iterator[ResultRow]:
    for case in cases:
        for angle in SEPARATED:
            now = _mean(getattr(case, inputs), "fusion", angle, "rmse_deg")
            yield ResultRow(f"{case.name}, {angle}", "", "rmse", "deg", None, now)


def _honesty(cases: list[ScenarioRuns]) -> Iterator[ResultRow]:
    for case in cases:
        for angle in SEPARATED:
            for metric in ("within_2sd", "nees"):
                now = _mean(case.antennas, "fusion", angle, metric)
                yield ResultRow(f"{case.name}, {angle}", "", metric, "-", None, now)


def _claims(cases: list[ScenarioRuns]) -> list[Claim]:
    goals = []
    for inputs, title in INPUT_SETS.items():
        best = [
            (f"{case.name} {angle}", _mean(runs, "fusion", angle, "rmse_deg"), other[1])
            for case in cases
            for angle in SEPARATED
            if (other := _best_other(runs := getattr(case, inputs), angle)) is not None
        ]
        goals.append(_claim(f"fusion is the best for every angle of every drive, {title}", best))
    shape = [
        (
            case.name,
            _mean(case.alone, "fusion", "grade", "std_deg"),
            ROUGH_SHAPE if case.rough else SMOOTH_SHAPE,
        )
        for case in cases
    ]
    goals.append(_claim("shape of grade below 0.06 deg on smooth roads, 0.15 on class A", shape))
    for inputs, angles, limit in (
        ("gnss", ("grade",), WITH_GNSS),
        ("gnss", ("pitch", "roll"), BODY),
        ("antennas", ("bank",), TWO_ANTENNAS),
    ):
        rows = [
            (
                f"{case.name} {angle}",
                _mean(getattr(case, inputs), "fusion", angle, "rmse_deg"),
                limit,
            )
            for case in cases
            for angle in angles
        ]
        words = {"gnss": "with GNSS", "antennas": "with two antennas"}[inputs]
        goals.append(_claim(f"{' and '.join(angles)} below {limit:g} deg {words}", rows))
    covered = [
        _mean(case.antennas, "fusion", angle, "within_2sd") for case in cases for angle in SEPARATED
    ]
    within = sum(COVERED[0] <= share <= COVERED[1] for share in covered)
    careless = sum(share < COVERED[0] for share in covered)
    goals.append(
        Claim(
            "2 sd hold 93 to 98 % of the errors of every angle of every drive",
            within == len(covered),
            f"{within} of {len(covered)} within, {careless} below, "
            f"{len(covered) - within - careless} above; mean {np.mean(covered):.3f}",
            "a model that doubts too much is as wrong as one that doubts too little",
        )
    )
    return goals


def _claim(text: str, rows: list[tuple[str, float, float]]) -> Claim:
    """Every value below its limit; else the rows that are not."""
    misses = [
        f"{name} {value:.3f} (limit {limit:.3f})" for name, value, limit in rows if value > limit
    ]
    worst = max(rows, key=lambda row: row[1] / row[2])
    now = "; ".join(misses) if misses else f"worst {worst[0]} {worst[1]:.3f} of {worst[2]:.3f}"
    if misses:
        now = f"{len(misses)} of {len(rows)} miss: {now}"
    return Claim(text, not misses, now, "a goal of this project, not of a paper")
