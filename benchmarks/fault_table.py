"""What each estimator does under each fault: writes docs/faults.md.

Run: PYTHONPATH=tests python benchmarks/fault_table.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support import faults
from support.drives import SHARED

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.metrics import angle_errors
from roadlog.signals import TRUTH_TOPIC
from roadlog.storage import Table

PAGE = Path(__file__).parent.parent / "docs" / "faults.md"
HEAD = """# Faults

What each estimator does when its inputs are wrong: the RMS error of its first angle in degrees
over the valid samples, and the share of samples that it calls valid. A passing fault acts from 40 s
on. A dash: the estimator cannot run, or calls nothing valid. No fault raises an exception, gives an
infinite angle, or gives a valid one beyond 45 deg; `tests/estimators/test_faults.py` holds that on
both drives. Made by `benchmarks/fault_table.py`.

What to read from it:

- A wrong sign, scale or bias of a sensor is no fault that an estimator can see in its own input:
  `roadlog info` finds most of them before.
- A frozen sensor repeats a plausible value. Only what has a second opinion (`fusion`) holds.
"""
SIMULATED = "The first 140 s of `mountain` with sensors: climbs, hairpins, a stop."
REAL = """The comma2k19 minute, a highway with speeds from CAN, against its reference grade. The
mean of the error, which is the unknown mounting's, is taken off."""


def cells(tables: list[Table], truth: Estimate, vehicle: Vehicle, *, centered: bool) -> list[str]:
    """One row: every estimator of an angle that the truth has."""
    drive = Drive.from_tables(tables)
    result = []
    for name in columns(truth):
        if estimators.get(name).missing(drive):
            result.append("-")
            continue
        estimate = estimators.run(name, drive, vehicle)
        angle = next(a for a in estimate.angles if a in truth.angles)
        found = angle_errors(estimate, truth, angle)
        share = estimate.valid.mean()
        if found is None or not found.valid.any():
            result.append("-")
            continue
        error = found.error[found.valid]
        rms = np.degrees(np.std(error) if centered else np.sqrt(np.mean(error**2)))
        result.append(f"{rms:.2g} ({100 * share:.0f} %)")
    return result


def columns(truth: Estimate) -> list[str]:
    return [e.name for e in estimators.all_estimators() if set(e.gives) & set(truth.angles)]


def section(
    title: str,
    text: str,
    drive: tuple[list[Table], list[Table], Vehicle],
    *,
    centered: bool = False,
) -> list[str]:
    """The tables of one drive, seven estimators beside each other."""
    inputs, others, vehicle = drive
    truth = Estimate.from_table(next(t for t in others if t.topic == TRUTH_TOPIC))
    runs = {"no fault": list(inputs)}
    runs |= {fault.name: faults.inject(inputs, fault) for fault in faults.OF_THE_LOG}
    for group in faults.GROUPS:
        runs |= {f"{group}: {f.name}": faults.inject(inputs, f, group) for f in faults.OF_A_GROUP}
    table = {
        name: cells(tables, truth, vehicle, centered=centered) for name, tables in runs.items()
    }
    lines, names = [f"## {title}", "", text, ""], columns(truth)
    for k in range(0, len(names), 7):
        part = slice(k, k + 7)
        lines.append("| fault | " + " | ".join(f"`{name}`" for name in names[part]) + " |")
        lines.append("|---" * (len(names[part]) + 1) + "|")
        lines += [f"| {fault} | " + " | ".join(row[part]) + " |" for fault, row in table.items()]
        lines.append("")
    return lines


def main() -> None:
    lines = [HEAD]
    lines += section("A simulated drive", SIMULATED, faults.pass_drive())
    lines += section("A real drive", REAL, faults.real_minute(SHARED), centered=True)
    PAGE.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
