"""Logs of satellite receivers, from the file to angles, with no profile by hand."""

from __future__ import annotations

import numpy as np
import pytest
from support.phone_drive import EPOCH
from support.receiver_formats import DRIVE, RECEIVERS

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.ingest import ingest
from roadlog.ingest.reference.gnss import from_gnss

pytest.importorskip("gpxpy")
pytest.importorskip("fitdecode")
pytest.importorskip("pyubx2")
LATE = {"nmea_over_midnight": 15 * 3600 - 60}


def table(result, topic: str):
    return next(t for t in result.tables if t.topic == topic)


@pytest.mark.parametrize("name", RECEIVERS)
def test_every_receiver_gives_what_was_driven(tmp_path, name):
    if name == "fit":
        pytest.importorskip("fit_tool")
    result = ingest([RECEIVERS[name](tmp_path)])
    assert not result.losses
    gnss = table(result, "/gnss")
    t = gnss.time * 1e-9 - EPOCH - LATE.get(name, 0)
    assert t[0] == pytest.approx(0, abs=1e-3)
    assert len(t) >= 119
    true = DRIVE.fixes(t)
    for field, near in (("latitude", 2e-6), ("longitude", 2e-6), ("altitude", 0.11)):
        assert np.abs(gnss.columns[field] - true[field]).max() < near
    speed = np.abs(gnss.columns["speed"] - DRIVE.speed(t))
    assert speed.max() < (0.3 if name == "gpx_of_positions" else 0.01)
    if np.isfinite(gnss.columns["course"]).any():
        apart = gnss.columns["course"] - np.radians(90 - true["course"])
        assert np.abs(np.angle(np.exp(1j * apart)))[DRIVE.speed(t) > 1].max() < 1e-3
    if name.startswith(("ubx", "sbf")) and name != "ubx_of_high_rate":
        assert np.abs(gnss.columns["climb"] - true["climb"]).max() < 2e-3
        assert gnss.columns["vertical_accuracy"] == pytest.approx(2.0)
    truth = from_gnss(result.tables)
    error = np.degrees(
        truth.columns["grade"] - DRIVE.grade(truth.time * 1e-9 - EPOCH - LATE.get(name, 0))
    )
    assert np.sqrt(np.mean(error**2)) < 0.5


@pytest.mark.parametrize("name", ["ubx", "ubx_with_a_clock_of_its_own"])
def test_a_u_blox_with_an_imu_gives_angles_and_wheel_directions(tmp_path, name):
    result = ingest([RECEIVERS[name](tmp_path)])
    imu = table(result, "/imu")
    t = imu.time * 1e-9 - EPOCH
    assert t[0] == pytest.approx(0, abs=2e-3)
    force, rate = DRIVE.imu(t)
    assert np.abs(imu.columns["accel_x"] - force[:, 0]).max() < 0.01
    assert np.abs(imu.columns["gyro_z"] - rate[:, 2]).max() < 1e-3
    assert np.abs(table(result, "/speed").columns["v"] - DRIVE.speed(t)).max() < 0.01
    assert "wheel_ticks.rl" in result.left_over
    drive = Drive.from_tables(result.tables)
    grade = estimators.run("kmbe", drive, Vehicle()).angles["grade"]
    error = np.degrees(grade - DRIVE.grade(drive.time))
    assert np.sqrt(np.nanmean(error[2500:11000] ** 2)) < 0.5


def test_wheel_ticks_keep_their_direction(tmp_path):
    from roadlog.ingest.formats.ubx import read
    from roadlog.ingest.profile import Everything

    recording = read(RECEIVERS["ubx"](tmp_path), Everything("everything", ""))
    ticks = next(f for f in recording.frames if f.name == "wheel_ticks")
    t = ticks.time * 1e-9 - EPOCH
    speed = 0.1 * ticks.columns["rl"]
    assert np.mean(speed[(t > 60) & (t < 110)]) == pytest.approx(
        np.mean(DRIVE.speed(t[(t > 60) & (t < 110)])), rel=0.02
    )
    assert (speed[t > 115.1] <= 0).all()


def test_rates_of_a_u_blox_that_fuses_are_taken_where_it_measures_none(tmp_path):
    result = ingest([RECEIVERS["ubx_of_fused_rates"](tmp_path)])
    imu = table(result, "/imu")
    _, rate = DRIVE.imu(imu.time * 1e-9 - EPOCH)
    for k, axis in enumerate("xyz"):
        assert np.abs(imu.columns[f"gyro_{axis}"] - rate[:, k]).max() < 1e-4
        assert np.isnan(imu.columns[f"accel_{axis}"]).all()  # without gravity there


def test_the_faster_fixes_of_a_u_blox_count(tmp_path):
    gnss = table(ingest([RECEIVERS["ubx_of_high_rate"](tmp_path)]), "/gnss")
    assert np.median(np.diff(gnss.time)) == pytest.approx(1e8, abs=1e6)
    assert gnss.columns["speed_accuracy"] == pytest.approx(0.1)


def test_two_antennas_of_a_septentrio_give_heading_and_inclination(tmp_path):
    result = ingest([RECEIVERS["sbf_of_two_antennas"](tmp_path)])
    gnss, truth = table(result, "/gnss"), table(result, "/truth/angles")
    np.testing.assert_allclose(gnss.columns["heading"], gnss.columns["course"], atol=1e-3)
    np.testing.assert_allclose(gnss.columns["speed_accuracy"], np.sqrt(0.02), atol=1e-6)
    grade = DRIVE.grade(truth.time * 1e-9 - EPOCH)
    np.testing.assert_allclose(truth.columns["inclination"], grade, atol=1e-6)
    assert np.isnan(truth.columns["roll_total"]).all()


def test_sentences_without_sums_dates_or_speeds_are_read(tmp_path):
    lines = RECEIVERS["nmea"](tmp_path).read_text().splitlines()
    path = tmp_path / "other.nmea"
    path.write_text("\r\n".join(line.split("*")[0] for line in lines) + "\r\n")
    whole = ingest([path])
    assert not whole.losses
    t = table(whole, "/gnss").time * 1e-9 - EPOCH
    np.testing.assert_allclose(table(whole, "/gnss").columns["speed"], DRIVE.speed(t), atol=0.01)
    path.write_text("\r\n".join(line for line in lines if "GGA" in line) + "\r\n")
    places = ingest([path])
    t = table(places, "/gnss").time * 1e-9 - 32_400
    speed = table(places, "/gnss").columns["speed"]
    np.testing.assert_allclose(speed, DRIVE.speed(t), atol=0.3)
    assert any("no sentence has a date" in note for note in places.notes)
    assert any("it is made of the positions" in note for note in places.notes)
