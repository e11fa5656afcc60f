"""The total-roll layers as estimators of their own: `gnss_ins` and `imu_roll`.

docs/methods/ryu2004.md#two-antennas; the filters are in `total_roll`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Detail, Estimate
from roadlog.estimators.base import ANY_SPEED, Estimator, parameter
from roadlog.estimators.ryu2004 import total_roll
from roadlog.estimators.ryu2004.total_roll import GNSS_GAP, TotalRoll
from roadlog.filters import Engine


@dataclass(frozen=True)
class TotalRollParameters:
    """docs/methods/ryu2004.md#parameters-of-gnss_ins-and-imu_roll; tuning is in `total_roll`."""

    smooth: bool = parameter(True, "", "Rauch-Tung-Striebel smoothing over the whole drive")


def gnss_ins(
    drive: Drive, vehicle: Vehicle, params: TotalRollParameters, engine: Engine
) -> Estimate:
    """Total roll, and sideslip at the roll axis under the CG, from two antennas and the IMU."""
    return _estimate(drive, total_roll.gnss_ins(drive, vehicle, params.smooth, engine))


def imu_roll(
    drive: Drive, vehicle: Vehicle, params: TotalRollParameters, engine: Engine
) -> Estimate:
    """Total roll from the IMU and the speed."""
    return _estimate(drive, total_roll.imu_roll(drive, vehicle, params.smooth, engine))


def _estimate(drive: Drive, total: TotalRoll) -> Estimate:
    missing = ~np.isfinite(total.angle) | (total.since_update > GNSS_GAP)
    details = {}
    if np.isfinite(total.beta).any():
        columns = {
            "beta": total.beta,
            "beta_sd": total.beta_sd,
            "v_x": total.velocity[0],
            "v_y": total.velocity[1],
        }
        details["sideslip"] = Detail("roadlog.v1.Sideslip", drive.time, columns)
    return Estimate(
        drive.time,
        {"roll_total": total.angle},
        {"roll_total": total.sd},
        ~missing,
        total.flags,
        details,
        [total.note],
    )


_INERTIAL = ("imu.accel_x", "imu.accel_y", "imu.gyro_x", "imu.gyro_y", "imu.gyro_z")

GNSS_INS = Estimator(
    name="gnss_ins",
    run=gnss_ins,
    parameters=TotalRollParameters,
    needs=(*_INERTIAL, *(f"gnss.{f}" for f in ("speed", "course", "climb", "heading", "roll"))),
    gives=("roll_total",),
    reference="Ryu 2004, the layer below; docs/methods/ryu2004.md#two-antennas",
    summary="total roll and sideslip from two GNSS antennas and the IMU",
    vehicle=("pitch_gradient", "roll_arm", "imu_position", "antenna_position"),
)

IMU_ROLL = Estimator(
    name="imu_roll",
    run=imu_roll,
    parameters=TotalRollParameters,
    needs=(*_INERTIAL, ANY_SPEED),
    gives=("roll_total",),
    reference="roadlog; docs/methods/ryu2004.md#total-roll-from-the-imu",
    summary="total roll from the IMU and the speed, for logs without two antennas",
    vehicle=("pitch_gradient", "roll_gradient", "rear_cornering_stiffness"),
    systematic_deg={"roll_total": 0.15},
    spoiled_by=frozenset({"vibration"}),
)
