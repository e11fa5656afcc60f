"""The sample logs: whole, as the README says, and as the script makes them."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from support.drives import ROOT, Run

from roadlog.log import DriveLog
from roadlog.signals import TRUTH_TOPIC

FOLDER = ROOT / "sample_logs"
LOGS = sorted(FOLDER.glob("*.mcap"))
LIMIT = 12_000_000  # bytes of all together


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make", FOLDER / "make.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["make"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def test_all_are_there_and_small(script: ModuleType) -> None:
    assert {path.stem for path in LOGS} == set(script.SAMPLES)
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < LIMIT


@pytest.mark.parametrize("path", LOGS, ids=lambda path: path.stem)
def test_a_log_is_whole_and_has_truth(path: Path) -> None:
    log = DriveLog(path)
    truth = log.truth()
    assert not log.losses
    assert truth is not None
    assert {"grade", "pitch"} <= set(truth.angles)
    assert log.drive().has_speed


def test_a_log_is_what_the_script_makes(script: ModuleType) -> None:
    simulation = script.drive(script.SAMPLES["slalom"])
    tables = DriveLog(FOLDER / "slalom.mcap").tables(["/imu", TRUTH_TOPIC])
    for topic, table in tables.items():
        made = simulation.table(topic)
        np.testing.assert_array_equal(table.time, made.time)
        for name, values in made.columns.items():
            # another processor may round another way, and an LSB then falls to the other side
            np.testing.assert_allclose(table.columns[name], values, atol=2e-3, err_msg=name)


def test_the_csv_says_the_same_as_its_log(roadlog: Run, tmp_path: Path) -> None:
    csv, profile = FOLDER / "small_logger.csv", FOLDER / "small_logger.toml"
    done = roadlog("ingest", csv, "-o", tmp_path / "small.mcap", "--profile", profile)
    assert done.returncode == 0, done.stderr
    small = DriveLog(tmp_path / "small.mcap").drive(50.0)
    whole = DriveLog(FOLDER / "ramps.mcap").drive(50.0)
    for role in ("imu.accel_x", "imu.accel_y", "imu.accel_z", "imu.gyro_x", "imu.gyro_z"):
        np.testing.assert_allclose(small[role][:2900], whole[role][:2900], atol=0.05)
