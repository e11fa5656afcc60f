"""What each estimator does under each fault: writes docs/faults.md.

Run: PYTHONPATH=tests python benchmarks/fault_table.py
"""

from __future__ import annotations

from pathlib import Path

import faults
import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.log import AngleTrack
from roadlog.metrics import angle_errors
from roadlog.signals import TRUTH_TOPIC

PAGE = Path(__file__).parent.parent / "docs" / "faults.md"
HEAD = """# Faults

What each estimator does when its inputs are wrong: the RMS error of its first angle in degrees
over the valid samples, and the share of samples that it calls valid. The drive is the first 140 s
of `mountain` with sensors; a passing fault acts from 40 s on. A dash: the estimator cannot run, or
calls nothing valid. No fault raises an exception, gives an infinite angle, or gives a valid one
beyond 45 deg; `tests/estimators/test_faults.py` holds that. Made by `benchmarks/fault_table.py`.
"""
NOTES = """
What to read from it:

- A wrong sign, scale or bias of a sensor is no fault that an estimator can see in its own input:
  `roadlog info` finds most of them before.
- A frozen sensor repeats a plausible value. Only what has a second opinion (`fusion`) holds.
"""


def main() -> None:
    inputs, others, vehicle = faults.pass_drive()
    truth = AngleTrack.from_table(next(t for t in others if t.topic == TRUTH_TOPIC))
    start = int(inputs[0].time[0])
    names = [e.name for e in estimators.all_estimators() if set(e.gives) & set(truth.angles)]

    def cells(tables: list) -> list[str]:
        drive = Drive.from_tables(tables)
        result = []
        for name in names:
            if estimators.get(name).missing(drive):
                result.append("-")
                continue
            estimate = estimators.run(name, drive, vehicle)
            angle = next(a for a in estimate.angles if a in truth.angles)
            time = start + np.round(estimate.time * 1e9).astype(np.int64)
            flags = np.zeros(len(time), np.uint32)
            track = AngleTrack(time, estimate.angles, estimate.sd, estimate.usable, flags)
            found = angle_errors(track, truth, angle)
            share = estimate.usable.mean()
            if found is None or not found.valid.any():
                result.append("-")
                continue
            rms = np.degrees(np.sqrt(np.mean(found.error[found.valid] ** 2)))
            result.append(f"{rms:.2g} ({100 * share:.0f} %)")
        return result

    runs = {"no fault": list(inputs)}
    runs |= {fault.name: faults.inject(inputs, fault) for fault in faults.OF_THE_LOG}
    for group in faults.GROUPS:
        runs |= {f"{group}: {f.name}": faults.inject(inputs, f, group) for f in faults.OF_A_GROUP}
    table = {name: cells(tables) for name, tables in runs.items()}
    lines = [HEAD]
    for k in range(0, len(names), 7):
        part = slice(k, k + 7)
        lines.append("| fault | " + " | ".join(f"`{name}`" for name in names[part]) + " |")
        lines.append("|---" * (len(names[part]) + 1) + "|")
        lines += [f"| {fault} | " + " | ".join(row[part]) + " |" for fault, row in table.items()]
        lines.append("")
    PAGE.write_text("\n".join(lines).rstrip() + "\n" + NOTES, encoding="utf-8")


if __name__ == "__main__":
    main()
