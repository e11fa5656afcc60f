"""A terrain model as reference: planes below the way, unknown where there is no road."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from support.drives import EPOCH_NS, table
from support.mountain_road import HOME

from roadlog.errors import LogReadError
from roadlog.geo import TransverseMercator
from roadlog.ingest.reference.dem import from_dem
from roadlog.signals import SECTIONS
from roadlog.storage import Table

rasterio = pytest.importorskip("rasterio")

CRS = f"+proj=tmerc +lat_0={HOME[0]} +lon_0={HOME[1]} +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m"
GRADE, BANK = np.radians(3.0), np.radians(-2.0)
HEADING = 0.6


def heights(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A plane: GRADE along HEADING, BANK across it; uphill to the left is positive."""
    c, d = np.cos(HEADING), np.sin(HEADING)
    return 500 + np.tan(GRADE) * (x * c + y * d) + np.tan(BANK) / np.cos(GRADE) * (y * c - x * d)


def grid(path: Path, cell: float, noise: float, **changes: float) -> Path:
    """A GeoTIFF of 300 m by 300 m about the origin."""
    n = int(300 / cell)
    x = -150 + cell * (np.arange(n) + 0.5)
    X, Y = np.meshgrid(x, x[::-1])
    values = heights(X, Y)
    rng = np.random.default_rng(1)
    smooth = gaussian_filter(rng.normal(size=values.shape), 8 / cell)
    values += noise * rng.normal(size=values.shape) + noise * smooth / smooth.std()
    if "hole" in changes:
        values[(np.abs(X) < 20) & (np.abs(Y) < 20)] -= changes["hole"]
    if "nodata" in changes:
        values[(np.abs(X) < 20) & (np.abs(Y) < 20)] = changes["nodata"]
    transform = rasterio.transform.from_origin(-150, 150, cell, cell)
    options = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": CRS}
    with rasterio.open(path, "w", height=n, width=n, transform=transform, **options) as file:
        file.write(values.astype(np.float32), 1)
    return path


def way(altitude: bool = True) -> list[Table]:
    """A drive of 200 m at 10 m/s through the origin."""
    t = np.arange(0.0, 20.0, 0.2)
    s = 10 * t - 100
    x, y = s * np.cos(HEADING), s * np.sin(HEADING)
    latitude, longitude = TransverseMercator(*HOME).inverse(x, y)
    columns = {"latitude": latitude, "longitude": longitude, "speed": np.full(len(t), 10.0)}
    if altitude:
        columns["altitude"] = heights(x, y)
    gnss = table("gnss", EPOCH_NS + np.round(t * 1e9).astype(np.int64), {})
    unknown = np.full(len(t), np.nan)
    filled = {s.field: columns.get(s.field, unknown) for s in SECTIONS["gnss"].signals}
    return [Table(gnss.topic, gnss.schema, gnss.time, filled)]


def test_grade_and_bank_of_a_fine_grid(tmp_path: Path) -> None:
    made, notes = from_dem(grid(tmp_path / "dem.tif", 1.0, 0.03), way())
    for angle, wanted, limit in (("grade", GRADE, 0.13), ("bank", BANK, 0.18)):
        error = np.degrees(made.columns[angle] - wanted)
        assert np.sqrt(np.mean(error**2)) < limit
        sd = np.degrees(np.median(made.columns[f"{angle}_sd"]))
        assert 0.02 < sd < 0.5
    assert "no vertical datum was converted" in " ".join(notes)


@pytest.mark.parametrize("changes", [{"hole": 15.0}, {"nodata": -9999.0}])
def test_a_bridge_and_unknown_cells_are_left_out(tmp_path: Path, changes: dict) -> None:
    made, _ = from_dem(grid(tmp_path / "dem.tif", 1.0, 0.02, **changes), way())
    assert len(made) < 95
    assert np.degrees(np.abs(made.columns["grade"] - GRADE)).max() < 1.0


def test_a_coarse_grid_holds_no_bank(tmp_path: Path) -> None:
    made, notes = from_dem(grid(tmp_path / "dem.tif", 30.0, 0.5), way())
    assert np.isnan(made.columns["bank"]).all()
    assert "hold no bank" in " ".join(notes)


def test_what_is_no_grid(tmp_path: Path) -> None:
    (tmp_path / "dem.tif").write_bytes(b"not a grid")
    with pytest.raises(LogReadError, match=r"dem\.tif"):
        from_dem(tmp_path / "dem.tif", way())
    far = [
        Table(t.topic, t.schema, t.time, {**t.columns, "latitude": t.columns["latitude"] + 1})
        for t in way()
    ]
    with pytest.raises(LogReadError, match=r"dem\.tif"):
        from_dem(grid(tmp_path / "dem.tif", 1.0, 0.0), far)
