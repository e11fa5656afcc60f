"""Axes of the IMU: turned, exchanged, reversed, tilted."""

from __future__ import annotations

import numpy as np

from roadlog.checks.motion import Examination
from roadlog.motion.axes import Explanation, judge
from roadlog.signals import AXES
from roadlog.types import Floats

MAX_TILT = 20.0  # deg of the mean specific force against z that no road explains


def axes(state: Examination) -> None:
    """What the best explanation of the axes says against the profile."""
    verdict = judge(state.evidence)
    if verdict is None:
        return
    mean, best, rivals = verdict.mean, verdict.best, verdict.rivals
    if best is None:
        if mean is not None:
            _tilt(state, mean)
        return
    if best.turned:
        _mount(state, best, mean)
    if best.exchanged:
        state.add(
            "exchanged",
            best.exchanged,
            "are exchanged: each goes with what the other should",
            "map each to the other's column in the profile",
        )
    if best.reversed == ("imu.accel",):
        roles = tuple(f"imu.accel_{axis}" for axis in AXES)
        hanging = next((e for e in rivals if not e.reversed), None)
        if hanging is None:
            found, other = "gravity reads down where the gyro says up", ""
        else:
            found = "gravity reads down"
            other = (
                f" (or else the sensor hangs upside down and backward, mount = {hanging.toml()}: "
                f"left and right are not observable in this log)"
            )
        state.add(
            "sign",
            roles,
            f"{found}: all signs are reversed, as on iOS",
            f"give all three scale = -1.0{other}",
            -1.0,
        )
    elif best.reversed:
        others = sorted({r for e in rivals if not e.turned for r in e.reversed} - {*best.reversed})
        names = (*best.reversed, *others)
        state.add(
            "sign",
            names,
            f"has the sign reversed against the rest of the log{_or(others)}",
            "give it scale = -1.0",
            -1.0,
        )


def _or(others: list[str]) -> str:
    return f" (or else {', '.join(others)}: not observable in this log)" if others else ""


def _mount(state: Examination, best: Explanation, mean: Floats | None) -> None:
    signals = tuple(f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in AXES)
    names = [name for name in signals if name in state.evidence]
    reads = ""
    if mean is not None:
        k = int(np.argmax(np.abs(mean)))
        reads = f"gravity reads {mean[k]:+.1f} m/s2 on {AXES[k]}; "
    state.add(
        "axes",
        tuple(names),
        f"{reads}the sensor's axes are not the vehicle's",
        f"say in the profile: [imu] mount = {best.toml()}",
    )


def _tilt(state: Examination, mean: Floats) -> None:
    tilt = float(np.degrees(np.arccos(np.clip(mean[2] / np.linalg.norm(mean), -1, 1))))
    if tilt > MAX_TILT:
        state.add(
            "axes",
            tuple(f"imu.accel_{axis}" for axis in AXES),
            f"gravity lies {tilt:.0f} deg off z, mostly on {AXES[int(np.argmax(np.abs(mean)))]}",
            "give the profile a [imu] mount; which way is forward is not observable in this drive",
            tilt,
        )
