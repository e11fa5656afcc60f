#!/usr/bin/env bash
# filterpy 2.0.0: a measurement that is missing has a likelihood, and a better one than those that are there.
#
# `KalmanFilter.update(None)` is the documented way to pass a step without a measurement. After it,
# `log_likelihood` is not zero and not "none": it is the density of a residual of exactly 0 under the innovation
# covariance S of the LAST measurement, however long ago that was. `mahalanobis` says 0, a perfect fit. While the
# state's covariance P grows through the gap, S and the likelihood stand still.
#
# Why it matters for drive logs: GNSS, wheel speeds and cameras pause (tunnels, standstill), and the sum of
# `log_likelihood` over a drive is what noise and filters are tuned and compared by. Every pause adds the reward
# of a perfect measurement, so the tuning that makes S small wins; the mean of the squared innovations (NIS) sinks
# with every gap and the filter looks too careful.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "filterpy==2.0.0" "numpy<3"
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import numpy as np
from filterpy.kalman import KalmanFilter

print("filterpy", version("filterpy"))
kalman = KalmanFilter(dim_x=2, dim_z=1)
kalman.F = np.array([[1.0, 0.1], [0.0, 1.0]])
kalman.H = np.array([[1.0, 0.0]])
kalman.Q *= 0.01
print("measurement  log-likelihood  squared innovation       S  variance of the state")
rows = []
for z in [1.0, 2.0] + [None] * 5:
    kalman.predict()
    kalman.update(z)
    rows.append((kalman.log_likelihood, kalman.mahalanobis, float(kalman.S[0, 0]), float(kalman.P[0, 0])))
    print(f"{z!s:>11}  {rows[-1][0]:14.3f}  {rows[-1][1] ** 2:18.3f}  {rows[-1][2]:6.3f}  {rows[-1][3]:21.3f}")
there, missing = rows[:2], rows[2:]
rewarded = all(m[0] > max(t[0] for t in there) and m[1] == 0.0 for m in missing)
stale = all(m[2] == there[-1][2] for m in missing) and missing[-1][3] > missing[0][3]
print("every missing measurement scores above every measurement:", rewarded)
print("S stands still while the state's variance grows:", stale)
sys.exit(0 if rewarded and stale else "the behavior has changed")
PYTHON
