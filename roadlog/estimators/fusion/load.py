"""How much of the body's constant pitch is load, and how much the mounting of the IMU.

Data give their sum only. A car is either about as it was when it was described, or laden; and a
mounting that is stated is right, as a rule. What no mounting of that kind explains is load. One
normal prior as wide as a full trunk would take a good part of every mounting for load.
Source: docs/methods/fusion.md#mounting-and-load.
"""

from __future__ import annotations

import numpy as np

from roadlog.units import DEG

USUAL_SD = 0.1 * DEG  # rad, of pitch of a car that somebody described: a driver -0.1, a family 0.2
UNKNOWN_SD = 0.4 * DEG  # of one that nobody did: it may have been driven with any load
LADEN_SD = 1.4 * DEG  # of a laden car: a full trunk 1.2 deg, with a trailer 1.6
LADEN = 1 / 3  # share of drives
WRONG_SD = 3.0 * DEG  # of a mounting that is not as stated
WRONG = 0.05  # share of those


def load_pitch(
    found: float, sd: float, mounting_sd: float, usual_sd: float, laden: float = LADEN
) -> tuple[float, float]:
    """rad and rad2, the load's part of its sum with the mounting, and its mean square error.

    The likelier hypothesis gives it, and the other is in the error. found, sd: rad, of the sum, as
    the data alone tell it; sd may be infinite. usual_sd: rad, of the load of a car that is not
    laden. laden: share of drives that are.
    """
    load, share = np.array([usual_sd, LADEN_SD]), np.array([1 - laden, laden])
    mounting = np.array([mounting_sd, max(mounting_sd, WRONG_SD)])
    weight = np.outer([1 - WRONG, WRONG], share)
    total = load**2 + mounting[:, None] ** 2 + min(sd, 100.0) ** 2
    weight = weight * np.exp(-0.5 * found**2 * (1 / total - 1 / total.max())) / np.sqrt(total)
    weight /= weight.sum()
    gain = load**2 / total
    likelier = int(np.argmax(weight.sum(axis=0)))
    mean = float(np.average(gain[:, likelier], weights=weight[:, likelier]) * found)
    spread = load**2 * (1 - gain) + (gain * found - mean) ** 2
    return mean, float(np.sum(weight * spread))
