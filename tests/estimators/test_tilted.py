"""What a stop and the vehicle file say of the IMU is in the standard deviations of every method."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.drives import hill_tables, table

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, Samples
from roadlog.motion.imu_noise import ImuNoise
from roadlog.motion.rest import gravity_error

STATED = Vehicle().with_stated_mounting()


def standing(bias: float) -> Drive:
    """Ten seconds at rest, then a minute of hills, with a bias on z."""
    tables = hill_tables(60.0)
    imu = tables[0]
    columns = {n: np.concatenate([np.full(1000, x[0]), x[1000:]]) for n, x in imu.columns.items()}
    columns["accel_x"][:1000] = columns["accel_y"][:1000] = 0.0
    columns["accel_z"][:1000] = 9.80665
    columns["accel_z"] = columns["accel_z"] + bias
    wheels = {n: np.where(np.arange(len(x)) < 1000, 0.0, x) for n, x in tables[1].columns.items()}
    return Drive.from_tables(
        [dataclasses.replace(imu, columns=columns), table("wheel_speeds", tables[1].time, wheels)]
    )


def test_a_bias_that_gravity_shows_is_in_the_sd() -> None:
    assert gravity_error(standing(0.0)) < 0.01
    assert gravity_error(standing(0.2)) == pytest.approx(0.2, abs=0.01)
    clean, biased = (
        estimators.run("kmbe", standing(bias), STATED).grade_sd[3000] for bias in (0.0, 0.2)
    )
    assert biased**2 - clean**2 == pytest.approx((0.2 / 9.80665) ** 2, rel=0.05)


@pytest.mark.parametrize(
    "name",
    [
        "kmbe",
        "ekf_suspension",
        "lowpass_attitude",
        "incl_kinematic",
        "pn",
        "ti_rls",
        "grade_pitch_ekf",
    ],
)
def test_a_mounting_that_nobody_stated_is_in_the_sd(name: str) -> None:
    drive = standing(0.0)
    angle = estimators.get(name).tilted[0]
    stated, loose = (
        estimators.run(name, drive, vehicle).sd[angle][3000] for vehicle in (STATED, Vehicle())
    )
    assert loose**2 - stated**2 == pytest.approx(np.radians(1.0) ** 2, rel=0.01)


@pytest.mark.parametrize(("rate", "lsb"), [(10.0, 0.0), (100.0, 0.0), (100.0, 0.3)])
def test_white_noise_is_found_at_any_rate_and_coarseness(rate: float, lsb: float) -> None:
    rng, density = np.random.default_rng(1), 0.05
    time = np.arange(round(300 * rate)) / rate
    noisy = density * np.sqrt(rate) * rng.standard_normal(len(time))
    noisy = np.round(noisy / lsb) * lsb if lsb else noisy
    imu = Samples(time, {"accel_x": noisy + np.sin(time)})
    assert ImuNoise.of(imu).accel[0] == pytest.approx(density, rel=0.3)
