"""The cases of vehicle logs beside the project, each as its case.md expects it."""

from __future__ import annotations

import runpy
import shutil
from contextlib import chdir
from pathlib import Path

import numpy as np
import pytest
from support.drives import SHARED

from roadlog.car.vehicle import Vehicle
from roadlog.checks import check
from roadlog.drive import Drive
from roadlog.estimators import run
from roadlog.ingest import IngestResult, ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.profile import Profile

pytest.importorskip("cantools")
pytest.importorskip("can")

MOTION = """[imu]
accel_x = { from = "Motion.AccelX", unit = "m/s^2" }
[speed]
v = { from = "Motion.VehicleSpeed", unit = "km/h" }
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the cases with their inputs."""
    source = SHARED.parent / "cases" / "vehicle"
    if not source.is_dir():
        pytest.skip("no cases/vehicle beside the project")
    folder = tmp_path_factory.mktemp("cases") / "vehicle"
    shutil.copytree(source, folder)
    for path in [folder, *folder.rglob("*")]:
        path.chmod(0o755 if path.is_dir() else 0o644)
    makes = sorted(folder.glob("*/make.py"), key=lambda p: "two-buses" not in str(p))
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder / "mf4-virtual-ide"))
        for make in makes:
            with chdir(make.parent):
                runpy.run_path(str(make))
    return folder


def drafted(source: Path, dbc: Path | None = None) -> tuple[str, IngestResult]:
    """The profile that `profile new` writes, and what `ingest` makes of it."""
    databases = [dbc] if dbc else []
    text = starter([source], databases)
    return text, ingest([source], Profile.from_toml(text, "new"), databases)


def column(result: IngestResult, topic: str, field: str) -> np.ndarray:
    return next(t for t in result.tables if t.topic == topic).columns[field]


@pytest.mark.parametrize(
    ("name", "count", "first", "last"),
    [
        ("candump-human/car.txt", 3000, 50.0, 79.99),
        ("trc-1.0/car.trc", 3000, 50.0, 79.99),
        ("dbc-short-frames/car.log", 3000, 50.0, 79.99),
        ("mf4-virtual-ide/virtual.mf4", 6000, 50.0, 109.99),
        ("mf4-virtual-ide/real.mf4", 6000, 50.0, 109.99),
    ],
)
def test_a_trace_gives_every_frame(made, name, count, first, last):
    dbc = (made / name).with_name("car.dbc")
    result = ingest([made / name], Profile.from_toml(MOTION, "p"), [dbc])
    assert {m.samples for m in result.mapped} == {count}
    speed = column(result, "/speed", "v") * 3.6
    np.testing.assert_allclose([speed[0], speed[-1]], [first, last], atol=1e-9)
    assert result.losses == []


def test_the_log_of_python_can_in_sqlite(made):
    profile = Profile.from_toml(MOTION, "p")
    dbc = made / "two-buses-one-id" / "car.dbc"
    result = ingest([made / "can-sqlite" / "car.db"], profile, [dbc])
    assert {m.samples for m in result.mapped} == {500}


def test_two_buses(made):
    folder = made / "two-buses-one-id"
    text, result = drafted(folder / "car.log", folder / "car.dbc")
    assert 'from = "can0.Motion.VehicleSpeed"' in text or 'from = "can1.Motion.' in text
    assert any("Motion (0x64) comes on can0 (3000) and can1 (3000)" in n for n in result.notes)


def test_a_truck(made):
    folder = made / "j1939-source"
    _, result = drafted(folder / "truck.log", folder / "j1939.dbc")
    speed = column(result, "/speed", "v") * 3.6
    assert len(speed) == 3000
    np.testing.assert_allclose([speed[0], speed[-1]], [60.0, 89.99], atol=0.005)
    np.testing.assert_allclose(column(result, "/imu", "accel_x"), 0.0, atol=1e-9)


def test_codes_of_no_value_do_not_reach_the_estimators(made):
    folder = made / "dbc-no-value-codes"
    text, result = drafted(folder / "car.log", folder / "car.dbc")
    assert {m.role: m.invalid for m in result.mapped} == {
        "imu.accel_x": 150,
        "imu.accel_z": 0,
        "speed.v": 150,
    }
    assert "top speed" not in text
    drive = Drive.from_tables(result.tables)
    estimate = run("kmbe", drive, Vehicle())
    error = np.degrees(estimate.angles["grade"] - 0.03 * np.sin(drive.time / 40))
    error[~estimate.valid] = np.nan
    assert np.sqrt(np.nanmean(error[drive.time > 160] ** 2)) < 0.2
    assert np.nanmax(np.abs(error)) < 5.0


@pytest.mark.parametrize(
    ("name", "mean"), [("csv-unit-row-slow", 12.49), ("csv-unit-row-with-digits", None)]
)
def test_rows_of_units(made, name, mean):
    text, result = drafted(made / name / "drive.csv")
    assert "nothing states the unit" not in text
    assert result.losses == []
    assert 'v = { from = "Speed", unit = "km/h" }' in text
    if mean:
        assert column(result, "/speed", "v").mean() == pytest.approx(mean, abs=0.01)


def test_the_vertical_speed_is_no_speed(made):
    text, _ = drafted(made / "csv-vertical-speed" / "drive.csv")
    assert 'v = { from = "velocity_kmh", unit = "km/h" }' in text
    assert 'climb = { from = "vert-vel"' in text


def test_positions_in_minutes(made):
    folder = made / "csv-position-in-minutes"
    text, result = drafted(folder / "drive.csv")
    assert 'v = { from = "velocity", unit = "km/h" }' in text
    assert np.nanmax(column(result, "/gnss", "latitude")) < 51
    given = ingest([folder / "drive.csv"], folder / "p.toml")
    found = [str(f) for f in check({t.topic: t for t in given.tables}) if f.level == "fault"]
    assert any("minutes of arc" in f for f in found)
    assert not any("tire radius" in f for f in found)
