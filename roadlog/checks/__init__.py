"""Does a log make sense? Checks that find the usual faults by the data itself."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from roadlog.car.correction import corrected
from roadlog.car.vehicle import Vehicle
from roadlog.checks import clocks, fixes, motion, quality, speeds, values
from roadlog.checks.finding import Finding
from roadlog.checks.impossible import beyond
from roadlog.drive import Drive
from roadlog.motion import axes
from roadlog.motion.evidence import Evidence
from roadlog.signals import AXES
from roadlog.storage import Table
from roadlog.types import Floats

__all__ = ["Finding", "check", "check_drive"]

MAX_TILT = 20.0  # deg of the mean specific force against z that no road explains


def check(tables: Mapping[str, Table], vehicle: Vehicle | None = None) -> list[Finding]:
    """Everything that looks wrong in a log's tables; faults first.

    Each step puts right what it finds before the next one looks, so that one fault gives one
    finding. vehicle: what its file corrects is no fault of the drive.
    """
    found = clocks.jumps(tables)
    jumped = {topic for finding in found for topic in finding.signals}
    found += [f for f in values.stamps(tables) if jumped.isdisjoint(f.signals)]
    impossible, tables = beyond(tables)
    found += impossible
    invalid, tables = values.invalid(tables)
    frozen, tables = values.frozen(tables)
    found += invalid + frozen
    if "/gnss" not in jumped:
        found += fixes.fixes(tables)
    if "/imu" not in jumped:
        found += quality.inertial(tables)
    apart = any(finding.check in ("clocks_differ", "clock_jump") for finding in found)
    if not apart and next(values.inputs(tables), None):
        degrees, tables = values.in_degrees(tables)
        drive = Drive.from_tables(table for _, table in values.inputs(tables))
        found += check_drive(corrected(drive, vehicle or Vehicle()), degrees)
    return sorted(found, key=lambda finding: finding.level)


def check_drive(drive: Drive, degrees: frozenset[str] = frozenset()) -> list[Finding]:
    """Units, axes, signs and clocks of speeds and inertial signals: what a grid can show.

    degrees: roles of angles that the log has in degrees and the drive in radians.
    """
    state = motion.Examination(Evidence.of(drive), degrees)
    motion.gravity(state)
    speeds.dead(state)
    motion.latency(state)
    speeds.speeds(state)
    motion.gyro_unit(state)
    motion.angles(state)
    _axes(state)
    return state.found


def _axes(state: motion.Examination) -> None:
    verdict = axes.judge(state.evidence)
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


def _mount(state: motion.Examination, best: axes.Explanation, mean: Floats | None) -> None:
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


def _tilt(state: motion.Examination, mean: Floats) -> None:
    tilt = float(np.degrees(np.arccos(np.clip(mean[2] / np.linalg.norm(mean), -1, 1))))
    if tilt > MAX_TILT:
        state.add(
            "axes",
            tuple(f"imu.accel_{axis}" for axis in AXES),
            f"gravity lies {tilt:.0f} deg off z, mostly on {AXES[int(np.argmax(np.abs(mean)))]}",
            "give the profile a [imu] mount; which way is forward is not observable in this drive",
            tilt,
        )
