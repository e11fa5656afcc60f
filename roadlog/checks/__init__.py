"""Does a log make sense? Checks that find the usual faults by the data itself."""

from __future__ import annotations

from collections.abc import Mapping

from roadlog.car.correction import corrected
from roadlog.car.vehicle import Vehicle
from roadlog.checks import clocks, fixes, motion, mounting, quality, speeds, values
from roadlog.checks.finding import Finding
from roadlog.checks.impossible import beyond
from roadlog.drive import Drive
from roadlog.motion.evidence import Evidence
from roadlog.signals import GNSS_TOPIC, IMU_TOPIC
from roadlog.storage import Table

__all__ = ["Finding", "check", "check_drive"]


def check(tables: Mapping[str, Table], vehicle: Vehicle | None = None) -> list[Finding]:
    """Everything that looks wrong in a log's tables; faults first.

    Each step puts right what it finds before the next one looks, so that one fault gives one
    finding. vehicle: what its file corrects is no fault of the drive.
    """
    of_day = clocks.of_day(tables)
    found = of_day or clocks.jumps(tables)
    jumped = {topic for finding in found for topic in finding.signals}
    found += [] if of_day else clocks.forward(tables)
    found += [f for f in values.stamps(tables) if jumped.isdisjoint(f.signals)]
    impossible, tables = beyond(tables)
    found += impossible
    invalid, tables = values.invalid(tables)
    leaps, tables = values.leaps(tables)
    frozen, tables = values.frozen(tables)
    found += invalid + leaps + frozen
    if GNSS_TOPIC not in jumped:
        found += fixes.fixes(tables)
    if IMU_TOPIC not in jumped:
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
    mounting.axes(state)
    return state.found
