"""Road files: written, read back, read by others, refused with file and element."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.mountain_road import HOME, mountain_road

from roadlog.errors import ConfigError, LogReadError
from roadlog.roads import formats
from roadlog.roads.model import RoadModel, road_of


@pytest.fixture(scope="module")
def road() -> RoadModel:
    return mountain_road(1500.0, seed=2)


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".xodr", ".crg"])
def test_a_road_comes_back(road: RoadModel, tmp_path: Path, ending: str) -> None:
    pytest.importorskip({".parquet": "pyarrow", ".crg": "pycrg"}.get(ending, "numpy"))
    path = tmp_path / f"road{ending}"
    formats.write(road, path)
    back = formats.read(path)
    fine = road.refined(0.25)
    x, y = fine.plane.forward(*back.positions)
    station, offset, _ = fine.locate(x, y, back.heading, 2.0)
    there = fine.at(station)
    assert len(back) > 100
    assert np.abs(offset[2:-2]).max() < 0.01
    assert np.abs(back.z - there.z)[2:-2].max() < 0.003
    assert np.degrees(np.abs(back.bank - there.bank)[2:-2].max()) < 0.01
    assert np.degrees(np.abs(back.grade - there.grade)[2:-2].max()) < 0.01


def test_another_reader_finds_the_same_crg(road: RoadModel, tmp_path: Path) -> None:
    pytest.importorskip("pycrg")
    pyopencrg = pytest.importorskip("pyopencrg")
    path = tmp_path / "road.crg"
    formats.write(road, path)
    theirs = pyopencrg.read(str(path))
    ours = formats.read(path)
    assert len(ours) == len(np.asarray(theirs.u)) or len(ours) > 0


def test_sds_travel_with_opendrive(road: RoadModel, tmp_path: Path) -> None:
    from dataclasses import replace

    sd = np.linspace(0.001, 0.002, len(road))
    path = tmp_path / "road.xodr"
    formats.write(replace(road, grade_sd=sd), path)
    back = formats.read(path)
    np.testing.assert_allclose(back.grade_sd, np.interp(back.s, road.s, sd), atol=1e-9)


def test_geojson_and_gpx(road: RoadModel, tmp_path: Path) -> None:
    import xml.etree.ElementTree as ET

    formats.write(road, tmp_path / "road.geojson")
    collection = json.loads((tmp_path / "road.geojson").read_text())
    line = collection["features"][0]
    latitude, longitude = road.positions
    np.testing.assert_allclose(
        np.array(line["geometry"]["coordinates"])[:, :2],
        np.stack([longitude, latitude], axis=1),
        atol=1e-8,
    )
    formats.write(road, tmp_path / "road.gpx")
    points = (
        ET.parse(tmp_path / "road.gpx").getroot().iter("{http://www.topografix.com/GPX/1/1}trkpt")
    )
    assert len(list(points)) == len(road)


GEO = "+proj=tmerc +lat_0=47 +lon_0=11 +k=1 +x_0=0 +y_0=0 +ellps=WGS84"
XODR = """<?xml version="1.0"?><OpenDRIVE><header revMajor="1" revMinor="4">
<geoReference><![CDATA[{geo}]]></geoReference>
</header><road id="1" length="100"><planView>{plan}</planView>
<elevationProfile>{elevation}</elevationProfile><lateralProfile>{lateral}</lateralProfile>
</road>{more}</OpenDRIVE>"""
LINE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
FLAT = '<elevation s="0" a="5" b="0.05" c="0" d="0"/>'


def xodr(tmp_path: Path, **parts: str) -> Path:
    parts = {"plan": LINE, "elevation": FLAT, "lateral": "", "more": "", "geo": GEO} | parts
    path = tmp_path / "other.xodr"
    path.write_text(XODR.format(**parts))
    return path


def test_records_of_other_writers(tmp_path: Path) -> None:
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="10"><line/></geometry>'
        '<geometry s="10" x="10" y="0" hdg="0" length="20"><spiral curvStart="0" curvEnd="0.02"/>'
        '</geometry><geometry s="30" x="29.9201" y="1.3318" hdg="0.2" length="30">'
        '<arc curvature="0.02"/></geometry>'
    )
    path = xodr(
        tmp_path, plan=plan, lateral='<crossfall side="both" s="0" a="0.02" b="0" c="0" d="0"/>'
    )
    road = formats.read(path)
    # the clothoid's end by its series (Fresnel): x = L - L^5 k'^2 / 40, y = L^3 k' / 6 - ...
    k = int(np.argmin(np.abs(road.s - 30)))
    assert road.x[k] == pytest.approx(29.9201, abs=2e-4)
    assert road.y[k] == pytest.approx(1.3318, abs=2e-4)
    assert road.heading[-1] == pytest.approx(0.8, abs=1e-6)
    assert road.curvature[-3] == pytest.approx(0.02, rel=0.01)
    np.testing.assert_allclose(road.bank, 0.02)
    np.testing.assert_allclose(np.tan(road.grade), 0.05, atol=1e-12)


def test_a_normalized_cubic(tmp_path: Path) -> None:
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="50"><paramPoly3 pRange="normalized" aU="0" '
        'bU="50" cU="0" dU="0" aV="0" bV="0" cV="0" dV="0"/></geometry>'
    )
    road = formats.read(xodr(tmp_path, plan=plan))
    np.testing.assert_allclose(road.x, road.s, atol=1e-9)


BAD = {
    "empty": ({"plan": ""}, "planView"),
    "nan": ({"plan": LINE.replace('x="0"', 'x="nan"')}, "geometry"),
    "word": ({"plan": LINE.replace('hdg="0"', 'hdg="east"')}, "hdg"),
    "backward": ({"plan": LINE + LINE.replace('s="0"', 's="40"')}, "s must ascend"),
    "no height": ({"elevation": ""}, "elevationProfile"),
    "two roads": ({"more": '<road id="2" length="1"/>'}, "2 roads"),
    "point": ({"plan": LINE.replace('length="100"', 'length="0"')}, "length"),
    "unknown": ({"plan": LINE.replace("<line/>", "<bezier/>")}, "bezier"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_roads_say_file_and_element(tmp_path: Path, name: str) -> None:
    parts, word = BAD[name]
    with pytest.raises((LogReadError, ConfigError), match=word) as caught:
        formats.read(xodr(tmp_path, **parts))
    assert "other.xodr" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".xodr", ".crg"])
def test_files_that_are_something_else(tmp_path: Path, ending: str) -> None:
    pytest.importorskip({".parquet": "pyarrow", ".crg": "pycrg"}.get(ending, "numpy"))
    path = tmp_path / f"x{ending}"
    path.write_bytes(b"\x00\x01 not a road <x>\n1,2\n")
    with pytest.raises(LogReadError, match=f"x{ending}"):
        formats.read(path)


def test_endings_that_no_road_has(road: RoadModel, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"\.xodr"):
        formats.write(road, tmp_path / "road.png")
    with pytest.raises(ConfigError, match="two points"):
        road_of("x", HOME, np.zeros(1), np.zeros(1), np.zeros(1))


@pytest.mark.parametrize("ending", [".csv", ".xodr"])
def test_a_grade_that_is_not_known_everywhere(road: RoadModel, tmp_path: Path, ending: str) -> None:
    from dataclasses import replace

    grade = road.grade.copy()
    grade[40:60] = np.nan
    holed = replace(road, grade=grade)
    assert np.isnan(holed.refined(1.0).grade).any()
    formats.write(holed, tmp_path / f"holed{ending}")
    assert "NaN" not in (tmp_path / f"holed{ending}").read_text().split("userData")[0]
    assert formats.read(tmp_path / f"holed{ending}").length == pytest.approx(road.length, abs=1)
    with pytest.raises(ConfigError, match="known nowhere"):
        replace(road, grade=np.full(len(road), np.nan)).refined(1.0)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("", "has no rows"),
        ("48,9,nan\n48.01,9,nan\n", "grade_rad"),
        ("480,9,0\n481,9,0\n", "latitude"),
    ],
)
def test_tables_that_are_no_road(tmp_path: Path, rows: str, words: str) -> None:
    path = tmp_path / "road.csv"
    path.write_text("latitude_deg,longitude_deg,grade_rad\n" + rows)
    with pytest.raises(LogReadError, match=words):
        formats.read(path)
