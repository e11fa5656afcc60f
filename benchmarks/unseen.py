"""Every estimator on drives that nobody tuned on: cars, mountings, sensors, roads, drivers by seed.

Prints one table. Run: python benchmarks/unseen.py FIRST COUNT [FOLDER [JOBS [ESTIMATOR...]]]

FIRST, COUNT: seeds. FOLDER: where simulated drives are kept, so that a later run only estimates,
and what was found of each by the same code, so that a run that was stopped goes on.
"""

from __future__ import annotations

import json
import sys
import zlib
from collections import defaultdict
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import gettempdir
from typing import Any

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.errors import EstimatorError
from roadlog.log import DriveLog, create
from roadlog.metrics import AngleMetrics, angle_errors, angle_metrics
from roadlog.signals import ANGLES, FLAGS
from roadlog.simulate import Scenario, simulate
from roadlog.simulate.gnss import GnssReceiver
from roadlog.simulate.imu import ImuSensor
from roadlog.simulate.profiles import Hills, Knots
from roadlog.simulate.scenario import Load, RoadShape, Wind
from roadlog.simulate.sensors import CanSensors, Sensors
from roadlog.simulate.speeds import Tour
from roadlog.storage import Table

DEG = float(np.pi / 180)
NEAR = 0.9  # share within 2 sd that a drive should reach
GRADES = {  # of an IMU: accelerometer and gyro noise per sqrt(Hz), their biases (1 sd), m/s2, rad/s
    "car": (0.0012, 0.007 * DEG, 0.02, 0.1 * DEG),
    "phone": (0.003, 0.01 * DEG, 0.05, 0.5 * DEG),
    "cheap": (0.006, 0.03 * DEG, 0.06, 0.5 * DEG),
}
STATED_SD = 0.3 * DEG  # rad, of a mounting that somebody measured
LOOSE_SD = np.radians([1.0, 1.0, 2.0])  # rad, roll, pitch, yaw of one that nobody did


@dataclass(frozen=True)
class Unseen:
    """One drive: what is driven, the true car's data sheet, what estimators are told of it."""

    scenario: Scenario
    car: Vehicle
    told: Vehicle
    speed: str  # wheels, OBD or GNSS


def drawn(seed: int) -> Unseen:
    """The drive of a seed."""
    rng = np.random.default_rng([seed, zlib.crc32(b"unseen")])
    car = _car(rng)
    imu, stated = _imu(rng)
    speed = str(rng.choice(["wheels", "OBD", "GNSS"], p=[0.4, 0.3, 0.3]))
    scenario = Scenario(
        f"unseen-{seed}",
        "a drive by chance",
        *_way(rng),
        gears=bool(rng.random() < 0.6),
        wind=Wind(rng.uniform(0, 8), rng.uniform(-np.pi, np.pi), rng.uniform(0, 2)),
        load=_load(rng),
        sensors=Sensors(imu=imu, can=_can(rng, speed), gnss=_gnss(rng, speed)),
    )
    told = Vehicle()
    if rng.random() < 0.4:  # somebody wrote a vehicle file
        told = replace(car, pitch_gradient=None, roll_gradient=None)
        told = told.with_values(imu_position=imu.position)
    if stated:
        told = told.with_stated_mounting(STATED_SD)
    return Unseen(scenario, car, told, speed)


def _car(rng: np.random.Generator) -> Vehicle:
    """From a small car to a van; springs are the simulator's own, scaled."""
    mass = rng.uniform(1000, 2600)
    wheelbase = 2.35 + 0.35 * (mass - 1000) / 1000 + rng.uniform(-0.1, 0.1)
    front = wheelbase * rng.uniform(0.42, 0.54)
    return Vehicle.preset("wagon").with_values(
        mass=mass,
        cg_to_front_axle=front,
        cg_to_rear_axle=wheelbase - front,
        cg_height=rng.uniform(0.50, 0.72),
        track=rng.uniform(1.4, 1.65),
        pitch_inertia=mass * rng.uniform(1.3, 1.8),
        roll_inertia=mass * rng.uniform(0.28, 0.4),
        yaw_inertia=mass * rng.uniform(1.5, 2.0),
        driven=str(rng.choice(["front", "rear"])),
    )


def _imu(rng: np.random.Generator) -> tuple[ImuSensor, bool]:
    """Its errors, and whether its mounting is stated to 0.3 deg."""
    accel, gyro, accel_bias, gyro_bias = GRADES[str(rng.choice(list(GRADES)))]
    rate = float(rng.choice([5, 10, 20, 25, 50, 100, 200]))
    stated = bool(rng.random() < 0.4)
    turn = rng.standard_normal(3) * (STATED_SD if stated else LOOSE_SD)
    filtered = rng.random() < 0.6  # else it hands out what it reads at the moment: all is folded
    shaken = rng.random() < 0.3  # by a loose mount or an engine: white behind the folding
    coarse = rng.random() < 0.3
    drifts = rng.random() < 0.3
    sensor = ImuSensor(
        rate=rate,
        position=(rng.uniform(-1.2, 1.2), rng.uniform(-0.5, 0.5), rng.uniform(-0.3, 0.6)),
        bandwidth=min(0.35 * rate, 40.0) if filtered else 100.0,
        misalignment_deg=tuple(np.degrees(turn)),
        accel_noise=float(np.hypot(accel, rng.uniform(0.02, 0.3) if shaken else 0.0)),
        gyro_noise=float(np.hypot(gyro, rng.uniform(0.02, 0.2) * DEG if shaken else 0.0)),
        accel_bias_sd=accel_bias,
        gyro_bias_sd=gyro_bias,
        accel_drift_sd=rng.uniform(0.05, 0.15) if drifts else 0.003,
        gyro_drift_sd=rng.uniform(0.01, 0.05) * DEG,
        drift_time=rng.uniform(150, 600),
        accel_lsb=rng.uniform(0.02, 0.3) if coarse else 0.0012,
        gyro_lsb=rng.uniform(0.1, 1.0) * DEG if coarse else 0.005 * DEG,
    )
    return sensor, stated


def _way(rng: np.random.Generator) -> tuple[Tour, RoadShape]:
    """Where and how fast, 2 to 5 minutes."""
    cruise = rng.uniform(8, 30)
    length = cruise * rng.uniform(120, 220)
    stops = tuple(
        (float(s), float(rng.uniform(5, 20)))
        for s in np.sort(rng.uniform(100, length - 100, rng.integers(0, 4)))
    )
    bends, s = [(0.0, 0.0)], rng.uniform(40, 200)
    tightest = max(15.0, 0.15 * cruise**2)
    while s < length:
        radius = tightest * np.exp(rng.uniform(0, 3)) * rng.choice([-1, 1])
        angle = min(abs(rng.normal(0, 0.8)), 1.5)
        entry = max(12.0, 0.8 * cruise)
        last = s + entry + angle * abs(radius)
        bends += [(s, 0.0), (s + entry, 1 / radius), (last, 1 / radius), (last + entry, 0.0)]
        s = last + entry + rng.exponential(150) + 10
    banked = rng.uniform(0, 0.06)
    bank = [(s, float(np.clip(-60 * bend, -1, 1) * banked)) for s, bend in bends]
    tour = Tour(
        length,
        cruise=Knots(tuple((x, cruise * rng.uniform(0.6, 1)) for x in np.arange(0, length, 250.0))),
        lateral=rng.uniform(1.5, 3.5),
        acceleration=rng.uniform(1.0, 2.0),
        braking=rng.uniform(1.2, 2.5),
        stops=stops,
    )
    road = RoadShape(
        grade=Hills(sd=rng.uniform(0.005, 0.05), length=rng.uniform(50, 200)),
        bank=Knots(tuple(bank)),
        curvature=Knots(tuple(bends)),
        roughness=float(rng.choice([4e-6, 16e-6, 64e-6])),  # ISO 8608: motorway, A, B
    )
    return tour, road


def _load(rng: np.random.Generator) -> Load:
    """Up to four people, and now and then a full trunk."""
    people = 75.0 * rng.integers(1, 5)
    trunk = rng.uniform(20, 150) if rng.random() < 0.3 else 0.0
    x = people * rng.uniform(-0.5, 0.2) - trunk * 1.4
    return Load(people + trunk, (x / (people + trunk), rng.uniform(-0.3, 0.3), 0.1))


def _can(rng: np.random.Generator, speed: str) -> CanSensors:
    """Wheel pulses; or a speed that a diagnosis tool asks for; or nothing."""
    quiet = CanSensors(wheel_rate=0.0, torque_rate=0.0, steering_rate=0.0)
    scale = float(1 + rng.normal(0, 0.01))
    if speed == "wheels":
        rate = float(rng.choice([10, 20, 50, 100]))
        lsb = rng.uniform(0.01, 0.1)
        return replace(quiet, wheel_rate=rate, wheel_lsb=lsb, wheel_scale=scale)
    if speed == "OBD":
        return replace(
            quiet,
            speed_rate=rng.uniform(1, 5),
            speed_noise=0.0,
            latency=rng.uniform(0.05, 0.4),
        )
    return quiet


def _gnss(rng: np.random.Generator, speed: str) -> GnssReceiver:
    """A phone's at 1 Hz, a better one at 5 or 10, or none where the car itself has a speed."""
    rate = float(rng.choice([0, 1, 5, 10], p=[0.5, 0.3, 0.1, 0.1]))
    if speed == "GNSS":
        rate = max(rate, 1.0)
    slow = rate < 5
    return GnssReceiver(
        rate=rate,
        position=(rng.uniform(-1, 1), rng.uniform(-0.4, 0.4), rng.uniform(0.4, 1.0)),
        horizontal_noise=3.0 if slow else 0.8,
        vertical_noise=4.0 if slow else 1.5,
        speed_noise=0.1 if slow else 0.03,
        climb_noise=0.15 if slow else 0.05,
        two_antennas=False,
        latency=rng.uniform(0, 0.8) if slow else rng.uniform(0, 0.1),
    )


def logged(seed: int, folder: Path) -> DriveLog:
    """The drive as a log, simulated when it is not there yet; heights only on every third."""
    unseen = drawn(seed)
    mark = zlib.crc32(repr((unseen, _tables.__code__.co_code)).encode())
    path = folder / f"unseen-{seed}-{mark:08x}.mcap"
    if not path.exists():
        made = simulate(unseen.scenario, seed=seed, vehicle=unseen.car)
        create(path, _tables(made.tables, seed, unseen.speed), vehicle=unseen.told)
    return DriveLog(path)


def _tables(tables: list[Table], seed: int, speed: str) -> list[Table]:
    """As a logger writes them: an OBD speed in whole km/h, a receiver without heights."""
    result = []
    for table in tables:
        columns: dict[str, Any] = dict(table.columns)
        if table.topic == "/speed" and speed == "OBD":
            columns["v"] = np.floor(columns["v"] * 3.6) / 3.6
        if table.topic == "/gnss" and seed % 3:
            unknown = np.full(len(table), np.nan)
            columns |= dict.fromkeys(
                ("altitude", "climb", "vertical_accuracy", "climb_accuracy"), unknown
            )
        result.append(replace(table, columns=columns))
    return result


@dataclass(frozen=True)
class Row:
    """One angle of one estimator on one drive. rejected: share of the
    samples. said: faults that the checks name."""

    seed: int
    name: str
    angle: str
    metrics: AngleMetrics
    rejected: float
    said: tuple[str, ...]


def found(seed: int, folder: Path, names: tuple[str, ...], code: int) -> list[Row]:
    """`estimated`, or what the same code found of it before."""
    mark = zlib.crc32(repr((names, code, drawn(seed))).encode())
    kept = folder / f"unseen-{seed}-{mark:08x}.json"
    if not kept.exists():
        rows = [asdict(row) for row in estimated(seed, folder, names)]
        kept.write_text(json.dumps(rows), encoding="utf-8")
    return [
        Row(**(row | {"metrics": AngleMetrics(**row["metrics"]), "said": tuple(row["said"])}))
        for row in json.loads(kept.read_text(encoding="utf-8"))
    ]


def code_of() -> int:
    """A checksum of roadlog's own code."""
    mark = 0
    for path in sorted(Path(estimators.__file__).parent.parent.rglob("*.py")):
        mark = zlib.crc32(path.read_bytes(), mark)
    return mark


def estimated(seed: int, folder: Path, names: tuple[str, ...] = ()) -> list[Row]:
    """Every estimator that can run on the drive of a seed, against its truth."""
    log = logged(seed, folder)
    drive, truth = log.drive(), log.truth()
    faults = log.faults()
    said = tuple(map(str, faults))
    assert truth is not None
    rows = []
    for estimator in estimators.all_estimators():
        if estimator.missing(drive) or (names and estimator.name not in names):
            continue
        try:
            estimate = estimators.run(estimator.name, drive, log.vehicle, faults=faults)
        except EstimatorError as error:
            print(f"seed {seed}: {error}", file=sys.stderr)
            continue
        track = estimate
        for angle in ANGLES:
            errors = angle_errors(track, truth, angle)
            if errors is not None and errors.valid.any():
                metrics = angle_metrics(errors, angle)
                rejected = float((track.flags & FLAGS["rejected"] > 0).mean())
                rows.append(Row(seed, estimator.name, angle, metrics, rejected, said))
    return rows


def table(rows: list[Row]) -> Iterator[str]:
    """Markdown: each estimator and angle over all drives."""
    heads = ("RMSE, deg", "std, deg", "within 2 sd", "NEES", "drives >= 90 %", "rejected")
    yield f"| {' | '.join(('estimator', 'angle', 'drives', *heads))} |"
    yield "|---|---|---|---|---|---|---|---|---|"
    groups: dict[tuple[str, str], list[Row]] = defaultdict(list)
    for row in rows:
        groups[row.name, row.angle].append(row)
    for (name, angle), group in groups.items():
        figures = [asdict(row.metrics) for row in group]
        n = np.array([f["n"] for f in figures], np.float64)

        def pooled(key: str, power: int = 1, figures: Any = figures, n: Any = n) -> float:
            values = np.array([np.nan if f[key] is None else f[key] for f in figures])
            known = np.isfinite(values)
            if not known.any():
                return float("nan")
            mean = np.average(values[known] ** power, weights=n[known])
            return float(mean ** (1 / power))

        near = np.mean([(f["within_2sd"] or 0) >= NEAR for f in figures])
        yield (
            f"| `{name}` | {angle} | {len(group)} | {pooled('rmse_deg', 2):.3f} "
            f"| {pooled('std_deg', 2):.3f} | {100 * pooled('within_2sd'):.1f} % "
            f"| {pooled('nees'):.2f} | {100 * near:.0f} % "
            f"| {100 * np.mean([row.rejected for row in group]):.0f} % |"
        )


def behind(rows: list[Row], name: str = "fusion", other: str = "kmbe") -> str:
    """On how many drives the grade of one estimator is behind that of another in RMSE."""
    rmse = {(r.name, r.seed): r.metrics.rmse_deg or np.nan for r in rows if r.angle == "grade"}
    both = [seed for n, seed in rmse if n == name and (other, seed) in rmse]
    ratios = {seed: rmse[name, seed] / rmse[other, seed] for seed in both}
    late = {seed: ratio for seed, ratio in ratios.items() if ratio > 1}
    worst = ", ".join(f"{s}: {100 * (r - 1):+.0f} %" for s, r in sorted(late.items()))
    return f"{name} is behind {other} on {len(late)} of {len(both)} drives ({worst or 'none'})"


def main() -> None:
    """Print the table."""
    first, count = int(sys.argv[1]), int(sys.argv[2])
    folder = Path(sys.argv[3] if len(sys.argv) > 3 else Path(gettempdir()) / "roadlog-unseen")
    jobs = int(sys.argv[4]) if len(sys.argv) > 4 else 2
    names = tuple(sys.argv[5:])
    folder.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs) as pool:
        work = partial(found, folder=folder, names=names, code=code_of())
        rows = [row for of_one in pool.map(work, range(first, first + count)) for row in of_one]
    print("\n".join(table(rows)))
    print("\n" + behind(rows))
    for row in rows:
        near = row.metrics.within_2sd or 0.0
        if (row.name, row.angle) == ("fusion", "grade") and near < NEAR:
            rmse = f"{row.metrics.rmse_deg:.2f} deg"
            print(f"- seed {row.seed}: {100 * near:.0f} % within 2 sd, {rmse}")
    for seed, said in sorted({(row.seed, row.said) for row in rows if row.said}):
        print(f"- seed {seed}: {'; '.join(said)}")


if __name__ == "__main__":
    main()
