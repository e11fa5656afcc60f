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
from roadlog.outlook import ACCURACY, SensorSet, _known, outlook
from roadlog.signals import SEPARATED


@pytest.mark.parametrize("there", product([False, True], repeat=5))
def test_every_set_of_sensors_has_figures(there: tuple[bool, ...]) -> None:
    assert _known(SensorSet(*there)) in ACCURACY


@pytest.mark.parametrize("sensors", ACCURACY)
def test_more_is_no_worse(sensors: SensorSet) -> None:
    for name in ("antennas", "gnss", "springs"):
        if not getattr(sensors, name):
            more = ACCURACY[_known(replace(sensors, **{name: True}))]
            assert np.all(np.array(more) <= np.array(ACCURACY[sensors]) + 0.011)


def test_a_straight_drive_without_receiver_is_told_what_helps() -> None:
    drive = Drive.from_tables(hill_tables())
    found = {one.angle: one for one in outlook(drive, Vehicle(), ["fusion"])}
    assert set(found) == set(SEPARATED)
    grade = found["grade"]
    assert grade.estimator == "fusion"
    assert grade.accuracy_deg == ACCURACY[SensorSet()][0]
    assert "GNSS" in grade.better
    assert grade.better_deg is not None
    assert grade.better_deg < grade.accuracy_deg


def test_without_a_whole_imu_the_others_are_named() -> None:
    drive = Drive.from_tables(hill_tables())
    signals = {r: v for r, v in drive.signals.items() if not r.startswith("imu.gyro")}
    drive = replace(drive, signals=signals)
    able = [e.name for e in estimators.runnable(drive)[0]]
    found = {one.angle: one for one in outlook(drive, Vehicle(), able)}
    assert found["grade"].estimator == "kmbe"
    assert found["bank"].estimator == ""
    assert "fusion" in found["bank"].better
