"""What `fusion` must not assume: a prior on how a road bends explains the springs.

A plain filter and smoother in NumPy over the model's own functions, with one state more: the road's
angle, which walks at random. `fusion` itself has no such state.
"""

import numpy as np
import pytest
from support.drives import simulated

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.fusion.body import body_pitch, body_roll
from roadlog.estimators.fusion.inputs import Inputs
from roadlog.estimators.fusion.mounting import mounting_prior
from roadlog.estimators.fusion.noise import noise_of
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.priors import priors
from roadlog.estimators.fusion.rauch_tung_striebel import noise_matrix, transition
from roadlog.estimators.fusion.recursion import prediction, soft_variance
from roadlog.estimators.fusion.rows import is_there, row
from roadlog.estimators.fusion.states import DRIVEN, DRIVERS, ROWS, N, State
from roadlog.estimators.fusion.steps import Sway, grid, table
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import Simulation
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

FREE = np.radians(50.0)  # rad/sqrt(s), of a road that may do what it likes
TIGHT = np.radians(0.02)  # rad, between the road's state and what the others make of it


def road(angle: str, x: Floats, s: Floats) -> tuple[float, Floats]:
    """The road's angle by the states of `fusion`, and its derivatives."""
    h = np.zeros(N + 1)
    if angle == "grade":
        h[[State.THETA, State.MOUNTING_PITCH, State.BODY_PITCH, State.PITCH_GRADIENT_SIDE]] = (
            1.0,
            -1.0,
            -1.0,
            -s[Sway.FORWARD_MAGNITUDE],
        )
        h[State.PITCH_GRADIENT] = -(
            s[Sway.FORWARD] - x[State.ACCEL_BIAS_X] - G * x[State.MOUNTING_PITCH]
        )
        return x[State.THETA] - x[State.MOUNTING_PITCH] - body_pitch(x, s), h
    h[[State.PHI, State.MOUNTING_ROLL, State.BODY_ROLL]] = 1.0, -1.0, -1.0
    h[State.ROLL_GRADIENT] = -(s[Sway.LATERAL] - x[State.ACCEL_BIAS_Y] - G * x[State.MOUNTING_ROLL])
    return x[State.PHI] - x[State.MOUNTING_ROLL] - body_roll(x, s), h


def walked(
    simulation: Simulation, vehicle: Vehicle, angle: str, walk: float
) -> tuple[float, Floats]:
    """Std of the angle's error, deg, and all states, where it walks by `walk` rad/sqrt(s)."""
    tables = [t for t in simulation.tables if t.topic in ("/imu", "/wheel_speeds")]
    drive, params = Drive.from_tables(tables), FusionParameters()
    inputs = Inputs.of(drive, vehicle, params, mounting_prior(vehicle, params))
    steps, noise = inputs.with_fixes(0.0), noise_of(inputs)
    mean, P0 = priors(inputs)
    x, P = np.append(steps.starts[0] + mean, 0.0), np.zeros((N + 1, N + 1))
    P[:N, :N], P[N, N] = P0, np.radians(10.0) ** 2
    records = table(steps, 0, len(steps.speed), noise.every).view(np.recarray)
    of_drive = noise.record(steps.dt)
    A, F, q = np.zeros((len(DRIVEN), DRIVERS)), np.eye(N + 1), np.zeros(N + 1)
    y, d, h = np.empty(N), np.empty(N), np.zeros(N)
    passed = []
    for k in range(len(steps.speed)):
        if k:
            prediction(x[:N], x[:N], records[k], of_drive, A, q, y, d)
            F = np.eye(N + 1)
            F[:N, :N] = transition(A, of_drive)
            x = np.append(y, x[N])
            P = F @ P @ F.T
            P[:N, :N] += noise_matrix(q)
            P[N, N] += walk**2 * steps.dt
        before = x, P
        for kind in range(ROWS):
            if is_there(kind, records[k + 1]):
                residual, sd, gate = row(kind, x[:N], records[k + 1], of_drive, h)
                x, P = updated(x, P, residual, np.append(h, 0.0), sd, gate)
        expected, of_road = road(angle, x[:N], steps.sway[k])
        of_road[N] = -1.0
        x, P = updated(x, P, x[N] - expected, of_road, TIGHT, 0.0)
        passed.append((F, *before, x, P))
    found = np.empty(len(passed))
    found[-1] = x[N]
    for k in range(len(passed) - 1, 0, -1):
        F, x_before, P_before, _, _ = passed[k]
        _, _, _, x_after, P_after = passed[k - 1]
        scale = 1 / np.sqrt(np.diag(P_before) + 1e-30)
        scaled = P_before * scale[:, None] * scale + 1e-12 * np.eye(N + 1)
        C = (scale[:, None] * np.linalg.solve(scaled, scale[:, None] * (F @ P_after))).T
        x = x_after + C @ (x - x_before)
        found[k - 1] = x[N]
    truth, time = simulation.table(TRUTH_TOPIC), grid(drive)
    at = (truth.time - drive.start_ns) * 1e-9
    counts = (time > at[0] + 5.0) & (time < at[-1] - 1.0)
    error = (found - np.interp(time, at, truth.columns[angle]))[counts]
    return float(np.degrees(error.std())), x[:N]


def updated(
    x: Floats, P: Floats, residual: float, h: Floats, sd: float, gate: float
) -> tuple[Floats, Floats]:
    spread = h @ P @ h
    gain = P @ h / (spread + soft_variance(residual, spread, sd, gate))
    P = P - np.outer(gain, h @ P)
    return x + gain * residual, 0.5 * (P + P.T)


@pytest.mark.parametrize(
    ("name", "angle", "walk_deg", "gain"),
    [
        ("luo2024-s2", "grade", 0.25, State.PITCH_GRADIENT),
        ("luo2024-s3b", "bank", 0.5, State.ROLL_GRADIENT),
    ],
)
def test_a_road_that_walks_at_random_explains_the_springs(
    name: str, angle: str, walk_deg: float, gain: int
) -> None:
    simulation = simulated(name, seed=1, full=True)
    place = simulation.vehicle.imu_position
    car = simulation.vehicle if angle == "bank" else Vehicle().with_values(imu_position=place)
    free, x = walked(simulation, car, angle, FREE)
    bound, drifted = walked(simulation, car, angle, np.radians(walk_deg))
    assert free < 0.06
    assert bound > 1.5 * free
    assert drifted[gain] > 1.3 * x[gain]
