"""A log that roadlog 0.1.0 wrote stays readable, and stays a log that results can go into.

Made with it by `roadlog simulate wang2025-up9 -o F --set duration=6` and `estimate F -e kmbe`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import ROOT

import roadlog
from roadlog.signals import ANGLES

GOLDEN = ROOT / "tests" / "data" / "roadlog-0.1.0.mcap"
RMSE_DEG = 0.07024  # of kmbe, as `roadlog evaluate` of 0.1.0 said


def test_everything_in_it_is_read() -> None:
    log = roadlog.open(GOLDEN)
    assert log.estimators == ["kmbe"]
    assert log.vehicle.mass == 1980.0
    assert log.metadata["estimate/kmbe"]["roadlog"] == "0.1.0"
    drive = log.drive()
    assert len(drive) == 601
    assert all(r in drive for r in ("imu.accel_x", "speed.v", "fuel.sender"))
    truth = log.truth()
    assert truth is not None
    assert set(truth.angles) == set(ANGLES)
    assert truth.valid.all()
    assert log.losses == []


def test_its_estimate_means_what_it_meant() -> None:
    log = roadlog.open(GOLDEN)
    stored = log.stored("kmbe")
    assert stored.valid.all()
    assert np.isfinite(stored.grade).all()
    assert np.isfinite(stored.grade_sd).all()
    figures = log.evaluate().figures["kmbe"]["grade"]
    assert figures.rmse_deg == pytest.approx(RMSE_DEG, abs=1e-5)


def test_a_result_can_be_put_in_its_place(tmp_path: Path) -> None:
    copy = tmp_path / "copy.mcap"
    copy.write_bytes(GOLDEN.read_bytes())
    log = roadlog.open(copy)
    before = log.stored("kmbe").grade
    log.write([log.estimate("kmbe", smooth=False)])
    again = roadlog.open(copy)
    assert again.estimators == ["kmbe"]
    assert not np.allclose(again.stored("kmbe").grade, before)
    assert again.losses == []
