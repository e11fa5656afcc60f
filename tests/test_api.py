"""The Python interface as a notebook uses it."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from support.drives import hill_tables

import roadlog
from roadlog.drive import Drive
from roadlog.errors import LogReadError
from roadlog.estimate import Estimate
from roadlog.signals import SECTIONS, TRUTH_TOPIC


def test_drive_and_log_become_tables(hill_log: Path) -> None:
    drive = roadlog.open(hill_log).drive()
    frame = drive.to_pandas()
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame["imu.accel_x"], drive["imu.accel_x"])
    assert drive.to_arrow().column_names[:1] == ["time"]


def test_an_estimator_runs_and_becomes_a_table(hill_log: Path) -> None:
    before = hill_log.read_bytes()
    log = roadlog.open(hill_log)
    causal = log.estimate("kmbe", smooth=False)
    smooth = log.estimate("kmbe")
    assert np.abs(causal.grade - smooth.grade).max() > 1e-4
    frame = smooth.to_pandas()
    assert list(frame.columns[:1]) == ["grade"]
    np.testing.assert_array_equal(frame["grade_sd"], smooth.grade_sd)
    assert hill_log.read_bytes() == before
    log.write([smooth])
    np.testing.assert_array_equal(log.stored("kmbe").grade, smooth.grade)


def test_estimates_may_be_made_as_they_are_written(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    names = ["incl_kinematic", "ls_attitude"]
    log.write((log.estimate(n) for n in names), names=names)
    log.write((log.estimate(n) for n in names), names=names)
    assert log.estimators == names
    assert {f"estimate/{n}" for n in names} <= set(log.metadata)


def test_a_file_that_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_text("no log")
    with pytest.raises(LogReadError, match="is no MCAP file"):
        roadlog.open(path)


def test_import_alone_loads_nothing_heavy() -> None:
    code = "import sys, roadlog; print([m for m in ('numpy', 'numba', 'mcap') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_names_are_there_when_they_are_used() -> None:
    assert roadlog.Drive is Drive
    assert roadlog.Estimate is Estimate
    assert issubclass(LogReadError, roadlog.RoadlogError)
    assert roadlog.estimators.get("kmbe").name == "kmbe"
    assert {"Vehicle", "simulate", "ingest", "open"} <= set(dir(roadlog))
    assert (
        roadlog.simulate("luo2024-s1", seed=1).vehicle
        == roadlog.simulate.simulate("luo2024-s1", seed=1).vehicle
    )
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        roadlog.simulat  # noqa: B018
    with pytest.raises(LogReadError, match="no such file"):
        roadlog.ingest(["nowhere.csv"])


COPIES: list[Callable] = [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]


@pytest.mark.parametrize("copied", COPIES, ids=["copy", "deepcopy", "pickle"])
def test_drives_estimates_and_logs_can_be_copied(copied: Callable, hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    drive, estimate = log.drive(), log.estimate("kmbe")
    truth, vehicle = log.truth(), log.vehicle
    for thing in (drive, estimate, truth, vehicle, estimate.errors(truth)):
        again = copied(thing)
        assert again == thing
    assert copied(log).drive() == drive
    other = copied(estimate)
    np.testing.assert_array_equal(other.grade_sd, estimate.grade_sd)
    assert copied(drive)["imu.accel_x"].flags.writeable is False


def test_equality_is_by_value_and_never_raises(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    drive, estimate = log.drive(), log.estimate("kmbe")
    assert drive == log.drive()
    assert drive != log.drive(rate=50.0)
    assert estimate == replace(estimate)
    assert estimate != replace(estimate, angles={"grade": estimate.grade + 1e-9})
    assert estimate != replace(estimate, angles={"grade": np.arange(3)}, time=np.arange(3.0), sd={})
    assert estimate != log.truth()
    for thing in (drive, estimate, log.truth()):
        assert thing != "kmbe"
        assert thing != 1


def test_an_estimator_runs_in_another_process(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    drive, vehicle = log.drive(), log.vehicle
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        there = pool.submit(roadlog.estimators.run, "kmbe", drive, vehicle).result()
    here = log.estimate("kmbe")
    assert replace(there, run_time=0.0) == replace(here, run_time=0.0)


def test_signals_cannot_be_changed_by_a_user(hill_log: Path) -> None:
    drive = roadlog.open(hill_log).drive()
    arrays = [drive.time, drive.speed, drive.standstill, drive.straight, drive["imu.accel_x"]]
    for values in (*arrays, drive.native["imu"].columns["accel_x"]):
        with pytest.raises(ValueError, match="read-only"):
            values[:] = 0


def test_one_type_for_fresh_stored_and_true(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    fresh = log.estimate("kmbe")
    log.write([fresh])
    stored, truth = log.stored("kmbe"), log.truth()
    for result in (fresh, stored, truth):
        assert isinstance(result, Estimate)
        assert result.grade.shape == result.grade_sd.shape == result.valid.shape
        assert result.time_ns.dtype == np.int64
        frame = result.to_pandas()
        assert frame.attrs["units"]["grade"] == "rad"
        assert frame.attrs["start_ns"] == log.drive().start_ns
        assert result.to_arrow().schema.field("grade_sd").metadata == {b"unit": b"rad"}
    np.testing.assert_array_equal(stored.time_ns, fresh.time_ns)
    assert (stored.name, stored.engine, stored.inputs) == ("kmbe", "compiled", fresh.inputs)
    assert stored.parameters == fresh.parameters
    assert stored.notes == fresh.notes
    assert log.drive().to_pandas().attrs["units"]["imu.accel_x"] == "m/s^2"


def test_into_xarray(hill_log: Path) -> None:
    pytest.importorskip("xarray")
    estimate = roadlog.open(hill_log).estimate("kmbe")
    found = estimate.to_xarray()
    assert found["grade"].attrs["units"] == "rad"
    assert found.attrs["engine"] == "compiled"
    np.testing.assert_array_equal(found["grade"], estimate.grade)


def test_what_a_notebook_shows(hill_log: Path) -> None:
    with roadlog.open(hill_log) as log:
        estimate = log.estimate("kmbe")
        log.write([estimate])
        table = log.evaluate()
        things = [log, log.drive(), estimate, log.truth(), estimate.errors(log.truth())]
        for thing in things:
            assert len(repr(thing)) < 300
            assert "<table>" in thing._repr_html_()
        assert "<table>" in table._repr_html_()
        frame = table.to_pandas()
        assert frame.loc[("kmbe", "grade"), "rmse_deg"] == table["kmbe"]["grade"].rmse_deg


def test_a_log_is_not_stale_after_it_is_written(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    assert log.vehicle == roadlog.Vehicle()
    heavy = roadlog.Vehicle().with_values(mass=1850.0)
    log.write([log.estimate("kmbe")], vehicle=heavy)
    assert log.vehicle.mass == 1850.0
    assert log.estimators == ["kmbe"]


def test_an_estimate_without_a_start_is_not_stored(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    before = hill_log.read_bytes()
    with pytest.raises(roadlog.RoadlogError, match="does not know when it begins"):
        log.write([replace(log.estimate("kmbe"), start_ns=None)])
    assert hill_log.read_bytes() == before


def test_a_truth_that_starts_late_gives_the_same_errors(tmp_path: Path) -> None:
    found = []
    for late in (0, 1, 5, 10):
        tables = hill_tables()
        truth = next(t for t in tables if t.topic == TRUTH_TOPIC)
        keep = truth.time >= truth.time[0] + late * 1_000_000_000
        columns = {name: values[keep] for name, values in truth.columns.items()}
        tables = [t for t in tables if t is not truth]
        tables.append(replace(truth, time=truth.time[keep], columns=columns))
        log = roadlog.create(tmp_path / f"late{late}.mcap", tables)
        estimate = log.estimate("kmbe")
        errors = estimate.errors(log.truth(), skip=12.0).metrics()["grade"]
        at = np.interp(log.truth().time, estimate.time, estimate.grade)
        by_hand = np.degrees(at - log.truth().grade)[log.truth().time >= 12.0]
        assert np.sqrt(np.mean(by_hand**2)) == pytest.approx(errors.rmse_deg, abs=1e-9)
        log.write([estimate])
        assert log.evaluate(skip=12.0)["kmbe"]["grade"].rmse_deg == pytest.approx(errors.rmse_deg)
        found.append(errors.rmse_deg)
    assert np.ptp(found) < 0.002


def test_time_counts_from_the_first_input_however_late_it_is(tmp_path: Path) -> None:
    tables = hill_tables()
    truth = next(t for t in tables if t.topic == TRUTH_TOPIC)
    late = [replace(t, time=t.time + 20_000_000_000) for t in tables if t is not truth]
    log = roadlog.create(tmp_path / "late.mcap", [truth, *late])
    assert log.drive_start_ns == log.drive().start_ns == int(late[0].time[0])
    assert log.truth().time[0] == -20.0
    alone = roadlog.create(tmp_path / "alone.mcap", [truth])
    assert alone.truth().time[0] == 0.0
    assert SECTIONS["imu"].topic not in {c.topic for c in alone.channels}
