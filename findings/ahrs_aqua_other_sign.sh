#!/usr/bin/env bash
# AHRS 0.4.0: of the attitude filters of one package, AQUA has pitch and roll with the other sign.
#
# All filters of `ahrs.filters` take the same arrays and give their result as `.Q`. For a sensor at rest, nose up by
# 20 degrees, Tilt, Madgwick, Mahony, Complementary and EKF agree: 20 degrees. AQUA says -20, for roll as well: its
# quaternion turns from the world into the sensor, that of the others from the sensor into the world. Which
# of the two stands in no type and no name; it follows from the formulas of the papers.
#
# Why it matters for drive logs: filters of such packages are swapped by name to compare them. Uphill becomes
# downhill; on a drive there and back the mean error is still zero.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "ahrs==0.4.0" "numpy<3"
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import ahrs
import numpy as np

print("AHRS", version("ahrs"))
tilt, gravity = np.radians(20.0), 9.80665
still = np.zeros((400, 3))
at_rest = {
    "pitch": np.tile([-gravity * np.sin(tilt), 0.0, gravity * np.cos(tilt)], (400, 1)),
    "roll": np.tile([0.0, gravity * np.sin(tilt), gravity * np.cos(tilt)], (400, 1)),
}
signs = {}
for name in ("Tilt", "Madgwick", "Mahony", "Complementary", "EKF", "AQUA"):
    kind, angles = getattr(ahrs.filters, name), {}
    for angle, acc in at_rest.items():
        found = kind(acc=acc) if name == "Tilt" else kind(gyr=still, acc=acc, frequency=10.0)
        roll, pitch, _ = np.degrees(ahrs.Quaternion(found.Q[-1]).to_angles())
        angles[angle] = pitch if angle == "pitch" else roll
    print(f"{name:<14} pitch {angles['pitch']:6.1f}  roll {angles['roll']:6.1f}")
    signs[name] = {round(float(x)) for x in angles.values()}
others = all(s == {20} for name, s in signs.items() if name != "AQUA")
sys.exit(0 if others and signs["AQUA"] == {-20} else "the behavior has changed")
PYTHON
