"""`--truth-from FILE`: a surveyed road placed along the drive."""

from __future__ import annotations

import numpy as np
import pytest

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile

PROFILE = """
[speed]
v = { from = "v", unit = "m/s" }
[gnss]
latitude = { from = "lat", unit = "deg" }
longitude = { from = "lon", unit = "deg" }
"""
M = 180 / np.pi / 6_371_000.0  # deg of latitude for a meter
SPEED = 10.0  # m/s


def truth(tmp_path, table: str, back: bool = False):
    """Truth of a drive of 40 s due north, or back south, along the meridian from 48 deg."""
    t = np.arange(0, 40.01, 0.5)
    x = 400 - SPEED * t if back else SPEED * t
    rows = np.column_stack([t, np.full(len(t), SPEED), 48 + x * M, np.full(len(t), 9.0)])
    drive = tmp_path / "drive.csv"
    np.savetxt(drive, rows, "%.9f", ",", header="t,v,lat,lon", comments="")
    road = tmp_path / "road.csv"
    road.write_text(table)
    made = ingest([drive], Profile.from_toml(PROFILE, "p"), truth_from=road).tables[-1]
    assert made.topic == "/truth/angles"
    return (made.time - made.time[0]) * 1e-9, made.columns


def test_distance_is_integrated_speed_and_grade_is_percent(tmp_path):
    t, columns = truth(tmp_path, "distance,grade,sd\n0,0,0.2\n200,4,0.2\n300,4,0.2\n")
    expected = np.arctan(np.interp(SPEED * t, [0, 200, 300], [0, 0.04, 0.04]))
    np.testing.assert_allclose(columns["grade"], expected, atol=2e-5)
    np.testing.assert_allclose(columns["grade_sd"], 0.002, rtol=0.005)
    assert t[-1] == pytest.approx(30.0)  # nothing is known beyond the survey


@pytest.mark.parametrize(
    "text",
    [
        "distance_km,grade_deg\n0,2\n1,2\n",
        "Distance [m];Grade [deg]\n0;2,0\n1000;2,0\n",
        "chainage,slope (rad)\n0,0.034906585\n1000,0.034906585\n",
    ],
)
def test_units_stand_in_the_header(tmp_path, text):
    _, columns = truth(tmp_path, text)
    np.testing.assert_allclose(np.degrees(columns["grade"]), 2.0, atol=1e-6)
    assert np.isnan(columns["grade_sd"]).all()


@pytest.mark.parametrize("back", [False, True])
def test_positions_are_matched_and_the_way_back_turns_the_sign(tmp_path, back):
    points = "".join(f"{48 + x * M:.9f},9.0001,{x / 100}\n" for x in range(-50, 451, 50))
    t, columns = truth(tmp_path, "latitude,longitude,grade_deg\n" + points, back)
    x = 400 - SPEED * t if back else SPEED * t
    expected = (-1 if back else 1) * x / 100
    np.testing.assert_allclose(np.degrees(columns["grade"]), expected, atol=0.01)


@pytest.mark.parametrize("aside", [100.0, 58.0, 25.0])
def test_a_road_that_crosses_is_not_taken(tmp_path, aside):
    """The survey comes back over its own beginning, steeper, at 45, 30 and 14 deg."""
    own = [(x, 5.0, 2.0) for x in range(-50, 451, 50)]
    around = [(600.0, 300.0, 8.0), (400.0, 500.0, 8.0)]
    over = [(300.0, aside, 8.0), (100.0, -aside, 8.0)]
    east = M / np.cos(np.radians(48.0))
    points = "".join(
        f"{48 + x * M:.9f},{9 + y * east:.9f},{g}\n" for x, y, g in own + around + over
    )
    t, columns = truth(tmp_path, "latitude,longitude,grade_deg\n" + points)
    np.testing.assert_allclose(np.degrees(columns["grade"]), 2.0, atol=0.01)
    assert len(t) >= 60  # where either may be meant nothing is said


def test_another_road_is_an_error(tmp_path):
    with pytest.raises(LogReadError, match="no part of the drive"):
        truth(tmp_path, "lat,lon,grade\n48,9.1,1\n48.01,9.1,1\n")


def test_a_table_without_grade_is_an_error_that_says_what_is_there(tmp_path):
    with pytest.raises(ConfigError, match=r"grade, and distance or latitude .*grad"):
        truth(tmp_path, "distance,gradient\n0,1\n1,1\n")


def test_a_word_among_the_numbers_names_its_row(tmp_path):
    with pytest.raises(LogReadError, match="row 2"):
        truth(tmp_path, "distance,grade\n0,1\n1,steep\n")
