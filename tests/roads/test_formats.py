"""Road files: written, read back, read by others, refused with file and element."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest
from support.mountain_road import HOME, mountain_road

from roadlog.errors import ConfigError, LogReadError
from roadlog.roads import formats
from roadlog.roads.model import RoadModel, road_of

SCHEMA = "ROADLOG_OPENDRIVE_SCHEMA"


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


def test_another_reader_finds_the_road_in_a_crg(road: RoadModel, tmp_path: Path) -> None:
    """pyopencrg, all Python, against the road itself and against pycrg, the reference code in C."""
    pycrg = pytest.importorskip("pycrg")
    pyopencrg = pytest.importorskip("pyopencrg")
    path = tmp_path / "road.crg"
    formats.write(road, path)
    theirs = pyopencrg.read(str(path))
    with pycrg.DataSet.open(str(path)) as data:
        grid = data.grid()
    u = np.arange(5.0, float(grid.u[-1]) - 5.0)
    x, y = np.array([theirs.uv_to_xy(at, 0.0) for at in u], np.float64).T
    left, right = (np.array([theirs.uv_to_z(at, v) for at in u]) for v in (2.0, -2.0))
    np.testing.assert_allclose(x, np.interp(u, grid.u, grid.x), atol=1e-4)
    np.testing.assert_allclose(y, np.interp(u, grid.u, grid.y), atol=1e-4)
    fine = road.refined(0.25)
    station, offset, _ = fine.locate(x, y, np.arctan2(np.gradient(y), np.gradient(x)), 2.0)
    there = fine.at(station)
    assert np.abs(offset).max() < 0.01
    assert np.abs(0.5 * (left + right) - there.z).max() < 0.001
    bank = np.arctan((left - right) / 4.0 * np.cos(there.grade))
    assert np.degrees(np.abs(bank - there.bank).max()) < 0.005


def test_another_reader_finds_the_road_in_an_xodr(road: RoadModel, tmp_path: Path) -> None:
    """pyxodr reads line and elevation, no superelevation; its steps along a record are uneven."""
    network = pytest.importorskip("pyxodr.road_objects.network")
    path = tmp_path / "road.xodr"
    formats.write(road, path)
    (theirs,) = network.RoadNetwork(str(path), resolution=1.0).get_roads()
    x, y = np.asarray(theirs.reference_line).T
    fine = road.refined(0.25)
    station, offset, _ = fine.locate(x, y, np.arctan2(np.gradient(y), np.gradient(x)), 2.0)
    assert np.abs(offset).max() < 0.01
    assert np.abs(np.asarray(theirs.z_coordinates) - fine.at(station).z)[1:-1].max() < 0.003


def test_netconvert_finds_the_road_in_an_xodr(road: RoadModel, tmp_path: Path) -> None:
    """SUMO's own reader (`pip install eclipse-sumo`): line and elevation, no superelevation."""
    import shutil
    import subprocess
    import xml.etree.ElementTree as ET

    program = shutil.which("netconvert")
    if program is None:
        pytest.skip("no netconvert (eclipse-sumo)")
    formats.write(road, tmp_path / "road.xodr")
    wanted = ("--opendrive.curve-resolution", "1", "--precision", "6")
    wanted += ("--offset.disable-normalization", "true")
    command = [program, "--opendrive-files", "road.xodr", "-o", "net.xml", *wanted]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    edges = [e for e in ET.parse(tmp_path / "net.xml").iter("edge") if e.get("shape")]
    fine = road.refined(0.25)
    for edge in edges:
        points = [point.split(",") for point in str(edge.get("shape")).split()]
        x, y, z = np.array(points, np.float64).T
        heading = np.arctan2(np.gradient(y), np.gradient(x))
        station, offset, _ = fine.locate(x, y, heading, 2.0)
        assert np.abs(offset).max() < 0.005
        assert np.abs(z - fine.at(station).z)[1:-1].max() < 0.003
    assert edges


@pytest.mark.needs_schema
def test_the_schema_of_opendrive_finds_no_fault(road: RoadModel, tmp_path: Path) -> None:
    """ASAM's schema of 1.8 is not ours to ship; `.ci/run` fetches it."""
    folder = os.environ.get(SCHEMA)
    if folder is None:
        pytest.skip(f"needs_schema: {SCHEMA} names no folder with OpenDRIVE_Core.xsd of 1.8")
    xmlschema = pytest.importorskip("xmlschema", reason="needs_schema: no xmlschema")
    schema = xmlschema.XMLSchema11(str(Path(folder) / "OpenDRIVE_Core.xsd"))
    path = tmp_path / "road.xodr"
    formats.write(road, path)
    assert list(schema.iter_errors(str(path))) == []
    path.write_text(path.read_text("utf-8").replace(' hdg="', ' heading="', 1), "utf-8")
    assert list(schema.iter_errors(str(path)))


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
</header><road id="1" length="{length}"><planView>{plan}</planView>
<elevationProfile>{elevation}</elevationProfile><lateralProfile>{lateral}</lateralProfile>
<userData code="roadlog" value="">{user}</userData></road>{more}</OpenDRIVE>"""
LINE = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
FLAT = '<elevation s="0" a="5" b="0.05" c="0" d="0"/>'


def xodr(tmp_path: Path, **parts: str) -> Path:
    parts = {
        "plan": LINE,
        "elevation": FLAT,
        "lateral": "",
        "more": "",
        "geo": GEO,
        "user": "",
    } | parts
    pieces = re.findall(r'length="([\d.]+)"', parts["plan"])
    parts.setdefault("length", str(sum(float(piece) for piece in pieces)))
    path = tmp_path / "other.xodr"
    path.write_text(XODR.format(**parts))
    return path


RIGHT = '<crossfall side="right" s="0" a="0.02" b="0" c="0" d="0"/>'


def test_records_of_other_writers(tmp_path: Path) -> None:
    plan = (
        '<geometry s="0" x="0" y="0" hdg="0" length="10"><line/></geometry>'
        '<geometry s="10" x="10" y="0" hdg="0" length="20"><spiral curvStart="0" curvEnd="0.02"/>'
        '</geometry><geometry s="30" x="29.9201" y="1.3318" hdg="0.2" length="30">'
        '<arc curvature="0.02"/></geometry>'
    )
    path = xodr(
        tmp_path, plan=plan, lateral=RIGHT + RIGHT.replace("right", "left").replace("0.02", "-0.02")
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


def test_a_normalized_cubic_that_runs_unevenly_keeps_its_stations(tmp_path: Path) -> None:
    """u = 20 p + 80 p^2: stations go by the way, not by p."""
    zero = " ".join(f'{name}="0"' for name in ("aU", "dU", "aV", "bV", "cV", "dV"))
    cubic = f'<paramPoly3 pRange="normalized" bU="20" cU="80" {zero}/>'
    road = formats.read(xodr(tmp_path, plan=LINE.replace("<line/>", cubic)))
    np.testing.assert_allclose(road.x, road.s, atol=0.001)


def test_an_encoding_that_none_knows_is_said(tmp_path: Path) -> None:
    path = xodr(tmp_path)
    path.write_text(path.read_text().replace('"1.0"?', '"1.0" encoding="klingon"?'))
    with pytest.raises(LogReadError, match=r"other\.xodr: .*klingon"):
        formats.read(path)


@pytest.mark.parametrize("ending", [".geojson", ".gpx"])
def test_maps_are_no_roads_to_be_read(road: RoadModel, tmp_path: Path, ending: str) -> None:
    from roadlog.ingest.reference import reference

    formats.write(road, tmp_path / f"road{ending}")
    for reader in (formats.read, lambda path: reference(path, [])):
        with pytest.raises(ConfigError, match="is written, and holds no road"):
            reader(tmp_path / f"road{ending}")


def test_a_crown_is_no_bank(tmp_path: Path) -> None:
    road = formats.read(xodr(tmp_path, lateral=RIGHT.replace("right", "both")))
    np.testing.assert_allclose(road.bank, 0.0)
    assert "a crown of up to 1.15 deg" in " ".join(road.notes)


def test_a_bank_that_begins_late_is_none_before(tmp_path: Path) -> None:
    lateral = '<superelevation s="40" a="0.03" b="0.001" c="0" d="0"/>'
    road = formats.read(xodr(tmp_path, lateral=lateral))
    np.testing.assert_allclose(road.bank[road.s < 40], 0.0)
    np.testing.assert_allclose(road.bank[road.s >= 40], 0.03 + 0.001 * (road.s[road.s >= 40] - 40))


def test_lanes_beside_the_line_are_said(tmp_path: Path) -> None:
    path = xodr(tmp_path)
    aside = '<lanes><laneOffset s="0" a="3.5" b="0" c="0" d="0"/></lanes></road>'
    path.write_text(path.read_text().replace("</road>", aside))
    assert "<laneOffset> is not read" in " ".join(formats.read(path).notes)


def test_a_spiral_between_equal_curvatures_is_an_arc(tmp_path: Path) -> None:
    """Other readers divide by the difference."""
    shapes = ('<arc curvature="0.02"/>', '<spiral curvStart="0.02" curvEnd="0.02"/>')
    arc, spiral = (formats.read(xodr(tmp_path, plan=LINE.replace("<line/>", s))) for s in shapes)
    np.testing.assert_allclose([spiral.x, spiral.y], [arc.x, arc.y], atol=1e-9)


def test_a_crg_whose_line_misses_its_end_is_refused(road: RoadModel, tmp_path: Path, capfd) -> None:
    """Written for 1 m between cross sections, and the header says a tenth more: pycrg prints it."""
    pytest.importorskip("pycrg")
    path = tmp_path / "road.crg"
    formats.write(road, path)
    step = rb"(?i)(reference_line_increment *= *)1\.0+"
    path.write_bytes(re.sub(step, rb"\g<1>1.1000000000000000", path.read_bytes()))
    with pytest.raises(LogReadError, match=r"road\.crg: ") as caught:
        formats.read(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_names_in_a_namespace(tmp_path: Path) -> None:
    path = xodr(tmp_path)
    plain = formats.read(path)
    text = path.read_text().replace("<OpenDRIVE>", '<OpenDRIVE xmlns="http://www.opendrive.org">')
    path.write_text(text)
    np.testing.assert_array_equal(formats.read(path).x, plain.x)


def test_an_offset_moves_and_turns_the_whole_file(tmp_path: Path) -> None:
    path = xodr(tmp_path)
    offset = '<offset x="1000" y="-200" z="300" hdg="0.5"/></header>'
    path.write_text(path.read_text().replace("</header>", offset))
    road = formats.read(path)
    assert (road.x[0], road.y[0], road.z[0]) == pytest.approx((1000, -200, 305))
    assert road.x[-1] == pytest.approx(1000 + 100 * np.cos(0.5))
    np.testing.assert_allclose(road.heading, 0.5)


@pytest.mark.parametrize("geo", ["+proj=utm +zone=32 +datum=WGS84", "EPSG:25832"])
def test_other_projections_are_turned_into_ours(tmp_path: Path, geo: str) -> None:
    warp = pytest.importorskip("rasterio.warp")
    x, y = 650_000.0, 5_230_000.0  # east of the zone's meridian: north leans by 1.5 deg
    line = LINE.replace('x="0" y="0"', f'x="{x}" y="{y}"')
    road = formats.read(xodr(tmp_path, plan=line, geo=geo))
    lon, lat = warp.transform("EPSG:25832", "EPSG:4326", [x, x + 100], [y, y])[:2]
    latitude, longitude = road.positions
    np.testing.assert_allclose(latitude[[0, -1]], lat, atol=1e-8)
    np.testing.assert_allclose(longitude[[0, -1]], lon, atol=1e-8)
    way = np.arctan2(road.y[-1] - road.y[0], road.x[-1] - road.x[0])
    np.testing.assert_allclose(road.heading, way, atol=1e-4)
    assert 0.02 < abs(way) < 0.03
    np.testing.assert_allclose(np.tan(road.grade), 0.05, atol=1e-12)


def test_a_road_from_nowhere_can_be_driven_on_but_is_no_reference(tmp_path: Path) -> None:
    from roadlog.ingest.reference import reference

    path = xodr(tmp_path, geo="")
    road = formats.read(path)
    assert not road.placed
    assert road.length == pytest.approx(100)
    with pytest.raises(LogReadError, match="does not say where on earth"):
        reference(path, [])


def crg(
    path: Path, step: float = 1.0, rough: float = 0.0, nan: bool = False, **more: object
) -> None:
    """A bend to the left, 5 % up, banked by 3 % in the grid of heights, headed north-west."""
    pycrg = pytest.importorskip("pycrg")
    v = np.arange(-4.0, 4.1, 1.0)
    n = round(200 / step) + 1
    heights = np.tile(0.03 * v, (n, 1)) + rough * np.random.default_rng(0).normal(size=(n, len(v)))
    if nan:
        heights[:, [0, 1, -1]] = np.nan
    phi = 2.2 + np.linspace(0, 1, n - 1)
    pycrg.write(path, heights, step, v.tolist(), phi, x0=5e5, y0=5.2e6, z0=400.0,
                slope=np.full(n - 1, 0.05), **more)  # fmt: skip


START = {"reference_line_start_lat": 47.0, "reference_line_start_lon": 11.0}


@pytest.mark.parametrize("mods", [{}, {"mods": {}}])
def test_a_crg_keeps_its_direction_and_height_with_and_without_modifiers(
    tmp_path: Path, mods: dict
) -> None:
    crg(tmp_path / "x.crg", road=START, **mods)
    road = formats.read(tmp_path / "x.crg")
    assert road.placed
    assert road.heading[0] == pytest.approx(2.2, abs=0.01)
    assert road.z[0] == pytest.approx(400.0)
    np.testing.assert_allclose(np.tan(road.grade), 0.05, atol=1e-4)
    np.testing.assert_allclose(np.tan(road.bank), 0.03, atol=1e-4)
    assert road.curvature[100] == pytest.approx(1 / 200, rel=0.02)


def test_a_rough_crg_of_centimeters_with_unknown_edges(tmp_path: Path) -> None:
    crg(tmp_path / "x.crg", step=0.02, rough=0.004, nan=True, road=START)
    road = formats.read(tmp_path / "x.crg")
    assert len(road) == pytest.approx(200, abs=1)
    assert np.degrees(np.std(road.grade)) < 0.05
    np.testing.assert_allclose(np.tan(road.bank), 0.03, atol=0.002)


def test_a_crg_from_nowhere_is_read_and_one_without_heights_refused(tmp_path: Path) -> None:
    crg(tmp_path / "x.crg")
    road = formats.read(tmp_path / "x.crg")
    assert not road.placed
    assert (road.x[0], road.y[0]) == (0, 0)
    pycrg = pytest.importorskip("pycrg")
    beside = np.zeros((20, 3))
    beside[7, :2] = np.nan
    pycrg.write(tmp_path / "hole.crg", beside, 1.0, [-2.0, 0.0, 6.0], np.zeros(19))
    with pytest.raises(LogReadError, match="u = 7 m"):
        formats.read(tmp_path / "hole.crg")


BAD = {
    "empty": ({"plan": ""}, "planView"),
    "nan": ({"plan": LINE.replace('x="0"', 'x="nan"')}, "geometry"),
    "word": ({"plan": LINE.replace('hdg="0"', 'hdg="east"')}, "hdg"),
    "backward": ({"plan": LINE + LINE.replace('s="0"', 's="40"')}, "s must ascend"),
    "no height": ({"elevation": ""}, "elevationProfile"),
    "two roads": ({"more": '<road id="2" length="1"/>'}, "2 roads"),
    "point": ({"plan": LINE.replace('length="100"', 'length="0"')}, "length"),
    "unknown": ({"plan": LINE.replace("<line/>", "<bezier/>")}, "bezier"),
    "missing part": (
        {"plan": LINE + LINE.replace('s="0" x="0"', 's="140" x="140"')},
        "40 m of road",
    ),
    "jump": ({"plan": LINE + LINE.replace('s="0" x="0"', 's="100" x="104"')}, "4.00 m away"),
    "late height": ({"elevation": FLAT.replace('s="0"', 's="30"')}, "begins at s = 30 m"),
    "degrees": ({"geo": "+proj=longlat +datum=WGS84"}, "no projection to meters"),
    "steep": ({"elevation": FLAT.replace('b="0.05"', 'b="9"')}, "<elevation>"),
    "step": ({"elevation": FLAT + FLAT.replace('s="0" a="5"', 's="50" a="90"')}, "jumps .82.*49 m"),
    "bank in deg": ({"lateral": RIGHT.replace("0.02", "4")}, "<crossfall>: is .114.6 deg"),
    "side": ({"lateral": RIGHT.replace("right", "up")}, "side = 'up'"),
    "kink": (
        {
            "plan": LINE
            + LINE.replace('s="0" x="0"', 's="100" x="100"').replace('hdg="0"', 'hdg="2.5"')
        },
        "turns at once",
    ),
    "on the spot": ({"plan": LINE.replace("<line/>", '<arc curvature="1000"/>')}, "do not agree"),
    "range": ({"plan": LINE.replace("<line/>", '<paramPoly3 pRange="x"/>')}, "pRange = 'x'"),
    "half a spiral": ({"plan": LINE.replace("<line/>", '<spiral curvStart="0"/>')}, "curvEnd"),
    "millimeter": ({"plan": LINE.replace('length="100"', 'length="0.001"')}, "too short"),
    "off the earth": ({"geo": GEO.replace("lat_0=47", "lat_0=95")}, "not on earth"),
    "far away": ({"plan": LINE.replace('x="0"', 'x="1e12"')}, "not on earth"),
    "user data": (
        {"more": "", "lateral": "", "plan": LINE, "user": '<point s="a"/>'},
        "<point> of <userData>",
    ),
    "user data back": (
        {"user": '<point s="9" z_sd="1"/><point s="2" z_sd="1"/>'},
        "s does not ascend",
    ),
    "cut plan": ({"length": "140"}, "<planView>: ends at s = 100 m, but <road> length = 140 m"),
    "endless": ({"length": "inf"}, "<road> length = 'inf'"),
    "gibberish": ({"geo": "somewhere nice"}, "is no projection"),
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


def damaged(name: str, data: bytes) -> bytes:
    noise = np.random.default_rng(0).bytes(len(data))
    return {
        "empty": b"",
        "half": data[: len(data) // 2],
        "head": data[:300],
        "zeros": data[:600] + bytes(len(data) - 600),
        "noise": data[:900] + noise[900:],
    }[name]


@pytest.mark.parametrize("ending", [".csv", ".parquet", ".xodr", ".crg"])
@pytest.mark.parametrize("name", ["empty", "half", "head", "zeros", "noise"])
def test_damaged_files_are_one_line(
    road: RoadModel, tmp_path: Path, ending: str, name: str
) -> None:
    pytest.importorskip({".parquet": "pyarrow", ".crg": "pycrg"}.get(ending, "numpy"))
    path = tmp_path / f"road{ending}"
    formats.write(road, path)
    path.write_bytes(damaged(name, path.read_bytes()))
    with pytest.raises(LogReadError, match=f"road{ending}") as caught:
        formats.read(path)
    assert str(caught.value).count(str(path)) == 1
    assert "\n" not in str(caught.value)


def test_stations_that_go_back_are_said_with_their_file(road: RoadModel, tmp_path: Path) -> None:
    path = tmp_path / "road.csv"
    formats.write(road, path)
    head, *rows = path.read_text().splitlines()
    path.write_text("\n".join([head, *rows[50:], *rows[:50]]))
    with pytest.raises(LogReadError, match=r"road\.csv: .*stations must ascend"):
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
        ("", "without rows"),
        ("48,9,nan\n48.01,9,nan\n", "grade_rad"),
        ("480,9,0\n481,9,0\n", "latitude"),
        ("48,9,5\n48.0001,9,5\n", r"grade_rad: is \(286"),
        ("48,9,0\n48.0001,9,inf\n", "grade_rad: is .inf"),
        ("48,9,0\nx,9,0\n", "row 1, column 1"),
        ("48,9,0\n48.1\n", "columns changed"),
    ],
)
def test_tables_that_are_no_road(tmp_path: Path, rows: str, words: str) -> None:
    path = tmp_path / "road.csv"
    path.write_text("latitude_deg,longitude_deg,grade_rad\n" + rows)
    with pytest.raises(LogReadError, match=words):
        formats.read(path)
