"""Jacobians of `fusion` against finite differences; docs/methods/fusion.md#process."""

import numpy as np
import pytest

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.fusion import model
from roadlog.estimators.fusion.inputs import build, with_fixes
from roadlog.estimators.fusion.model import N, Noise, Steps
from roadlog.estimators.fusion.priors import FusionParameters, mounting_prior, noise_of, priors
from roadlog.estimators.fusion.speed import speed_source
from roadlog.types import Floats

K = 500  # a step at which every row of the road is used
STEP = 1e-6


@pytest.fixture
def inputs(hill_drive: Drive) -> tuple[Steps, Noise, Floats]:
    """Steps with every row at K, the noise, and a state far from zero in every component."""
    vehicle, params = Vehicle(), FusionParameters()
    source = speed_source(hill_drive, vehicle)
    steps = build(hill_drive, vehicle, source, params.speed_sd, params.creep_speed_sd)
    steps = with_fixes(steps, hill_drive, source, 0.0)
    mean, P0 = priors(vehicle, params, source, mounting_prior(vehicle, params))
    noise = noise_of(steps, vehicle, params, hill_drive)
    steps.fixes[K] = 3.0, -8.0, 0.4, 2.0, 1.0, 0.1, 1.5, 0.0
    steps.speed[K] = 9.0
    steps.rate_at[K] = 0.1, -0.2, 0.3
    steps.sway[K] = 1.2, -2.0, -1.7, 1.3, 0.01, -0.02
    steps.antenna[:] = 0.3, -0.5, 1.1
    rng = np.random.default_rng(3)
    x = mean + np.sqrt(np.diag(P0)) * rng.standard_normal(N)
    x[[model.U, model.V, model.W]] = 9.0, 0.4, -0.3
    x[[model.PHI, model.THETA, model.PSI]] = 0.12, -0.08, 0.7
    return steps, noise, x


def test_transition_is_the_jacobian_of_the_process(inputs: tuple[Steps, Noise, Floats]) -> None:
    _, noise, x = inputs
    f, w, dt = np.array([1.0, -2.0, 9.6]), np.array([0.1, -0.2, 0.3]), 1e-3
    F = np.empty((N, N))
    model.transition(x, w, dt, noise, False, F)

    def rate(y: Floats) -> Floats:
        dx = np.empty(N)
        model.derivative(y, f, w, dx)
        return dx

    A = np.stack([(rate(x + e) - rate(x - e)) / (2 * STEP) for e in STEP * np.eye(N)], axis=1)
    expected = np.eye(N) + dt * A
    for state, time in (
        (model.EP, noise.body_time),
        (model.ER, noise.body_time),
        (model.HO, noise.altimeter_time),
        (model.HB, noise.barometer_time),
    ):
        expected[state, state] = np.exp(-dt / time)
    np.testing.assert_allclose(F, expected, atol=1e-6 * dt)


# derivatives that docs/methods/fusion.md#measurement-rows leaves out on purpose
BODY_PITCH = (model.MTHETA, model.EP, model.KTHETA, model.KSIDE)
BODY_ROLL = (model.MPHI, model.ER, model.KPHI, model.BA + 1)
OMITTED = {
    model.SPEED: (*BODY_PITCH, model.MPSI, model.V, model.W),
    model.SLIP: BODY_ROLL,
    model.CONTACT: BODY_ROLL,
}


@pytest.mark.parametrize("kind", range(model.ROWS))
def test_rows_are_the_jacobians_of_their_residuals(
    inputs: tuple[Steps, Noise, Floats], kind: int
) -> None:
    steps, noise, x = inputs
    steps.still[K] = model.STILL_VELOCITY <= kind < model.FIX
    h, unused = np.empty(N), np.empty(N)
    residual, sd, _ = model.row(kind, K, x, steps, noise, h)
    assert np.isfinite(residual)
    assert sd > 0
    expected = np.array(
        [
            model.row(kind, K, x - e, steps, noise, unused)[0]
            - model.row(kind, K, x + e, steps, noise, unused)[0]
            for e in STEP * np.eye(N)
        ]
    ) / (2 * STEP)
    omitted = list(OMITTED.get(kind, ()))
    assert np.all(h[omitted] == 0)
    expected[omitted] = 0
    if kind == model.SPEED:  # omitted as well: the body pitch's small share of the bias
        expected[model.BA] -= (1 + x[model.KAPPA]) * x[model.KTHETA] * x[model.W]
    np.testing.assert_allclose(h, expected, atol=1e-6)


def test_a_row_without_a_sample_is_no_row(inputs: tuple[Steps, Noise, Floats]) -> None:
    steps, noise, x = inputs
    h = np.empty(N)
    steps.speed[K] = np.nan
    assert np.isnan(model.row(model.SPEED, K, x, steps, noise, h)[0])
    assert np.isnan(model.row(model.SLIP, K + 1, x, steps, noise, h)[0])  # every 0.1 s only
