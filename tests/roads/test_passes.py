"""What a drive says of its road: places, angles by distance, and how far to believe them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from support.drives import EPOCH_NS, table
from support.mountain_road import HOME

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.geo import TransverseMercator
from roadlog.roads.passes import STEP, Pass, pass_of

SPEED = 15.0  # m/s


def drive_east(seconds: float = 60.0) -> Drive:
    """At constant speed on a road that winds to the east."""
    t = np.arange(0.0, seconds, 0.1)
    stamps = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    s = SPEED * t
    latitude, longitude = TransverseMercator(*HOME).inverse(s, 20 * np.sin(s / 200))
    tables = [
        table("speed", stamps, {"v": np.full(len(t), SPEED)}),
        table("gnss", stamps, {"latitude": latitude, "longitude": longitude}),
    ]
    return Drive.from_tables(tables)


def true_grade(distance: np.ndarray) -> np.ndarray:
    """rad, hills of 400 m."""
    return np.radians(3.0) * np.sin(2 * np.pi * distance / 400.0)


def estimate_of(drive: Drive) -> Estimate:
    grade = true_grade(SPEED * drive.time)
    sd = np.full(len(grade), 0.01)
    return Estimate(
        drive.time,
        {"grade": grade},
        {"grade": sd},
        drive.time > 10.0,
        name="fusion",
        start_ns=drive.start_ns,
    )


def test_pass_of_a_drive() -> None:
    drive = drive_east()
    estimate = estimate_of(drive)
    found = pass_of(drive, estimate, name="one")
    assert found is not None
    assert abs(len(found) - 50.0 * SPEED / STEP) <= 2
    assert np.abs(np.degrees(found.grade - true_grade(found.distance))).max() < 0.1
    x, y = TransverseMercator(*HOME).forward(found.latitude, found.longitude)
    assert np.abs(y - 20 * np.sin(x / 200))[5:-5].max() < 1.0
    assert np.abs(found.course - np.arctan(0.1 * np.cos(x / 200)))[5:-5].max() < 0.03
    assert np.isnan(found.bank).all()
    again = Pass.from_bytes(found.to_bytes())
    assert (again.name, again.estimator) == ("one", "fusion")
    np.testing.assert_allclose(again.grade, found.grade, atol=1e-7)


def test_an_estimate_without_an_sd_or_a_drive_without_places_has_no_pass() -> None:
    drive = drive_east()
    estimate = estimate_of(drive)
    assert pass_of(drive, replace(estimate, sd={})) is None
    stamps = EPOCH_NS + np.arange(600) * 10**8
    blind = Drive.from_tables([table("speed", stamps, {"v": np.full(600, SPEED)})])
    assert pass_of(blind, estimate_of(blind)) is None


def test_altitudes_are_the_roads_and_not_the_antennas() -> None:
    t = np.arange(0.0, 30.0, 0.1)
    stamps = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    latitude, longitude = TransverseMercator(*HOME).inverse(SPEED * t, np.zeros(len(t)))
    above = {"latitude": latitude, "longitude": longitude, "altitude": np.full(len(t), 502.0)}
    drive = Drive.from_tables(
        [table("speed", stamps, {"v": np.full(len(t), SPEED)}), table("gnss", stamps, above)]
    )
    car = Vehicle(cg_height=0.6, antenna_position=(0.0, 0.0, 1.0))
    for vehicle, height in ((car, 500.4), (Vehicle(), 500.7)):
        found = pass_of(drive, estimate_of(drive), vehicle)
        assert found is not None
        np.testing.assert_allclose(found.altitude, height)
