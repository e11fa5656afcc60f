"""A recording holds what the log says; read back without a viewer."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from roadlog import estimators
from roadlog.errors import MissingSignalError
from roadlog.log import DriveLog
from roadlog.vehicle import Vehicle
from roadlog.view.model import drive_view
from roadlog.view.recording import write_recording


@pytest.fixture
def log(hill_log: Path) -> DriveLog:
    log = DriveLog(hill_log)
    drive = log.drive()
    names = ("kmbe", "lowpass_attitude")
    estimates = [estimators.run(name, drive, Vehicle()) for name in names]
    log.write(estimates, drive, engine="compiled")
    return DriveLog(hill_log)


def column(path: Path, entity: str, name: str) -> np.ndarray:
    stream = RrdReader(path).stream().filter(content=entity, is_static=False)
    table = pa.Table.from_batches([c.to_record_batch() for c in stream]).sort_by("drive_time")
    return table[name].combine_chunks().flatten().to_numpy()


def test_recording_shows_the_estimate_in_degrees_with_its_variance(
    log: DriveLog, tmp_path: Path
) -> None:
    path = tmp_path / "x.rrd"
    write_recording(drive_view(log), path)
    track = log.estimate("kmbe")
    shown = column(path, "/angles/grade/kmbe", "Measurements:values")
    np.testing.assert_allclose(shown, np.degrees(track.angles["grade"])[::5], atol=1e-12)
    variance = column(path, "/angles/grade/kmbe", "Measurements:variances")
    np.testing.assert_allclose(np.sqrt(variance), np.degrees(track.sd["grade"])[::5], atol=1e-9)
    truth = column(path, "/angles/grade/truth", "Scalars:scalars")
    np.testing.assert_allclose(truth, np.degrees(log.truth().angles["grade"])[::5], atol=1e-12)


def test_every_tab_has_its_views(log: DriveLog, tmp_path: Path) -> None:
    path = tmp_path / "x.rrd"
    write_recording(drive_view(log), path)
    reader = RrdReader(path)
    entities = {c.entity_path for c in reader.store().schema().component_columns()}
    assert {
        "/angles/grade/truth",
        "/angles/grade/kmbe",
        "/angles/inclination/lowpass_attitude",
        "/errors/grade/kmbe",
        "/errors/grade/kmbe/band",
        "/inputs/imu/accel",
        "/inputs/imu/gyro",
        "/inputs/speed",
    } <= entities
    (blueprint,) = reader.blueprints()
    batches = [c.to_record_batch() for c in reader.stream(store=blueprint)]
    classes = [
        kind[0]
        for batch in batches
        if "ViewBlueprint:class_identifier" in batch.schema.names
        for kind in batch.column("ViewBlueprint:class_identifier").to_pylist()
    ]
    # six angles of the truth, two errors, three inputs
    assert classes == ["TimeSeries"] * 11


def test_one_estimator_at_another_rate(log: DriveLog) -> None:
    view = drive_view(log, ["kmbe"], rate=50.0)
    assert view.estimators == ("kmbe",)
    assert np.median(np.diff(view.estimates["grade"]["kmbe"].time)) == pytest.approx(0.02)
    with pytest.raises(MissingSignalError, match=r"no estimate 'kmb'. Close: kmbe"):
        drive_view(log, ["kmb"])
