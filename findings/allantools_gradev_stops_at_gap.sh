#!/usr/bin/env bash
# allantools 2024.6: the "gap resistant" Allan deviation of a rate ends at the first gap.
#
# `gradev` is the one function of the package that takes NaN for missing samples. For phase data it uses what is on
# both sides of a gap. For `data_type="freq"`, the kind that a gyroscope or an accelerometer is, the data are first
# summed up, and the sum after the first NaN is NaN to the end: of 1000 s with a gap of 0.1 s at 20 s only the first
# 20 s count, and long averaging times disappear from the result. The printed line speaks of phase data being
# preferred, not of data being left out. (`oadev` and the others give NaN, which at least is seen.)
#
# Why it matters for drive logs: noise and bias stability of an IMU are read from such curves, from logs with
# a lost sample here and there; the bias stability stands at the long averaging times that are gone.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "allantools==2024.6" "numpy<3"
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import allantools
import numpy as np

print("allantools", version("allantools"))
rate, taus = 100.0, [0.1, 1.0, 10.0]
gyro = np.random.default_rng(0).normal(0.0, 1.0, 100_000)
torn = gyro.copy()
torn[2000:2010] = np.nan
kept = {}
for name, data in (("whole", gyro), ("0.1 s missing at 20 s", torn)):
    found, deviation, _, count = allantools.gradev(data, rate=rate, data_type="freq", taus=taus)
    kept[name] = (list(found), list(count))
    print(f"{name}: averaging times {list(found)} s, deviations {np.round(deviation, 3)}, from {count} differences")
whole, less = kept.values()
gone = less[0] == [0.1, 1.0] and whole[0] == taus and less[1][0] < 0.03 * whole[1][0]
sys.exit(0 if gone else "the behavior has changed")
PYTHON
