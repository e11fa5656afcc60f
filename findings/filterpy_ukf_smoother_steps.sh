#!/usr/bin/env bash
# filterpy 2.0.0: the smoother of the unscented filter takes the time steps one off, and no process noise but the last.
#
# `UnscentedKalmanFilter.batch_filter(zs, dts=dts)` predicts with dts[k] on the way INTO sample k. Its partner
# `rts_smoother(xs, Ps, dts=dts)` takes dts[k] for the way OUT of sample k. The same list in both, as the names
# suggest, smooths with each step shifted by one; nothing is said. The list `Qs` of the smoother is taken and never
# read: the filter's own Q, the one of the last step if it was changed on the way, serves every step.
# With a linear model the answer is known from `KalmanFilter.rts_smoother` of the same package, whose lists
# do count from the way in.
#
# Why it matters for drive logs: logged steps are not equal (jitter, gaps, fixes between IMU samples). With equal
# steps both mistakes are invisible, with a gap the smoothed angles are wrong on both of its sides.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "filterpy==2.0.0" "numpy<3"
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

import numpy as np
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter

print("filterpy", version("filterpy"))
steps = np.array([0.1, 0.1, 2.0, 0.1, 0.1, 2.0, 0.1, 0.1])
zs = np.array([0.0, 0.3, 2.9, 3.0, 3.2, 5.0, 5.3, 5.2])


def transition(dt: float) -> np.ndarray:
    return np.array([[1.0, dt], [0.0, 1.0]])


def noise(dt: float) -> np.ndarray:
    return 0.5 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])


linear = KalmanFilter(2, 1)
linear.H, linear.R = np.array([[1.0, 0.0]]), np.eye(1)
points = MerweScaledSigmaPoints(2, alpha=1.0, beta=2.0, kappa=1.0)
unscented = UnscentedKalmanFilter(2, 1, 0.1, lambda x: x[:1], lambda x, dt: transition(dt) @ x, points)
xs, Ps = [], []
for dt, z in zip(steps, zs, strict=True):
    unscented.Q = noise(dt)
    unscented.predict(dt=dt)
    unscented.update(z)
    xs.append(unscented.x.copy())
    Ps.append(unscented.P.copy())
xs, Ps = np.array(xs), np.array(Ps)
Fs, Qs = [transition(dt) for dt in steps], [noise(dt) for dt in steps]
right = linear.rts_smoother(xs, Ps, Fs, Qs)[0][:, 0]
same = unscented.rts_smoother(xs, Ps, Qs=Qs, dts=steps)[0][:, 0]
shifted = unscented.rts_smoother(xs, Ps, Qs=Qs, dts=np.append(steps[1:], steps[-1]))[0][:, 0]
no_lists = unscented.rts_smoother(xs, Ps, dts=steps)[0][:, 0]
print("linear smoother, the same steps:      ", right.round(3))
print("unscented smoother, the same steps:   ", same.round(3))
print("unscented smoother, steps moved by one:", shifted.round(3))
off, still = np.abs(same - right).max(), np.abs(shifted - right).max()
print(f"largest difference from the linear smoother: {off:.3f}, steps moved by one {still:.3f}")
unread = bool(np.array_equal(same, no_lists))
print("the result with the list Qs is the one without, bit for bit:", unread)
unscented.Q = noise(0.1)
constant = linear.rts_smoother(xs, Ps, Fs, [noise(0.1)] * len(steps))[0][:, 0]
matches = bool(np.allclose(shifted, constant))
print("with the steps moved, it is the linear smoother with the LAST step's Q everywhere:", matches)
sys.exit(0 if off > 0.05 and unread and matches else "the behavior has changed")
PYTHON
