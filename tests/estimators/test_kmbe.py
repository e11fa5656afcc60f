import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables, table

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import ConfigError, EstimatorError
from roadlog.estimators import get
from roadlog.signals import FLAGS
from roadlog.units import STANDARD_GRAVITY as G

RIGID = Vehicle().with_values(pitch_gradient=0.0)


def true_grade(drive: Drive) -> np.ndarray:
    return np.radians(4.0) * np.sin(2 * np.pi * drive.time / 40)


def rmse_deg(estimate, truth: np.ndarray, skip: int = 500) -> float:
    return float(np.degrees(np.sqrt(np.nanmean((estimate.grade - truth)[skip:] ** 2))))


@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("variant", ["corrected", "paper"])
def test_engines_agree(hill_drive: Drive, variant: str, smooth: bool) -> None:
    settings = {"variant": variant, "smooth": smooth}
    compiled = estimators.run("kmbe", hill_drive, Vehicle(), settings)
    reference = estimators.run("kmbe", hill_drive, Vehicle(), settings, engine="reference")
    np.testing.assert_allclose(compiled.grade, reference.grade, atol=1e-9)
    np.testing.assert_allclose(compiled.grade_sd, reference.grade_sd, atol=1e-9)


def test_finds_the_grade(hill_drive: Drive) -> None:
    truth = true_grade(hill_drive)
    smooth = estimators.run("kmbe", hill_drive, RIGID)
    causal = estimators.run("kmbe", hill_drive, RIGID, {"smooth": False})
    assert rmse_deg(smooth, truth) < 0.08
    assert rmse_deg(smooth, truth) < 0.6 * rmse_deg(causal, truth)
    inside = np.abs(smooth.grade - truth) <= 2 * smooth.grade_sd
    assert inside[500:].mean() > 0.95


def test_pitch_gradient_takes_the_body_out() -> None:
    """With body pitch K f_x in the accelerometer, `paper` reads 1 + g K times the slope."""
    gain = 0.0045
    tables = hill_tables(120.0, seed=None)
    imu = tables[0]
    pitched = imu.columns["accel_x"] * (1 + G * gain)
    tables[0] = table("imu", imu.time, {**imu.columns, "accel_x": pitched})
    drive = Drive.from_tables(tables)
    truth = true_grade(drive)
    car = Vehicle().with_values(pitch_gradient=gain)

    def slope(variant: str) -> float:
        grade = estimators.run("kmbe", drive, car, {"variant": variant}).grade
        return float(np.polyfit(truth[500:-500], grade[500:-500], 1)[0])

    assert 1.03 < slope("paper") < 1.06
    assert 0.99 < slope("corrected") < 1.01


def test_speed_gap_of_two_seconds_is_bridged() -> None:
    """The filter predicts through 2 s, sd grows to 1.5 +- 0.3 %, the error stays below 1 %."""
    tables = hill_tables(60.0)
    wheels = tables[1]
    seconds = (wheels.time - EPOCH_NS) * 1e-9
    keep = (seconds < 30) | (seconds > 32)
    columns = {name: values[keep] for name, values in wheels.columns.items()}
    tables[1] = table("wheel_speeds", wheels.time[keep], columns)
    drive = Drive.from_tables(tables)
    estimate = estimators.run("kmbe", drive, RIGID.with_stated_mounting(), {"smooth": False})
    gap = (drive.time > 31.5) & (drive.time < 32)
    before = (drive.time > 28) & (drive.time < 30)
    assert estimate.grade_sd[gap].min() > 1.5 * estimate.grade_sd[before].max()
    assert 100 * estimate.grade_sd[gap][-1] == pytest.approx(1.5, abs=0.3)
    assert np.abs(100 * np.tan(estimate.grade - true_grade(drive)))[gap].max() < 1.0
    assert estimate.valid[gap].all()
    assert (estimate.flags[gap] & FLAGS["missing"]).all()


@pytest.mark.parametrize("smooth", [True, False])
def test_long_gap_is_flagged_and_the_filter_starts_again(smooth: bool) -> None:
    tables = hill_tables(60.0)
    imu = tables[0]
    seconds = (imu.time - EPOCH_NS) * 1e-9
    keep = (seconds < 20) | (seconds > 30)
    columns = {name: values[keep] for name, values in imu.columns.items()}
    tables[0] = table("imu", imu.time[keep], columns)
    drive = Drive.from_tables(tables)
    estimate = estimators.run("kmbe", drive, RIGID, {"smooth": smooth})
    gap = (drive.time > 20.5) & (drive.time < 29.9)
    assert not estimate.valid[gap].any()
    assert np.isnan(estimate.grade[gap]).all()
    assert (estimate.flags[gap] & FLAGS["missing"]).all()
    after = drive.time > 33.5
    assert estimate.valid[after].all()
    assert np.degrees(np.abs(estimate.grade - true_grade(drive)))[after].max() < 1.0


def test_drive_without_acceleration_says_what_is_missing() -> None:
    drive = Drive.from_tables([hill_tables(5.0)[1]])
    with pytest.raises(EstimatorError, match=r"kmbe cannot run: the drive has no imu.accel_x"):
        estimators.run("kmbe", drive, Vehicle())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"smoth": "true"}, r"no parameter 'smoth'. Close: smooth"),
        ({"smooth": "maybe"}, "must be true or false"),
        ({"grade_noise": "small"}, "must be a float"),
        ({"variant": "best"}, "must be one of corrected, paper"),
    ],
)
def test_bad_setting_is_explained(settings: dict[str, str], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        get("kmbe").configure(settings)


def test_defaults_of_the_vehicle_are_named(hill_drive: Drive) -> None:
    notes = estimators.run("kmbe", hill_drive, Vehicle()).notes
    assert any("pitch_gradient" in note for note in notes)
    assert not estimators.run("kmbe", hill_drive, Vehicle.preset("wagon")).notes
