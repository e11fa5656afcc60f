"""A road as a surface: which side is up, how wide, and in what colors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.drives import Run
from support.mountain_road import mountain_road

from roadlog.roads import formats
from roadlog.view import colors
from roadlog.view.scene import EXAGGERATION
from roadlog.view.surface import bank_limit, edges, profile, width, write_road


def test_right_side_down_is_the_left_edge_up() -> None:
    road = mountain_road(300.0)
    tilted = replace(road, bank=np.full(len(road), 0.05))
    left, right = edges(tilted)
    rise = np.arcsin((left - right)[:, 2] / np.linalg.norm(left - right, axis=1))
    np.testing.assert_allclose(rise, EXAGGERATION * 0.05, atol=1e-12)
    middle = 0.5 * (left + right)
    np.testing.assert_allclose(np.ptp(middle[:, 2]), EXAGGERATION * np.ptp(road.z))
    # looking along the road, the left edge is on the left
    ahead = np.stack([np.cos(road.heading), np.sin(road.heading)], axis=1)
    across = (left - middle)[:, :2]
    assert np.all(ahead[:, 0] * across[:, 1] - ahead[:, 1] * across[:, 0] > 0)


def test_width_and_colors_follow_the_road() -> None:
    road = mountain_road(3000.0)
    assert 7.0 < width(road) <= 1 / np.abs(road.curvature).max()
    assert bank_limit(road) == pytest.approx(4.5, abs=0.5)
    level = replace(road, bank=np.full(len(road), np.nan))
    assert bank_limit(level) == 1.0
    assert set(profile(level)) == {"grade", "bank", "elevation"}
    shades = colors.grade_colors(np.array([-9.0, 0.0, 9.0]), bank_limit(road))
    assert shades.tolist() == [colors.DOWNHILL, colors.LEVEL, colors.UPHILL]


def test_a_road_without_bank_or_sds_can_be_written(tmp_path: Path) -> None:
    road = mountain_road(300.0)
    write_road(replace(road, bank=np.full(len(road), np.nan)), tmp_path / "road.rrd")
    assert (tmp_path / "road.rrd").stat().st_size > 5000


def test_view_takes_a_road_file(roadlog: Run, tmp_path: Path) -> None:
    formats.write(mountain_road(300.0), tmp_path / "pass.xodr")
    done = roadlog("view", "pass.xodr", "--save", "pass.rrd")
    assert done.returncode == 0, done.stderr
    assert "pass.rrd: 300 m of road" in done.stdout
    two = roadlog("view", "pass.xodr", "pass.xodr", "--save", "two.rrd")
    assert two.returncode == 2
    assert "one road at a time" in two.stderr
