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


US_FOOT = 1200 / 3937
FEET = CRS.replace("+units=m", "+units=us-ft")


def plain(path: Path, crs: str | None, cell: float, size: float = 1.0, unit: str = "") -> Path:
    """A grid without noise of heights in units of 1 / size m, in any coordinates."""
    n = int(300 / cell / (US_FOOT if crs == FEET else 1.0))
    step, (x0, y0) = cell, (0.0, 0.0)
    if crs == "EPSG:4326":
        step, (y0, x0) = 1e-5, HOME
        n = 400
    x = step * (np.arange(n) + 0.5 - n / 2)
    X, Y = np.meshgrid(x0 + x, y0 + x[::-1])
    if crs == "EPSG:4326":
        east, north = TransverseMercator(*HOME).forward(Y, X)
    else:
        east, north = (axis * (US_FOOT if crs == FEET else 1.0) for axis in (X, Y))
    corner = rasterio.transform.from_origin(x0 - n / 2 * step, y0 + n / 2 * step, step, step)
    with rasterio.open(
        path, "w", driver="GTiff", count=1, dtype="float32", crs=crs, transform=corner,
        height=n, width=n,
    ) as file:  # fmt: skip
        file.write((heights(east, north) * size).astype(np.float32), 1)
        if unit:
            file.units = (unit,)
    return path


@pytest.mark.parametrize(
    ("crs", "cell", "size", "unit", "said"),
    [
        (FEET, 3.0, 1 / US_FOOT, "US survey foot", "heights in feet (US survey foot)"),
        (FEET, 3.0, 1 / US_FOOT, "", "heights in feet, by the altitudes"),
        (FEET, 3.0, 1.0, "m", "as they are"),
        (CRS, 1.0, 1 / 0.3048, "ft", "heights in feet (ft)"),
        (CRS, 1.0, 100.0, "", "heights in 0.01 m, by the altitudes"),
        ("EPSG:4326", 1.0, 1.0, "", "as they are"),
    ],
)
def test_feet_degrees_and_centimeters(tmp_path, crs, cell, size, unit, said):
    made, notes = from_dem(plain(tmp_path / "dem.tif", crs, cell, size, unit), way())
    for angle, wanted in (("grade", GRADE), ("bank", BANK)):
        assert np.degrees(np.abs(made.columns[angle] - wanted)).max() < 0.02, angle
    assert said in " ".join(notes)


def test_a_grid_in_feet_that_leaves_its_heights_open_is_refused(tmp_path):
    with pytest.raises(LogReadError, match=r"dem\.tif: its cells are in feet.*give the band"):
        from_dem(plain(tmp_path / "dem.tif", FEET, 3.0, 1 / US_FOOT), way(altitude=False))
    with pytest.raises(LogReadError, match=r"dem\.tif.*coordinate system"):
        from_dem(plain(tmp_path / "dem.tif", None, 3.0), way())


@pytest.mark.parametrize(
    "changes", [{"hole": 15.0}, *({"nodata": v} for v in (-9999.0, 0.0, 32767.0, np.nan))]
)
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
