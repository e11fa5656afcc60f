"""The Python interface as a notebook uses it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import roadlog
from roadlog.errors import LogReadError


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
    log.write([smooth], log.drive(), engine="compiled")
    np.testing.assert_array_equal(log.stored("kmbe").angles["grade"], smooth.grade)


def test_estimates_may_be_made_as_they_are_written(hill_log: Path) -> None:
    log = roadlog.open(hill_log)
    drive = log.drive()
    names = ["incl_kinematic", "ls_attitude"]
    log.write((log.estimate(n) for n in names), drive, engine="compiled", names=names)
    log.write((log.estimate(n) for n in names), drive, engine="compiled", names=names)
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
