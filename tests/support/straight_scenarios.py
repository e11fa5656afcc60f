"""Massel's two manoeuvres, from docs/simulator.md#straight-truth alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.signal import butter, sosfilt
from support.drives import EPOCH_NS, table

from roadlog.drive import Drive
from roadlog.units import STANDARD_GRAVITY as G

MASS, HEIGHT, INERTIA, STIFFNESS, DAMPING = 1600.0, 0.55, 2600.0, 251e3, 17.9e3
GRADE = np.arctan(0.10)
SIMULATION_RATE = 2000.0  # Hz


@dataclass(frozen=True)
class Truth:
    """Uniform clock; SI and rad."""

    time: np.ndarray
    speed: np.ndarray
    vdot: np.ndarray
    grade: np.ndarray
    pitch: np.ndarray


@cache
def truth(name: str) -> Truth:
    """`quasi` or `accel` at SIMULATION_RATE."""
    t = np.arange(round((20 if name == "quasi" else 25) * SIMULATION_RATE) + 1) / SIMULATION_RATE
    omega = 2 * np.pi * 0.1592
    if name == "quasi":
        speed, vdot = (40 + np.sin(omega * t)) / 3.6, omega * np.cos(omega * t) / 3.6
    else:
        vdot = np.full(len(t), 4 / 3.6)
        for start in (5.0, 10.0, 15.0, 20.0):
            s = np.clip(np.minimum(t - start, start + 0.5 - t) / 0.15, 0, 1)
            vdot = vdot * (1 - 1.15 * (1 - np.cos(np.pi * s)) / 2)
        speed = 5 / 3.6 + np.concatenate([[0], np.cumsum((vdot[1:] + vdot[:-1]) / 2)]) * (t[1])
    pitch, dt = np.empty(len(t)), t[1]
    moment = MASS * HEIGHT * (vdot + G * np.sin(GRADE))
    p, w = moment[0] / STIFFNESS, 0.0
    for k in range(len(t)):
        pitch[k] = p
        w += dt * (moment[k] - DAMPING * w - STIFFNESS * p) / INERTIA
        p += dt * w
    return Truth(t, speed, vdot, np.full(len(t), GRADE), pitch)


def massel_drive(name: str, rate: float = 100.0, seed: int | None = 1, noise: str = "N1") -> Drive:
    """The manoeuvre on a grid of `rate` Hz with noise N1 or N2; seed None: exact sensors."""
    full = truth(name)
    every = round(SIMULATION_RATE / rate)
    speed, vdot, grade, p = (a[::every] for a in (full.speed, full.vdot, full.grade, full.pitch))
    along, normal = vdot + G * np.sin(grade), G * np.cos(grade)
    f_x, f_z = along * np.cos(p) + normal * np.sin(p), normal * np.cos(p) - along * np.sin(p)
    if seed is not None:
        rng = np.random.default_rng(seed)
        scale = np.sqrt(rate / 1000)
        accel, wheel = (0.02, 0.005) if noise == "N1" else (0.05, 0.02)
        f_x = f_x + rng.normal(0, accel * scale, len(p))
        f_z = f_z + rng.normal(0, accel * scale, len(p))
        speed = speed + rng.normal(0, wheel * scale, len(p))
        if noise == "N2":
            heave = sosfilt(
                butter(2, (1, 15), "bandpass", fs=rate, output="sos"), rng.normal(size=len(p))
            )
            f_z = f_z + 0.2 * heave / heave.std()
    time = EPOCH_NS + np.round(full.time[::every] * 1e9).astype(np.int64)
    zero = np.zeros(len(p))
    return Drive.from_tables(
        [
            table("imu", time, {"accel_x": f_x, "accel_y": zero, "accel_z": f_z}),
            table("wheel_speeds", time, dict.fromkeys(("fl", "fr", "rl", "rr"), speed)),
        ],
        rate,
    )


def massel_truth(name: str, rate: float) -> Truth:
    """The truth on the grid of `massel_drive`."""
    every = round(SIMULATION_RATE / rate)
    full = truth(name)
    return Truth(*(getattr(full, f)[::every] for f in ("time", "speed", "vdot", "grade", "pitch")))


def errors_deg(estimate, name: str, rate: float, angle: str = "grade") -> np.ndarray:
    """Error over the scored time, t in [2, T - 0.5] s, in deg; NaN where there is no estimate."""
    true = massel_truth(name, rate)
    scored = (true.time >= 2) & (true.time <= true.time[-1] - 0.5)
    return np.degrees(estimate.angles[angle] - getattr(true, angle))[scored]


def rmse(values: np.ndarray) -> float:
    """Root mean square of what is known."""
    return float(np.sqrt(np.nanmean(values**2)))
