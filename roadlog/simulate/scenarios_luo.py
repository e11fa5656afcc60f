"""Scenarios of Luo 2024.

Source: docs/methods/luo2024.md."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.simulate.profiles import Knots, Sine
from roadlog.simulate.scenario import RoadShape, Scenario

CLASS_A = 16e-6  # m3, ISO 8608
_RAMP = "(0,-1.8)(27,-1.8)(35.7,3.4)(57,3.4)(69,-3.9)(88,-3.9)(98,1)(107,1)(112,-1.5)(118,0)"
_S2_SPEED = (
    "(0,9.7)(5,9.7)(12.3,6.4)(21,6.4)(29,10.8)(46,10.8)(54,7.6)(68,7.6)(73,9.6)(78,7.4)(81,7.4)"
    "(85.6,11)(90,8.2)(95,11.2)(107,9.2)"
)
_S3_BENDS = "(5,12,90)(21,29,-80)(36,68,60)(76,92,-70)(98,107,90)"  # s, s, m left +
_S3_ENTRY = 40.0  # m, over which a bend comes in and goes out
_STEEPEST_BANK, _AT_CURVATURE = -0.04, 1 / 60  # superelevation of s3b


def tuples(text: str) -> list[tuple[float, ...]]:
    """Numbers of a profile written as (t, value)(t, value)."""
    groups = text.strip("()").split(")(")
    return [tuple(float(x) for x in group.split(",")) for group in groups]


def _at_time(t: float) -> float:
    """m along the ramp road at a time of the constant-speed drive."""
    return 48.5 + 9.7 * t


def _bends(speed: Knots) -> tuple[tuple[float, float], ...]:
    """Curvature over distance from bends that are given in time."""
    time = np.arange(0.0, 120.0, 0.01)
    v = speed.sample(time)
    distance = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2 * 0.01)]) + _at_time(0.0)
    points = []
    for t0, t1, radius in tuples(_S3_BENDS):
        first, last = np.interp([t0, t1], time, distance)
        half = _S3_ENTRY / 2
        points += [(first - half, 0.0), (first + half, 1 / radius)]
        points += [(last - half, 1 / radius), (last + half, 0.0)]
    return tuple((float(s), float(bend)) for s, bend in points)


def luo() -> list[Scenario]:
    """The paper's simulations, its test roads as far as it describes them, and what it lacks."""
    return [*_simulations(), *_test_roads()]


def _simulations() -> list[Scenario]:
    ramp = Knots(tuple((_at_time(t), p / 100) for t, p in tuples(_RAMP)), (10.0,))
    speed = Knots(tuple((t, v) for t, v in tuples(_S2_SPEED)), (0.8,), over="time")
    bends = Knots(_bends(speed))
    gain = _STEEPEST_BANK / _AT_CURVATURE
    bank = Knots(tuple((s, gain * bend) for s, bend in bends.points))
    s1 = Scenario(
        "luo2024-s1",
        "straight ramps of -3.9 to +3.4 % at 9.7 m/s (118 s)",
        9.7,
        RoadShape(grade=ramp, roughness=CLASS_A),
        duration=118.0,
    )
    s2 = replace(s1, name="luo2024-s2", summary="the same ramps at 6 to 11 m/s", speed=speed)
    s3 = replace(
        s2,
        name="luo2024-s3",
        summary="the same ramps and speeds through bends of 60 to 90 m radius",
        road=replace(s1.road, curvature=bends),
    )
    s3b = replace(
        s3,
        name="luo2024-s3b",
        summary="the same bends with superelevation",
        road=replace(s3.road, bank=bank),
    )
    return [s1, s2, s3, s3b]


def _test_roads() -> list[Scenario]:
    road1 = Scenario(
        "luo2024-road1",
        "straight slope to 6 % at a wavering 7 m/s (25 s)",
        Sine(7.0, 0.8, 9.0),
        RoadShape(
            grade=Knots(((40.0, 0.0), (60.0, 0.045), (110.0, 0.06), (150.0, 0.05), (190.0, 0.055))),
            roughness=CLASS_A,
        ),
        duration=25.0,
    )
    road2 = Scenario(
        "luo2024-road2",
        "5 % slope through a bend of 30 m radius at 7 m/s (19 s)",
        7.0,
        RoadShape(
            grade=Knots(((40.0, 0.02), (60.0, 0.05))),
            curvature=Knots(((50.0, 0.0), (70.0, 1 / 30))),
            roughness=CLASS_A,
        ),
        duration=19.0,
    )
    helix = Scenario(
        "luo2024-helix",
        "5 % spiral of 25 m radius at 8 m/s (40 s)",
        8.0,
        RoadShape(grade=0.05, curvature=Knots(((60.0, 0.0), (80.0, 1 / 25))), roughness=CLASS_A),
        duration=40.0,
    )
    stopgo = Scenario(
        "luo2024-stopgo",
        "stop with held brakes on a 4 % slope and drive on (40 s)",
        Knots(((0.0, 9.0), (8.0, 9.0), (14.0, 0.0), (20.0, 0.0), (26.0, 7.0)), over="time"),
        RoadShape(grade=Knots(((60.0, 0.01), (90.0, 0.04))), roughness=CLASS_A),
        duration=40.0,
    )
    return [road1, road2, helix, stopgo]
