"""Each format of phones, receivers, cameras and loggers: `ingest`, `info`, `estimate` as a user.

No profile by hand. That the values are those that were driven, tests/ingest says.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support import camera_formats
from support.drives import Run
from support.phone_drive import EPOCH, PhoneDrive
from support.phone_formats import APPS
from support.phone_variants import VARIANTS
from support.receiver_formats import RECEIVERS

from roadlog.log import DriveLog

DRIVE = PhoneDrive()
CAMERAS = ("gopro", "gopro_turned", "gopro_json", "gopro_tables", "gopro_tables_older")
NEEDS = {"fit": "fit_tool", "openpilot": "capnp", "phyphox_xlsx": "openpyxl"}


def openpilot(folder: Path) -> Path:
    """A comma device's log."""
    from support.openpilot_log import write

    return write(folder / "rlog.zst")


WRITERS: dict[str, Callable[[Path], Path]] = {
    **APPS,
    **VARIANTS,
    **RECEIVERS,
    **{name: getattr(camera_formats, name) for name in CAMERAS},
    "openpilot": openpilot,
}


@pytest.mark.parametrize("name", WRITERS)
def test_from_the_file_to_angles(tmp_path: Path, roadlog: Run, name: str) -> None:
    for package in ("gpxpy", "fitdecode", "pyubx2", NEEDS.get(name, "numpy")):
        pytest.importorskip(package)
    source = WRITERS[name](tmp_path)
    done = roadlog("ingest", source, "-o", "drive.mcap")
    assert done.returncode == 0, done.stderr
    done = roadlog("info", "drive.mcap")
    assert done.returncode == 0, done.stderr
    checks = [line for line in done.stdout.splitlines() if line.startswith("CHECK")]
    slow = [line for line in checks if "imu: comes every 0.5 s only" in line]
    assert (checks, bool(slow)) == (slow, name.startswith("torque"))
    able = re.search(r"can run: (.*)", done.stdout)
    assert able is not None
    has_imu = bool(re.search(r"^imu\.accel_x", done.stdout, re.MULTILINE))
    assert has_imu == ("kmbe" in able[1])
    if not has_imu:
        assert "cannot run: kmbe: " in done.stdout
        assert ("--truth-from gnss" in done.stdout) == (name != "obd_fusion")  # speed by OBD
        refused = roadlog("estimate", "drive.mcap")
        assert refused.returncode == 1
        assert "no estimator can run; " in refused.stderr
        assert len(refused.stderr) < 300
        return
    done = roadlog("estimate", "drive.mcap", "-e", "kmbe")
    assert done.returncode == 0, done.stderr
    grade = DriveLog(tmp_path / "drive.mcap").stored("kmbe")
    seconds = grade.time_ns * 1e-9
    since = seconds - (EPOCH if seconds[0] > 1e8 else 32400 if seconds[0] > 1e4 else 0)
    error = np.degrees(grade.grade - DRIVE.grade(since))
    moving = (since > 25) & (since < 110)
    if slow:  # its angles are written, but may not be used
        assert "imu: comes every 0.5 s only" in done.stderr
        assert not grade.valid.any()
    else:
        moving &= grade.valid
    assert moving.sum() > 40
    assert np.sqrt(np.mean(error[moving] ** 2)) < (2.5 if name.startswith("torque") else 1.0)
