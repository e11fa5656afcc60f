"""The smoother of `fusion` against filterpy and against a dense batch solution."""

import numpy as np
import pytest

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.fusion.bryson_frazier import PIECE
from roadlog.estimators.fusion.inputs import Inputs
from roadlog.estimators.fusion.mounting import mounting_prior
from roadlog.estimators.fusion.noise import Noise, noise_of
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.priors import priors
from roadlog.estimators.fusion.rauch_tung_striebel import transition
from roadlog.estimators.fusion.recursion import prediction, residual_row
from roadlog.estimators.fusion.rows import is_there
from roadlog.estimators.fusion.smoother import smooth
from roadlog.estimators.fusion.states import DRIVEN, DRIVERS, ROWS, W_THETA, N, State
from roadlog.estimators.fusion.steps import Fix, Steps, table
from roadlog.types import Floats

LENGTH = 2 * PIECE + 44  # steps; no multiple of the checkpoints


@pytest.fixture
def problem(hill_drive: Drive) -> tuple[Steps, Noise, Floats]:
    """Six seconds with climb and two altitudes now and then, and a loop closure."""
    vehicle, params = Vehicle(), FusionParameters()
    inputs = Inputs.of(hill_drive, vehicle, params, mounting_prior(vehicle, params))
    steps, noise = inputs.with_fixes(0.0), noise_of(inputs)
    mean, P0 = priors(inputs)
    steps.starts[:] += mean
    cut = {
        name: values[:LENGTH].copy()
        for name, values in steps._asdict().items()
        if isinstance(values, np.ndarray) and len(values) > LENGTH
    }
    steps = steps._replace(**cut)
    steps.fixes[::20, 2] = 0.3
    steps.fixes[10::50, 3] = 1.0
    steps.fixes[15::50, Fix.BAROMETER] = 0.9
    steps.clone[60], steps.fixes[110, Fix.CLOSURE] = True, 0.0
    return steps, noise, P0


def with_gap(steps: Steps) -> Steps:
    """The IMU is away for a second; a new run begins behind it."""
    alive, start = steps.alive.copy(), steps.start.copy()
    alive[120:170] = False
    start[170] = 1
    return steps._replace(alive=alive, start=start, starts=np.repeat(steps.starts, 2, axis=0))


def noise_root(q: np.ndarray) -> np.ndarray:
    """Lower triangular, (29, 29), whose square is the process noise."""
    root = np.diag(np.sqrt(q[:N]))
    w, theta = State.W, State.THETA
    root[theta, w] = q[W_THETA] / root[w, w]
    root[theta, theta] = np.sqrt(q[theta] - root[theta, w] ** 2)
    return root


@pytest.mark.parametrize(("known", "look_ahead"), [(0, True), (170, True), (0, False)])
@pytest.mark.parametrize("gap", [False, True])
def test_engines_agree(
    problem: tuple[Steps, Noise, Floats], gap: bool, known: int, look_ahead: bool
) -> None:
    steps, noise, P0 = problem
    if gap:
        steps = with_gap(steps)
    steps.speed[60] += 3.0  # an outlier: the soft weight must agree as well
    at = smooth(steps, noise, P0).x[:known]
    compiled = smooth(steps, noise, P0, at, "compiled", look_ahead)
    reference = smooth(steps, noise, P0, at, "reference", look_ahead)
    for name in ("x", "variance", "shape_variance", "x_end", "P_end", "innovations"):
        np.testing.assert_allclose(
            getattr(compiled, name), getattr(reference, name), atol=1e-7, err_msg=name
        )
    np.testing.assert_allclose(compiled.variance, reference.variance, rtol=1e-7)


def test_without_looking_ahead_the_future_changes_nothing(
    problem: tuple[Steps, Noise, Floats],
) -> None:
    steps, noise, P0 = problem
    before = smooth(steps, noise, P0, look_ahead=False)
    steps.speed[200:] += 5.0
    after = smooth(steps, noise, P0, look_ahead=False)
    np.testing.assert_array_equal(after.x[:200], before.x[:200])
    assert np.abs(after.x[200:] - before.x[200:]).max() > 0.1


def test_equals_the_dense_batch_solution(problem: tuple[Steps, Noise, Floats]) -> None:
    """Linear case: the conditional mean of all states given all rows, by one dense solve."""
    steps, noise, P0 = problem
    noise = noise._replace(gate=0.0, still_gate=0.0)
    n = 200
    cut = {
        name: values[:n]
        for name, values in steps._asdict().items()
        if isinstance(values, np.ndarray) and len(values) == LENGTH
    }
    steps = steps._replace(**cut)
    at = smooth(steps, noise, P0).x
    smoothed = smooth(steps, noise, P0, at)
    # every state is mean + map @ e, e = start and process noise, of unit variance
    mean, spread = steps.starts[0].copy(), np.zeros((N, N * (n + 1)))
    spread[:, :N] = np.sqrt(P0)
    means, maps, rows, residuals, sds = [], [], [], [], []
    records = table(steps, 0, n, noise.every).view(np.recarray)
    of_drive = noise.record(steps.dt)
    A, q = np.zeros((len(DRIVEN), DRIVERS)), np.empty(N + 1)
    y, d, h = np.empty(N), np.empty(N), np.empty(N)
    for k in range(n):
        if k > 0:
            prediction(mean, at[k - 1], records[k], of_drive, A, q, y, d)
            if steps.clone[k]:
                y[State.KEPT_ALTITUDE] = mean[State.ALTITUDE]
            mean = y.copy()
            spread = transition(A, of_drive, steps.clone[k]) @ spread
            spread[:, N * k : N * (k + 1)] += noise_root(q)
        means.append(mean)
        maps.append(spread.copy())
        for kind in range(ROWS):
            if is_there(kind, records[k + 1]):
                residual, sd, _ = residual_row(kind, mean, at[k], records[k + 1], of_drive, h)
                rows.append(h @ spread)
                residuals.append(residual)
                sds.append(sd)
    A = np.array(rows)
    e = A.T @ np.linalg.solve(A @ A.T + np.diag(np.square(sds)), residuals)
    batch = np.array([m + s @ e for m, s in zip(means, maps, strict=True)])
    np.testing.assert_allclose(smoothed.x, batch, atol=1e-8)


def test_constants_learn_across_a_gap(problem: tuple[Steps, Noise, Floats]) -> None:
    """What one run of the IMU says of a bias holds in the run before it as well."""
    steps, noise, P0 = problem
    gap = with_gap(steps)
    gap.fixes[:170] = np.nan  # only the second run has GNSS
    first = gap._replace(alive=gap.alive & (np.arange(LENGTH) < 120))
    joint, alone = smooth(gap, noise, P0), smooth(first, noise, P0)
    assert np.isnan(joint.x[120:170]).all()
    assert (
        joint.P_end[State.ACCEL_BIAS_X, State.ACCEL_BIAS_X]
        < alone.P_end[State.ACCEL_BIAS_X, State.ACCEL_BIAS_X]
    )
    np.testing.assert_allclose(
        joint.x[50, State.ACCEL_BIAS_X], joint.x_end[State.ACCEL_BIAS_X], atol=1e-3
    )
    assert joint.variance[60, 0] < alone.variance[60, 0]
