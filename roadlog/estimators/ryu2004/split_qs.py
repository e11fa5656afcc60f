"""Bank and roll by the body's steady lean: the baseline, and the fallback at low speed.

Elimination of the rates in Ryu 2004, (17) and (19): roll = K_phi f_y holds with and without
bank: docs/methods/ryu2004.md#steady-split. Wrong by 3-5 times the observer above 0.8 Hz of
steering.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, flag, parameter
from roadlog.estimators.ryu2004.total_roll import GNSS_GAP, TWO_ANTENNAS, TotalRoll, total_roll
from roadlog.filters import Engine
from roadlog.types import Floats

GAIN_SD = 0.10  # of K_phi, relative: what a wrong roll stiffness makes of it


@dataclass(frozen=True)
class SplitParameters:
    """The split itself has none."""

    smooth: bool = parameter(True, "", "smooth total roll over the whole drive")


def split(total: TotalRoll, vehicle: Vehicle) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """bank, roll and roll_total, and their standard deviations, rad."""
    roll = vehicle.roll_gain * total.force.y
    roll_sd = GAIN_SD * np.abs(roll)
    angles = {"bank": total.angle - roll, "roll": roll, "roll_total": total.angle}
    sds = {"bank": np.hypot(total.sd, roll_sd), "roll": roll_sd, "roll_total": total.sd}
    return angles, sds


def split_qs(drive: Drive, vehicle: Vehicle, params: SplitParameters, engine: Engine) -> Estimate:
    """roll = K_phi f_y, bank = total roll - roll."""
    total = total_roll(drive, vehicle, params.smooth, engine)
    angles, sds = split(total, vehicle)
    missing = ~np.isfinite(angles["bank"]) | (total.since_update > GNSS_GAP)
    flags = total.flags | flag(missing, "missing")
    return Estimate(drive.time, angles, sds, ~missing, flags, notes=[total.note])


SPLIT_QS = Estimator(
    name="split_qs",
    run=split_qs,
    parameters=SplitParameters,
    needs=("imu.accel_x", "imu.accel_y", "imu.gyro_x", "imu.gyro_y", "imu.gyro_z", ANY_SPEED),
    helped=TWO_ANTENNAS,
    gives=("bank", "roll", "roll_total"),
    reference="Ryu 2004, eqs. (17) and (19) at rest; docs/methods/ryu2004.md#steady-split",
    summary="steady lean of the body: bank = total roll less what the side force explains",
    vehicle=("roll_gradient",),
    systematic_deg={"bank": 0.04, "roll": 0.06},
    spoiled_by=frozenset({"vibration"}),
)
