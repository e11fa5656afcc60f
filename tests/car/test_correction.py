"""What a vehicle file says of the sensors reaches every estimator, once."""

import numpy as np
import pytest
from support.drives import hill_tables, table

from roadlog import estimators
from roadlog.car.correction import corrected
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import ConfigError

ON_ITS_SIDE = ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))  # forward -y, left -z, up x
BIAS = (0.2, -0.1, 0.05)  # m/s2
LOGGER = Vehicle().with_values(
    imu_mount=ON_ITS_SIDE, accel_bias=BIAS, speed_scale=1 / 1.02, speed_delay=0.3
)


def disturbed(duration: float = 60.0) -> Drive:
    """`hill_tables` as a logger on its side with biased accelerometers and a late speed sees it."""
    tables = hill_tables(duration)
    imu, wheels = tables[0], tables[1]
    columns = {}
    for kind, bias in (("accel", BIAS), ("gyro", (0.0, 0.0, 0.0))):
        axes = np.stack([imu.columns[f"{kind}_{a}"] + b for a, b in zip("xyz", bias, strict=True)])
        turned = np.array(ON_ITS_SIDE).T @ axes
        columns |= {f"{kind}_{a}": row for a, row in zip("xyz", turned, strict=True)}
    late = {name: 1.02 * values for name, values in wheels.columns.items()}
    tables[0] = table("imu", imu.time, columns)
    tables[1] = table("wheel_speeds", wheels.time + 300_000_000, late)
    return Drive.from_tables(tables)


def test_undoes_what_the_logger_did() -> None:
    found, true = corrected(disturbed(), LOGGER), Drive.from_tables(hill_tables())
    inside = slice(100, len(true) - 100)
    for role in ("imu.accel_x", "imu.accel_y", "imu.accel_z", "imu.gyro_y", "wheel_speeds.rl"):
        np.testing.assert_allclose(found[role][inside], true[role][inside], atol=1e-9)
    for kind in ("accel", "gyro"):
        for axis in "xyz":
            name = f"{kind}_{axis}"
            ours, theirs = found.native["imu"].columns[name], true.native["imu"].columns[name]
            np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.parametrize("name", ["kmbe", "lowpass_attitude", "fusion"])
def test_every_estimator_profits(name: str) -> None:
    drive, true = disturbed(), Drive.from_tables(hill_tables())
    estimate = estimators.run(name, drive, LOGGER)
    angle = "grade" if "grade" in estimate.angles else "inclination"
    expected = estimators.run(name, true, Vehicle()).angles[angle]
    inside = slice(500, len(true) - 500)
    worst = np.abs(estimate.angles[angle][inside] - expected[inside]).max()
    assert np.degrees(worst) < 0.02
    assert any("imu_mount, accel_bias" in note for note in estimate.notes)


def test_all_that_the_car_sends_is_on_time() -> None:
    tables = hill_tables(20.0)
    wheels = tables[1]
    steering = {"road_wheel_angle": np.sin(np.arange(len(wheels)) / 100.0)}
    tables.append(table("steering", wheels.time + 300_000_000, steering))
    found = corrected(Drive.from_tables(tables), Vehicle().with_values(speed_delay=0.3))
    inside = slice(100, 1500)
    true = np.sin(found.time)
    np.testing.assert_allclose(found["steering.road_wheel_angle"][inside], true[inside], atol=1e-9)


def test_nothing_said_changes_nothing() -> None:
    drive = Drive.from_tables(hill_tables())
    assert corrected(drive, Vehicle.preset("wagon")) is drive


def test_half_an_accelerometer_cannot_be_turned() -> None:
    tables = hill_tables()
    columns = {k: v for k, v in tables[0].columns.items() if k != "accel_y"}
    tables[0] = table("imu", tables[0].time, columns)
    with pytest.raises(ConfigError, match=r"no imu\.accel_y"):
        corrected(Drive.from_tables(tables), LOGGER)
