"""Fixed-interval smoother for the model of `fusion`: what it gives, and the choice of engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from roadlog.estimators.fusion.bryson_frazier import bryson_frazier
from roadlog.estimators.fusion.noise import Noise
from roadlog.estimators.fusion.recursion import OWN_STATES
from roadlog.estimators.fusion.states import N
from roadlog.estimators.fusion.steps import Steps
from roadlog.filters import Engine
from roadlog.types import Floats

ALL = range(N)


@dataclass(frozen=True)
class Smoothed:
    """x (n, states): smoothed states, or the filter's own; NaN where the IMU is missing.

    variance (n, 6): rad2, of the outputs, at every tenth of a second and the ends of a run of the
    IMU, NaN elsewhere. shape_variance (n, 2): of grade and bank if the OFFSETS were known. x_end,
    P_end: states and covariance after the last step; for the constants, of the whole drive.
    innovations (n, 17): residual of each row over its sd as the filter predicted it, NaN without.
    """

    x: Floats
    variance: Floats
    shape_variance: Floats
    x_end: Floats
    P_end: Floats
    innovations: Floats


def smooth(
    steps: Steps,
    noise: Noise,
    P0: Floats,
    at: Floats = OWN_STATES,
    engine: Engine = "compiled",
    look_ahead: bool = True,
    states: Sequence[int] = ALL,
) -> Smoothed:
    """All states from all measurements. P0 (29, 29): before the first step.

    at (m, 29): states of an earlier run, at which the first m steps are linearised (iterated
    smoother); the others are at the filter's own. look_ahead: without it each step's states are
    the filter's, from the past alone. states: those that x is wanted of; one takes 1.4 MB an hour.
    """
    if engine == "reference":
        from roadlog.estimators.fusion.rauch_tung_striebel import rauch_tung_striebel as run
    else:
        run = bryson_frazier
    return Smoothed(*run(steps, noise, P0, at, look_ahead, states))
