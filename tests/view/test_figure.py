"""The figure of `roadlog plot`, and the viewer in a notebook."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.image import imread
from numpy.testing import assert_allclose
from support.drives import ROOT, Run, simulated
from support.view_logs import ERROR, NAMES, SD, make_log
from typer.testing import CliRunner

from roadlog import view as roadlog_view
from roadlog.cli import app
from roadlog.errors import LogReadError, MissingExtraError
from roadlog.log import DriveLog, create
from roadlog.metrics import evaluate
from roadlog.view import colors
from roadlog.view.figure import angle_figure, write_figure
from roadlog.view.model import DriveView, drive_view
from roadlog.view.panels import Extent
from roadlog.view.slopes import in_percent


def test_figure_draws_what_the_view_holds(log: DriveLog) -> None:
    view = drive_view(log, ["kmbe"])
    figure = angle_figure(view)
    angle, error = figure.axes[:2]
    assert (angle.get_ylabel(), error.get_ylabel()) == ("grade [°]", "grade error [°]")
    truth, kmbe = angle.get_lines()
    assert_allclose(truth.get_ydata(), view.truth["grade"]["truth"].values)
    assert_allclose(kmbe.get_ydata(), view.estimates["grade"]["kmbe"].values)
    assert to_hex(kmbe.get_color()) == f"#{colors.colors(['kmbe'])['kmbe']:06x}"
    assert_allclose(error.get_lines()[0].get_ydata()[21:], np.degrees(ERROR), atol=1e-9)
    (band,) = error.collections
    assert_allclose(np.ptp(band.get_paths()[0].vertices[:, 1]), 4 * np.degrees(SD), atol=1e-9)
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["truth", "kmbe"]


def test_figure_over_a_part_of_the_distance(log: DriveLog) -> None:
    view = drive_view(log, ["kmbe"])
    distance = view.estimates["grade"]["kmbe"].distance
    assert distance is not None
    first, last = np.percentile(distance, [20, 60])
    figure = angle_figure(view, Extent("distance", first, last))
    line = figure.axes[0].get_lines()[-1]
    x = line.get_xdata()
    assert first <= x.min() <= x.max() <= last
    inside = (distance >= first) & (distance <= last)
    assert_allclose(line.get_ydata(), view.estimates["grade"]["kmbe"].values[inside])
    assert "distance [m]" in {axis.get_xlabel() for axis in figure.axes}
    assert "kmbe RMSE" in figure.axes[1].get_title(loc="left")
    low, high = figure.axes[1].get_ylim()  # the band's edges are seen
    assert low < -2 * np.degrees(SD) < 2 * np.degrees(SD) < high
    shown = np.concatenate([curve.get_ydata() for curve in figure.axes[0].get_lines()])
    low, high = figure.axes[0].get_ylim()  # fits the part
    assert low < shown.min() <= shown.max() < high
    assert high - low < 1.5 * max(np.ptp(shown), 1.0)


def test_a_band_wider_than_the_curve_has_edges(log: DriveLog) -> None:
    view = drive_view(log, ["kmbe"])
    curve = view.estimates["grade"]["kmbe"]
    assert curve.sd is not None
    wide = replace(curve, sd=np.where(np.isfinite(curve.sd), 20.0, np.nan))
    view = replace(view, estimates={**view.estimates, "grade": {"kmbe": wide}})
    low, high = angle_figure(view).axes[0].get_ylim()
    middle = np.nanmedian(curve.values)
    assert low < middle - 40 < middle + 40 < high


def test_slopes_in_percent(log: DriveLog) -> None:
    degrees = drive_view(log, ["kmbe"])
    figure = angle_figure(in_percent(degrees))
    angle, error = figure.axes[:2]
    assert (angle.get_ylabel(), error.get_ylabel()) == ("grade [%]", "grade error [%]")
    true, found = (
        100 * np.tan(np.radians(curves["grade"][name].values))
        for curves, name in ((degrees.truth, "truth"), (degrees.estimates, "kmbe"))
    )
    truth, kmbe = angle.get_lines()
    assert_allclose(truth.get_ydata(), true)
    assert_allclose(kmbe.get_ydata(), found)
    off, wrong = error.get_lines()[0].get_ydata(), degrees.errors["grade"]["kmbe"].values
    known = np.isfinite(wrong)
    assert_allclose(off[known], (found - true)[known], atol=1e-9)
    assert np.isnan(off[~known]).all()
    assert "%, spread" in error.get_title(loc="left")
    assert "pitch [°]" in {axis.get_ylabel() for axis in figure.axes}


def test_the_rmse_is_that_of_evaluate(log: DriveLog) -> None:
    """Only that the errors are taken at the picture's samples, 20 of a second, not the truth's."""
    evaluated = evaluate(log)["kmbe"]["grade"]
    title = angle_figure(drive_view(log, ["kmbe"])).axes[1].get_title(loc="left")
    assert title == f"kmbe RMSE {evaluated.rmse_deg:.2f}°, spread {evaluated.std_deg:.2f}°"


def test_no_two_estimates_of_a_figure_share_a_color_and_no_title_is_cut(tmp_path: Path) -> None:
    """Of a log with more estimators than there are colors, those that share one."""
    first, second = colors.PROMINENCE[0], colors.PROMINENCE[len(colors.PALETTE)]
    log = make_log(tmp_path / "x.mcap", colors.PROMINENCE)
    figure = angle_figure(drive_view(log, [first, second, "static_slope"]))
    lines = figure.axes[0].get_lines()[1:]
    assert len({line.get_color() for line in lines}) == len(lines) == 3
    figure.draw_without_rendering()
    right = figure.bbox.x1
    for axis in figure.axes:
        for text in (axis.title, axis._left_title):  # type: ignore[attr-defined]
            assert text.get_window_extent().x1 <= right
    assert "static_slope RMSE" in figure.axes[1].get_title(loc="left")


def test_two_drives_in_one_figure_are_told_apart(tmp_path: Path) -> None:
    """One estimator of each, truth and speed by their dashes, and speeds by color too."""
    logs = [make_log(tmp_path / f"s{k}.mcap", ("kmbe", "debe"), seed=k) for k in (1, 2)]
    figure = angle_figure(drive_view(logs))
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names[:4] == ["truth@s1", "truth@s2", "kmbe@s1", "kmbe@s2"]
    first, second = figure.axes[0].get_lines()[:2]
    assert first.get_linestyle() != second.get_linestyle()
    (speed,) = (axis for axis in figure.axes if axis.get_ylabel() == "speed [m/s]")
    colored = {line.get_color() for line in speed.get_lines()}
    assert colored == {line.get_color() for line in figure.axes[0].get_lines()[2:]}
    assert "speed and altitude in the color" in figure.legends[0].get_title().get_text()


def test_of_many_drives_the_figure_says_the_extent(tmp_path: Path) -> None:
    """Their truths are one entry of the legend, their RMSE one line."""
    logs = [make_log(tmp_path / f"s{k}.mcap", ("kmbe",), seed=k) for k in range(5)]
    figure = angle_figure(drive_view(logs), Extent(angles=("grade",)))
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["truth of each drive", *(f"kmbe@s{k}" for k in range(5))]
    assert figure.axes[1].get_title(loc="left") == "kmbe in 5 drives: RMSE 0.30°, spread 0.00°"


def test_figure_of_single_angles(log: DriveLog, tmp_path: Path) -> None:
    view = drive_view(log, ["kmbe"])
    assert len(view.ranges) > 1
    labels = [axis.get_ylabel() for axis in angle_figure(view, Extent(angles=("grade",))).axes]
    assert [label for label in labels if label.endswith("[°]")] == ["grade [°]", "grade error [°]"]
    with pytest.raises(LogReadError, match=r"no angle 'grde'\. Close: grade"):
        write_figure(view, tmp_path / "x.png", Extent(angles=("grde",)))
    with pytest.raises(LogReadError, match=r"asked for, --from 1e\+06 s; the drive ends at \d+ s$"):
        write_figure(view, tmp_path / "x.png", Extent(first=1e6))


@pytest.mark.parametrize(
    ("suffix", "start"), [(".png", b"\x89PNG"), (".svg", b"<?xml"), (".pdf", b"%PDF")]
)
def test_figure_is_the_same_bytes_every_time(
    suffix: str, start: bytes, log: DriveLog, tmp_path: Path
) -> None:
    view = drive_view(log, ["kmbe"])
    paths = [tmp_path / f"{k}{suffix}" for k in range(2)]
    for path in paths:
        write_figure(view, path)
    first, second = (path.read_bytes() for path in paths)
    assert first.startswith(start)
    assert first == second


def test_plot_command(log: DriveLog, tmp_path: Path, roadlog: Run) -> None:
    out = tmp_path / "x.png"
    run = roadlog("plot", log.path, "-o", out)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout == f"{out}: fusion, tfobe, kmbe\n"
    assert len(np.unique(imread(out).reshape(-1, 4), axis=0)) > 50
    assert roadlog("plot", log.path, "-o", "x.jpg").returncode == 2


def test_nothing_to_draw(tmp_path: Path) -> None:
    log = make_log(tmp_path / "plain.mcap", (), truth=False)
    with pytest.raises(LogReadError, match="no estimates and no truth to draw"):
        write_figure(drive_view(log), tmp_path / "x.png")
    assert not (tmp_path / "x.png").exists()


def test_save_says_what_is_missing(tmp_path: Path, roadlog: Run) -> None:
    log = make_log(tmp_path / "plain.mcap", (), truth=False)
    run = roadlog("view", log.path, "--save", tmp_path / "x.rrd")
    assert run.returncode == 0
    assert f"has no estimates yet; run `roadlog estimate {log.path}`" in run.stderr
    assert "has no truth, so no errors are shown" in run.stderr
    assert "60.0 s, 0 estimates" in run.stdout


def test_runs_side_by_side(tmp_path: Path, roadlog: Run) -> None:
    logs = [make_log(tmp_path / f"{name}.mcap", NAMES[:2]).path for name in "ab"]
    run = roadlog("view", *logs, "-e", "fusion", "--save", tmp_path / "x.rrd")
    assert (run.returncode, run.stderr) == (0, "")
    assert "2 estimates" in run.stdout
    assert roadlog("view", logs[0], "--web", "--png", tmp_path).returncode == 2


def test_notebook_without_its_extra(log: DriveLog, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'roadlog\[notebook\]'"):
        roadlog_view.notebook(log)


def test_notebook_shows_the_viewer(log: DriveLog, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("rerun_notebook", reason="the extra `notebook` is not installed")
    import rerun as rr

    shown = []
    monkeypatch.setattr(rr.RecordingStream, "notebook_show", lambda _, **o: shown.append(o))
    roadlog_view.notebook(log, ["kmbe"])
    (options,) = shown
    assert options["height"] == 700
    assert options["blueprint"] is not None


def stop_and_go() -> DriveView:
    """A simulated pass with two stops and nothing but the truth."""
    made = simulated("mountain")
    log = create(Path("pass.mcap"), made.tables, made.metadata, made.vehicle)
    return drive_view(log)


def test_a_stop_is_a_mark_over_time_and_no_spike_over_distance(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    view = stop_and_go()
    over_time, over_distance = angle_figure(view), angle_figure(view, Extent("distance"))
    for figure in (over_time, over_distance):
        assert figure.legends[0].get_title().get_text() == "pass\nbars at the foot: stops"
        assert len(figure.axes[0].patches) >= 2
        assert not [axis for axis in figure.axes if axis.axison and not axis.has_data()]
    x = over_distance.axes[0].get_lines()[0].get_xdata()
    assert (np.diff(x) > 0).all()
    longest = max(np.ptp(patch.get_extents().intervalx) for patch in over_time.axes[0].patches)
    assert longest > 0


def test_an_angle_that_only_the_truth_has(tmp_path: Path) -> None:
    log = ROOT / "tests" / "data" / "roadlog-0.1.0.mcap"
    out = tmp_path / "bank.svg"
    done = CliRunner().invoke(app, ["plot", str(log), "--angle", "bank", "-o", str(out)])
    assert done.exit_code == 0, done.output
    text = out.read_text(encoding="utf-8")
    assert "bank [°]" in text
    assert "grade" not in text
