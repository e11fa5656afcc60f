"""What an earlier commit estimated, against this tree: the largest difference of every estimator.

For a change that moves code and must not move a number. A setting that is not in the earlier tree,
or not in an estimator, is left out there: `--set wheels=all` compares what was before undriven
wheels were taken. Ends with 1 where an angle differs by more than 1e-9 deg.

Run: python benchmarks/same.py [--commit C] [--set KEY=VALUE]... [--only NAME]... [LOG...]
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from against import COMMIT, ROOT, Tree, trees

SAME = 1e-9  # deg
RUN = """
import dataclasses, json, sys
from pathlib import Path
import numpy as np
from roadlog import estimators
from roadlog.errors import RoadlogError
from roadlog.log import DriveLog
target, logs, names, settings = sys.argv[1], *map(json.loads, sys.argv[2:])
found = {}
for log in map(DriveLog, map(Path, logs)):
    drive, vehicle = log.drive(), log.vehicle
    for name in names or estimators.TABLE:
        own = {f.name for f in dataclasses.fields(estimators.get(name).parameters)}
        try:
            made = estimators.run(
                name, drive, vehicle, {k: v for k, v in settings.items() if k in own}
            )
        except RoadlogError:
            continue
        for angle, values in made.angles.items():
            found[f"{name}/{log.path.stem}/{angle}"] = values
            found[f"{name}/{log.path.stem}/{angle}_sd"] = made.sd[angle]
np.savez(target, **found)
print(0)
"""


def estimates(tree: Tree, target: Path, asked: list[str]) -> dict[str, np.ndarray]:
    """estimator/log/angle -> values of one tree."""
    tree.measured(RUN, target, *asked)
    with np.load(target) as found:
        return dict(found)


def apart(before: np.ndarray, now: np.ndarray) -> float:
    """deg, the largest difference; infinite where one knows what the other does not."""
    if before.shape != now.shape or (np.isnan(before) != np.isnan(now)).any():
        return np.inf
    return float(np.degrees(np.nanmax(np.abs(before - now), initial=0.0)))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("logs", nargs="*", default=sorted((ROOT / "sample_logs").glob("*.mcap")))
    parser.add_argument("--commit", default=COMMIT)
    parser.add_argument("--set", dest="settings", action="append", default=[])
    parser.add_argument("--only", action="append", default=[])
    given = parser.parse_args()
    logs = [str(Path(log).resolve()) for log in given.logs]
    settings = dict(pair.split("=", 1) for pair in given.settings)
    asked = [json.dumps(part) for part in (logs, given.only, settings)]
    with tempfile.TemporaryDirectory() as folder, trees(given.commit) as (earlier, here):
        before = estimates(earlier, Path(folder, "before.npz"), asked)
        now = estimates(here, Path(folder, "now.npz"), asked)
    differs = False
    print(f"{'largest difference, deg':24}{'angles':>10}{'sd':>10}")
    for name in dict.fromkeys(key.split("/")[0] for key in before):
        angles, sds = (
            max(
                apart(before[k], now[k])
                for k in before
                if k.split("/")[0] == name and k.endswith("_sd") == of_sd
            )
            for of_sd in (False, True)
        )
        differs |= angles > SAME
        print(f"{name:24}{angles:10.1e}{sds:10.1e}")
    return int(differs)


if __name__ == "__main__":
    sys.exit(main())
