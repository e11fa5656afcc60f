"""A road from drives to a file and back under a car, by the thresholds of docs/roads.md."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from support.drives import EPOCH_NS, table
from support.mountain_road import HOME, driven, mountain_road

from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.geo import TransverseMercator
from roadlog.ingest.reference.dem import from_dem
from roadlog.roads import formats
from roadlog.roads.merge import roads
from roadlog.roads.model import RoadModel, beside, car_axes
from roadlog.roads.passes import pass_of
from roadlog.signals import SECTIONS, TRUTH_TOPIC, truth_topic
from roadlog.simulate import simulate
from roadlog.simulate.on_road import on_road
from roadlog.simulate.road import build
from roadlog.simulate.scenarios import SCENARIOS
from roadlog.storage import Table
from roadlog.types import Floats


def rms_deg(values: Floats) -> float:
    return float(np.degrees(np.sqrt(np.mean(values**2))))


# a road under the simulator's car: the same road


def test_a_road_through_a_file_and_a_drive_is_itself(tmp_path: Path) -> None:
    road = mountain_road(600.0, seed=4)
    formats.write(road, tmp_path / "road.xodr")
    back = formats.read(tmp_path / "road.xodr")
    at = np.arange(20.0, 580.0)
    fine = road.refined(0.25)
    for angle in ("grade", "bank"):
        off = np.degrees(getattr(back.refined(0.25).at(at), angle) - getattr(fine.at(at), angle))
        assert np.abs(off).max() < 0.01, angle
    made = simulate("mountain", road=back, ideal=True)
    truth, motion = made.table(TRUTH_TOPIC), made.table(truth_topic("motion"))
    x, y, heading = (
        np.interp(truth.time, motion.time, np.unwrap(v) if n == "heading" else v)
        for n, v in motion.columns.items()
        if n in ("x", "y", "heading")
    )
    station, offset, turn = fine.locate(*_placed(road, made, x, y), heading, 10.0)
    known = np.isfinite(station) & (truth.time > truth.time[0] + 5 * 10**9)
    wanted = car_axes(*beside(fine, station[known], offset[known]), turn[known])
    for angle, value, limit in zip(("grade", "bank"), wanted, (0.003, 0.015), strict=True):
        assert rms_deg(truth.columns[angle][known] - value) < limit, angle


def test_the_line_under_the_simulator_is_the_roads() -> None:
    """Integrated from the tables that the car drives on: 0.05 m over 3 km."""
    road = mountain_road(3000.0)
    fine = road.refined(0.25)
    shape = on_road(SCENARIOS["mountain"], road).road
    clock = np.arange(2.0)
    tables = build(shape, road.length, clock, clock, np.random.default_rng(0))
    middle = 0.5 * (tables.heading[1:] + tables.heading[:-1])
    x, y = (tables.step * np.cumsum(wave(middle)) for wave in (np.cos, np.sin))
    count = len(fine) - 1
    away = np.hypot(fine.x[0] + x[:count] - fine.x[1:], fine.y[0] + y[:count] - fine.y[1:])
    assert away.max() < 0.05


@pytest.mark.parametrize(
    ("ending", "line", "bank"), [(".xodr", 0.005, 0.03), (".crg", 0.01, 0.005)]
)
def test_ten_kilometers_through_a_file(
    tmp_path: Path, ending: str, line: float, bank: float
) -> None:
    """Between the nodes too, and 2 m beside the line."""
    if ending == ".crg":
        pytest.importorskip("pycrg")
    fine = mountain_road(10_000.0).refined(0.25)
    formats.write(mountain_road(10_000.0), tmp_path / f"road{ending}")
    back = formats.read(tmp_path / f"road{ending}").refined(0.5)
    station, offset, _ = fine.locate(*fine.plane.forward(*back.positions), back.heading, 2.0)
    there = fine.at(station)
    inside = slice(4, -4)
    across = [2.0 * np.tan(m.bank) / np.cos(m.grade) for m in (back, there)]
    assert np.abs(offset[inside]).max() < line
    assert np.abs(back.z - there.z)[inside].max() < 0.001
    assert np.abs(back.z + across[0] - there.z - across[1])[inside].max() < 0.001
    assert np.degrees(np.abs(back.bank - there.bank)[inside].max()) < bank


def test_true_drives_merge_to_the_surface_below_their_own_line() -> None:
    """Against the table's middle line it is 0.03 deg and more: cars cut bends, and turn with it."""
    road = mountain_road(600.0, seed=4)
    fine = road.refined(0.5)
    passes = []
    for way in (road, road.reversed()):
        made = simulate("mountain", road=way, ideal=True)
        drive = Drive.from_tables(made.tables)
        truth = Estimate.from_table(made.table(TRUTH_TOPIC), drive.start_ns, "truth")
        sd = dict.fromkeys(truth.angles, np.full(len(truth.time), np.radians(0.1)))
        own = pass_of(drive, replace(truth, sd=sd), made.vehicle, f"drive {len(passes)}")
        assert own is not None
        passes.append(own)
    (model,) = roads(passes)
    x, y = fine.plane.forward(*model.positions)
    station, offset, turn = fine.locate(x, y, model.heading, 10.0)
    grade, bank = car_axes(*beside(fine, station, offset), turn)
    assert rms_deg(model.grade - grade) < 0.02
    assert rms_deg(model.bank - bank) < 0.03


def _placed(road: RoadModel, made, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """The simulator's x and y, from its home, in the road's plane."""
    latitude, longitude = TransverseMercator(*made.motion.home[:2]).inverse(x, y)
    return road.plane.forward(latitude, longitude)


def test_turned_twice_it_is_itself() -> None:
    road = mountain_road(600.0, seed=4)
    twice = road.reversed().reversed()
    for name in ("s", "x", "y", "z", "grade", "bank", "curvature"):
        np.testing.assert_allclose(getattr(twice, name), getattr(road, name), atol=1e-9)
    there = road.reversed().at(road.length - 100.0 - road.s[0])
    np.testing.assert_allclose(there.grade, -road.at(road.s[0] + 100.0).grade, atol=1e-4)
    np.testing.assert_allclose(there.bank, -road.at(road.s[0] + 100.0).bank, atol=1e-4)


# a terrain model of the mountain road, slopes of 50 % beside it


CRS = f"+proj=tmerc +lat_0={HOME[0]} +lon_0={HOME[1]} +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m"
PAVED = 4.5  # m, half its width


@pytest.fixture(scope="module")
def mountain() -> RoadModel:
    return mountain_road(900.0, seed=0)


@pytest.fixture(scope="module")
def terrain(mountain: RoadModel) -> tuple[Floats, float, float, Floats]:
    """Heights of 1 m cells, its west and north edge, and the stations below the cells."""
    from scipy.spatial import cKDTree

    x0, y1 = np.floor(mountain.x.min()) - 40, np.ceil(mountain.y.max()) + 40
    columns = int(mountain.x.max() + 40 - x0)
    rows = int(y1 - mountain.y.min() + 40)
    X, Y = np.meshgrid(x0 + 0.5 + np.arange(columns), y1 - 0.5 - np.arange(rows))
    fine = mountain.refined(0.5)
    node = cKDTree(np.stack([fine.x, fine.y], 1)).query(np.stack([X.ravel(), Y.ravel()], 1))[1]
    node = node.reshape(X.shape)
    c, d = np.cos(fine.heading[node]), np.sin(fine.heading[node])
    dx, dy = X - fine.x[node], Y - fine.y[node]
    across, along = dy * c - dx * d, dx * c + dy * d
    tangent = (np.tan(fine.bank) / np.cos(fine.grade))[node]
    n = np.clip(across, -PAVED, PAVED)
    z = fine.z[node] + np.tan(fine.grade[node]) * along + n * tangent + 0.5 * (across - n)
    return z, x0, y1, fine.s[node]


def written(path: Path, z: Floats, x0: float, y1: float, cell: float = 1.0) -> Path:
    rasterio = pytest.importorskip("rasterio")
    corner = rasterio.transform.from_origin(x0, y1, cell, cell)
    with rasterio.open(
        path, "w", driver="GTiff", count=1, dtype="float32", crs=CRS, transform=corner,
        height=z.shape[0], width=z.shape[1],
    ) as file:  # fmt: skip
        file.write(z.astype(np.float32), 1)
    return path


def along(mountain: RoadModel) -> list[Table]:
    """A drive at 10 m/s along the middle, its fixes every 2 m."""
    s = np.arange(20.0, mountain.length - 20.0, 2.0)
    there = mountain.refined(0.5).at(s)
    latitude, longitude = TransverseMercator(*HOME).inverse(there.x, there.y)
    columns = {
        "latitude": latitude, "longitude": longitude, "course": there.heading,
        "altitude": there.z, "speed": np.full(len(s), 10.0),
    }  # fmt: skip
    gnss = table("gnss", EPOCH_NS + np.round(s / 10 * 1e9).astype(np.int64), {})
    unknown = np.full(len(s), np.nan)
    filled = {sig.field: columns.get(sig.field, unknown) for sig in SECTIONS["gnss"].signals}
    return [Table(gnss.topic, gnss.schema, gnss.time, filled)]


def noise(shape: tuple[int, ...], size: float, seed: int = 3) -> Floats:
    """m, white and as much again over 15 m."""
    rng = np.random.default_rng(seed)
    smooth = gaussian_filter(rng.normal(size=shape), 15)
    return size * (rng.normal(size=shape) + smooth / smooth.std())


def compared(made: Table, mountain: RoadModel) -> dict[str, Floats]:
    """rad, grade and bank less those of the road where they are known."""
    s = (made.time - EPOCH_NS) * 1e-8
    there = mountain.refined(0.5).at(s)
    return {a: made.columns[a] - getattr(there, a) for a in ("grade", "bank")}


def test_a_terrain_model_of_the_mountain(mountain, terrain, tmp_path: Path) -> None:
    z, x0, y1, _ = terrain
    path = written(tmp_path / "dtm.tif", z + noise(z.shape, 0.03), x0, y1)
    made, _ = from_dem(path, along(mountain))
    off = compared(made, mountain)
    assert len(made) > 0.9 * len(along(mountain)[0])
    assert rms_deg(off["grade"]) < 0.13
    assert rms_deg(off["bank"]) < 0.18


@pytest.mark.parametrize("kind", ["bridge", "crowns"])
def test_what_is_no_road_is_left_out(mountain, terrain, tmp_path: Path, kind: str) -> None:
    z, x0, y1, station = terrain
    z = z + noise(z.shape, 0.02)
    if kind == "bridge":  # 80 m that a terrain model does not have
        z = np.where((station > 300) & (station < 380), z - 15.0, z)
    else:  # trees over a part of the road, in a surface model
        crowns = gaussian_filter(np.random.default_rng(1).normal(size=z.shape), 2.5)
        z = np.where((crowns > np.quantile(crowns, 0.8)) & (station > 500), z + 6.0, z)
    made, notes = from_dem(written(tmp_path / "dem.tif", z, x0, y1), along(mountain))
    assert "left out" in " ".join(notes)
    off = compared(made, mountain)
    assert np.degrees(np.abs(off["grade"])).max() < 2.0
    s = (made.time - EPOCH_NS) * 1e-8
    if kind == "bridge":
        assert not ((s > 298) & (s < 302) | (s > 378) & (s < 382)).any()
    assert (s < 290).sum() > 0.95 * 135
    assert np.degrees(np.abs(off["bank"])).max() < 3.0


def test_a_grid_of_30_m_refuses_the_bank(mountain, terrain, tmp_path: Path) -> None:
    z, x0, y1, _ = terrain
    rows, columns = (size // 30 * 30 for size in z.shape)
    coarse = z[:rows, :columns].reshape(rows // 30, 30, columns // 30, 30).mean(axis=(1, 3))
    made, notes = from_dem(written(tmp_path / "srtm.tif", coarse, x0, y1, 30.0), along(mountain))
    assert np.isnan(made.columns["bank"]).all()
    assert "hold no bank" in " ".join(notes)


# what it costs


def test_twenty_drives_of_ten_kilometers_are_merged_and_written_soon(tmp_path: Path) -> None:
    """CPU of this process: 30 s for the merging, 2 s for each file."""
    road = mountain_road(10_000.0)
    passes = [driven(road, k, forward=k % 2 == 0) for k in range(20)]
    began = time.process_time()
    (model,) = roads(passes)
    assert time.process_time() - began < 30.0
    assert model.length > 9_900.0
    for ending in formats.MODULES:
        began = time.process_time()
        formats.write(model, tmp_path / f"road{ending}")
        assert time.process_time() - began < 2.0, ending
