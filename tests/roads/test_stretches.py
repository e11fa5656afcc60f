"""Which passes go over the same road: circles, turns, carriageways, crossings, holes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.mountain_road import HOME, driven

from roadlog.roads.merge import roads
from roadlog.roads.model import RoadModel, road_of
from roadlog.roads.passes import Pass
from roadlog.roads.way import STEP
from roadlog.types import Bools

FINE = 0.5  # m
TURN = 2 * np.pi


def line(*pieces: tuple[float, float], y: float = 0.0, heading: float = 0.0) -> RoadModel:
    """A road east from (0, y) by pieces of a length in m, each turning left by an angle in rad."""
    counts = [max(1, round(length / FINE)) for length, _ in pieces]
    turns = np.concatenate(
        [np.full(n, angle / n) for n, (_, angle) in zip(counts, pieces, strict=True)]
    )
    course = heading + np.concatenate([[0.0], np.cumsum(turns)])
    middle = 0.5 * (course[1:] + course[:-1])
    x = FINE * np.concatenate([[0.0], np.cumsum(np.cos(middle))])
    across = FINE * np.concatenate([[0.0], np.cumsum(np.sin(middle))])
    s = FINE * np.arange(len(x))
    grade = 0.03 * np.sin(s / 60)
    z = np.cumsum(grade) * FINE
    bank = 0.05 * np.sin(s / 40)
    whole = road_of("line", HOME, x, y + across, z, np.arctan(grade), bank, course, s)
    return whole.at(np.arange(0.0, s[-1], STEP))


def circle(radius: float, laps: float, side: int = 1) -> tuple[float, float]:
    return TURN * radius * laps, side * TURN * laps


def kept(own: Pass, where: Bools) -> Pass:
    """A pass without some of its points."""
    columns = {
        name: value[where] for name, value in vars(own).items() if isinstance(value, np.ndarray)
    }
    return replace(own, **columns)


@pytest.mark.parametrize(("radius", "laps"), [(10, 30), (12, 30), (15, 12), (30, 5), (60, 3)])
def test_a_circle_is_driven_many_times(radius: float, laps: int) -> None:
    (found,) = roads([driven(line(circle(radius, laps)), 1)])
    assert found.length == pytest.approx(TURN * radius, abs=13.0)
    assert np.median(found.passes) == pytest.approx(laps, abs=1)
    assert not found.both_ways


def test_a_circle_smaller_than_any_road_is_none() -> None:
    assert roads([driven(line(circle(6, 20)), 1)]) == []
    (found,) = roads([driven(line((400, 0), circle(6, 4), (400, 0)), 1)])[:1]
    assert 300 < found.length < 450


@pytest.mark.parametrize("radius", [15.25, 40])
def test_a_figure_of_eight_is_one_road(radius: float) -> None:
    (found,) = roads([driven(line(*[circle(radius, 1), circle(radius, 1, -1)] * 6), 1)])
    assert found.length == pytest.approx(2 * TURN * radius, abs=20.0)
    assert np.median(found.passes) >= 5


def test_a_closed_track_is_whole() -> None:
    lap = [(200, 0), (50 * np.pi, np.pi), (200, 0), (50 * np.pi, np.pi)]
    track = line(*lap * 5)
    (found,) = roads([driven(track, 1), driven(track, 2, forward=False)])
    assert found.length == pytest.approx(400 + 100 * np.pi, abs=15.0)
    assert np.median(found.passes) == 10
    assert found.both_ways


def test_a_roundabout_driven_round_and_back_out() -> None:
    away = (10 * np.pi / 2, -np.pi / 2)
    out_and_back = line((300, 0), away, circle(12, 0.999), away, (300, 0))
    (found,) = roads([driven(out_and_back, 0)])
    assert found.length == pytest.approx(out_and_back.length - 40, rel=0.02)
    assert found.passes.max() == 1


@pytest.mark.parametrize("apart", [6.0, 12.0])
def test_after_a_u_turn_the_other_lane_is_the_road_and_the_other_carriageway_is_none(
    apart: float,
) -> None:
    """6 m apart two lanes, 12 m apart two roads."""
    found = roads([driven(line((500, 0), (apart / 2 * np.pi, np.pi), (500, 0)), 0)])[0]
    one = apart < 10
    assert found.length == pytest.approx(490 if one else 970, abs=25)
    assert np.median(found.passes) == (2 if one else 1)


@pytest.mark.parametrize("seed", range(3))
def test_carriageways_stay_apart(seed: int) -> None:
    there, back = line((1500, 0)), line((1500, 0), y=13.0)
    passes = [driven(there, 10 * seed), driven(back, 10 * seed + 1, forward=False)]
    passes += [driven(there, 10 * seed + 2), driven(back, 10 * seed + 3, forward=False)]
    found = roads(passes)
    assert [len(m) for m in found] == pytest.approx([291, 291], abs=2)
    assert all(np.median(m.passes) == 2 and not m.both_ways for m in found)


@pytest.mark.parametrize("hole", [30.0, 45.0, 60.0, 100.0])
def test_a_hole_of_one_drive_is_filled_by_others(hole: float) -> None:
    road = line((1500, 0.5), (500, -0.5))
    first = driven(road, 0)
    first = kept(first, np.abs(first.distance - 1000) > hole / 2)
    (found,) = roads([first, driven(road, 1), driven(road, 2)])
    assert found.length == pytest.approx(road.length - 40, rel=0.01)
    assert found.passes.min() == 2


def test_the_height_goes_on_over_a_hole() -> None:
    climb = line((800, 0))
    own = driven(climb, 0)
    own = replace(own, grade=np.full(len(own), 0.05))
    (found,) = roads([kept(own, np.abs(own.distance - 400) > 18)])
    assert found.passes.min() == 0
    np.testing.assert_allclose(np.diff(found.z) / np.diff(found.s), np.tan(0.05), atol=0.02)


def test_a_tunnel_divides_a_road_and_another_road_is_its_own() -> None:
    road = line((1500, 0.5), (1000, -0.5))
    own = driven(road, 0)
    blind = kept(own, np.abs(own.distance - 1200) > 150)
    crossing = line((800, 0), y=-200.0, heading=1.3)
    found = roads([blind, driven(crossing, 1)])
    assert [m.length for m in found] == pytest.approx([1110, 1050, 755], abs=15)
    assert all(m.passes.max() == 1 for m in found)


def test_a_drive_back_keeps_to_its_leg_of_a_hairpin() -> None:
    """The other leg lies 13 m beside and was driven the way that it goes."""
    road = line((400, 0), (6.5 * np.pi, np.pi), (400, 0))
    (found,) = roads([driven(road, 4), driven(road, 5, forward=False)])
    assert found.length == pytest.approx(road.length - 40, rel=0.02)
    assert found.both_ways
    assert np.mean(found.passes == 2) > 0.98
