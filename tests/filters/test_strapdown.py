"""Strapdown integration: turns, both directions of time, and an independent attitude."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from roadlog.estimators.kim2023.strapdown import (
    StrapdownStart,
    attitude,
    dead_reckon,
    nose_up,
    to_navigation,
    turn,
)
from roadlog.units import STANDARD_GRAVITY as G


def test_two_seconds_at_20_degrees_per_second_turn_by_40_degrees() -> None:
    q = attitude(0.0, 0.0)
    for _ in range(200):
        q = turn(q, 0.0, -np.radians(20.0), 0.0, 0.01)
    assert np.degrees(nose_up(q)) == pytest.approx(40.0, abs=1e-9)


def test_turning_back_in_time_returns() -> None:
    rng = np.random.default_rng(3)
    rates = rng.normal(0, 0.5, (500, 3))
    start = attitude(0.05, -0.02)
    q = start
    for w in rates:
        q = turn(q, *w, 0.01)
    for w in rates[::-1]:
        q = turn(q, *w, -0.01)
    assert np.abs(q - start).max() < 1e-12


def test_turn_and_rotation_agree_with_scipy() -> None:
    rng = np.random.default_rng(4)
    q = attitude(0.1, 0.2)
    # yaw 0, pitch about +y is nose down, roll about +x is right side down
    oracle = Rotation.from_euler("ZYX", [0.0, -0.1, 0.2])
    for w in rng.normal(0, 2.0, (100, 3)):
        q = turn(q, *w, 0.01)
        oracle = oracle * Rotation.from_rotvec(w * 0.01)
    vector = np.array([1.0, -2.0, 3.0])
    assert np.allclose(to_navigation(q, *vector), oracle.apply(vector), atol=1e-13)


@pytest.mark.parametrize("engine", ["compiled", "reference"])
@pytest.mark.parametrize("trapezoid", [True, False])
def test_forward_and_reverse_find_the_same_slope(engine: str, trapezoid: bool) -> None:
    grade, pitch = np.arctan(0.05), np.radians(0.5)
    incl = grade + pitch
    n, accel = 301, 1.5
    standing = np.array([G * np.sin(incl), 0.0, G * np.cos(incl)])
    # constant from sample 1 on: the rectangle's first step stands still
    moving = standing + accel * np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
    forward = np.tile(moving, (n, 1))
    rate = np.zeros((n, 3))
    q = attitude(incl, 0.0)
    paths = [
        dead_reckon(
            sign * (forward - standing) + standing,
            rate,
            h,
            StrapdownStart(q, G),
            2.0,
            trapezoid=trapezoid,
            engine=engine,
        )
        for sign, h in ((1.0, 0.01), (-1.0, -0.01))
    ]
    for path in paths:
        assert np.degrees(path.slope - grade) == pytest.approx(0.0, abs=1e-6)
        assert path.s[-1] >= 2.0
        assert path.s[-2] < 2.0
        assert path.chord_deviation < 1e-9
    # braking: going back in time the car moves backward, where it came from
    assert paths[0].x[-1] > 0 > paths[1].x[-1]


def test_engines_agree() -> None:
    rng = np.random.default_rng(5)
    force = rng.normal([1.0, 0.0, G], 0.3, (200, 3))
    rate = rng.normal(0, 0.1, (200, 3))
    lever, v = np.array([1.9, 0.2, -0.3]), np.array([0.01, 0.0, 0.02])
    start = StrapdownStart(attitude(0.03, 0.01), G, v, lever)
    both = [
        dead_reckon(force, rate, -0.01, start, 1e9, engine=engine)
        for engine in ("compiled", "reference")
    ]
    for name in ("s", "x", "y", "z", "inclination"):
        assert np.allclose(getattr(both[0], name), getattr(both[1], name), atol=1e-12, rtol=0)


def test_a_body_that_rocks_about_the_followed_point_leaves_no_path() -> None:
    t = np.arange(301) * 0.01
    lever = np.array([1.9, 0.0, 0.0])
    theta = np.radians(0.4) * np.exp(-2.6 * t) * np.cos(7.4 * t)
    velocity, acceleration = np.gradient(theta, 0.01), np.gradient(np.gradient(theta, 0.01), 0.01)
    force = np.stack(
        [G * np.sin(theta) - 1.9 * velocity**2, 0 * t, G * np.cos(theta) + 1.9 * acceleration], 1
    )
    rate = np.stack([0 * t, -velocity, 0 * t], 1)
    start = np.array([-np.sin(theta[0]), 0.0, np.cos(theta[0])]) * 1.9 * velocity[0]
    q = attitude(theta[0], 0.0)
    path = dead_reckon(force, rate, 0.01, StrapdownStart(q, G, start, lever), 2.0)
    held = dead_reckon(force, rate, 0.01, StrapdownStart(q, G), 2.0)
    assert np.abs(path.z).max() < 1e-3
    assert np.abs(held.z).max() > 1e-2
