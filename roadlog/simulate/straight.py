"""The papers' simple truth: a body that pitches on its springs along a straight road.

Equations and sensors: docs/simulator.md#straight-truth; nothing here knows of tires.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.jit import compiled
from roadlog.simulate.motion import Motion
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

MOTION_RATE = 1000.0  # Hz, of the motion
SUBSTEPS = 2  # integration steps in one of the motion: 0.5 ms


@dataclass(frozen=True)
class PitchModel:
    """The pitching body divided by its inertia: a damped oscillator driven by specific force.

    gradient: k = m h / K, body pitch per longitudinal specific force; 0 = a rigid body.
    """

    gradient: float  # rad/(m/s2)
    frequency: float = 1.25  # Hz
    damping: float = 0.35  # -, of critical
    load: float = 0.0  # rad, static pitch by what lies in the car
    drag: float = 0.0  # 1/m, rho CdA / (2 m)
    rolling_resistance: float = 0.0  # -, counts in the drive force only
    mass: float = 1600.0  # kg, counts in the drive force only

    @classmethod
    def of_suspension(
        cls,
        mass: float,
        height: float,
        inertia: float,
        stiffness: float,
        damping: float,
        drag_area: float = 0.0,
        air_density: float = 1.2,
        rolling_resistance: float = 0.0,
    ) -> PitchModel:
        """From kg, m, kg m2, N m/rad, N m s/rad, m2 and kg/m3."""
        omega = np.sqrt(stiffness / inertia)
        return cls(
            gradient=mass * height / stiffness,
            frequency=float(omega / (2 * np.pi)),
            damping=float(damping / (2 * omega * inertia)),
            drag=air_density * drag_area / (2 * mass),
            rolling_resistance=rolling_resistance,
            mass=mass,
        )


def drive_straight(model: PitchModel, time: Floats, v: Floats, grade: Floats) -> Motion:
    """The motion of a body on a straight road.

    time: s, uniform at MOTION_RATE. v: m/s along the road. grade: rad, uphill +.
    """
    dt = time[1] - time[0]
    v_dot = np.gradient(v, dt)
    grade_dot = np.gradient(grade, dt)
    moment = v_dot + G * np.sin(grade) + model.drag * v * np.abs(v)
    omega = 2 * np.pi * model.frequency
    pitch, pitch_rate, pitch_dot2 = _oscillator(
        model.gradient * moment + model.load, omega, model.damping, dt, SUBSTEPS
    )
    along, up = v_dot + G * np.sin(grade), G * np.cos(grade) + v * grade_dot
    zero = np.zeros(len(time))
    force = np.stack(
        [
            along * np.cos(pitch) + up * np.sin(pitch),
            zero,
            up * np.cos(pitch) - along * np.sin(pitch),
        ],
        axis=1,
    )
    rate = np.stack([zero, -(pitch_rate + grade_dot), zero], axis=1)
    rate_dot = np.stack([zero, -(pitch_dot2 + np.gradient(grade_dot, dt)), zero], axis=1)
    moving = np.where(np.abs(v) > 1e-6, 1.0, 0.0)
    drive_force = model.mass * (moment + moving * model.rolling_resistance * G * np.cos(grade))
    angles = {
        "grade": grade,
        "bank": zero,
        "pitch": pitch,
        "roll": zero,
        "inclination": grade + pitch,
        "roll_total": zero,
    }
    signals = {"speed.v": v, "powertrain.drive_force": drive_force}
    signals |= {f"wheel_speeds.{wheel}": v for wheel in ("fl", "fr", "rl", "rr")}
    return Motion(
        time,
        force,
        rate,
        rate_dot,
        angles,
        signals,
        road_force=np.stack([along, zero, up], axis=1),
    )


@compiled
def _oscillator(
    target: Floats, omega: float, damping: float, dt: float, substeps: int
) -> tuple[Floats, Floats, Floats]:
    """p'' = omega^2 (target - p) - 2 damping omega p', semi-implicit Euler, from rest."""
    n = len(target)
    p, rate, accel = np.empty(n), np.empty(n), np.empty(n)
    h = dt / substeps
    p[0], rate[0], accel[0] = target[0], 0.0, 0.0
    angle, speed = target[0], 0.0
    for k in range(1, n):
        for j in range(substeps):
            share = (j + 1) / substeps
            now = target[k - 1] + share * (target[k] - target[k - 1])
            speed += h * (omega * omega * (now - angle) - 2 * damping * omega * speed)
            angle += h * speed
        p[k], rate[k] = angle, speed
        accel[k] = omega * omega * (target[k] - angle) - 2 * damping * omega * speed
    return p, rate, accel
