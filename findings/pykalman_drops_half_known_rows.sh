#!/usr/bin/env bash
# A Kalman smoother throws away the speed of every step at which the position is missing.
#
# A measurement vector of position and speed, the position masked where there was no fix: one expects
# a correction by what is there. pykalman skips the whole row as soon as one of its components is
# masked, without a word, in filter and smoother: 540 of 600 speeds count for nothing, and the result
# is the same to the last digit as if they had never been measured. simdkalman, which takes NaN for
# missing, does the same. Corrected component by component, the smoothed speed errs a third less.
# Package: pykalman 0.11.2, simdkalman 1.0.4.
# Why it matters: drive logs are made of sensors at different rates (GNSS at 1 Hz, speed at 10, IMU at
# 100); on one grid almost every row lacks something.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pykalman==0.11.2" "simdkalman==1.0.4" "numpy<3"
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
import pykalman
import simdkalman

print(", ".join(f"{name} {version(name)}" for name in ("pykalman", "simdkalman")))
n, dt = 600, 0.1
A, Q, R = np.array([[1.0, dt], [0.0, 1.0]]), np.diag([1e-6, 0.05**2]), np.diag([4.0, 0.01])
x0, P0 = np.array([0.0, 10.0]), 10.0 * np.eye(2)
speed = 10 + 2 * np.sin(np.arange(n) * dt / 5)
rng = np.random.default_rng(0)
z = np.stack([np.cumsum(speed) * dt + rng.normal(0, 2, n), speed + rng.normal(0, 0.1, n)], axis=1)
has_fix = np.arange(n) % 10 == 0  # position at 1 Hz, speed at 10 Hz
partly = z.copy()
partly[~has_fix, 0] = np.nan
without = z.copy()
without[~has_fix] = np.nan  # no speed either, where there is no position


def by_pykalman(rows):
    model = pykalman.KalmanFilter(
        A, np.eye(2), transition_covariance=Q, observation_covariance=R,
        initial_state_mean=x0, initial_state_covariance=P0,
    )
    return model.smooth(np.ma.masked_invalid(rows))[0]


def by_simdkalman(rows):
    model = simdkalman.KalmanFilter(A, Q, np.eye(2), R)
    return model.smooth(rows[None], initial_value=x0, initial_covariance=P0).states.mean[0]


def by_components(rows):
    """Rauch, Tung, Striebel with each known component as a measurement of its own."""
    xs, Ps, priors, x, P = [], [], [], x0, P0
    for k, row in enumerate(rows):
        if k:
            x, P = A @ x, A @ P @ A.T + Q
        priors.append((x, P))
        for i in np.flatnonzero(np.isfinite(row)):
            gain = P[:, i] / (P[i, i] + R[i, i])
            x, P = x + gain * (row[i] - x[i]), P - np.outer(gain, P[i])
        xs.append(x)
        Ps.append(P)
    for k in range(n - 2, -1, -1):
        C = Ps[k] @ A.T @ np.linalg.inv(priors[k + 1][1])
        xs[k] = xs[k] + C @ (xs[k + 1] - priors[k + 1][0])
    return np.array(xs)


def rmse(states):
    return float(np.sqrt(np.mean((states[:, 1] - speed) ** 2)))


best = rmse(by_components(partly))
print(f"component by component: speed RMSE {best:.4f} m/s")
for name, smooth in (("pykalman", by_pykalman), ("simdkalman", by_simdkalman)):
    with_speed, no_speed = smooth(partly), smooth(without)
    apart = float(np.abs(with_speed - no_speed).max())
    print(f"{name}: speed RMSE {rmse(with_speed):.4f} m/s, {apart:g} from what it gives without these speeds")
    assert apart == 0.0, f"changed: {name} uses rows that are known in part"
    assert rmse(with_speed) > 1.5 * best, f"changed: {name} is as good as by components"
print("as described")
PYTHON
