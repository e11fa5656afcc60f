"""The suspension filter as Wang 2025 prints it: docs/methods/wang2025.md#as-printed.

The Jacobian is the transition, the noises have rank one, and the pitch is stepped by Euler's rule.
"""

from __future__ import annotations

import numpy as np

from roadlog.estimators.wang2025.suspension_ekf import (
    SuspensionModel,
    SuspensionTrack,
    accel_row,
    jacobian,
    measured_accel,
)
from roadlog.types import Floats

W = np.array([0.0, 0.1, 0.0, 1.0])  # printed: nothing for the grade


def filter_printed(model: SuspensionModel) -> SuspensionTrack:
    """Filtered states by x' = A x + B F, P' = A P A' + W Q W' and V R V' of rank one.

    Q is the pitch's process noise, V the measurements' standard deviations. No gate.
    """
    noise = np.outer(W, W) * model.Q[3]
    spread = np.sqrt(model.R)
    x, P, innovation = _filter(
        np.ascontiguousarray(model.speed),
        np.ascontiguousarray(model.accel),
        np.ascontiguousarray(model.force),
        model.x0,
        model.P0,
        noise,
        np.outer(spread, spread),
        model.car,
        model.body_mount,
    )
    return SuspensionTrack(x, P, innovation, np.zeros(len(model.speed), np.bool_))


def _filter(
    speed: Floats,
    accel: Floats,
    force: Floats,
    x0: Floats,
    P0: Floats,
    Q: Floats,
    R: Floats,
    car: Floats,
    body: bool,
) -> tuple[Floats, Floats, Floats]:
    n = len(speed)
    xs, Ps = np.empty((n, 4)), np.empty((n, 4, 4))
    innovation = np.full((n, 3), np.nan)
    x, P = x0.copy(), P0.copy()
    A, H = np.empty((4, 4)), np.zeros((2, 4))
    H[0, 0] = 1.0
    for k in range(n):
        if k > 0:
            jacobian(x, force[k], car, A)
            x = A @ x
            if np.isfinite(force[k]):
                x[1] += force[k] / car[1]
            P = A @ P @ A.T + Q
        if np.isfinite(speed[k]) and np.isfinite(accel[k]):
            accel_row(x, body, H[1])
            residual = np.array([speed[k] - x[0], accel[k] - measured_accel(x, body)])
            S = H @ P @ H.T + R
            gain = P @ H.T @ np.linalg.inv(S)
            innovation[k, :2] = residual
            innovation[k, 2] = 0.5 * residual @ np.linalg.inv(S) @ residual
            x = x + gain @ residual
            P = P - gain @ H @ P
            P = 0.5 * (P + P.T)
        xs[k], Ps[k] = x, P
    return xs, Ps, innovation
