"""What is shown, as arrays."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from support.view_logs import DURATION, ERROR, NAMES, SD, make_log

from roadlog import metrics
from roadlog.errors import MissingSignalError
from roadlog.log import DriveLog
from roadlog.view import colors
from roadlog.view.curves import Curve
from roadlog.view.model import SHOWN_FIRST, _range, _symmetric, drive_view


def test_curves_are_in_degrees_on_the_drive_clock(log: DriveLog) -> None:
    view = drive_view(log)
    track, curve = log.stored("kmbe"), view.estimates["grade"]["kmbe"]
    assert_allclose(curve.time, np.arange(DURATION * 20 + 1) / 20, atol=1e-9)
    expected = np.where(track.valid, np.degrees(track.angles["grade"]), np.nan)[::5]
    assert_allclose(curve.values, expected, atol=1e-9)
    assert_allclose(curve.sd, np.degrees(SD), atol=1e-9)
    assert_allclose(view.errors["grade"]["kmbe"].values[40:], np.degrees(ERROR), atol=1e-9)
    assert np.isnan(view.errors["grade"]["kmbe"].values[:19]).all()  # not valid, not compared
    low, high = view.ranges["grade"]
    assert low < -4.0 < 4.0 < high  # the truth swings by 4 degrees


def test_distance_is_the_integral_of_the_speed(log: DriveLog) -> None:
    t = np.arange(DURATION * 20 + 1) / 20
    driven = 12 * t + 4 * 17 / (2 * np.pi) * (1 - np.cos(2 * np.pi * t / 17))
    assert_allclose(drive_view(log).estimates["grade"]["kmbe"].distance, driven, atol=0.01)


def test_few_estimators_are_drawn_first_the_prominent_ones(log: DriveLog) -> None:
    view = drive_view(log)
    assert view.estimators == ("fusion", "tfobe", "kmbe", "static_slope", "debe")
    assert view.shown["grade"] == view.estimators[:SHOWN_FIRST]
    assert drive_view(log, ["debe", "kmbe"]).shown["grade"] == ("kmbe", "debe")
    assert view.drawn() == view.drawn(["grade"]) == view.estimators[:SHOWN_FIRST]
    assert view.drawn(["bank"]) == view.drawn(further=["tires"]) == ()
    with pytest.raises(MissingSignalError, match=r"no estimate 'kmb'. Close: kmbe"):
        drive_view(log, ["kmb"])


def test_an_estimator_has_one_color_everywhere() -> None:
    few, many = colors.colors(["kmbe", "fusion"]), colors.colors(colors.PROMINENCE[:12])
    assert {few[name] for name in few} == {many[name] for name in few}
    assert len(set(many.values())) == 12
    runs = colors.colors(["kmbe@a", "kmbe@b"])
    assert runs["kmbe@a"] == few["kmbe"] != runs["kmbe@b"]


def test_runs_of_one_drive_share_truth_and_inputs(tmp_path: Path) -> None:
    one, two = make_log(tmp_path / "a.mcap", NAMES[:2]), make_log(tmp_path / "b.mcap", NAMES[:1])
    view = drive_view([one, two])
    assert view.estimators == ("fusion@a", "fusion@b", "tfobe@a")
    assert list(view.truth["grade"]) == ["truth"]
    assert [list(runs) for runs in view.inputs.values()] == [["a"]] * len(view.inputs)
    other = make_log(tmp_path / "c.mcap", NAMES[:1], seed=2)
    view = drive_view([one, other])
    assert list(view.truth["grade"]) == ["truth@a", "truth@c"]
    assert list(view.tracks) == ["a", "c"]


def test_histogram_holds_every_error(log: DriveLog) -> None:
    histogram = drive_view(log).histograms["grade"]["kmbe"]
    assert histogram.shares.sum() == pytest.approx(1.0)
    (k,) = np.flatnonzero(histogram.shares)
    assert histogram.edges[k] <= np.degrees(ERROR) + 1e-9
    assert histogram.edges[k + 1] >= np.degrees(ERROR) - 1e-9


def test_track_is_metric_and_knows_the_grade(log: DriveLog) -> None:
    track = drive_view(log).tracks[""]
    assert_allclose(np.hypot(track.east, 500 - track.north), 500.0, atol=0.1)
    assert_allclose(track.grade, 4 * np.sin(2 * np.pi * track.time / 40), atol=0.01)
    assert track.source == "GNSS; grade by truth"


def test_scene_drives_along_the_road_with_exaggerated_signs(log: DriveLog) -> None:
    scene = drive_view(log).scene
    assert scene is not None
    assert_allclose(0.5 * (scene.left + scene.right)[[0, -1]], scene.positions[[0, -1]], atol=0.2)
    assert (scene.left[:, 1] > scene.right[:, 1]).all()  # driven east, left is north
    k = 200  # 10 s: uphill by 4 deg, shown four times as steep: turned about -y
    half = np.radians(4 * 4.0) / 2
    assert_allclose(scene.body[k], [0, -np.sin(half), 0, np.cos(half)], atol=1e-3)
    assert list(scene.wireframes) == ["fusion", "tfobe", "kmbe"]


def test_lanes_say_what_the_car_does(log: DriveLog) -> None:
    lanes = drive_view(log).lanes
    assert lanes["motion"].states == ("straight",)
    stops = lanes["static_slope"]
    assert stops.states == ("", "into the stop, reverse time", "", "out of the stop", "")
    assert_allclose(stops.time, [0.0, 18.0, 20.05, 30.0, 31.55], atol=0.051)


def test_stop_windows_against_their_chords(log: DriveLog) -> None:
    picture = drive_view(log).stops["static_slope"]
    into, out = picture.windows
    assert into.into
    assert not out.into
    assert_allclose(into.chord, 0.1 * into.s, atol=1e-12)
    assert_allclose(np.max(into.z - into.chord), 0.01, atol=1e-6)
    assert_allclose(picture.path(0)[:, 0], into.s / 2)  # a window is one unit wide
    assert_allclose(picture.path(0)[10, 1], -5 * (0.1 + 10 * 0.01) / 2)  # 5 times as steep
    assert_allclose(picture.chord(1)[1], picture.path(1)[-1])
    assert "| 30.0 | out of the stop |" in picture.table
    assert "no: rejected |" in picture.table


def test_summary_gives_the_figures_of_evaluate(log: DriveLog) -> None:
    texts = drive_view(log, ["kmbe"]).texts
    m = metrics.evaluate(log)["kmbe"]["grade"]
    row = f"| grade | kmbe | {m.rmse_deg:.3f} | {m.bias_deg:.3f} | {m.p95_deg:.3f} |"
    assert row in texts["drive"]
    assert "# hill.mcap" in texts["drive"]
    assert "- **kmbe** (smooth = False): made up" in texts["estimates"]
    assert "| mass | 1600.0 | kg | default |" in texts["estimates"]


def test_a_log_that_lacks_something_says_what_to_do(tmp_path: Path) -> None:
    plain = make_log(tmp_path / "plain.mcap", ())
    view = drive_view(plain)
    assert view.notes == (
        f"{plain.path}: has no estimates yet; run `roadlog estimate {plain.path}`",
    )
    assert list(view.truth["grade"]) == ["truth"]
    untrue = drive_view(make_log(tmp_path / "untrue.mcap", NAMES[:1], truth=False))
    assert untrue.errors == {}
    assert "no truth, so no errors are shown" in untrue.notes[0]
    assert_array_equal(untrue.error_ranges, {})


def test_truth_rarer_than_the_screen_is_joined_by_a_line(tmp_path: Path) -> None:
    log = make_log(tmp_path / "x.mcap", ("kmbe",))
    view = drive_view(log, rate=200.0)
    assert np.isfinite(view.truth["grade"]["truth"].values).all()
    assert len(view.truth["grade"]["truth"].time) == DURATION * 200 + 1


def test_an_estimate_far_off_the_truth_is_still_on_its_axis() -> None:
    """And the edges of a wide band are on the axis of the errors."""
    time = np.arange(200.0)
    truth, off = Curve(time, np.zeros(200)), Curve(time, np.full(200, -3.0), np.full(200, 0.4))
    low, high = _range([truth], [off])
    assert low < -3.0 < 0.0 < high
    low, high = _symmetric([Curve(time, np.full(200, 0.05), np.full(200, 0.4))])
    assert low < -0.8
    assert high > 0.8
