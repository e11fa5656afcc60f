"""Strapdown integration near a standstill: attitude, velocity, path; time may run backward.

Kim 2023, eqs. (10)-(13), corrected: docs/methods/kim2023.md#strapdown.
Quaternions are scalar first and rotate vehicle axes into the navigation frame (x forward at the
start, y left, z up).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from roadlog.filters import Engine
from roadlog.jit import argument, compiled
from roadlog.types import Floats

SMALL_TURN = 1e-9  # rad, below this sin(x)/x is 1


@dataclass(frozen=True)
class StrapdownPath:
    """Where a point of the body went, sample by sample from the standing position, all (m,).

    s: horizontal path length, m. x forward, y left, z up, m. inclination: rad, nose up +.
    """

    s: Floats
    x: Floats
    y: Floats
    z: Floats
    inclination: Floats

    def __len__(self) -> int:
        return len(self.s)

    @property
    def slope(self) -> float:
        """rad, uphill along the car's nose +; eq. (15) with the sign of the direction."""
        return self.slope_after(0)

    def slope_after(self, k: int) -> float:
        """rad, like `slope`, of the path from its sample k on."""
        rise = np.sign(self.x[-1]) * (self.z[-1] - self.z[k])
        return float(np.arctan2(rise, self.s[-1] - self.s[k]))

    @property
    def chord_deviation(self) -> float:
        """m, largest distance of the path (s, z) from the chord between its ends."""
        across = np.abs(self.s * self.z[-1] - self.z * self.s[-1])
        return float(across.max() / max(np.hypot(self.s[-1], self.z[-1]), 1e-12))

    @property
    def way_back(self) -> float:
        """m, the longest way against the direction in which the path ends."""
        progress = np.sign(self.x[-1]) * self.x
        return float((np.maximum.accumulate(progress) - progress).max())


class StrapdownStart(NamedTuple):
    """The first sample of an integration, at a standstill.

    attitude (4,): quaternion. gravity: m/s2, length of the mean specific force there, so that a
    constant accelerometer bias cancels. velocity (3,): of the sensor, m/s. lever (3,): from the
    point that is followed to the sensor, m.
    """

    attitude: Floats
    gravity: float
    velocity: Floats = np.zeros(3)
    lever: Floats = np.zeros(3)


def dead_reckon(
    force: Floats,
    rate: Floats,
    step: float,
    start: StrapdownStart,
    distance: float,
    trapezoid: bool = True,
    engine: Engine = "compiled",
) -> StrapdownPath:
    """Integrate from a standstill until the horizontal path is `distance` or the samples end.

    force (n, 3), m/s2, and rate (n, 3), rad/s, bias removed: vehicle axes, in the order of
    integration, the first one at the standstill. step: s, negative when time runs back. distance:
    m. trapezoid: means of neighboring samples; else the paper's rectangle.
    """
    loop = _dead_reckon if engine == "compiled" else _dead_reckon.py_func
    samples = argument(force), argument(rate)
    rows, end = loop(*samples, step, start, distance, trapezoid)
    return StrapdownPath(*rows[:end].T)


def attitude(inclination: float, roll_total: float) -> Floats:
    """Quaternion (4,) of a body with heading 0: inclination nose up +, roll right side down +."""
    ct, st = np.cos(-inclination / 2), np.sin(-inclination / 2)
    cr, sr = np.cos(roll_total / 2), np.sin(roll_total / 2)
    return np.array([ct * cr, ct * sr, st * cr, -st * sr])


@compiled
def turn(q: Floats, wx: float, wy: float, wz: float, step: float) -> Floats:
    """Quaternion after turning at a constant body rate [rad/s] for `step` seconds; eq. (10).

    The sine coefficient is sin(T/2)/(T/2) with T = |w| step: as printed, half the
    turn is lost. It is even in T, so a negative step needs nothing else.
    """
    half = 0.5 * step * np.sqrt(wx * wx + wy * wy + wz * wz)
    c = np.cos(half)
    s = (np.sin(half) / half if abs(half) > SMALL_TURN else 1.0) * 0.5 * step
    a, b, d, e = q[0], q[1], q[2], q[3]
    r = np.empty(4)
    r[0] = c * a + s * (-wx * b - wy * d - wz * e)
    r[1] = c * b + s * (wx * a + wz * d - wy * e)
    r[2] = c * d + s * (wy * a - wz * b + wx * e)
    r[3] = c * e + s * (wz * a + wy * b - wx * d)
    norm = np.sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3])
    for i in range(4):
        r[i] /= norm
    return r


@compiled
def to_navigation(q: Floats, vx: float, vy: float, vz: float) -> tuple[float, float, float]:
    """A vector of the vehicle axes in the navigation frame."""
    a, b, c, d = q[0], q[1], q[2], q[3]
    x = (1 - 2 * (c * c + d * d)) * vx + 2 * (b * c - a * d) * vy + 2 * (b * d + a * c) * vz
    y = 2 * (b * c + a * d) * vx + (1 - 2 * (b * b + d * d)) * vy + 2 * (c * d - a * b) * vz
    z = 2 * (b * d - a * c) * vx + 2 * (c * d + a * b) * vy + (1 - 2 * (b * b + c * c)) * vz
    return x, y, z


@compiled
def nose_up(q: Floats) -> float:
    """Inclination of a quaternion, rad, nose up +."""
    return np.arcsin(min(1.0, max(-1.0, 2 * (q[1] * q[3] - q[0] * q[2]))))


@compiled
def _dead_reckon(
    force: Floats,
    rate: Floats,
    step: float,
    start: StrapdownStart,
    distance: float,
    trapezoid: bool,
) -> tuple[Floats, int]:
    """Columns s, x, y, z, inclination, one row a sample; and the number of rows."""
    n = len(force)
    rows = np.zeros((n, 5))
    gravity, lever = start.gravity, start.lever
    q, v, p = start.attitude.copy(), start.velocity.copy(), np.zeros(3)
    a, mean, next_a, w = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    a[0], a[1], a[2] = to_navigation(q, force[0, 0], force[0, 1], force[0, 2])
    a[2] -= gravity
    start_lever = to_navigation(q, lever[0], lever[1], lever[2])
    rows[0, 4] = nose_up(q)
    for k in range(1, n):
        for i in range(3):
            w[i] = 0.5 * (rate[k - 1, i] + rate[k, i]) if trapezoid else rate[k - 1, i]
        q = turn(q, w[0], w[1], w[2], step)
        next_a[0], next_a[1], next_a[2] = to_navigation(q, force[k, 0], force[k, 1], force[k, 2])
        next_a[2] -= gravity
        now_lever = to_navigation(q, lever[0], lever[1], lever[2])
        for i in range(3):
            mean[i] = 0.5 * (a[i] + next_a[i]) if trapezoid else a[i]
            p[i] += step * v[i] + 0.5 * step * step * mean[i]
            v[i] += step * mean[i]
            a[i] = next_a[i]
            rows[k, i + 1] = p[i] - now_lever[i] + start_lever[i]
        dx, dy = rows[k, 1] - rows[k - 1, 1], rows[k, 2] - rows[k - 1, 2]
        rows[k, 0] = rows[k - 1, 0] + np.sqrt(dx * dx + dy * dy)
        rows[k, 4] = nose_up(q)
        if rows[k, 0] >= distance:
            return rows, k + 1
    return rows, n
