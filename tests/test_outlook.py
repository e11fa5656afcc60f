"""What `info` expects of a log: known for every set of sensors, better with more."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from support.drives import hill_tables

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.outlook import (
    BRIEF,
    LATERAL,
    SHAKEN,
    Manner,
    SensorSet,
    accuracies,
    expected,
    known,
    noise,
    outlook,
)
from roadlog.signals import SEPARATED
from roadlog.simulate import simulate

NOISE = 1.35, 0.06  # share and deg: figures of three or four drives, with a lean to either side


def test_every_set_of_sensors_has_figures() -> None:
    for there in product([False, True], repeat=7):
        assert known(SensorSet(*there)) in accuracies()


@pytest.mark.parametrize("name", ["antennas", "gnss", "springs", "steady", "mounted"])
def test_more_is_no_worse(name: str) -> None:
    for sensors, now in accuracies().items():
        if not getattr(sensors, name):
            more = accuracies()[known(replace(sensors, **{name: True}))]
            assert np.all(np.array(more) <= NOISE[0] * np.array(now) + NOISE[1]), sensors


def test_a_straight_drive_without_receiver_is_told_what_helps() -> None:
    drive = Drive.from_tables(hill_tables(seed=None))
    car = Vehicle().with_stated_mounting()
    sensors = SensorSet.of(drive, car)
    assert sensors == SensorSet(steady=True, mounted=True)
    found = {one.angle: one for one in outlook(sensors, ["fusion"])}
    assert set(found) == set(SEPARATED)
    grade = found["grade"]
    assert grade.estimator == "fusion"
    assert grade.accuracy_deg == accuracies()[sensors][0]
    assert "GNSS" in grade.better
    assert grade.better_deg is not None
    assert grade.better_deg < grade.accuracy_deg


def test_how_a_drive_is_driven_is_in_its_figures() -> None:
    sensors = SensorSet(gnss=True, turns=True, steady=True, mounted=True)
    usual = expected(sensors, Manner())
    assert usual == pytest.approx(accuracies()[sensors])
    grade, bank, pitch, roll = expected(sensors, Manner(lateral=2 * LATERAL))
    assert (grade, pitch) == (usual[0], usual[2])
    assert 1.5 * usual[1] < bank < 2 * usual[1]  # what the springs leave doubles
    assert 1.9 * usual[3] < roll < 2 * usual[3]
    known_springs = replace(sensors, springs=True)
    fast = expected(known_springs, Manner(lateral=2 * LATERAL))
    assert fast == pytest.approx(expected(known_springs, Manner()))
    speed = replace(sensors, gnss=False, mounted=False)
    brief = expected(speed, Manner(moving=BRIEF - 1))
    assert brief[0] == accuracies()[replace(speed, turns=False)][0] > expected(speed, Manner())[0]


def test_the_manner_of_a_drive_is_measured() -> None:
    made = simulate("ryu2004-laps", seed=1)
    manner = Manner.of(Drive.from_tables(made.tables))
    assert manner.lateral == pytest.approx(9.5**2 / 30, rel=0.05)  # m/s, m
    assert manner.moving == pytest.approx(88, abs=1)
    lone = Drive.from_tables(hill_tables(seed=None))
    assert Manner.of(lone).lateral < 0.1


@pytest.mark.parametrize("rate", [10.0, 25.0, 100.0])
def test_an_imu_is_shaken_by_its_noise_at_its_own_rate(rate: float) -> None:
    tables = hill_tables(rate=rate, seed=None)
    assert noise(Drive.from_tables(tables)) < SHAKEN
    imu = tables[0]
    rng = np.random.default_rng(1)
    shaken = {
        name: values + rng.normal(0, 0.06 * np.sqrt(rate), len(values))
        for name, values in imu.columns.items()
        if name.startswith("accel")
    }
    drive = Drive.from_tables([replace(imu, columns={**imu.columns, **shaken}), *tables[1:]])
    assert noise(drive) == pytest.approx(0.06, rel=0.1)
    assert not SensorSet.of(drive, Vehicle()).steady


def test_a_mounting_that_nobody_states_is_in_the_bank() -> None:
    receiver = SensorSet(gnss=True, turns=True, steady=True)
    bank = outlook(receiver, ["fusion"])[1]
    assert bank.accuracy_deg is not None
    assert bank.accuracy_deg > 1
    stated = outlook(replace(receiver, mounted=True), ["fusion"])[1]
    assert stated.accuracy_deg is not None
    assert stated.accuracy_deg < 0.5


def test_without_a_whole_imu_the_others_are_named() -> None:
    drive = Drive.from_tables(hill_tables())
    signals = {r: v for r, v in drive.signals.items() if not r.startswith("imu.gyro")}
    drive = replace(drive, signals=signals)
    able = [e.name for e in estimators.runnable(drive)[0]]
    found = {one.angle: one for one in outlook(SensorSet.of(drive, Vehicle()), able)}
    assert found["grade"].estimator == "kmbe"
    assert found["bank"].estimator == ""
    assert "fusion" in found["bank"].better
