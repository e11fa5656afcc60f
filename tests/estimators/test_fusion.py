"""`fusion` on drives with known truth, with faults, and on the public comma2k19 minute."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.drives import antenna_apart, hill_tables, simulated, table
from support.memory import peak

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators.fusion.speed import SpeedSource, gnss_delay
from roadlog.metrics import AngleMetrics, angle_errors, angle_metrics
from roadlog.signals import FLAGS, TRUTH_TOPIC
from roadlog.storage import Table

RIGID = Vehicle().with_values(pitch_gradient=0.0, roll_gradient=0.0)


def metrics(tables: list[Table], estimate: Estimate, angle: str) -> AngleMetrics:
    truth = next(t for t in tables if t.topic == TRUTH_TOPIC)
    errors = angle_errors(estimate, Estimate.from_table(truth), angle)
    assert errors is not None
    return angle_metrics(errors, angle)


def run(
    tables: list[Table], vehicle: Vehicle = RIGID, **settings: object
) -> tuple[Estimate, Drive]:
    drive = Drive.from_tables(tables)
    return estimators.run("fusion", drive, vehicle, settings), drive


def without(source: Table, start: float, end: float) -> Table:
    """The channel without a stretch of time, s."""
    since = (source.time - source.time[0]) * 1e-9
    keep = (since < start) | (since > end)
    return Table(
        source.topic,
        source.schema,
        source.time[keep],
        {name: values[keep] for name, values in source.columns.items()},
    )


def with_gnss(tables: list[Table], delay: float = 0.0) -> list[Table]:
    """A 10 Hz receiver beside `hill_tables`, exact but late."""
    truth, wheels = tables[2], tables[1]
    at = slice(None, None, 10)
    v, grade = wheels.columns["fl"][at], truth.columns["grade"][at]
    columns = {"speed": v, "course": 0 * v, "climb": v * np.sin(grade)}
    return [*tables, table("gnss", wheels.time[at] + round(delay * 1e9), columns)]


def test_finds_the_grade_of_a_hill() -> None:
    tables = hill_tables(120.0)
    grade = metrics(tables, run(tables)[0], "grade")
    assert grade.std_deg is not None
    assert grade.std_deg < 0.06
    assert grade.within_2sd == 1.0


@pytest.mark.parametrize("name", ["wang2025-up9", "wang2025-down12"])
def test_shape_of_the_grade_on_simulated_roads(name: str) -> None:
    drive = simulated(name, seed=1)
    found = run(drive.tables, drive.vehicle)
    for angle in ("grade", "pitch"):
        result = metrics(drive.tables, found[0], angle)
        assert result.std_deg is not None
        assert result.std_deg < 0.06, angle
        assert result.within_2sd is not None
        assert result.within_2sd > 0.93, angle


def test_gnss_makes_the_offset_known() -> None:
    """A biased accelerometer tilts the grade by b/g; a receiver that climbs tells."""
    tables = hill_tables(120.0)
    imu = tables[0]
    tables[0] = table("imu", imu.time, {**imu.columns, "accel_x": imu.columns["accel_x"] + 0.05})
    alone, _ = run(tables)
    assert abs(metrics(tables, alone, "grade").bias_deg or 0) > 0.2
    assert np.all(alone.flags & FLAGS["uncertain"])  # type: ignore[operator]
    assert any("mean of grade" in note for note in alone.notes)
    helped, _ = run(with_gnss(tables))
    assert (metrics(tables, helped, "grade").rmse_deg or 1) < 0.08
    assert not any("mean of grade" in note for note in helped.notes)
    assert helped.grade_sd.mean() < 0.5 * alone.grade_sd.mean()


@pytest.mark.parametrize("ahead", [-0.8, 0.8])
def test_an_antenna_elsewhere_does_not_tilt_the_imu(ahead: float) -> None:
    """In a slalom its course swings otherwise than the IMU's: nothing to bend the mounting for."""
    overrides = antenna_apart(ahead)
    tables = simulated("ryu2004-slalom", seed=11, overrides=overrides).tables
    estimate, _ = run(tables, Vehicle())
    assert (metrics(tables, estimate, "grade").rmse_deg or 1) < 0.045
    found = estimate.details["constants"].columns
    for name in ("mounting_pitch", "mounting_yaw"):
        assert abs(found[name][0]) < 2.0 * found[f"{name}_sd"][0], name


def test_shape_is_better_known_than_the_mean(hill_drive: Drive) -> None:
    estimate = estimators.run("fusion", hill_drive, RIGID)
    shape = estimate.details["shape"].columns["grade_shape_sd"]
    assert 0 < shape.mean() < 0.5 * estimate.grade_sd.mean()


def test_late_receiver_is_found() -> None:
    tables = with_gnss(hill_tables(120.0), delay=0.4)
    drive = Drive.from_tables(tables)
    wheels = drive.native["wheel_speeds"]
    source = SpeedSource("wheel_speeds", wheels.time, wheels.columns["fl"], 0.0, 0.02)
    assert gnss_delay(drive, source)[0] == pytest.approx(0.4, abs=0.01)
    on_time = Drive.from_tables(with_gnss(hill_tables(120.0)))
    assert abs(gnss_delay(on_time, source)[0]) < 0.01


def test_late_and_wrong_speed_is_found() -> None:
    """2 % of scale and 0.1 s of delay: constants of the smoother, not errors of the grade."""
    tables = with_gnss(hill_tables(120.0))
    wheels = tables[1]
    late = {name: 1.02 * values for name, values in wheels.columns.items()}
    tables[1] = table("wheel_speeds", wheels.time + 100_000_000, late)
    estimate, _ = run(tables)
    constants = estimate.details["constants"].columns
    assert constants["speed_scale"][0] == pytest.approx(0.02, abs=0.003)
    assert (metrics(tables, estimate, "grade").rmse_deg or 1) < 0.1


def test_speed_gaps_cost_little() -> None:
    """Five seconds without speed in every twenty."""
    tables = hill_tables(120.0)
    whole = metrics(tables, run(tables)[0], "grade").std_deg
    for start in range(10, 110, 20):
        tables[1] = without(tables[1], start, start + 5.0)
    estimate, _ = run(tables)
    assert (metrics(tables, estimate, "grade").std_deg or 1) < (whole or 0) + 0.02
    missing = (estimate.flags & FLAGS["missing"]) > 0  # type: ignore[operator]
    assert not missing[estimate.time < 9.9].any()
    away = np.minimum(np.abs(estimate.time - 10.0), np.abs(estimate.time - 15.0)) < 1.0
    assert not missing[away].any()  # smoothed across up to 3 s from the next sample


def test_imu_gap_is_left_out_and_flagged() -> None:
    tables = hill_tables(120.0)
    whole = metrics(tables, run(tables)[0], "grade").std_deg
    tables[0] = without(tables[0], 50.0, 53.0)
    estimate, _ = run(tables)
    gap = (estimate.time > 50.05) & (estimate.time < 52.95)
    assert np.isnan(estimate.grade[gap]).all()
    assert not estimate.valid[gap].any()
    edges = (np.abs(estimate.time - 49.0) < 0.5) | (np.abs(estimate.time - 54.0) < 0.5)
    assert np.all(estimate.flags[edges] & FLAGS["converging"])  # type: ignore[index]
    assert (metrics(tables, estimate, "grade").std_deg or 1) < (whole or 0) + 0.02


def test_slip_bursts_lose_their_weight() -> None:
    """+20 % of wheel speed for 0.5 s every 10 s changes the grade by less than 0.01 deg."""
    tables = hill_tables(120.0)
    whole = metrics(tables, run(tables)[0], "grade").rmse_deg
    wheels = tables[1]
    since = (wheels.time - wheels.time[0]) * 1e-9
    slipping = np.where(np.abs(since % 10 - 5) < 0.25, 1.2, 1.0)
    columns = {name: slipping * values for name, values in wheels.columns.items()}
    tables[1] = table("wheel_speeds", wheels.time, columns)
    assert metrics(tables, run(tables)[0], "grade").rmse_deg == pytest.approx(whole, abs=0.01)


@pytest.mark.parametrize("gnss", [False, True])
def test_comma2k19_minute(shared: Path, gnss: bool) -> None:
    from roadlog.ingest import ingest

    tables = ingest([shared / "comma2k19"]).tables
    if not gnss:
        tables = [t for t in tables if not t.topic.startswith("/gnss")]
    estimate, _ = run(tables, Vehicle())
    grade = metrics(tables, estimate, "grade")
    inclination = metrics(tables, estimate, "inclination")
    assert (grade.std_deg or 1) < 0.155
    assert (grade.within_2sd or 0) > 0.9
    if gnss:
        assert (grade.rmse_deg or 1) < 0.16
        assert (inclination.std_deg or 1) < 0.10
    else:
        assert (inclination.std_deg or 1) < 0.09


@pytest.mark.slow
def test_one_hour_is_quick_and_small() -> None:
    tables = hill_tables(3600.0)
    drive = Drive.from_tables(tables)
    estimators.run("fusion", Drive.from_tables(hill_tables(20.0)), RIGID)  # compiles
    started = time.process_time()  # of the core: what else the machine does is not counted
    estimate = estimators.run("fusion", drive, RIGID)
    assert time.process_time() - started < 10.0
    assert np.isfinite(estimate.grade).all()
    assert peak() < 800e6


def test_says_what_it_used(hill_drive: Drive) -> None:
    estimate = estimators.run("fusion", hill_drive, RIGID)
    assert any(note.startswith("used: imu, wheel_speeds (rl, rr)") for note in estimate.notes)
    found = next(note for note in estimate.notes if note.startswith("estimated constants"))
    assert "gyro_bias_y" in found
    assert "mounting_roll" not in found  # a straight drive does not tell it
    rear = replace(RIGID, driven="rear")
    assert any("(fl, fr)" in note for note in estimators.run("fusion", hill_drive, rear).notes)
