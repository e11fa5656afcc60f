"""Road profiles: passes over the same road line up, add up by their variance, and stay honest."""

from dataclasses import replace

import numpy as np
import pytest
from support.drives import EPOCH_NS, table

from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.geo import EARTH_RADIUS
from roadlog.report.road import STEP, Pass, RoadMerger, pass_of

LATITUDE, LONGITUDE = 48.0, 11.0
LENGTH = 3000.0  # m, of the road
SD = np.radians(0.3)


def true_grade(distance: np.ndarray) -> np.ndarray:
    """rad, hills of 400 m."""
    return np.radians(3.0) * np.sin(2 * np.pi * distance / 400.0)


def position(distance: np.ndarray, across: np.ndarray | float = 0.0) -> tuple[np.ndarray, ...]:
    """deg, on a road that winds to the east, `across` m to the left of its middle."""
    bend = 2 * np.pi / 1500.0
    x, y = distance, 100.0 * np.sin(bend * distance)
    heading = np.arctan(100.0 * bend * np.cos(bend * distance))
    x, y = x - across * np.sin(heading), y + across * np.cos(heading)
    latitude = LATITUDE + np.degrees(y / EARTH_RADIUS)
    longitude = LONGITUDE + np.degrees(x / (EARTH_RADIUS * np.cos(np.radians(LATITUDE))))
    return latitude, longitude, heading


def drive_over(
    rng: np.random.Generator, first: float = 0.0, last: float = LENGTH, sd: float = SD
) -> Pass:
    """A pass that begins anywhere, in any lane, with noise in position and grade."""
    distance = np.arange(first + rng.uniform(0, STEP), last, STEP)
    lane = rng.normal(0.0, 2.0) + rng.normal(0.0, 0.5, len(distance))
    latitude, longitude, heading = position(distance, lane)
    grade = true_grade(distance) + rng.normal(0.0, sd, len(distance))
    start = rng.uniform(0, 1e5)  # the way before the road, which each drive comes along
    return Pass("x", latitude, longitude, heading, grade, np.full(len(grade), sd), distance + start)


def merged(passes: list[Pass]):
    merger = RoadMerger()
    for drive in passes:
        merger.add(drive)
    return merger.profile()


def along(longitude: np.ndarray) -> np.ndarray:
    """m along the road of the points of a profile, to the lane's width."""
    radius = EARTH_RADIUS * np.cos(np.radians(LATITUDE))
    return np.radians(longitude - LONGITUDE) * radius


def test_many_passes_make_the_error_smaller_by_their_square_root() -> None:
    rng = np.random.default_rng(3)
    profile = merged([drive_over(rng) for _ in range(25)])
    assert len(np.unique(profile.stretch)) == 1
    assert abs(profile.length - LENGTH) <= 2 * STEP
    error = profile.grade - true_grade(along(profile.longitude))
    rmse = float(np.sqrt(np.mean(error[profile.passes == 25] ** 2)))
    # 0.06 deg of noise, and some meters in position times the change of grade over them
    assert np.degrees(rmse) < 0.15
    assert (profile.passes >= 24).mean() > 0.97
    assert np.median(profile.sd) == pytest.approx(SD / 5, rel=0.15)
    z = error / profile.sd
    assert 0.7 < np.sqrt(np.mean(z**2)) < 2.0


def test_a_sure_pass_outweighs_an_unsure_one() -> None:
    rng = np.random.default_rng(4)
    unsure = drive_over(rng, sd=np.radians(2.0))
    sure = drive_over(rng, sd=np.radians(0.05))
    profile = merged([unsure, sure])
    both = profile.passes == 2
    error = profile.grade - true_grade(along(profile.longitude))
    assert np.degrees(np.sqrt(np.mean(error[both] ** 2))) < 0.2


def test_disagreement_makes_the_sd_larger() -> None:
    rng = np.random.default_rng(5)
    passes = [drive_over(rng, sd=np.radians(0.1)) for _ in range(2)]
    wrong = Pass(**{**vars(passes[1]), "grade": passes[1].grade + np.radians(2.0)})
    agreed, disagreed = merged(passes), merged([passes[0], wrong])
    assert np.median(disagreed.sd) > 8 * np.median(agreed.sd)


def test_order_of_passes_does_not_matter() -> None:
    rng = np.random.default_rng(6)
    passes = [drive_over(rng) for _ in range(6)]
    a, b = merged(passes), merged(passes[::-1])
    at = np.arange(100.0, LENGTH - 100.0, 20.0)
    grades = [np.interp(at, along(p.longitude), p.grade) for p in (a, b)]
    assert np.degrees(np.abs(grades[0] - grades[1]).mean()) < 0.1


def test_the_other_direction_is_another_stretch() -> None:
    rng = np.random.default_rng(7)
    there = drive_over(rng)
    back = Pass(
        "x",
        there.latitude[::-1],
        there.longitude[::-1],
        there.heading[::-1] + np.pi,
        -there.grade[::-1],
        there.sd,
        there.distance,
    )
    profile = merged([there, back])
    assert len(np.unique(profile.stretch)) == 2
    assert (profile.passes == 1).all()


def test_a_longer_drive_goes_on_where_the_road_was_known() -> None:
    rng = np.random.default_rng(8)
    profile = merged([drive_over(rng, 1000.0, 2000.0), drive_over(rng, 0.0, LENGTH)])
    assert len(np.unique(profile.stretch)) == 3
    middle = profile.stretch == 0
    assert (profile.passes[middle] == 2).mean() > 0.95
    assert abs(profile.length - LENGTH) <= 4 * STEP


def test_laps_of_one_drive_are_passes_of_one_road() -> None:
    rng = np.random.default_rng(9)
    lap = np.arange(0.0, 5 * 2000.0, STEP)
    angle = 2 * np.pi * lap / 2000.0
    radius = 2000.0 / (2 * np.pi)
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    latitude = LATITUDE + np.degrees(y / EARTH_RADIUS)
    longitude = LONGITUDE + np.degrees(x / (EARTH_RADIUS * np.cos(np.radians(LATITUDE))))
    grade = np.radians(2.0) * np.sin(angle) + rng.normal(0, SD, len(lap))
    drive = Pass("x", latitude, longitude, angle + np.pi / 2, grade, np.full(len(lap), SD), lap)
    profile = merged([drive])
    assert abs(profile.length - 2000.0) <= 3 * STEP
    assert np.median(profile.passes) == 5


def test_pass_of_a_drive() -> None:
    t = np.arange(0.0, 60.0, 0.1)
    stamps = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    latitude, longitude, _ = position(15.0 * t)
    tables = [
        table("speed", stamps, {"v": np.full(len(t), 15.0)}),
        table("gnss", stamps, {"latitude": latitude, "longitude": longitude}),
    ]
    drive = Drive.from_tables(tables)
    grade = true_grade(15.0 * drive.time)
    valid = drive.time > 10.0
    sd = np.full(len(grade), 0.01)
    estimate = Estimate(drive.time, {"grade": grade}, {"grade": sd}, valid, name="fusion")
    found = pass_of(drive, estimate)
    assert found is not None
    assert abs(len(found.grade) - 50.0 * 15.0 / STEP) <= 2
    at = found.distance
    assert np.abs(np.degrees(found.grade - true_grade(at))).max() < 0.05
    assert np.abs(found.latitude - position(at)[0]).max() < 1e-5
    assert np.abs(found.heading - position(at)[2])[3:-3].max() < 0.05
    again = Pass.from_bytes(found.to_bytes())
    assert again.estimator == "fusion"
    np.testing.assert_allclose(again.grade, found.grade, atol=1e-7)
    assert pass_of(drive, replace(estimate, sd={})) is None
