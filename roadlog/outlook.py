"""What a log is good for: per angle which estimator to take, how accurate it will be, what to add.

The figures are RMS errors of simulated drives of the full car with what a log may lack left out;
outlook.csv, made by `benchmarks/outlook.py`. Whether they hold tells `benchmarks/promised.py`. A
log in which a check finds a fault does worse.
"""

from __future__ import annotations

import csv
from collections.abc import Collection, Iterator
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib.resources import files

import numpy as np

from roadlog.car.suspension import knows_springs
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.signals import AXES, SEPARATED

BENDS = np.pi  # rad of turning to either side from which a drive has bends
WORTH = 0.8  # of the error now, at most: what is worth adding
LATERAL = 1.27  # m/s2 RMS, of the drives with bends that the figures are of
BRIEF = 100.0  # s; bends of less do not tell the accelerometers' zero
STANDS = 0.5  # m/s, at most
SHAKEN = 0.02  # (m/s2)/sqrt(Hz); car loggers have 0.001 to 0.016, phones 0.04 to 0.1


@dataclass(frozen=True)
class SensorSet:
    """What decides beside IMU and speed. antennas: two across the car. gnss: a receiver that
    measures velocity, up and down too, as those of phones do not. torque: of drive and brakes.
    springs: the suspension's gradients are known, by the vehicle file. turns: the drive has bends,
    which tell the accelerometers' zero. steady: the IMU is neither shaken nor noisy. mounted: the
    vehicle file says how it lies."""

    antennas: bool = False
    gnss: bool = False
    torque: bool = False
    springs: bool = False
    turns: bool = False
    steady: bool = False
    mounted: bool = False

    @classmethod
    def of(cls, drive: Drive, vehicle: Vehicle) -> SensorSet:
        """Those of a drive."""
        yaw = drive.signals.get("imu.gyro_z", np.zeros(1))
        return cls(
            antennas="gnss.roll" in drive.signals,
            gnss={"gnss.speed", "gnss.climb", "gnss.altitude"} <= set(drive.signals),
            torque=any(r.startswith(("wheel_torques.", "powertrain.")) for r in drive.signals),
            springs=all(knows_springs(vehicle, axis) for axis in ("pitch", "roll")),
            turns=float(np.nansum(np.abs(yaw))) / drive.rate > BENDS,
            steady=noise(drive) < SHAKEN,
            mounted=vehicle.states_mounting,
        )

    def with_more(self) -> Iterator[tuple[str, SensorSet]]:
        """What could be added, in words, and what there were then."""
        if not self.springs:
            yield "the car's suspension (`roadlog calibrate`)", replace(self, springs=True)
        if not self.mounted:
            words = "the IMU's mounting (`roadlog calibrate`, drives there and back)"
            yield words, replace(self, mounted=True)
        if not self.steady:
            words = "an IMU that is fixed firmly and filters before it samples"
            yield words, replace(self, steady=True)
        if not self.gnss:
            yield "a GNSS receiver with velocity, up and down too", replace(self, gnss=True)
        if not self.torque:
            yield "drive and brake torques", replace(self, torque=True)
        if not self.antennas:
            more = replace(self, antennas=True, gnss=True)
            yield "a receiver with two antennas across the car", more
        if not self.turns:
            yield "bends or turns in the drive", replace(self, turns=True)

    def __str__(self) -> str:
        """The IMU in words."""
        lies = "mounted as its vehicle file says"
        if not self.mounted:
            lies = "that may lean by 1.5 deg (no vehicle file says how it is mounted)"
        return f"{'an' if self.steady else 'a shaken or noisy'} IMU {lies}"


def noise(drive: Drive) -> float:
    """Of the accelerometers, in (m/s2)/sqrt(Hz), by what no car moves like: white from sample to
    sample. Vibration that a slow sensor folds is in it. Infinite where nothing tells it."""
    samples = drive.native.get("imu")
    if samples is None:
        return np.inf
    found = []
    for axis in AXES:
        values = np.asarray(samples.columns.get(f"accel_{axis}", ()), np.float64)
        known = np.isfinite(values)
        steps = np.diff(values[known], 2)
        if len(steps):
            interval = float(np.median(np.diff(samples.time[known])))
            found.append(np.sqrt(np.mean(steps**2) / 6 * interval))
    return float(np.median(found)) if found else np.inf


@dataclass(frozen=True)
class Manner:
    """How a drive is driven. lateral: RMS of the lateral acceleration, m/s2. moving: s."""

    lateral: float = LATERAL
    moving: float = np.inf

    @classmethod
    def of(cls, drive: Drive) -> Manner:
        """That of a drive; the usual one where it has no speed or no yaw rate."""
        if not drive.has_speed or "imu.gyro_z" not in drive.signals:
            return cls()
        speed = drive.speed
        square = np.nanmean((speed * drive.signals["imu.gyro_z"]) ** 2)
        moving = float(np.sum(np.abs(speed) > STANDS)) / drive.rate
        return cls(float(np.sqrt(square)) if np.isfinite(square) else LATERAL, moving)


# of the others, where there is no `fusion`, the best first; docs/consistency.md, deg
OTHERS = {
    "grade": {"kmbe": 0.28, "ekf_suspension": 0.36, "tfobe": 0.39, "debe": 0.40},
    "bank": {"roll_bank_obs": 0.07, "split_qs": 0.08},
    "pitch": {"ekf_suspension": 0.08, "grade_pitch_ekf": 0.47, "kasaba": 0.73},
    "roll": {"roll_bank_obs": 0.06, "split_qs": 0.07},
}


@cache
def accuracies() -> dict[SensorSet, tuple[float, ...]]:
    """Of `fusion`, by what there is: RMS errors of grade, bank, pitch, roll, deg."""
    text = files("roadlog").joinpath("outlook.csv").read_text("utf-8")
    names = [field.name for field in fields(SensorSet)]
    return {
        SensorSet(**{name: row[name] == "1" for name in names}): tuple(
            float(row[a]) for a in SEPARATED
        )
        for row in csv.DictReader(text.splitlines())
    }


@dataclass(frozen=True)
class Outlook:
    """Of one angle. estimator: to take, empty for none. accuracy_deg: RMS error simulated, None
    where there is none. better: what to add, in words, empty for nothing; better_deg: with it."""

    angle: str
    estimator: str
    accuracy_deg: float | None
    better: str = ""
    better_deg: float | None = None


def outlook(
    sensors: SensorSet,
    able: Collection[str],
    lacking: Collection[str] = (),
    manner: Manner = Manner(),
) -> list[Outlook]:
    """For each angle, what to expect of a drive. able: estimators that can run on it. lacking: what
    `fusion` would need.
    """
    if "fusion" in able:
        return [_of_fusion(sensors, manner, k) for k in range(len(SEPARATED))]
    found = []
    for k, angle in enumerate(SEPARATED):
        name = next((name for name in OTHERS[angle] if name in able), "")
        now, better = OTHERS[angle].get(name), expected(sensors, manner)[k]
        if now is not None and better > WORTH * now:
            found.append(Outlook(angle, name, now))
        else:
            words = f"{_needed(lacking)}: `fusion` can run then"
            found.append(Outlook(angle, name, now, words, better))
    return found


def _needed(lacking: Collection[str]) -> str:
    """What `fusion` lacks, in words."""
    kinds = {"imu.accel": "three accelerations", "imu.gyro": "three rates"}
    parts = [words for kind, words in kinds.items() if any(kind in role for role in lacking)]
    parts += ["a speed"] if any("imu." not in role for role in lacking) else []
    return " and ".join(parts or kinds.values())


def expected(sensors: SensorSet, manner: Manner) -> tuple[float, ...]:
    """RMS errors of `fusion` in grade, bank, pitch and roll, deg.

    How far the body leans on unknown springs grows with the lateral acceleration, and brief bends
    leave the accelerometers' zero as unknown as a straight drive does.
    """
    now = accuracies()[known(sensors)]
    if not sensors.turns:
        return now
    firm = accuracies()[known(replace(sensors, springs=True))]
    share = (manner.lateral / LATERAL) ** 2
    leaning = [f**2 + max(0.0, n**2 - f**2) * share for n, f in zip(now, firm, strict=True)]
    grade, bank, pitch, roll = now[0], np.sqrt(leaning[1]), now[2], np.sqrt(leaning[3])
    if manner.moving < BRIEF:
        grade = max(grade, accuracies()[known(replace(sensors, turns=False))][0])
    return grade, float(bank), pitch, float(roll)


def _of_fusion(sensors: SensorSet, manner: Manner, k: int) -> Outlook:
    now = expected(sensors, manner)[k]
    ways = [(expected(more, manner)[k], words) for words, more in sensors.with_more()]
    best, words = min(ways, key=lambda way: way[0], default=(now, ""))
    if best > WORTH * now:
        return Outlook(SEPARATED[k], "fusion", now)
    return Outlook(SEPARATED[k], "fusion", now, words, best)


def known(sensors: SensorSet) -> SensorSet:
    """The nearest with figures: antennas come with a receiver, and torques tell little beside."""
    if sensors.antennas:
        return replace(sensors, gnss=True, torque=True)
    return sensors
