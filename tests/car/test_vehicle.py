import dataclasses

import pytest

from roadlog.car.vehicle import PRESETS, ValueSource, Vehicle
from roadlog.errors import ConfigError

SALOON = """
[vehicle]
name = "saloon"
mass = 1568.0
inertia = { roll = 597.0, pitch = 2382.0, yaw = 2670.0 }
cornering_stiffness = { front = 97600.0, rear = 84000.0 }
driven = "front"
imu_position = [-0.25, 0.12, -0.10]
pitch_gradient = 0.0052

imu_mount = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]
accel_bias = [0.01, -0.02, 0.03]
speed_delay = -0.02

[tank]
sender = [0.15, 0.0]

[sources]
pitch_gradient = { source = "calibrated", sd = 0.0002 }
imu_mount = { source = "calibrated", sd = [0.03, 0.001, 0.002] }
"""


def test_file_values_and_sources() -> None:
    car = Vehicle.from_toml(SALOON)
    assert (car.mass, car.yaw_inertia, car.rear_cornering_stiffness) == (1568.0, 2670.0, 84000.0)
    assert car.imu_position == (-0.25, 0.12, -0.10)
    assert car.tank_sender == (0.15, 0.0)
    assert car.imu_mount == ((0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))
    assert car.speed_delay == -0.02
    assert car.source("imu_mount") == ValueSource("calibrated", axis_sd=(0.03, 0.001, 0.002))
    assert car.source("mass") == ValueSource("given")
    assert car.source("pitch_gradient") == ValueSource("calibrated", 0.0002)
    assert car.source("drag_area") == ValueSource("default")


@pytest.mark.parametrize("car", [Vehicle.from_toml(SALOON), *map(Vehicle.preset, PRESETS)])
def test_toml_round_trip(car: Vehicle) -> None:
    again = Vehicle.from_toml(car.to_toml())
    assert dataclasses.asdict(again) == dataclasses.asdict(car)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[vehicle]\nmas = 1500", r"unknown key 'mas'. Close: mass"),
        ("[vehicle]\nmass = -3", "mass = -3: must be positive"),
        ("[vehicle]\nmass = 'heavy'", "must be a number"),
        ("[vehicle]\nmass = nan", "must be a number"),
        ("[vehicle]\ndriven = 'left'", "front, rear or all"),
        ("[vehicle]\nimu_position = [1, 2]", "must be 3 numbers"),
        ("[vehicel]\nmass = 3", r"unknown section \[vehicel\]. Close: vehicle"),
        ("[vehicle]\naccel_bias = [1, 2]", r"must be 3 numbers \[m/s2\]"),
        ("[vehicle]\nimu_mount = [1, 2, 3]", "three rows of three numbers"),
        ("[vehicle]\nimu_mount = [[1, 0, 0], [0, 1, 0], [0, 0, -1]]", "no rotation"),
        ("[sources]\nmass = { source = 'given', sd = [1, 2] }", "must be a number or three"),
        ("[tank]\nconsumption = [[0, 0, 1], [10, 0, 2]]", "2 speeds and 1 forces: must hold every"),
        ("[tank]\nconsumption = [[0, 0, 1], 3]", "must be rows of three numbers"),
        ("[vehicle", "not a TOML file"),
        ("[sources]\nmass = 'guess'", "none of given"),
    ],
)
def test_bad_file_is_explained(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Vehicle.from_toml(text, "car.toml")


def test_gradients_follow_from_stiffness() -> None:
    wang = Vehicle.preset("wang2025")
    # docs/methods/common.md#preset-cars: k = m h / K = 0.238 deg/(m/s2)
    assert wang.pitch_gain == pytest.approx(0.238 * 3.14159265 / 180, rel=5e-3)
    soft = dataclasses.replace(Vehicle.preset("wagon"), roll_gradient=None)
    # docs/methods/common.md#preset-cars: K_phi = m h / k_r = 0.0113
    assert soft.roll_gain == pytest.approx(0.0113, rel=2e-3)
