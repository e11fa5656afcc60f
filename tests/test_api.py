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


def test_a_file_that_is_no_log(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_text("no log")
    with pytest.raises(LogReadError, match="is no MCAP file"):
        roadlog.open(path)


def test_import_alone_loads_nothing_heavy() -> None:
    code = "import sys, roadlog; print([m for m in ('numpy', 'numba', 'mcap') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
