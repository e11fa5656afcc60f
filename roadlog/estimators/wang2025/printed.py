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

W = np.array([0.0, 0.1, 0.0, 1.0])  # printed: nothing for the grade


def filter_printed(model: SuspensionModel) -> SuspensionTrack:
    """Filtered states by x' = A x + B F, P' = A P A' + W Q W' and V R V' of rank one.

    Q is the pitch's process noise, V the measurements' standard deviations. No gate.
    """
    Q, spread = np.outer(W, W) * model.Q[3], np.sqrt(model.R)
    R = np.outer(spread, spread)
    n = len(model.speed)
    xs, Ps = np.empty((n, 4)), np.empty((n, 4, 4))
    innovation = np.full((n, 3), np.nan)
    x, P = model.x0.copy(), model.P0.copy()
    A, H = np.empty((4, 4)), np.zeros((2, 4))
    H[0, 0] = 1.0
    for k, (speed, accel, force) in enumerate(
        zip(model.speed, model.accel, model.force, strict=True)
    ):
        if k > 0:
            jacobian(x, force, model.car, A)
            x = A @ x
            if np.isfinite(force):
                x[1] += force / model.car.mass
            P = A @ P @ A.T + Q
        if np.isfinite(speed) and np.isfinite(accel):
            accel_row(x, model.body_mount, H[1])
            residual = np.array([speed - x[0], accel - measured_accel(x, model.body_mount)])
            S = H @ P @ H.T + R
            gain = P @ H.T @ np.linalg.inv(S)
            innovation[k, :2] = residual
            innovation[k, 2] = 0.5 * residual @ np.linalg.inv(S) @ residual
            x = x + gain @ residual
            P = P - gain @ H @ P
            P = 0.5 * (P + P.T)
        xs[k], Ps[k] = x, P
    return SuspensionTrack(xs, Ps, innovation, np.zeros(n, np.bool_))
