"""Every straight-driving method on damaged input."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.drives import hill_tables

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import EstimatorError

METHODS = (
    "incl_kinematic",
    "ls_window",
    "rls_forget",
    "ti",
    "pn",
    "ti_rls",
    "ekf_suspension",
    "lowpass_attitude",
    "ls_attitude",
    "fuel_level",
)
WITHOUT_F_Z = ("incl_kinematic", "ekf_suspension", "lowpass_attitude", "ls_attitude")
ALL = pytest.mark.parametrize("method", METHODS)
CAR = Vehicle()
MISSING, CONVERGING, STANDSTILL = 1, 32, 8


def drive_with(rate: float = 100.0, log_rate: float = 100.0, **changes: slice) -> Drive:
    """The hill drive with a fuel sender; role (dots as __) -> samples set to NaN."""
    drive = Drive.from_tables(hill_tables(rate=log_rate), rate)
    signals = {role: values.copy() for role, values in drive.signals.items()}
    signals["fuel.sender"] = np.full(len(drive), 0.07)
    for role, where in changes.items():
        signals[role.replace("__", ".")][where] = np.nan
    return dataclasses.replace(drive, signals=signals)


def outputs(estimate) -> dict[str, np.ndarray]:
    """Every array that is to be finite or flagged."""
    result = dict(estimate.angles)
    result |= {f"{name}_sd": values for name, values in estimate.sd.items()}
    if "fuel" in estimate.details:
        columns = dict(estimate.details["fuel"].columns)
        for name in ("consumption", "remaining_range"):  # unknown of a car without a map
            assert np.isnan(columns.pop(name)).all()
        result |= columns
    return result


def check(estimate, drive: Drive) -> None:
    """Lengths equal, no NaN without a flag, nothing valid that is not known, angles add up."""
    for name, values in outputs(estimate).items():
        assert len(values) == len(drive), name
        bad = ~np.isfinite(values)
        assert not (bad & (estimate.flags == 0)).any(), name
        assert not (bad & estimate.valid).any(), name
    assert len(estimate.flags) == len(estimate.valid) == len(drive)
    if {"grade", "pitch", "inclination"} <= set(estimate.angles):
        total = estimate.grade + estimate.pitch - estimate.inclination
        assert np.nanmax(np.abs(total), initial=0.0) < 1e-12


@ALL
def test_clean_drive_is_valid_nearly_everywhere(method: str) -> None:
    drive = drive_with()
    estimate = estimators.run(method, drive, CAR)
    check(estimate, drive)
    # the regressions say nothing near the extremes of dv/dt, where it does not change
    assert estimate.valid.mean() > (0.8 if method in ("ls_window", "rls_forget") else 0.9)
    known = [np.isfinite(values[300:]).mean() for values in outputs(estimate).values()]
    assert min(known) > 0.99


@ALL
@pytest.mark.parametrize("role", ["imu__accel_x", "imu__accel_z"])
def test_burst_of_nan_is_flagged_and_left_behind(method: str, role: str) -> None:
    if role == "imu__accel_z" and method in WITHOUT_F_Z:
        pytest.skip("does not use f_z")
    drive = drive_with(**{role: slice(3000, 3100)})
    estimate = estimators.run(method, drive, CAR)
    check(estimate, drive)
    assert (estimate.flags[3010:3090] & MISSING).all()
    clean = estimators.run(method, drive_with(), CAR)
    after = slice(3100 + 800, None)  # the longest window and its halves
    for name, values in estimate.angles.items():
        assert np.isfinite(values[after]).all() == np.isfinite(clean.angles[name][after]).all()
        difference = np.abs(values - clean.angles[name])[after]
        assert np.nanmax(difference) < np.radians(0.05), name


@ALL
def test_ten_second_gap_in_everything(method: str) -> None:
    gap = slice(2000, 3000)
    drive = drive_with()
    signals = {role: values.copy() for role, values in drive.signals.items()}
    for values in signals.values():
        values[gap] = np.nan
    drive = dataclasses.replace(drive, signals=signals)
    estimate = estimators.run(method, drive, CAR)
    check(estimate, drive)
    assert (estimate.flags[2200:2900] & MISSING).all()
    assert not estimate.valid[2300:2900].any()
    for name, values in estimate.angles.items():
        assert np.isfinite(values[3900:5500]).mean() > 0.95, name


@ALL
def test_standing_car_is_flagged(method: str) -> None:
    drive = drive_with()
    standing = np.zeros(len(drive))
    signals = dict(drive.signals) | {
        f"wheel_speeds.{w}": standing for w in ("fl", "fr", "rl", "rr")
    }
    drive = dataclasses.replace(drive, signals=signals)
    estimate = estimators.run(method, drive, CAR)
    check(estimate, drive)
    if method != "fuel_level":  # fuel does not care whether the car stands
        assert (estimate.flags & STANDSTILL).all()
    if method in ("ti", "pn", "ti_rls"):
        assert not estimate.valid.any()


@ALL
def test_log_of_25_hz(method: str) -> None:
    for rate in (100.0, 25.0):
        drive = drive_with(rate, log_rate=25.0)
        estimate = estimators.run(method, drive, CAR)
        check(estimate, drive)
        assert estimate.valid.mean() > 0.8


@ALL
def test_signal_of_nothing_but_nan(method: str) -> None:
    drive = drive_with(imu__accel_x=slice(None))
    estimate = estimators.run(method, drive, CAR)
    check(estimate, drive)
    assert not estimate.valid.any()


@ALL
def test_missing_signal_is_named(method: str) -> None:
    drive = drive_with()
    signals = {role: v for role, v in drive.signals.items() if not role.startswith("wheel_speeds")}
    with pytest.raises(EstimatorError, match="speed"):
        estimators.run(method, dataclasses.replace(drive, signals=signals), CAR)


@ALL
def test_few_samples(method: str) -> None:
    full = drive_with()
    for n in (1, 2, 7):
        signals = {role: values[:n] for role, values in full.signals.items()}
        drive = Drive(full.time[:n], full.start_ns, full.rate, signals, {})
        check(estimators.run(method, drive, CAR), drive)


@ALL
def test_results_survive_the_log(method: str, tmp_path) -> None:
    from roadlog.log import create

    drive = drive_with()
    log = create(tmp_path / "hill.mcap", hill_tables())
    estimate = estimators.run(method, drive, CAR)
    log.write([estimate])
    for name, detail in estimate.details.items():
        table = log.detail(method, name)
        assert table is not None
        for field, values in detail.columns.items():
            np.testing.assert_array_equal(table.columns[field], values)
