"""The roads of a report: every drive merged as `roadlog road` does, one table for all stretches."""

from pathlib import Path

import numpy as np
import pytest
from support.mountain_road import driven, errors, mountain_road

from roadlog.report import road as report_road
from roadlog.report.road import merged
from roadlog.roads.formats import table


def test_drives_both_ways_are_one_stretch_with_bank_and_height(tmp_path: Path) -> None:
    road = mountain_road(1000.0)
    roll = np.radians(0.25)
    passes = [driven(road, k, forward=k < 2, roll=roll) for k in range(4)]
    profile = merged(passes)
    assert (profile.drives, profile.left_out) == (4, 0)
    (model,) = profile.models
    assert model.both_ways
    assert model.sources == tuple(sorted(own.name for own in passes))
    off = errors(model, road)
    assert np.degrees(np.sqrt(np.mean(off["grade"] ** 2))) < 0.06
    assert abs(np.degrees(off["bank"].mean())) < 0.04  # the mounting is not in it
    profile.write(tmp_path / "road_profile")
    written = {ending: tmp_path / f"road_profile{ending}" for ending in (".csv", ".parquet")}
    heading = written[".csv"].read_text("utf-8").splitlines()[0].split(",")
    assert heading[0] == "stretch"
    assert {"s_m", "z_m", "grade_rad", "grade_sd_rad", "bank_rad", "bank_sd_rad"} < set(heading)
    for path in written.values():
        again = table.read(path)
        np.testing.assert_allclose(again.bank, model.bank, atol=1e-8)
        np.testing.assert_allclose(again.z, model.z, atol=1e-5)


def test_two_roads_are_two_stretches_the_longest_first() -> None:
    roads = mountain_road(500.0, seed=1), mountain_road(1000.0, seed=2)
    far = driven(roads[1], 2)
    far.latitude[:] += 0.5
    profile = merged([driven(roads[0], 1), far])
    assert [model.drives for model in profile.models] == [1, 1]
    lengths = [model.length for model in profile.models]
    assert lengths == sorted(lengths, reverse=True)
    assert profile.length == pytest.approx(sum(lengths))
    columns = profile.columns()
    assert set(columns["stretch"]) == {1, 2}
    assert len(columns["stretch"]) == len(columns["grade_rad"])


def test_what_is_more_than_memory_holds_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    road = mountain_road(500.0)
    passes = [driven(road, k) for k in range(3)]
    monkeypatch.setattr(report_road, "MOST_POINTS", len(passes[0]) + len(passes[1]))
    profile = merged(passes)
    assert (profile.drives, profile.left_out) == (3, 1)
    assert profile.models[0].drives == 2


def test_no_drive_with_positions_has_no_road(tmp_path: Path) -> None:
    profile = merged([])
    assert profile.models == ()
    profile.write(tmp_path / "road_profile")
    assert (tmp_path / "road_profile.csv").read_text("utf-8").strip() == "stretch"
