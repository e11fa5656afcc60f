"""Merging drives to a road: accuracy, honest sds, each road once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.mountain_road import HOME, driven, errors, mountain_road

from roadlog.roads import formats
from roadlog.roads.merge import roads
from roadlog.roads.model import RoadModel, car_axes, road_axes, road_of
from roadlog.roads.passes import Pass
from roadlog.types import Floats

ROLL, PITCH = np.radians(0.25), np.radians(0.04)


@pytest.fixture(scope="module")
def road() -> RoadModel:
    return mountain_road()


def rms_deg(values: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean(values**2))))


def merged(passes: list[Pass]) -> RoadModel:
    found = roads(passes)
    assert len(found) == 1
    return found[0]


def test_axes_turn_there_and_back() -> None:
    rng = np.random.default_rng(0)
    grade, bank = rng.uniform(-0.15, 0.15, (2, 50))
    for turn in (0.0, 0.08, np.pi, np.pi - 0.05, -np.pi / 2):
        back = road_axes(*car_axes(grade, bank, turn), turn)
        np.testing.assert_allclose(back, (grade, bank), atol=1e-12)
    opposite = car_axes(grade, bank, np.pi)
    np.testing.assert_allclose(opposite, (-grade, -bank), atol=1e-12)


def test_both_directions_cancel_the_mounting(road: RoadModel) -> None:
    passes = [driven(road, k, forward=k % 2 == 0, roll=ROLL, pitch=PITCH) for k in range(2)]
    found = merged(passes)
    off = errors(found, road)
    assert found.both_ways
    assert found.drives == 2
    assert rms_deg(off["grade"]) < 0.05
    assert rms_deg(off["bank"]) < 0.06
    assert abs(np.degrees(off["bank"].mean())) < 0.03
    assert "roll +0.2" in " ".join(found.notes)


@pytest.mark.parametrize("count", [1, 5, 20])
def test_sds_hold_for_many_drives_of_one_car(road: RoadModel, count: int) -> None:
    found = merged([driven(road, k, roll=ROLL, pitch=PITCH) for k in range(count)])
    off = errors(found, road)
    for angle in ("grade", "bank"):
        sd = getattr(found, f"{angle}_sd")[: len(off[angle])]
        within = np.mean(np.abs(off[angle]) < 2 * sd)
        assert 0.9 <= within <= 1.0, (angle, within)
    # what all drives of the car share does not go away with more of them
    assert np.median(found.bank_common_sd) > np.radians(0.2)
    assert np.all(found.bank_sd >= found.bank_common_sd - 1e-12)


def test_cars_average_their_mountings(road: RoadModel) -> None:
    rolls = np.random.default_rng(5).normal(0, np.radians(0.28), 4)
    passes = [driven(road, k, car=f"car{k}", roll=roll) for k, roll in enumerate(rolls)]
    one, four = merged(passes[:1]), merged(passes)
    ratio = np.median(four.bank_common_sd) / np.median(one.bank_common_sd)
    assert ratio == pytest.approx(0.5, abs=0.05)


def test_more_drives_bring_the_line_and_the_height_nearer(road: RoadModel) -> None:
    off = errors(merged([driven(road, k, forward=k % 2 == 0) for k in range(10)]), road)
    assert np.sqrt(np.mean(off["offset"] ** 2)) < 0.6
    assert np.std(off["z"]) < 0.8


@pytest.mark.parametrize("both", [True, False])
def test_elevation_rises_as_the_grade_says(road: RoadModel, both: bool, tmp_path: Path) -> None:
    """Altitudes that wander by 2 m lean a short road by 0.2 deg; the grades know better."""
    short = road.between(0.0, 500.0)
    found = merged([driven(short, k, forward=not both or k % 2 == 0) for k in range(2)])
    rise = found.z[-1] - found.z[0]
    slope = np.tan(found.grade)
    steps = 0.5 * (slope[1:] + slope[:-1]) * np.diff(found.s)
    assert rise == pytest.approx(steps.sum(), abs=0.01)
    formats.write(found, tmp_path / "road.xodr")
    back = formats.read(tmp_path / "road.xodr")
    assert abs(np.degrees(back.grade.mean() - found.grade.mean())) < 0.003
    assert np.std(errors(found, short)["z"]) < 0.3


def test_lanes_with_a_crown_leave_the_mounting_open(road: RoadModel) -> None:
    passes = [driven(road, k, forward=k % 2 == 0, lane=-1.75, roll=ROLL) for k in range(2)]
    found = merged(passes)
    assert "crowned road and a mounting roll look the same" in " ".join(found.notes)
    assert abs(np.degrees(errors(found, road)["bank"].mean())) < 0.03


def test_places_at_a_crossing_are_on_the_leg_that_is_driven() -> None:
    """A loop whose legs cross at 60 deg: the other leg is nearer, the own one has the heading."""
    turn = np.linspace(0.0, np.radians(300), 260)
    x = np.concatenate([np.arange(-300.0, 0.0, 2.0), 100 * np.sin(turn)])
    y = np.concatenate([np.zeros(150), 100 * (1 - np.cos(turn))])
    away = np.arange(2.0, 300.0, 2.0)
    x = np.concatenate([x, x[-1] + away * np.cos(turn[-1])])
    y = np.concatenate([y, y[-1] + away * np.sin(turn[-1])])
    line = road_of("loop", HOME, x, y, np.zeros(len(x)), bank=np.zeros(len(x)))
    for lane in (-3.0, 3.0):
        own_x = line.x - lane * np.sin(line.heading)
        own_y = line.y + lane * np.cos(line.heading)
        station, _, turned = line.locate(own_x, own_y, line.heading, 10.0)
        np.testing.assert_allclose(station[5:-5], line.s[5:-5], atol=0.5)
        assert np.abs(turned[5:-5]).max() < 0.05


def test_a_drive_counts_once_at_a_crossing() -> None:
    """A road that crosses itself: a loop like a clover leaf's."""
    turn = np.linspace(0.0, 1.5 * np.pi, 95)
    x = np.concatenate([np.arange(-400.0, 0.0, 5.0), 100 * np.sin(turn), np.full(80, -100.0)])
    y = np.concatenate([np.zeros(80), 100 * (1 - np.cos(turn)), 100 - np.arange(1, 81) * 5.0])
    line = road_of("loop", HOME, x, y, np.zeros(len(x)), bank=np.zeros(len(x)))
    found = roads([driven(line, k) for k in range(3)])
    assert len(found) == 1
    assert found[0].length == pytest.approx(line.length - 40, rel=0.02)
    assert found[0].passes.max() == 3


def test_hairpins_are_not_one_road_driven_back() -> None:
    """Legs 14 m apart, opposite directions: within reach of each other."""
    turn = np.linspace(0.0, np.pi, 8)[1:-1]
    x = np.concatenate([np.arange(0, 300.0, 5), 300 + 7 * np.sin(turn), np.arange(300.0, 0, -5)])
    y = np.concatenate([np.zeros(60), 7 * (1 - np.cos(turn)), np.full(60, 14.0)])
    line = road_of("hairpin", HOME, x, y, np.zeros(len(x)), bank=np.zeros(len(x)))
    found = roads([driven(line, k) for k in range(3)])
    assert found[0].length == pytest.approx(line.length - 40, rel=0.05)
    assert found[0].passes.max() == 3


def test_a_road_above_itself_is_not_driven_back() -> None:
    """Legs 4 m apart in opposite directions, the second one 20 m and more higher up."""
    turn = np.linspace(0.0, np.pi, 8)[1:-1]
    x = np.concatenate([np.arange(0, 300.0, 5), 300 + 2 * np.sin(turn), np.arange(300.0, 0, -5)])
    y = np.concatenate([np.zeros(60), 2 * (1 - np.cos(turn)), np.full(60, 4.0)])
    z = np.concatenate([np.zeros(60), np.linspace(0, 20, 6), np.full(60, 20.0)])
    line = road_of("storeys", HOME, x, y, z, grade=np.zeros(len(x)), bank=np.zeros(len(x)))
    (found,) = roads([driven(line, 1)])
    assert not found.both_ways
    assert found.passes.max() == 1


def test_drives_that_begin_elsewhere_are_still_one_road(road: RoadModel) -> None:
    early, late = road.between(None, 2000.0), road.between(900.0, None)
    found = roads([driven(early, 1), driven(late, 2), driven(late, 3, forward=False)])
    assert len(found) == 1
    assert found[0].length == pytest.approx(road.length - 40, rel=0.02)
    assert set(found[0].passes) == {1, 2, 3}


def test_passes_go_through_a_file(road: RoadModel) -> None:
    one = driven(road, 1)
    again = Pass.from_bytes(one.to_bytes())
    assert again.car == one.car
    np.testing.assert_allclose(again.latitude, one.latitude, atol=1e-12)
    np.testing.assert_allclose(again.bank, one.bank, atol=1e-6)


def test_a_sure_drive_outweighs_an_unsure_one(road: RoadModel) -> None:
    unsure = driven(road, 1, shape=np.radians(2.0))
    found = merged([unsure, driven(road, 2, shape=np.radians(0.05))])
    assert rms_deg(errors(found, road)["grade"]) < 0.2


def test_disagreement_makes_the_sd_larger(road: RoadModel) -> None:
    passes = [driven(road, k) for k in range(2)]
    waves = np.radians(1.0) * np.sin(passes[1].distance / 30)
    wrong = replace(passes[1], grade=passes[1].grade + waves)
    agreed, disagreed = merged(passes), merged([passes[0], wrong])
    assert np.median(disagreed.grade_sd) > 4 * np.median(agreed.grade_sd)


def test_laps_of_one_drive_are_passes_of_one_road() -> None:
    turn = np.linspace(0.0, 10 * np.pi, 2001)
    radius = 2000.0 / (2 * np.pi)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    lap = road_of("lap", HOME, x, y, np.zeros(len(x)), bank=np.zeros(len(x)))
    (found,) = roads([driven(lap, 9)])
    assert abs(found.length - 2000.0) <= 30.0
    assert np.median(found.passes) == 5


@pytest.mark.parametrize(("count", "cars"), [(1, 1), (5, 1), (20, 1), (4, 4)])
def test_shares_within_one_and_two_sd_are_what_they_say(count: int, cars: int) -> None:
    """Over many cars, whose mountings are drawn as `fusion` says that it knows them."""
    short = mountain_road(400.0)
    rng = np.random.default_rng(11)
    ratios: dict[str, list[Floats]] = {"grade": [], "bank": []}
    for draw in range(12):
        roll, pitch = np.radians(rng.normal(0, (0.28, 0.03), (cars, 2))).T
        found = merged(
            [
                driven(short, 100 * draw + k, car=f"car{k % cars}", roll=roll[k % cars],
                       pitch=pitch[k % cars])
                for k in range(count)
            ]
        )  # fmt: skip
        for angle, values in errors(found, short).items():
            if angle in ratios:
                ratios[angle].append(np.abs(values) / getattr(found, f"{angle}_sd")[: len(values)])
    for angle, parts in ratios.items():
        ratio = np.concatenate(parts)
        assert 0.5 <= np.mean(ratio < 1) <= 0.95, angle
        assert np.mean(ratio < 2) >= 0.9, angle


def test_a_bank_that_changes_every_few_meters_is_kept() -> None:
    """Waves of 20 m, as there are on circles; halving those of 15 m took a quarter of them."""
    x = np.arange(0.0, 800.0, 0.5)
    bank = np.radians(2.5) * np.sin(2 * np.pi * x / 20.0)
    line = road_of("waves", HOME, x, np.zeros(len(x)), np.zeros(len(x)), bank=bank, s=x)
    found = merged([driven(line, k, forward=k % 2 == 0) for k in range(2)])
    off = errors(found, line)["bank"]
    there = found.bank[: len(off)] * np.sign(np.cos(found.heading[: len(off)])) - off
    kept = np.dot(found.bank[: len(off)], there) / np.dot(there, there)
    assert abs(kept) > 0.9
