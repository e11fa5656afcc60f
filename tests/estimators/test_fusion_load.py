"""A constant pitch is mounting or load; what cannot be told apart is in the standard deviation."""

from pathlib import Path

import numpy as np
import pytest
from support.drives import simulated

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.fusion.load import USUAL_SD, load_pitch
from roadlog.log import DriveLog
from roadlog.metrics import angle_errors
from roadlog.signals import TRUTH_TOPIC
from roadlog.units import DEG

STATED, LOOSE = 0.3, 1.5  # deg, sd of a mounting
SAMPLES = Path(__file__).parent.parent.parent / "sample_logs"


def load(found: float, mounting: float, known: float = 0.05) -> tuple[float, float]:
    """deg, the load's part of a pitch and its sd."""
    mean, variance = load_pitch(found * DEG, known * DEG, mounting * DEG, USUAL_SD)
    return mean / DEG, float(np.sqrt(variance)) / DEG


@pytest.mark.parametrize("found", [-0.4, -0.15, 0.0, 0.15, 0.3, 0.5])
def test_what_a_stated_mounting_may_be_is_no_load(found: float) -> None:
    mean, sd = load(found, STATED)
    assert abs(mean) <= 0.1 * abs(found)
    assert 0.1 < sd < 0.45


@pytest.mark.parametrize("found", [1.2, 1.6, 2.0])
def test_what_no_stated_mounting_can_be_is_a_load(found: float) -> None:
    mean, sd = load(found, STATED)
    assert mean == pytest.approx(found, abs=0.25)
    assert abs(found - mean) < 2 * sd


@pytest.mark.parametrize("pitch", [-0.1, 0.0, 0.2, 0.6, 1.15])
@pytest.mark.parametrize("mounting", [-0.3, 0.0, 0.5, 1.0])
def test_of_a_loose_mounting_every_usual_load_is_within_its_sd(
    pitch: float, mounting: float
) -> None:
    mean, sd = load(pitch + mounting, LOOSE)
    assert abs(pitch - mean) < 2 * sd


def test_where_the_data_say_nothing_the_load_is_as_likely_as_before() -> None:
    mean, variance = load_pitch(0.0, np.inf, STATED * DEG, USUAL_SD)
    assert mean == 0.0
    assert np.sqrt(variance) / DEG == pytest.approx(0.81, abs=0.05)


def test_a_load_that_is_sure_to_be_there_divides_the_pitch_by_the_priors() -> None:
    mean, _ = load_pitch(1.0, 0.0, 1.0, 1.0, laden=0.0)
    assert mean == pytest.approx(0.5, abs=0.01)


def within(estimate: Estimate, truth: Estimate, angle: str) -> tuple[float, float]:
    """deg RMS of the error, and the share within 2 sd."""
    errors = angle_errors(estimate, truth, angle)
    assert errors is not None
    error, sd = errors.error[errors.valid], errors.sd[errors.valid]
    return float(np.sqrt(np.mean(error**2))) / DEG, float(np.mean(np.abs(error) < 2 * sd))


def test_a_full_trunk_behind_a_mounting_that_nobody_stated() -> None:
    log = DriveLog(SAMPLES / "stops.mcap")
    truth = log.truth()
    assert truth is not None
    estimate = estimators.run("fusion", log.drive(), log.vehicle)
    for angle in ("grade", "pitch", "inclination", "bank", "roll"):
        assert within(estimate, truth, angle)[1] > 0.9, angle


def test_a_full_trunk_is_found_where_the_mounting_is_stated() -> None:
    own = {"speed.motions": 3, "imu.accel_bias": (0.0, 0.0, 0.0)}
    drive = simulated("kim2023-testroad", seed=1, full=True, load="trunk", overrides=own)
    truth = Estimate.from_table(drive.table(TRUTH_TOPIC))
    estimate = estimators.run("fusion", Drive.from_tables(drive.tables), drive.vehicle)
    rms, near = within(estimate, truth, "pitch")
    assert rms < 0.4  # of 1.15
    assert near > 0.9
