"""What the smoother of `fusion` is to solve, with noise and mounting as the drive shows them.

Source: docs/methods/fusion.md#innovations, docs/methods/fusion.md#mounting.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimators.fusion.bryson_frazier import filtered
from roadlog.estimators.fusion.innovations import CHANGED, misfit, scales
from roadlog.estimators.fusion.inputs import Inputs
from roadlog.estimators.fusion.mounting import Mounting, mounting_prior, straightened
from roadlog.estimators.fusion.noise import Noise, noise_of
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.priors import priors
from roadlog.estimators.fusion.speed import gnss_delay
from roadlog.estimators.fusion.states import CONSTANTS, GYRO_BIAS, Row, State
from roadlog.estimators.fusion.steps import Steps, beginning, last
from roadlog.types import Floats
from roadlog.units import DEG

MAX_ROUNDS = 4  # of adapting
RELIEVED = 0.8  # share to which a bias that walks faster must bring a misfit to be its cause
GOOD_GYRO, LIKE_OTHERS = 0.3 * DEG, 2.0  # rad/s, and times the largest bias that was found


@dataclass(frozen=True)
class Fit:
    """What the smoother is given. steps: with fixes. P0 (29, 29): prior of all states.

    late_receiver: it lies further from the car's own speed than is looked for. doubts: sentences on
    constants that no car has.
    """

    inputs: Inputs
    steps: Steps
    P0: Floats
    noise: Noise
    late_receiver: bool = False
    doubts: tuple[str, ...] = ()


def fitted(drive: Drive, vehicle: Vehicle, params: FusionParameters) -> Fit:
    """With the noise that the drive shows, and the IMU turned until it is straight."""

    def begun(mounting: Mounting) -> Fit:
        return begin(Inputs.of(drive, vehicle, params, mounting))

    fit = begun(mounting_prior(vehicle, params))
    for _ in range(MAX_ROUNDS):
        fit, x = _adapted(fit)
        fit = replace(fit, P0=_alike(fit.P0, x[last(beginning(fit.steps))]))
        turned = straightened(beginning(fit.steps), fit.inputs.mounting, x)
        if turned is None or not params.smooth:
            break
        fit = begun(turned)
    return fit


def begin(inputs: Inputs) -> Fit:
    """With priors, the noise as it is set, and the receiver's fixes at their own times."""
    mean, P0 = priors(inputs)
    noise = noise_of(inputs)
    delay, beyond = gnss_delay(inputs.drive, inputs.source)
    if (
        delay and inputs.source.name != "gnss"
    ):  # behind a speed that may be late itself: by how much follows from the IMU
        alone = beginning(_started(inputs.steps, mean))
        late = float(filtered(alone, noise, P0)[0][last(alone), State.SPEED_DELAY])
        delay += late if abs(late) > inputs.steps.dt / 2 else 0.0  # counts at the nearest step
    return Fit(inputs, _started(inputs.with_fixes(delay), mean), P0, noise, beyond)


def _started(steps: Steps, mean: Floats) -> Steps:
    """With the constants begun at their prior mean (29,)."""
    return steps._replace(starts=steps.starts + mean)


def _adapted(fit: Fit) -> tuple[Fit, Floats]:
    """With the noise that the innovations show; and the filter's states of the beginning."""
    steps = beginning(fit.steps)
    fit, x, innovations = _wandering(fit, steps)
    if not _is_wrong(scales(innovations, steps.dt)):
        return fit, x
    known = knowing(steps, x[last(steps)])
    scale = scales(filtered(known, fit.noise, fit.P0)[1], steps.dt)
    if not _is_wrong(scale):
        return fit, x
    fit = replace(fit, noise=fit.noise._replace(scale=scale))
    return fit, filtered(steps, fit.noise, fit.P0)[0]


def _wandering(fit: Fit, steps: Steps) -> tuple[Fit, Floats, Floats]:
    """With biases of the accelerometer that wander as fast as the innovations say.

    Drift is the one slow error that the contact with the road sees: where a faster walk does not
    relieve that row, the cause is another. The other axes follow where that explains the speed row.
    Also the filter's states and innovations (n, ROWS).
    """

    def tried(noise: Noise) -> tuple[Fit, Floats, Floats]:
        return replace(fit, noise=noise), *filtered(steps, noise, fit.P0)

    def wrong(run: tuple[Fit, Floats, Floats], row: Row) -> float:
        return float(misfit(run[2], steps.dt)[row])

    best = tried(fit.noise)
    walk = fit.noise.vertical_bias
    while (m := wrong(best, Row.CONTACT)) > CHANGED:
        faster = tried(fit.noise._replace(vertical_bias=m * walk))
        if wrong(faster, Row.CONTACT) > RELIEVED * m:
            break
        best, walk = faster, m * walk
    if walk > fit.noise.vertical_bias:
        alike = tried(fit.noise._replace(vertical_bias=walk, accel_bias=walk))
        if wrong(alike, Row.SPEED) < min(CHANGED, RELIEVED * wrong(best, Row.SPEED)):
            return alike
    return best


def _alike(P0: Floats, x: Floats) -> Floats:
    """P0 with gyro biases that are as likely as those found, x (29,): the axes share a housing.

    The speed shows that of the pitch rate in every drive; those of roll and yaw look like a bank on
    a straight road without a stop.
    """
    sd, P0 = max(LIKE_OTHERS * float(np.abs(x[GYRO_BIAS]).max()), GOOD_GYRO), P0.copy()
    for axis in (State.GYRO_BIAS_X, State.GYRO_BIAS_Z):
        P0[axis, axis] = min(P0[axis, axis], sd**2)
    return P0


def _is_wrong(scale: Floats) -> bool:
    return bool(np.any(scale > CHANGED))


def knowing(steps: Steps, x: Floats) -> Steps:
    """Begun at the constants of x (29,), as they are known from the whole drive."""
    starts = steps.starts.copy()
    starts[:, CONSTANTS] = x[list(CONSTANTS)]
    return steps._replace(starts=starts)
