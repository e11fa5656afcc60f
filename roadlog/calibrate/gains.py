"""Pitch and roll gradient of the suspension by instrumental variables.

Source: docs/calibration.md#gradients-by-instrumental-variables. The smoothed absolute angles do
not depend on the gradients;
dv/dt and v r of the wheels are not moved by slopes, which the accelerometer is.
"""

from __future__ import annotations

import numpy as np

from roadlog.calibrate.constant import JACKKNIFE_BLOCK, Constant, jackknife, unknown
from roadlog.calibrate.mounting import filled
from roadlog.car.suspension import PITCH_MODE, ROLL_MODE
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.filters.kernels import odd_window, slope
from roadlog.filters.lowpass import band_pass, second_order
from roadlog.types import Bools, Floats
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

SLOW = (0.15, 0.5)  # Hz, of the answer
FAST = (0.4, 2.0)  # Hz, that must agree with it
SPEED = 2.0  # m/s, beyond which samples count
SLOPE_WINDOW = 0.3  # s, for dv/dt
SYSTEMATIC = 0.06  # share: braking and accelerating differ, springs are not linear
PITCH_EXCITATION, ROLL_EXCITATION = 0.2, 0.1  # m/s2 rms in the band
AGREEMENT = 0.15  # share by which the two bands of the roll gradient may differ
ROLL_PRIOR_SD = 0.0015  # rad/(m/s2)
PRIOR_GATE = 3.0  # sd
MIN_BLOCKS = 5
WORTH = 0.5  # share of the value; a larger standard error says nothing
UNIT = "rad/(m/s2)"


def pitch_gradient(drive: Drive, estimate: Estimate) -> Constant:
    """Body pitch per longitudinal specific force."""
    force = second_order(filled(drive["imu.accel_x"]), *PITCH_MODE, drive.rate)
    change = slope(filled(drive.speed), odd_window(SLOPE_WINDOW, drive.dt), drive.dt)
    use = _usable(drive, estimate)
    value, sd, level, blocks = _ratio(estimate.inclination, force, change, use, SLOW, drive.rate)
    evidence = (
        f"braking and accelerating, {level:.2f} m/s2 rms over {blocks * JACKKNIFE_BLOCK:.0f} s"
    )
    if blocks < MIN_BLOCKS or level < PITCH_EXCITATION:
        return unknown(
            "pitch_gradient",
            UNIT,
            f"longitudinal force is {level:.2f} m/s2 rms in {SLOW[0]}-{SLOW[1]} Hz "
            f"({PITCH_EXCITATION} needed): brake and accelerate more",
        )
    if not value > 0 or sd > WORTH * value:
        return unknown(
            "pitch_gradient",
            UNIT,
            f"braking says {value:.4f} +- {sd:.4f}: masked by the slopes of this road",
        )
    return Constant("pitch_gradient", UNIT, value, sd, evidence)


def roll_gradient(drive: Drive, estimate: Estimate, vehicle: Vehicle) -> Constant:
    """Body roll per lateral specific force; not told on superelevated roads."""
    force = second_order(filled(drive["imu.accel_y"]), *ROLL_MODE, drive.rate)
    lateral = filled(drive.speed) * filled(drive["imu.gyro_z"])
    use = _usable(drive, estimate)
    angle = estimate.roll_total
    value, sd, level, blocks = _ratio(angle, force, lateral, use, SLOW, drive.rate)
    if blocks < MIN_BLOCKS or level < ROLL_EXCITATION:
        return unknown(
            "roll_gradient",
            UNIT,
            f"lateral force is {level:.2f} m/s2 rms in {SLOW[0]}-{SLOW[1]} Hz "
            f"({ROLL_EXCITATION} needed): drive a slalom or quick level curves",
        )
    fast = _ratio(angle, force, lateral, use, FAST, drive.rate)[0]
    if not value > 0 or abs(fast - value) > AGREEMENT * value:
        return unknown(
            "roll_gradient",
            UNIT,
            f"slow and quick turning disagree ({value / DEG:.2f} and {fast / DEG:.2f} deg/(m/s2)): "
            f"the road is banked in its curves",
        )
    prior = vehicle.roll_gain
    if abs(value - prior) > PRIOR_GATE * ROLL_PRIOR_SD or sd > WORTH * value:
        return unknown(
            "roll_gradient", UNIT, f"curves say {value:.4f} +- {sd:.4f}, which no car does"
        )
    turned = f"turning, {level:.2f} m/s2 rms over {blocks * JACKKNIFE_BLOCK:.0f} s"
    evidence = f"{turned}; quick turns {fast:.4f}"
    return Constant("roll_gradient", UNIT, value, sd, evidence)


def _usable(drive: Drive, estimate: Estimate) -> Bools:
    """Where the car moves and the angles are known."""
    return (np.abs(filled(drive.speed)) > SPEED) & estimate.valid


def _ratio(
    angle: Floats,
    force: Floats,
    instrument: Floats,
    use: Bools,
    band: tuple[float, float],
    rate: float,
) -> tuple[float, float, float, int]:
    """Gradient from sum(I angle) / sum(I force) in a band, its sd, rms force, number of blocks."""
    passed = [band_pass(filled(x), band, rate) for x in (angle, force, instrument)]
    block = np.arange(len(use))[use] // round(JACKKNIFE_BLOCK * rate)
    theta, s, z = (x[use] for x in passed)
    count = np.bincount(block)
    blocks = int((count > 0).sum())
    if blocks < MIN_BLOCKS:
        return np.nan, np.inf, 0.0, blocks
    top, bottom = (np.bincount(block, z * x)[count > 0] for x in (theta, s))
    ratio, sd = jackknife(top, bottom)
    value = _gradient(ratio.real)
    return value, float(np.hypot(sd, SYSTEMATIC * value)), float(np.sqrt(np.mean(s**2))), blocks


def _gradient(response: float) -> float:
    """K from K (1 - g K): a tilted body feels a share of its own tilt as force."""
    return float((1 - np.sqrt(max(0.0, 1 - 4 * G * response))) / (2 * G))
