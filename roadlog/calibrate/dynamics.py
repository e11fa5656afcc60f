"""Roll stiffness, roll damping and the inertias in roll and yaw, from drives with two antennas.

Source: docs/calibration.md#roll-and-yaw-dynamics, after Ryu 2004, who finds them by GNSS and IMU.
Regressions with instruments: what the road does to the body is in roll rate and angle, but not in
v r and not in the steering.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roadlog import estimators
from roadlog.calibrate.constant import JACKKNIFE_BLOCK, Constant, unknown
from roadlog.calibrate.mounting import filled
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.filters.lowpass import band_pass
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

BAND = (0.2, 2.5)  # Hz: slower is the road's bank, faster its roughness
MIN_BLOCKS = 4
MIN_SPEED = 5.0  # m/s
MARGIN = 3.0  # s at both ends, where the band-pass still settles
TURNING = 0.3  # m/s2 rms of v r in the band
WORTH = 0.3  # share of the value; a larger standard error says nothing
HEIGHT_SD, PLACE_SD = 0.3, 0.03  # m, of the IMU's height where it is a guess, where it is given
SHEET_SHARE = 0.1  # of a mass or lever that is only a default
# name -> unit, and the share that one mass on one spring and linear tires are wrong by: on the
# simulated full car -15 to -25 % of the roll inertia, -2 to -5 % of damping and stiffness, +7 to
# +16 % of the yaw inertia
ROLL = {
    "roll_inertia": ("kg m2", 0.20),
    "roll_damping": ("N m s/rad", 0.06),
    "roll_stiffness": ("N m/rad", 0.05),
}
YAW = ("yaw_inertia", "kg m2", 0.12)
BALANCE = 0.015  # share of the spring's moment that the balance leaves out: slow turns tell less
STEER = "steering.road_wheel_angle"


@dataclass(frozen=True)
class _Signals:
    """In the band, SI. p, r: body rates. roll: total. force: at the CG, along the body's y axis.
    turn: v r. use: samples that count, block: their number in the jackknife.
    """

    p: Floats
    r: Floats
    roll: Floats
    force: Floats
    turn: Floats
    use: Bools
    block: Floats
    dt: float

    def change(self, values: Floats) -> Floats:
        """Per second."""
        return np.gradient(values, self.dt)

    def with_changes(self, values: Floats, order: int) -> list[Floats]:
        """The signal and its derivatives up to `order`."""
        found = [values]
        for _ in range(order):
            found.append(self.change(found[-1]))
        return found


def dynamics(drive: Drive, vehicle: Vehicle) -> list[Constant]:
    """The four constants. drive: in vehicle axes. vehicle: with the place of the IMU, and nothing
    left that would correct the drive again.
    """
    if "gnss.roll" not in drive or estimators.get("gnss_ins").refusal(drive):
        return _unknown("needs two antennas (GNSS roll and heading)")
    ins = estimators.run("gnss_ins", drive, vehicle)
    if not np.isfinite(ins.roll_total).any():
        return _unknown("needs two antennas (GNSS roll and heading)")
    signals = _signals(drive, vehicle, ins.roll_total)
    level = float(np.sqrt(np.mean(signals.turn[signals.use] ** 2))) if signals.use.any() else 0.0
    time = JACKKNIFE_BLOCK * len(np.unique(signals.block[signals.use]))
    if time < MIN_BLOCKS * JACKKNIFE_BLOCK or level < TURNING:
        return _unknown(
            f"v r is {level:.1f} m/s2 rms in {BAND[0]}-{BAND[1]} Hz over {time:.0f} s "
            f"({TURNING} and {MIN_BLOCKS * JACKKNIFE_BLOCK:.0f} s needed): drive a slalom"
        )
    evidence = f"turning, {level:.1f} m/s2 rms over {time:.0f} s; two antennas"
    sideslip = ins.details["sideslip"].columns["beta"]
    return [
        *_roll(signals, vehicle, evidence),
        _yaw(drive, signals, sideslip, vehicle, evidence),
    ]


def _unknown(reason: str) -> list[Constant]:
    units = {name: unit for name, (unit, _) in ROLL.items()} | {YAW[0]: YAW[1]}
    return [unknown(name, unit, reason) for name, unit in units.items()]


def _signals(drive: Drive, vehicle: Vehicle, roll_total: Floats) -> _Signals:
    def band(values: Floats) -> Floats:
        return band_pass(filled(values), BAND, drive.rate)

    p, r = band(drive["imu.gyro_x"]), band(drive["imu.gyro_z"])
    ahead, _, up = vehicle.imu_position or (0.0, 0.0, 0.0)
    lever = np.gradient(r * ahead - p * up, drive.dt)
    speed, time = filled(drive.speed), drive.time
    use = (speed > MIN_SPEED) & (time > MARGIN) & (time < time[-1] - MARGIN)
    return _Signals(
        p,
        r,
        band(roll_total),
        band(drive["imu.accel_y"]) - lever,
        band(speed * filled(drive["imu.gyro_z"])),
        use & np.isfinite(roll_total),
        time // JACKKNIFE_BLOCK,
        drive.dt,
    )


def _roll(signals: _Signals, vehicle: Vehicle, evidence: str) -> list[Constant]:
    """I phi'' + b phi' + k phi = m h f_y, Ryu's (17) and (19); the bank is not in the band."""
    swing = vehicle.mass * vehicle.roll_arm
    columns = [signals.change(signals.p), signals.p, signals.roll]
    instruments = signals.with_changes(signals.turn, 2)
    values, sds = _fit(columns, swing * signals.force, instruments, signals)
    is_placed = vehicle.source("imu_position").kind in ("given", "preset")
    use = signals.use
    turning = float(np.std(signals.p[use]) / np.std(signals.roll[use]))  # rad/s
    slack = BALANCE * abs(values[2])
    height = swing * (PLACE_SD if is_placed else HEIGHT_SD)
    sds[:2] = np.hypot(sds[:2], [np.hypot(height, slack / turning**2), slack / turning])
    return [
        _judged(name, unit, value, sd, share, evidence, _defaults(vehicle, "mass", "roll_arm"))
        for (name, (unit, share)), value, sd in zip(ROLL.items(), values, sds, strict=True)
    ]


def _yaw(
    drive: Drive, signals: _Signals, sideslip: Floats, vehicle: Vehicle, evidence: str
) -> Constant:
    """C alpha + (I/L) r' + (I s/(L v)) r'' - s (a m/(L v)) f' = (a m/L) f of the rear axle.

    s: the tires' relaxation length; f: side force in the road's plane, over mass.
    """
    name, unit, share = YAW
    if STEER not in drive:
        return unknown(name, unit, "no steering angle in the log")
    length, speed = vehicle.wheelbase, filled(drive.speed)
    load = vehicle.mass * vehicle.cg_to_front_axle / length
    force = signals.force - G * signals.roll
    slip = vehicle.cg_to_rear_axle * drive["imu.gyro_z"] / np.maximum(speed, 1.0) - sideslip
    _, yaw, jerk = signals.with_changes(signals.r, 2)
    usual = float(np.mean(speed[signals.use]))
    columns = [
        band_pass(filled(slip), BAND, drive.rate),
        yaw / length,
        jerk / (length * usual),
        -load / usual * signals.change(force),
    ]
    steer = band_pass(filled(drive[STEER]), BAND, drive.rate)
    values, sds = _fit(columns, load * force, signals.with_changes(steer, 3), signals)
    sheet = _defaults(vehicle, "mass", "cg_to_front_axle", "cg_to_rear_axle")
    return _judged(name, unit, float(values[1]), float(sds[1]), share, evidence, sheet)


def _fit(
    columns: Sequence[Floats], response: Floats, instruments: Sequence[Floats], signals: _Signals
) -> tuple[Floats, Floats]:
    """Coefficients by instrumental variables, and standard errors by leaving out one block each."""
    A, Z = (np.stack(part, axis=1)[signals.use] for part in (columns, instruments))
    y, block = response[signals.use], np.unique(signals.block[signals.use], return_inverse=True)[1]
    parts = range(int(block.max()) + 1)
    grams = np.array([Z[block == k].T @ A[block == k] for k in parts])
    sums = np.array([Z[block == k].T @ y[block == k] for k in parts])

    def solved(gram: Floats, total: Floats) -> Floats:
        scale = np.abs(gram).max(axis=1, keepdims=True)  # instruments of very different sizes
        return np.linalg.lstsq(gram / scale, total / scale[:, 0], rcond=None)[0]

    gram, total = grams.sum(axis=0), sums.sum(axis=0)
    without = np.array([solved(gram - g, total - s) for g, s in zip(grams, sums, strict=True)])
    spread = np.sum((without - without.mean(axis=0)) ** 2, axis=0)
    return solved(gram, total), np.sqrt((len(parts) - 1) / len(parts) * spread)


def _defaults(vehicle: Vehicle, *names: str) -> list[str]:
    """Those that are only defaults."""
    return [name for name in names if vehicle.source(name).kind == "default"]


def _judged(
    name: str, unit: str, value: float, sd: float, share: float, evidence: str, sheet: list[str]
) -> Constant:
    """The constant with the model's own error and that of default values in its standard error."""
    sd = float(np.sqrt(sd**2 + (share**2 + len(sheet) * SHEET_SHARE**2) * value**2))
    if not value > 0 or sd > WORTH * value:
        reason = f"turning says {value:.0f} +- {sd:.0f}: steer to and fro about once a second"
        return unknown(name, unit, reason)
    remark = f"; rests on the default {', '.join(sheet)}" if sheet else ""
    return Constant(name, unit, float(value), sd, evidence + remark)
