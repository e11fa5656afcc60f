#!/usr/bin/env bash
# asammdf 8.8.28 writes a straight line where an MF4 file says that a signal was invalid; mdfreader 4.3 the code itself.
#
# MDF 4 has an invalidation bit for each sample ("the sensor had no value here"). Read as a signal (`get`), such samples
# are left out. Read as a table they come back as numbers: `to_dataframe()`, `get_group()` and the CSV export
# interpolate over them, also without any raster, and nothing marks the rows. Ten minutes without a value become a line
# between the values before and after. mdfreader knows the bits but `get_channel_data` ignores them: there the invalid
# rows hold what the bus sent, here 6553.5 km/h. So one file gives three different columns by three usual ways.
#
# Why it matters for drive logs: a wheel speed that was lost in a tunnel turns into a perfectly even deceleration, whose
# derivative an estimator takes for the car's own and books as grade; a mean speed or a distance over it looks plausible.
# Compare the number of samples of `get` with the rows of the table, or read signal by signal.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "asammdf==8.8.28" "mdfreader==4.3"
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import csv
import glob
import sys
from importlib.metadata import version

import mdfreader
import numpy as np
from asammdf import MDF, Signal

print(*(f"{name} {version(name)}" for name in ("asammdf", "mdfreader")))
path = f"{sys.argv[1]}/drive.mf4"
time = np.arange(0.0, 1000.0, 100.0)
lost = (time >= 200) & (time <= 700)
speed = np.where(lost, 6553.5, np.where(time < 500, 90.0, 20.0))
with MDF(version="4.10") as file:
    file.append([
        Signal(speed, time, name="speed", unit="km/h", invalidation_bits=lost),
        Signal(time, time, name="counter"),
    ])
    file.save(path)
with MDF(path) as file:
    alone = file.get("speed").samples
    table = file.to_dataframe(raster=None)["speed"].to_numpy()
    group = file.get_group(0)["speed"].to_numpy()
    file.export("csv", f"{sys.argv[1]}/drive.csv")
(exported,) = glob.glob(f"{sys.argv[1]}/*.csv")
with open(exported, newline="") as stream:
    written = np.array([float(row["speed"]) for row in csv.DictReader(stream)])
other = np.asarray(mdfreader.Mdf(path).get_channel_data("speed"))
print(f"{lost.sum()} of {len(time)} samples are marked invalid")
for name, values in (("get", alone), ("to_dataframe", table), ("get_group", group), ("CSV export", written)):
    print(f"asammdf {name:<13}", *(f"{v:7.1f}" for v in values))
print(f"{'mdfreader':<21}", *(f"{v:7.1f}" for v in other))
line = np.interp(time, time[~lost], speed[~lost])
same = np.array_equal(alone, speed[~lost]) and np.array_equal(other, speed)
same &= all(np.allclose(values, line) for values in (table, group, written))
sys.exit(0 if same else "the behavior has changed")
PYTHON
