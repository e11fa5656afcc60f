"""A recording holds what the log says; read back without a viewer."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from numpy.testing import assert_allclose
from rerun.chunk import RrdReader
from support.view_logs import DURATION, ERROR, SD, make_log

from roadlog.errors import LogWriteError
from roadlog.log import DriveLog
from roadlog.view import colors
from roadlog.view.model import DriveView, drive_view
from roadlog.view.recording import write_recording

ROWS = int(DURATION * 20) + 1


@pytest.fixture(autouse=True)
def _strict() -> None:
    rr.set_strict_mode(True)  # else wrong types are only warnings


@pytest.fixture
def view(log: DriveLog) -> DriveView:
    return drive_view(log)


@pytest.fixture
def recording(view: DriveView, tmp_path: Path) -> Path:
    path = tmp_path / "x.rrd"
    write_recording(view, path)
    return path


def rows(path: Path, entity: str, static: bool = False) -> pa.Table:
    stream = RrdReader(path).stream().filter(content=entity, is_static=static)
    tables = [pa.Table.from_batches([chunk.to_record_batch()]) for chunk in stream]
    return pa.concat_tables(tables, promote_options="default")


def column(table: pa.Table, name: str) -> np.ndarray:
    return table[name].drop_null().combine_chunks().flatten().to_numpy(zero_copy_only=False)


def blueprint(path: Path) -> list[pa.RecordBatch]:
    reader = RrdReader(path)
    (store,) = reader.blueprints()
    return [chunk.to_record_batch() for chunk in reader.stream(store=store)]


def texts(batches: list[pa.RecordBatch], component: str) -> list[str]:
    return [
        entry
        for batch in batches
        if component in batch.schema.names
        for entries in batch.column(component).to_pylist()
        for entry in entries or []
    ]


def test_estimates_share_one_entity_with_their_variances(view: DriveView, recording: Path) -> None:
    table = rows(recording, "/angles/grade/estimates")
    assert table.num_rows == ROWS
    shown = view.shown["grade"]
    values = column(table, "Measurements:values").reshape(ROWS, len(shown))
    variances = column(table, "Measurements:variances").reshape(ROWS, len(shown))
    for k, name in enumerate(shown):
        assert_allclose(values[:, k], view.estimates["grade"][name].values, atol=2.0**-15)
    assert_allclose(np.sqrt(variances[21:]), np.degrees(SD), rtol=5e-3)
    others = rows(recording, "/angles/grade/more_estimates")
    assert len(column(others, "Measurements:values")) == 2 * ROWS


def test_truth_and_errors(view: DriveView, recording: Path) -> None:
    truth = column(rows(recording, "/angles/grade/truth"), "Scalars:scalars")
    assert_allclose(truth, view.truth["grade"]["truth"].values, atol=2.0**-15)
    table = rows(recording, "/errors/grade/estimates")
    errors = column(table, "Scalars:scalars").reshape(ROWS, 3)[21:]
    assert_allclose(errors, np.degrees(ERROR), atol=2.0**-14)
    band = rows(recording, "/errors/grade/estimates/band")
    width = np.sqrt(column(band, "Measurements:variances").reshape(ROWS, 3)[21:])
    assert_allclose(width, 2 * np.degrees(SD), rtol=5e-3)
    assert not column(band, "Measurements:values").reshape(ROWS, 3)[21:].any()


def test_both_timelines(view: DriveView, recording: Path) -> None:
    for entity in ("/angles/grade/estimates", "/errors/grade/estimates", "/inputs/speed/signals"):
        table = rows(recording, entity)
        time = table["drive_time"].cast(pa.int64()).to_numpy() * 1e-9
        assert_allclose(time, np.arange(ROWS) / 20, atol=1e-9)
        meters = table["distance_m"].to_numpy()
        driven = view.estimates["grade"]["kmbe"].distance
        assert_allclose(meters, driven, atol=0.5)


def test_styles(view: DriveView, recording: Path) -> None:
    color = colors.colors(view.estimators)
    shown = [name for name in view.estimators if name in view.shown["grade"]]
    for entity, kind in (("/angles/grade", "Measurements"), ("/errors/grade", "SeriesLines")):
        style = rows(recording, f"{entity}/estimates", static=True)
        assert column(style, f"{kind}:names").tolist() == shown
        rgba = [color[name] << 8 | 0xFF for name in shown]
        assert column(style, f"{kind}:colors").tolist() == rgba
        assert column(style, f"{kind}:visible_series").tolist() == [True] * len(shown)
        hidden = rows(recording, f"{entity}/more_estimates", static=True)
        assert not column(hidden, f"{kind}:visible_series").any()


def test_every_tab_has_its_views(recording: Path) -> None:
    batches = blueprint(recording)
    kinds = texts(batches, "ViewBlueprint:class_identifier")
    counts = {kind: kinds.count(kind) for kind in set(kinds)}
    # 4 angles; 2 totals, of which inclination has errors; errors of 2 angles; 3 inputs; 3 beside
    # the scene; track beside the scene, in the map tab, windows; texts: events, 2 of the summary
    assert counts == {
        "TimeSeries": 4 + 3 + 2 + 3 + 3,
        "BarChart": 2,
        "StateTimeline": 1,
        "3D": 1,
        "2D": 3,
        "Map": 1,
        "TextDocument": 3,
    }
    names = texts(batches, "ContainerBlueprint:display_name")
    tabs = ["Angles", "Totals", "Errors", "Inputs", "Scene", "Map", "Windows", "Summary"]
    assert set(tabs) <= set(names)
    assert (
        len(texts(batches, "TimeAxis:link")) == 4 + 3 + 2 + 3 + 1
    )  # plots and lanes share their time axis


def test_recording_is_sound_and_named(recording: Path) -> None:
    (entry,) = RrdReader(recording).recordings()
    (layout,) = RrdReader(recording).blueprints()
    assert entry.application_id == layout.application_id == "roadlog"
    name = rows(recording, "/__properties", static=True)
    assert column(name, "RecordingInfo:name").tolist() == ["hill"]
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(recording)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_lanes_scene_map_and_windows_are_there(view: DriveView, recording: Path) -> None:
    lane = rows(recording, "/lanes/static_slope")
    assert column(lane, "StateChange:state").tolist() == list(view.lanes["static_slope"].states)
    body = column(rows(recording, "/world/chase/car"), "Transform3D:quaternion")
    assert view.scene is not None
    assert_allclose(np.stack(body), view.scene.body, atol=2.0**-15)
    track = rows(recording, "/map/car")
    assert track.num_rows == DURATION + 1
    paths = column(rows(recording, "/stops/static_slope/paths", static=True), "LineStrips2D:strips")
    assert [len(strip) for strip in paths] == [21, 21]
    text = column(rows(recording, "/summary/drive", static=True), "TextDocument:text")
    assert text.tolist() == [view.texts["drive"]]


def test_names_of_runs_may_hold_anything(tmp_path: Path) -> None:
    names = ["a b.mcap", "50 % [x].mcap"]
    logs = [make_log(tmp_path / name, ("kmbe",), seed=k) for k, name in enumerate(names, 1)]
    path = tmp_path / "x.rrd"
    write_recording(drive_view(logs), path)
    entities = {c.entity_path for c in RrdReader(path).store().schema().component_columns()}
    assert {r"/map/50\ \%\ \[x\]/path", r"/angles/grade/truth\@50\ \%\ \[x\]"} <= entities


def test_a_folder_that_is_not_there_is_an_error(view: DriveView, tmp_path: Path) -> None:
    with pytest.raises(LogWriteError, match=r"nowhere/x\.rrd: cannot be written"):
        write_recording(view, tmp_path / "nowhere" / "x.rrd")
