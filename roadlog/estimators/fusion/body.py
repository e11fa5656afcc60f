"""The body on its springs: its pitch and roll against the road, written once.

Balance of moments: J angle'' = K f - angle - c angle', where angle'' is the acceleration against
the horizontal, which the gyro knows. The first two terms behind the lag c are `Steps.sway`; so
body motion that the road excites is separated from the road itself. What the sensor's bias and
mounting make of gravity is no force on the springs. Every function takes x (29,), s (6,), or,
`interpreted`, arrays of a whole drive under each state of x and each row of s.
Source: docs/methods/fusion.md#body-angles.
"""

from __future__ import annotations

from roadlog.estimators.fusion.states import State
from roadlog.estimators.fusion.steps import Sway
from roadlog.jit import compiled
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G


@compiled
def forward_force(x: Floats, s: Floats) -> float:
    """m/s2, longitudinal specific force that pitches the body."""
    return s[Sway.FORWARD] - x[State.ACCEL_BIAS_X] - G * x[State.MOUNTING_PITCH]


@compiled
def lateral_force(x: Floats, s: Floats) -> float:
    """m/s2, lateral specific force that rolls the body."""
    return s[Sway.LATERAL] - x[State.ACCEL_BIAS_Y] - G * x[State.MOUNTING_ROLL]


@compiled
def body_pitch(x: Floats, s: Floats) -> float:
    """rad, pitch of the body against the road, nose up."""
    return (
        x[State.PITCH_GRADIENT] * forward_force(x, s)
        + x[State.PITCH_GRADIENT_SIDE] * s[Sway.FORWARD_MAGNITUDE]
        + s[Sway.PITCH_INERTIA]
        + x[State.BODY_PITCH]
    )


@compiled
def body_roll(x: Floats, s: Floats) -> float:
    """rad, roll of the body against the road."""
    return x[State.ROLL_GRADIENT] * lateral_force(x, s) + s[Sway.ROLL_INERTIA] + x[State.BODY_ROLL]


@compiled
def body_pitch_row(gradient: float, force: float, s: Floats, h: Floats) -> None:
    """Derivatives of `body_pitch` into h (29,), at a gradient in rad/(m/s2) and a force in m/s2."""
    h[State.PITCH_GRADIENT], h[State.PITCH_GRADIENT_SIDE] = force, s[Sway.FORWARD_MAGNITUDE]
    h[State.ACCEL_BIAS_X], h[State.MOUNTING_PITCH] = -gradient, -G * gradient
    h[State.BODY_PITCH] = 1.0


@compiled
def body_roll_row(gradient: float, force: float, h: Floats) -> None:
    """Derivatives of `body_roll` into h (29,), likewise."""
    h[State.ROLL_GRADIENT] = force
    h[State.ACCEL_BIAS_Y], h[State.MOUNTING_ROLL] = -gradient, -G * gradient
    h[State.BODY_ROLL] = 1.0
