"""Jacobians of `fusion` against finite differences; docs/methods/fusion.md#process."""

import numpy as np
import pytest

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.fusion import model
from roadlog.estimators.fusion.body import body_pitch, body_roll
from roadlog.estimators.fusion.inputs import Inputs
from roadlog.estimators.fusion.mounting import mounting_prior
from roadlog.estimators.fusion.noise import Noise, noise_of
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.priors import priors
from roadlog.estimators.fusion.rauch_tung_striebel import transition
from roadlog.estimators.fusion.rows import is_there, row
from roadlog.estimators.fusion.states import DRIVEN, DRIVERS, FIRST_FIX, ROWS, N, Row, State
from roadlog.estimators.fusion.steps import Steps, Sway, table
from roadlog.types import Floats, Record

K = 500  # a step at which every row of the road is used
STEP = 1e-6


@pytest.fixture
def inputs(hill_drive: Drive) -> tuple[Steps, Noise, Floats]:
    """Steps with every row at K, the noise, and a state far from zero in every component."""
    vehicle, params = Vehicle(), FusionParameters()
    inputs = Inputs.of(hill_drive, vehicle, params, mounting_prior(vehicle, params))
    steps, noise = inputs.with_fixes(0.0), noise_of(inputs)
    mean, P0 = priors(inputs)
    steps.fixes[K] = 3.0, -8.0, 0.4, 2.0, 1.0, 0.1, 1.5, 0.0
    steps.speed[K] = 9.0
    steps.rate_at[K] = 0.1, -0.2, 0.3
    steps.sway[K] = 1.2, -2.0, -1.7, 1.3, 0.01, -0.02
    steps.antenna[:] = 0.3, -0.5, 1.1
    rng = np.random.default_rng(3)
    x = mean + np.sqrt(np.diag(P0)) * rng.standard_normal(N)
    x[[State.U, State.V, State.W]] = 9.0, 0.4, -0.3
    x[[State.PHI, State.THETA, State.PSI]] = 0.12, -0.08, 0.7
    return steps, noise, x


def at(k: int, steps: Steps, noise: Noise) -> Record:
    """Step k as the kernels see it."""
    return table(steps, k, k + 1, noise.every).view(np.recarray)[1]


def test_transition_is_the_jacobian_of_the_process(inputs: tuple[Steps, Noise, Floats]) -> None:
    steps, noise, x = inputs
    f, w, dt = np.array([1.0, -2.0, 9.6]), np.array([0.1, -0.2, 0.3]), 1e-3
    steps.rate[K] = w
    A = np.zeros((len(DRIVEN), DRIVERS))
    model.coupling(x, at(K, steps._replace(dt=dt), noise), A)
    F = transition(A, noise.record(dt))

    def rate(y: Floats) -> Floats:
        dx = np.zeros(N)
        model.derivative(y, f, w, dx)
        return dx

    A = np.stack([(rate(x + e) - rate(x - e)) / (2 * STEP) for e in STEP * np.eye(N)], axis=1)
    expected = np.eye(N) + dt * A
    for state, time in (
        (State.BODY_PITCH, noise.body_time),
        (State.BODY_ROLL, noise.body_time),
        (State.RECEIVER_ERROR, noise.altimeter_time),
        (State.BAROMETER_ERROR, noise.barometer_time),
    ):
        expected[state, state] = np.exp(-dt / time)
    np.testing.assert_allclose(F, expected, atol=1e-6 * dt)


# derivatives that docs/methods/fusion.md#measurement-rows leaves out on purpose
BODY_PITCH = (
    State.MOUNTING_PITCH,
    State.BODY_PITCH,
    State.PITCH_GRADIENT,
    State.PITCH_GRADIENT_SIDE,
)
BODY_ROLL = (State.MOUNTING_ROLL, State.BODY_ROLL, State.ROLL_GRADIENT, State.ACCEL_BIAS_Y)
OMITTED = {
    Row.SPEED: (*BODY_PITCH, State.MOUNTING_YAW, State.V, State.W),
    Row.SLIP: BODY_ROLL,
    Row.CONTACT: BODY_ROLL,
}


@pytest.mark.parametrize("levers", [1.0, 0.0])
@pytest.mark.parametrize("kind", range(ROWS))
def test_rows_are_the_jacobians_of_their_residuals(
    inputs: tuple[Steps, Noise, Floats], kind: int, levers: float
) -> None:
    """levers: 0 of a shaken sensor, whose rows leave out what holds the noise of the force."""
    steps, noise, x = inputs
    assert noise.levers == 1.0
    noise = noise._replace(levers=levers)
    steps.still[K] = Row.STILL_U <= kind < FIRST_FIX
    h, unused = np.empty(N), np.empty(N)
    s, of_drive = at(K, steps, noise), noise.record(steps.dt)
    assert is_there(kind, s)
    _, sd, _ = row(kind, x, s, of_drive, h)
    assert sd > 0
    expected = np.array(
        [
            row(kind, x - e, s, of_drive, unused)[0] - row(kind, x + e, s, of_drive, unused)[0]
            for e in STEP * np.eye(N)
        ]
    ) / (2 * STEP)
    omitted = list(OMITTED.get(kind, ()))
    assert np.all(h[omitted] == 0)
    expected[omitted] = 0
    if kind == Row.SPEED:  # omitted as well: the body pitch's small share of the bias
        expected[State.ACCEL_BIAS_X] -= (
            (1 + x[State.SPEED_SCALE]) * x[State.PITCH_GRADIENT] * x[State.W]
        )
    if kind == Row.SLIP and not levers:
        expected[State.U] -= x[State.SLIP_GRADIENT] * s.sway[Sway.TIRE]
        expected[State.W] = 0.0
    if kind == Row.CONTACT and not levers:
        expected[State.U] -= body_pitch(x, s.sway)
        expected[State.V] -= body_roll(x, s.sway)
    np.testing.assert_allclose(h, expected, atol=1e-6)


def test_a_row_without_a_sample_is_no_row(inputs: tuple[Steps, Noise, Floats]) -> None:
    steps, noise, _ = inputs
    assert is_there(Row.SPEED, at(K, steps, noise))
    steps.speed[K] = np.nan
    assert not is_there(Row.SPEED, at(K, steps, noise))
    assert is_there(Row.SLIP, at(K, steps, noise))
    assert not is_there(Row.SLIP, at(K + 1, steps, noise))  # every 0.1 s only
