"""A road model back under the simulator's car, and as reference of the drive on it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.mountain_road import mountain_road

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.reference import reference
from roadlog.log import create
from roadlog.roads import formats
from roadlog.roads.model import RoadModel
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import Simulation, simulate

QUIET = {"gnss.horizontal_noise": 0.0, "gnss.speed_noise": 0.0}


@pytest.fixture(scope="module")
def road() -> RoadModel:
    return mountain_road(500.0, seed=6)


@pytest.fixture(scope="module")
def drive(road: RoadModel) -> Simulation:
    return simulate("mountain", road=road, ideal=True)


def test_the_drive_lies_on_the_road(road: RoadModel, drive: Simulation) -> None:
    gnss = drive.table("/gnss").columns
    x, y = road.plane.forward(gnss["latitude"], gnss["longitude"])
    station, offset, _ = road.refined(0.5).locate(x, y, gnss["course"], 5.0)
    assert np.nanmax(np.abs(offset)) < 1.0
    assert np.nanmax(station) == pytest.approx(road.length - 20, abs=3.0)
    motion = drive.motion
    assert motion.home[2] == pytest.approx(road.z[0])


@pytest.mark.parametrize("ending", [".xodr", ".parquet"])
@pytest.mark.parametrize("against", [False, True])
def test_a_road_is_the_reference_of_its_drive(
    road: RoadModel, drive: Simulation, tmp_path: Path, ending: str, against: bool
) -> None:
    """Grade and bank come back in the car's axes, whichever way the file runs."""
    path = tmp_path / f"road{ending}"
    formats.write(road.reversed() if against else road, path)
    tables = [t for t in drive.tables if t.topic != TRUTH_TOPIC]
    made, _ = reference(path, tables)
    truth = drive.table(TRUTH_TOPIC)
    moving = made.time > made.time[0] + 8 * 10**9
    for angle, limit in (("grade", 0.02), ("bank", 0.02)):
        wanted = np.interp(made.time, truth.time, truth.columns[angle])
        error = np.degrees(made.columns[angle] - wanted)[moving]
        assert np.sqrt(np.mean(error**2)) < limit, angle


def test_fixes_that_wander_are_held_to_gyro_and_wheels(tmp_path: Path) -> None:
    """One antenna, 1 m of wander: the fixes alone were 0.17 deg off, and told none at rest."""
    road = mountain_road(1500.0, seed=12)
    formats.write(road, tmp_path / "road.xodr")
    chosen = {"gnss.two_antennas": False, "gnss.horizontal_noise": 1.0, "gnss.rate": 5.0}
    made_by = simulate("mountain", road=road, seed=3, overrides=chosen)
    tables = [t for t in made_by.tables if t.topic != TRUTH_TOPIC]
    made, _ = reference(tmp_path / "road.xodr", tables)
    truth = made_by.table(TRUTH_TOPIC)
    for angle in ("grade", "bank"):
        wanted = np.interp(made.time, truth.time, truth.columns[angle])
        error = np.degrees(made.columns[angle] - wanted)
        assert np.sqrt(np.mean(error**2)) < 0.06, angle
    standing = made_by.table("/gnss").columns["speed"] < 0.1
    assert standing.sum() > 20
    assert len(made) > 0.95 * len(standing)  # the road goes on below a car that stands


def test_the_reference_takes_the_place_of_the_own_truth_and_says_so(
    road: RoadModel, drive: Simulation, tmp_path: Path
) -> None:
    formats.write(road, tmp_path / "road.xodr")
    create(tmp_path / "drive.mcap", drive.tables, drive.metadata, drive.vehicle)
    result = ingest([tmp_path / "drive.mcap"], truth_from=tmp_path / "road.xodr")
    wanted = "truth: grade and bank by road.xodr; the source's own truth is left out"
    assert wanted in result.notes
    assert not [m for m in result.mapped if m.role.startswith("truth.")]


def test_another_road_is_no_reference(drive: Simulation, tmp_path: Path) -> None:
    from dataclasses import replace

    elsewhere = replace(mountain_road(500.0, seed=1), origin=(40.0, 11.4))
    formats.write(elsewhere, tmp_path / "other.xodr")
    with pytest.raises(LogReadError, match="no part of the drive"):
        reference(tmp_path / "other.xodr", drive.tables)


def test_a_road_too_short(road: RoadModel) -> None:
    with pytest.raises(ConfigError, match="too short"):
        simulate("mountain", road=road.between(0.0, 30.0))


def test_a_drive_longer_than_its_road(road: RoadModel) -> None:
    with pytest.raises(ConfigError, match="ends after"):
        simulate("luo2024-s1", road=road.between(0.0, 200.0))
