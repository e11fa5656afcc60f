"""The test road: acceleration and loads (Figs 20, 21), ramps (Fig 23), and reverse time.

A body on springs with the IMU 1.9 m ahead, which the estimator is not told.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roadlog.drive import Drive
from roadlog.estimators import run as run_estimator
from roadlog.estimators.kim2023.strapdown import StrapdownStart, attitude, dead_reckon
from roadlog.reproduce import Form, ResultRow, ResultTable, over, over_seeds
from roadlog.reproduce.kim2023.motions import (
    ACCELERATIONS,
    MICRO_G,
    NOISE,
    PRINTED,
    SEEDS,
    WAIT,
    said,
)
from roadlog.signals import ACCELERATION
from roadlog.simulate import simulate
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

SPRINGS = float(np.radians(0.14))  # rad/(m/s2), body pitch of the test road's car
RAMPS = (-15, -7, 0, 7, 15)  # percent
LOADS = (0.0, 0.4, 0.8, 1.2)  # deg of pitch
PAPER_RAMP = 0.2  # deg, at 15 percent
FORMS: dict[Form, dict[str, Any]] = {"printed": PRINTED | {"chord_max": 0.1}, "mended": {}}
SETTINGS = (
    f"printed: {said(PRINTED)}, chord_max=0.1 (its limit is not in the paper; at the default "
)
SETTINGS += "it rejects these windows); mended: defaults, and no imu_position in either"


@dataclass(frozen=True)
class Ride:
    """Ten starts and stops on one ramp: percent, m/s2, deg."""

    ramp: float = 0.0
    acceleration: float = 1.5
    load: float = 0.0

    @property
    def true_pitch(self) -> float:
        """deg, of the standing body: its load, and its springs under gravity along the ramp."""
        along = G * np.sin(np.arctan(self.ramp / 100))
        return float(self.load + np.degrees(SPRINGS) * along)


RIDES = [Ride(acceleration=float(a)) for a in ACCELERATIONS]
RIDES += [Ride(ramp=float(r), load=load) for r in RAMPS for load in LOADS]
Found = dict[Form, list[tuple[float, float]]]  # a seed: mean error and spread, deg


def run(ride: Ride) -> Found:
    """Errors of the windows out of stops (Fig 21 is of accelerations), or of all on ramps."""
    found: Found = {form: [] for form in FORMS}
    for seed in SEEDS:
        overrides = {
            "speed.acceleration": ride.acceleration,
            "road.grade": ride.ramp / 100,
            "straight.load": float(np.radians(ride.load)),
        }
        simulation = simulate("kim2023-testroad", seed=seed, overrides=overrides)
        drive = Drive.from_tables(simulation.tables)
        vehicle = simulation.vehicle.with_values("default", imu_position=None)
        for form, settings in FORMS.items():
            columns = (
                run_estimator("static_slope", drive, vehicle, settings).details["events"].columns
            )
            used = columns["valid"] & ((columns["kind"] == ACCELERATION) | (ride not in RIDES[:3]))
            pitch = np.degrees(columns["pitch"][used])
            enough = len(pitch) > 1
            error = float(pitch.mean() - ride.true_pitch) if enough else float("nan")
            found[form].append((error, float(pitch.std(ddof=1)) if enough else float("nan")))
    return found


def tables(found: Mapping[Ride, Found]) -> list[ResultTable]:
    """Fig 21, and Figs 20 and 23 as one: every ramp with every load."""
    speeds, ramps = [], []
    for ride, forms in found.items():
        for form, seeds in forms.items():
            errors, spreads = zip(*seeds, strict=True)
            if ride in RIDES[:3]:
                case = f"{ride.acceleration:g} m/s2"
                speeds.append(over_seeds(case, form, "pitch, mean error", "deg", None, errors))
                speeds.append(over_seeds(case, form, "pitch, spread", "deg", None, spreads))
            else:
                case = f"ramp {ride.ramp:+.0f} %, load {ride.load} deg"
                ramps.append(over_seeds(case, form, "pitch, mean error", "deg", None, errors))
                if ride.load == 0.0 and abs(ride.ramp) == 15:
                    paper = PAPER_RAMP * np.sign(ride.ramp)
                    pitch = [error + ride.true_pitch for error in errors]
                    ramps.append(over_seeds(case, form, "pitch by gravity", "deg", paper, pitch))
    of = f"{len(SEEDS)} seeds of 10 starts and stops"
    return [
        ResultTable(f"Fig 21: windows out of stops on a soft body, {of}", speeds, SETTINGS),
        ResultTable(f"Figs 20, 23: five ramps by four loads, {of}", ramps, SETTINGS),
    ]


def directions() -> tuple[ResultTable, Floats, Floats]:
    """Pitch from the last 2 m before a stop, back from it or forward to it, deg."""
    between = 20.0  # s
    pairs = over(_both_ways, [(seed, between) for seed in SEEDS])
    reverse, forward = (np.concatenate(part) for part in zip(*pairs, strict=True))
    rows = []
    for name, values in (("reverse", reverse), ("forward", forward)):
        rows.append(ResultRow(name, "", "pitch, mean error", "deg", None, float(values.mean())))
        rows.append(ResultRow(name, "", "pitch, spread", "deg", None, float(values.std(ddof=1))))
    title = f"the last 2 m before a stop, {between:.0f} s after the one before"
    settings = "the integration alone, trapezoid, with 0.02 deg/s of gyro bias left in"
    return ResultTable(title, rows, settings), reverse, forward


def _both_ways(job: tuple[int, float]) -> tuple[Floats, Floats]:
    seed, between = job
    overrides = {
        "gyro_noise": float(np.radians(0.01)),
        "speed.duration": between / 2,
        "speed.motions": 10,
        "accel_noise": NOISE * MICRO_G,
    }
    drive = Drive.from_tables(simulate("kim2023-mc", seed=seed, overrides=overrides).tables)
    force, rate = (
        np.stack([drive[f"imu.{kind}_{axis}"] for axis in "xyz"], axis=1)
        for kind in ("accel", "gyro")
    )
    rate = rate - np.radians([0.0, 0.02, 0.0])  # what is left of the bias
    stand, moving = round(WAIT * drive.rate), round(between * drive.rate)
    reverse, forward = [], []
    for start in range(stand, len(drive) - moving, moving + 2 * stand):
        stop = start + moving
        before, after = force[start - stand : start], force[stop + 1 : stop + stand]
        window = slice(start, stop + 1)
        f, w = force[window], rate[window]
        x, y, z = after.mean(axis=0)
        at_rest = np.arctan2(x, np.hypot(y, z))
        q = attitude(at_rest, np.arctan2(y, z))
        standing = StrapdownStart(q, np.sqrt(x * x + y * y + z * z))
        back = dead_reckon(f[::-1], w[::-1], -drive.dt, standing, 2.0)
        reverse.append(at_rest - back.slope)
        x, y, z = before.mean(axis=0)
        q = attitude(np.arctan2(x, np.hypot(y, z)), np.arctan2(y, z))
        path = dead_reckon(
            f, w, drive.dt, StrapdownStart(q, np.sqrt(x * x + y * y + z * z)), np.inf
        )
        last = path.s >= path.s[-1] - 2.0
        s, z_last = path.s[last], path.z[last]
        forward.append(at_rest - np.arctan2(z_last[-1] - z_last[0], s[-1] - s[0]))
    return np.degrees(reverse), np.degrees(forward)
