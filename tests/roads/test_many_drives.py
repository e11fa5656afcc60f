"""Roads out of drives that are simulated and estimated, by the thresholds of docs/roads.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from support.mountain_road import drive_over, errors, mountain_road

from roadlog.geo import TransverseMercator
from roadlog.roads import formats
from roadlog.roads.merge import roads
from roadlog.roads.model import RoadModel
from roadlog.roads.passes import Pass
from roadlog.types import Floats

pytestmark = pytest.mark.slow
PAIRS = 6


@dataclass(frozen=True)
class Driven:
    """3 km of mountain road, and drives over it: of one car both ways, and one of four others."""

    road: RoadModel
    there: list[Pass]
    back: list[Pass]
    others: list[Pass]


@pytest.fixture(scope="module")
def drives() -> Driven:
    road = mountain_road(3000.0, 0)
    return Driven(
        road,
        [drive_over(road, k, True) for k in range(20)],
        [drive_over(road, 100 + k, False) for k in range(PAIRS)],
        [drive_over(road, 200 + k, True, k) for k in range(1, 5)],
    )


def rms_deg(values: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean(values**2))))


def merged(passes: Sequence[Pass]) -> RoadModel:
    return max(roads(passes), key=lambda m: m.length)


def test_one_drive_to_a_file_that_others_read(drives: Driven, tmp_path: Path) -> None:
    pyopencrg = pytest.importorskip("pyopencrg")
    network = pytest.importorskip("pyxodr.road_objects.network")
    road, model = drives.road, merged(drives.there[:1])
    formats.write(model, tmp_path / "road.xodr")
    (theirs,) = network.RoadNetwork(str(tmp_path / "road.xodr"), resolution=1.0).get_roads()
    x, y = np.asarray(theirs.reference_line).T
    height = np.asarray(theirs.z_coordinates)
    fine = road.refined(0.5)
    local = TransverseMercator(*model.origin).inverse(x, y)
    station, offset, _ = fine.locate(
        *road.plane.forward(*local), np.arctan2(np.gradient(y), np.gradient(x)), 10.0
    )
    known = np.isfinite(station)
    assert np.sqrt(np.mean(offset[known] ** 2)) < 1.5
    assert np.std(height[known] - fine.at(station[known]).z) < 2.5
    formats.write(model, tmp_path / "road.crg")
    data = pyopencrg.read(str(tmp_path / "road.crg"))
    u = np.arange(5.0, model.length - 5.0)
    left, right = (np.array([data.uv_to_z(at, v) for at in u]) for v in (2.0, -2.0))
    middle = 0.5 * (left + right)
    slope = np.arctan(np.gradient(middle, u))
    bank = np.arctan((left - right) / 4 * np.cos(slope))
    off = errors(model, road)
    place = np.interp(u, model.s - model.s[0], np.arange(len(model)))
    nodes = np.round(place).astype(int)
    np.testing.assert_allclose(slope, np.interp(u, model.s - model.s[0], model.grade), atol=0.003)
    assert rms_deg(bank - model.bank[nodes]) < 0.1
    assert rms_deg(off["grade"]) < 0.10
    assert rms_deg(off["bank"]) < 0.25


@pytest.mark.parametrize(
    ("count", "grade", "line", "height"), [(5, 0.08, 0.8, 0.6), (20, 0.075, 0.6, 0.2)]
)
def test_drives_in_one_direction(
    drives: Driven, count: int, grade: float, line: float, height: float
) -> None:
    off = errors(merged(drives.there[:count]), drives.road)
    assert rms_deg(off["grade"]) < grade
    assert rms_deg(off["bank"]) < 0.25
    assert np.sqrt(np.mean(off["offset"] ** 2)) < line
    assert np.std(off["z"]) < height


@pytest.mark.parametrize(("each", "grade", "bank"), [(1, 0.05, 0.06), (2, 0.04, 0.05)])
def test_drives_each_way(drives: Driven, each: int, grade: float, bank: float) -> None:
    """Medians over the sets; the mean bank of every one."""
    found = []
    for k in range(0, PAIRS, each):
        off = errors(merged([*drives.there[k : k + each], *drives.back[k : k + each]]), drives.road)
        found.append([rms_deg(off["grade"]), rms_deg(off["bank"])])
        assert abs(np.degrees(off["bank"].mean())) < 0.03
    assert np.all(np.median(found, axis=0) < (grade, bank))


@pytest.mark.parametrize("which", ["1", "5", "20", "1 + 1", "2 + 2", "4 cars"])
def test_errors_are_within_two_sd(drives: Driven, which: str) -> None:
    """Within one: by mountings that are drawn often, in test_merge.py."""
    chosen = {
        "1": drives.there[:1],
        "5": drives.there[:5],
        "20": drives.there,
        "1 + 1": [*drives.there[:1], *drives.back[:1]],
        "2 + 2": [*drives.there[:2], *drives.back[:2]],
        "4 cars": drives.others,
    }[which]
    model = merged(chosen)
    off = errors(model, drives.road)
    for angle in ("grade", "bank"):
        sd = getattr(model, f"{angle}_sd")[: len(off[angle])]
        assert np.mean(np.abs(off[angle]) < 2 * sd) >= 0.9, angle
