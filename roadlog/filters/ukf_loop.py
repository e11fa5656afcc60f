"""Unscented Kalman filter over a drive that may freeze and start anew, on both engines.

While a sample is frozen (a stop, a gap) the leading states are not known and the others stay, with
their process noise; behind it the leading states start from what was measured.

A model is a NamedTuple of what its equations need, with three compiled functions of it
(`register`): numba picks them by the model's type, so the loop is written and compiled as one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from roadlog.filters import Engine
from roadlog.filters.ukf import (
    correct,
    correct_linear,
    keep_upright,
    mean_and_covariance,
    padded,
    reference_ukf,
    restart_state,
    sigma_points,
)
from roadlog.jit import argument, compiled, loaded, overload
from roadlog.types import Bools, Floats


class Tuning(NamedTuple):
    """Diagonals: Q (states,) per step, R (rows,), P0 (states,)."""

    Q: Floats
    R: Floats
    P0: Floats


class UkfTrack(NamedTuple):
    """x (n, states): posterior; sd (n, outputs): what the model's `spread` makes of the
    covariance; repaired (n,): a covariance was not positive definite."""

    x: Floats
    sd: Floats
    repaired: Bools


class Equations(NamedTuple):
    """process(model, x, k, y): the state one step on into y. measure(model, x, k, z): all rows into
    z. slopes(model, k, H): their derivatives into H (rows, padded), NaN in the first column of a
    row that is curved in the state. spread(model, P, sd): standard deviations into sd; outputs:
    their number. angle: state that must stay below the vertical, -1 for none."""

    process: Callable
    measure: Callable
    slopes: Callable
    spread: Callable
    outputs: int
    angle: int


_EQUATIONS: dict[type, Equations] = {}


def register(model: type, equations: Equations) -> None:
    """Say which equations a type of model has."""
    _EQUATIONS[model] = equations


def track(
    model: Any, z: Floats, start: Floats, frozen: Bools, tune: Tuning, engine: Engine
) -> UkfTrack:
    """Filter one run without gaps.

    z (n, rows): measured, NaN where not measured or not used. start (n, m): the first m states to
    start from, at the first sample and after a freeze; NaN keeps the state. frozen (n,).
    """
    equations = _EQUATIONS[type(model)]
    if engine == "reference":
        return _reference(model, equations, z, start, frozen, tune)
    sd = np.empty((len(z), equations.outputs))
    states, m = len(tune.P0), z.shape[1]
    sizes = padded(max(states, m)), padded(2 * states + 1)
    given = model, argument(z), argument(start), frozen, tune
    x, repaired = _compiled(*given, equations.angle, sd, *sizes)
    return UkfTrack(x, sd, repaired)


def _process(model: Any, x: Floats, k: int, y: Floats) -> None:
    raise NotImplementedError  # stands for the model's own in compiled code


def _measure(model: Any, x: Floats, k: int, z: Floats) -> None:
    raise NotImplementedError


def _slopes(model: Any, k: int, H: Floats) -> None:
    raise NotImplementedError


def _spread(model: Any, P: Floats, sd: Floats) -> None:
    raise NotImplementedError


def _of(model: Any) -> Equations | None:
    """Equations of a model's numba type."""
    is_model = isinstance(model, loaded().types.NamedTuple)
    return _EQUATIONS.get(model.instance_class) if is_model else None


@overload(_process)
def _process_of(model, x, k, y):  # type: ignore[no-untyped-def]  # noqa: ARG001
    equations = _of(model)
    if equations is None:
        return None
    process = equations.process

    def own(model, x, k, y):  # type: ignore[no-untyped-def]
        process(model, x, k, y)

    return own


@overload(_measure)
def _measure_of(model, x, k, z):  # type: ignore[no-untyped-def]  # noqa: ARG001
    equations = _of(model)
    if equations is None:
        return None
    measure = equations.measure

    def own(model, x, k, z):  # type: ignore[no-untyped-def]
        measure(model, x, k, z)

    return own


@overload(_slopes)
def _slopes_of(model, k, H):  # type: ignore[no-untyped-def]  # noqa: ARG001
    equations = _of(model)
    if equations is None:
        return None
    slopes = equations.slopes

    def own(model, k, H):  # type: ignore[no-untyped-def]
        slopes(model, k, H)

    return own


@overload(_spread)
def _spread_of(model, P, sd):  # type: ignore[no-untyped-def]  # noqa: ARG001
    equations = _of(model)
    if equations is None:
        return None
    spread = equations.spread

    def own(model, P, sd):  # type: ignore[no-untyped-def]
        spread(model, P, sd)

    return own


@compiled
def _restart(x: Floats, P: Floats, start: Floats, P0: Floats) -> None:
    for i in range(len(start)):
        restart_state(x, P, i, start[i] if np.isfinite(start[i]) else x[i], P0[i])


@compiled
def _curved(z: Floats, H: Floats) -> bool:
    """Whether the state bends one of the measurements that are there."""
    curved = False
    for row in range(len(z)):
        curved |= np.isfinite(z[row]) and np.isnan(H[row, 0])
    return curved


@compiled
def _compiled(
    model: Any,
    z: Floats,
    start: Floats,
    frozen: Bools,
    tune: Tuning,
    angle: int,
    sd: Floats,
    width: int,
    span: int,
) -> tuple[Floats, Bools]:
    """width, span: of a row over the states or the measurements, and of one over sigma points."""
    n, states, points, m = len(z), len(tune.P0), 2 * len(tune.P0) + 1, z.shape[1]
    xs, repaired = np.empty((n, states)), np.zeros(n, np.bool_)
    x, P, U = np.zeros(states), np.zeros((states, width)), np.zeros((states, width))
    for i in range(states):
        P[i, i] = tune.P0[i]
    X, Y = np.empty((points, states)), np.empty((points, states))
    Z, work, H = np.empty((points, m)), np.zeros((3, m, width)), np.zeros((m, width))
    D = np.zeros((max(states, m), span))
    _restart(x, P, start[0], tune.P0)
    for k in range(n):
        if frozen[k]:
            for i in range(start.shape[1], states):
                P[i, i] += tune.Q[i]
        else:
            if k > 0 and frozen[k - 1]:
                _restart(x, P, start[k], tune.P0)
            elif k > 0:
                repaired[k] = sigma_points(x, P, U, X)
                for p in range(points):
                    _process(model, X[p], k, Y[p])
                mean_and_covariance(Y, tune.Q, x, P, D)
            _slopes(model, k, H)
            if _curved(z[k], H):
                repaired[k] |= sigma_points(x, P, U, X)
                for p in range(points):
                    _measure(model, X[p], k, Z[p])
                correct(x, P, U, Z, z[k], tune.R, D, work)
            else:
                _measure(model, x, k, Z[0])
                for i in range(states):
                    work[1, 0, i] = x[i]
                correct_linear(x, P, z[k], Z[0], H, tune.R, work[:, 0])
            if angle >= 0:
                keep_upright(x, P, angle, tune.P0[angle])
        for i in range(states):
            xs[k, i] = x[i]
        _spread(model, P, sd[k])
    return xs, repaired


def _reference(
    model: Any, equations: Equations, z: Floats, start: Floats, frozen: Bools, tune: Tuning
) -> UkfTrack:
    n, states = len(z), len(tune.P0)
    xs, sd = np.empty((n, states)), np.empty((n, equations.outputs))
    x, P = np.zeros(states), np.diag(tune.P0)
    _restart(x, P, start[0], tune.P0)
    ukf = reference_ukf(x, P, tune.Q)
    kept = np.where(np.arange(states) < start.shape[1], 0.0, tune.Q)

    def fx(x: Floats, _dt: float, k: int) -> Floats:
        y = np.empty(states)
        equations.process(model, x, k, y)
        return y

    def hx(x: Floats, k: int, known: Any) -> Floats:
        rows = np.empty(z.shape[1])
        equations.measure(model, x, k, rows)
        return rows[known]

    for k in range(n):
        if frozen[k]:
            ukf.P += np.diag(kept)
        else:
            if k > 0 and frozen[k - 1]:
                _restart(ukf.x, ukf.P, start[k], tune.P0)
                ukf.sigmas_f = ukf.points_fn.sigma_points(ukf.x, ukf.P)
            elif k > 0:
                ukf.predict(fx=fx, k=k)
            known = np.flatnonzero(np.isfinite(z[k]))
            if len(known):
                ukf.update(z[k][known], R=np.diag(tune.R[known]), hx=hx, k=k, known=known)
            if equations.angle >= 0:
                angle = equations.angle
                keep_upright(ukf.x, ukf.P, angle, tune.P0[angle])
        xs[k] = ukf.x
        equations.spread(model, np.asarray(ukf.P), sd[k])
    return UkfTrack(xs, sd, np.zeros(n, np.bool_))
