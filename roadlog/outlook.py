"""What a log is good for: per angle which estimator to take, how accurate it will be, what to add.

The figures are RMS errors of simulated drives of the full car with what a log may lack left out;
`benchmarks/outlook.py` prints the table again. A log in which a check finds a fault does worse.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from roadlog.car.suspension import knows_springs
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.signals import SEPARATED

BENDS = np.pi  # rad of turning to either side from which a drive has bends
WORTH = 0.8  # of the error now, at most: what is worth adding


@dataclass(frozen=True)
class SensorSet:
    """What decides beside IMU and speed. antennas: two across the car. torque: of drive and brakes.
    springs: the suspension's gradients are known, by the vehicle file. turns: the drive has bends,
    which tell the accelerometers' zero."""

    antennas: bool = False
    gnss: bool = False
    torque: bool = False
    springs: bool = False
    turns: bool = False

    @classmethod
    def of(cls, drive: Drive, vehicle: Vehicle) -> SensorSet:
        """Those of a drive."""
        yaw = drive.signals.get("imu.gyro_z", np.zeros(1))
        return cls(
            antennas="gnss.roll" in drive.signals,
            gnss={"gnss.speed", "gnss.altitude"} <= set(drive.signals),
            torque=any(r.startswith(("wheel_torques.", "powertrain.")) for r in drive.signals),
            springs=all(knows_springs(vehicle, axis) for axis in ("pitch", "roll")),
            turns=float(np.nansum(np.abs(yaw))) / drive.rate > BENDS,
        )

    def with_more(self) -> Iterator[tuple[str, SensorSet]]:
        """What could be added, in words, and what there were then."""
        if not self.springs:
            yield "the car's suspension (`roadlog calibrate`)", replace(self, springs=True)
        if not self.gnss:
            yield "a GNSS receiver with velocity", replace(self, gnss=True)
        if not self.torque:
            yield "drive and brake torques", replace(self, torque=True)
        if not self.antennas:
            more = replace(self, antennas=True, gnss=True)
            yield "a receiver with two antennas across the car", more
        if not self.turns:
            yield "bends or turns in the drive", replace(self, turns=True)


# of `fusion`, by what there is: grade, bank, pitch, roll, deg
ACCURACY: dict[SensorSet, tuple[float, float, float, float]] = {
    SensorSet(antennas=True, gnss=True, torque=True, springs=True, turns=True): (
        0.04,
        0.05,
        0.04,
        0.05,
    ),
    SensorSet(antennas=True, gnss=True, torque=True, turns=True): (0.05, 0.19, 0.04, 0.19),
    SensorSet(gnss=True, torque=True, springs=True, turns=True): (0.05, 0.18, 0.04, 0.06),
    SensorSet(gnss=True, torque=True, turns=True): (0.05, 0.29, 0.04, 0.19),
    SensorSet(gnss=True, springs=True, turns=True): (0.05, 0.18, 0.04, 0.06),
    SensorSet(gnss=True, turns=True): (0.05, 0.29, 0.04, 0.19),
    SensorSet(torque=True, springs=True, turns=True): (0.05, 0.19, 0.04, 0.06),
    SensorSet(torque=True, turns=True): (0.13, 0.29, 0.04, 0.19),
    SensorSet(springs=True, turns=True): (0.08, 0.19, 0.04, 0.06),
    SensorSet(turns=True): (0.13, 0.29, 0.04, 0.19),
    SensorSet(antennas=True, gnss=True, torque=True, springs=True): (0.03, 0.03, 0.03, 0.03),
    SensorSet(antennas=True, gnss=True, torque=True): (0.04, 0.05, 0.04, 0.03),
    SensorSet(gnss=True, torque=True, springs=True): (0.03, 0.11, 0.03, 0.03),
    SensorSet(gnss=True, torque=True): (0.04, 0.13, 0.04, 0.03),
    SensorSet(gnss=True, springs=True): (0.03, 0.11, 0.03, 0.03),
    SensorSet(gnss=True): (0.04, 0.13, 0.04, 0.03),
    SensorSet(torque=True, springs=True): (0.08, 0.15, 0.04, 0.03),
    SensorSet(torque=True): (0.22, 0.15, 0.03, 0.03),
    SensorSet(springs=True): (0.07, 0.15, 0.03, 0.03),
    SensorSet(): (0.22, 0.15, 0.03, 0.03),
}
# of the others, where there is no `fusion`, the best first; docs/consistency.md, deg
OTHERS = {
    "grade": {"kmbe": 0.28, "ekf_suspension": 0.36, "tfobe": 0.39, "debe": 0.40},
    "bank": {"roll_bank_obs": 0.07, "split_qs": 0.08},
    "pitch": {"ekf_suspension": 0.08, "grade_pitch_ekf": 0.47, "kasaba": 0.73},
    "roll": {"roll_bank_obs": 0.06, "split_qs": 0.07},
}
WHOLE_IMU = "three accelerations and three rates: `fusion` can run then"


@dataclass(frozen=True)
class Outlook:
    """Of one angle. estimator: to take, empty for none. accuracy_deg: RMS error simulated, None
    where there is none. better: what to add, in words, empty for nothing; better_deg: with it."""

    angle: str
    estimator: str
    accuracy_deg: float | None
    better: str = ""
    better_deg: float | None = None


def outlook(drive: Drive, vehicle: Vehicle, able: Collection[str]) -> list[Outlook]:
    """For each angle, what to expect of a drive. able: estimators that can run on it."""
    sensors = SensorSet.of(drive, vehicle)
    if "fusion" in able:
        return [_of_fusion(sensors, k) for k in range(len(SEPARATED))]
    found = []
    for k, angle in enumerate(SEPARATED):
        name = next((name for name in OTHERS[angle] if name in able), "")
        better = ACCURACY[_known(sensors)][k]
        found.append(Outlook(angle, name, OTHERS[angle].get(name), WHOLE_IMU, better))
    return found


def _of_fusion(sensors: SensorSet, k: int) -> Outlook:
    now = ACCURACY[_known(sensors)][k]
    ways = [(ACCURACY[_known(more)][k], words) for words, more in sensors.with_more()]
    best, words = min(ways, key=lambda way: way[0], default=(now, ""))
    if best > WORTH * now:
        return Outlook(SEPARATED[k], "fusion", now)
    return Outlook(SEPARATED[k], "fusion", now, words, best)


def _known(sensors: SensorSet) -> SensorSet:
    """The nearest with figures: antennas come with a receiver, and torques tell little beside."""
    if sensors.antennas:
        return replace(sensors, gnss=True, torque=True)
    return sensors
