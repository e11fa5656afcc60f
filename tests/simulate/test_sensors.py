"""Sensors: each error has the size that it says, alone; ideal sensors have none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from roadlog.simulate import Simulation, simulate
from roadlog.simulate.imu import ImuSensor
from roadlog.simulate.motion import Motion
from roadlog.units import STANDARD_GRAVITY as G

RATE = 100.0  # Hz


@cache
def resting(duration: float = 400.0) -> Motion:
    """A car that stands level."""
    time = np.arange(round(duration * 200) + 1) / 200
    zero, none = np.zeros(len(time)), np.zeros((len(time), 3))
    force = np.tile([0.0, 0.0, G], (len(time), 1))
    return Motion(time, force, none, none, {}, {"speed.v": zero})


def read(sensor: ImuSensor, seed: int = 1) -> dict[str, np.ndarray]:
    return sensor.measure(resting(), seed)["imu"][1]


@cache
def stopgo(**overrides: float) -> Simulation:
    return simulate("luo2024-stopgo", overrides=dict(overrides))


def test_ideal_imu_reads_the_truth() -> None:
    fields = read(ImuSensor().ideal())
    np.testing.assert_array_equal(fields["accel_z"], G)
    np.testing.assert_array_equal(fields["gyro_y"], 0.0)


def test_noise_density_is_the_white_noise_of_a_sample() -> None:
    fields = read(replace(ImuSensor().ideal(), accel_noise=0.002, gyro_noise=0.0003))
    assert np.std(fields["accel_x"]) == pytest.approx(0.002 * np.sqrt(RATE), rel=0.03)
    assert np.std(fields["gyro_z"]) == pytest.approx(0.0003 * np.sqrt(RATE), rel=0.03)


def test_turn_on_bias_is_drawn_anew_with_each_seed() -> None:
    sensor = replace(ImuSensor().ideal(), accel_bias_sd=0.05)
    drawn = [read(sensor, seed)["accel_x"][0] for seed in range(40)]
    assert np.std(drawn) == pytest.approx(0.05, rel=0.3)
    assert np.ptp(read(sensor)["accel_x"]) == 0.0


def test_bias_instability_wanders_with_its_time_constant() -> None:
    sensor = replace(ImuSensor().ideal(), accel_drift_sd=0.01, drift_time=2.0)
    values = np.concatenate([read(sensor, seed)["accel_x"] for seed in range(3)])
    assert np.std(values) == pytest.approx(0.01, rel=0.15)
    one = read(sensor)["accel_x"]
    lag = round(2.0 * RATE)
    assert np.corrcoef(one[:-lag], one[lag:])[0, 1] == pytest.approx(np.exp(-1), abs=0.15)


def test_quantization_gives_multiples_of_the_lsb() -> None:
    fields = read(replace(ImuSensor(), accel_lsb=0.01, gyro_lsb=0.001))
    np.testing.assert_allclose(np.remainder(fields["accel_x"] / 0.01 + 0.5, 1), 0.5, atol=1e-9)
    np.testing.assert_allclose(np.remainder(fields["gyro_x"] / 0.001 + 0.5, 1), 0.5, atol=1e-9)


@pytest.mark.parametrize(
    ("turn", "axis", "value"),
    [((0.0, 1.0, 0.0), "accel_x", 1.0), ((1.0, 0.0, 0.0), "accel_y", 1.0)],
    ids=["nose up", "right side down"],
)
def test_misalignment_turns_gravity(
    turn: tuple[float, float, float], axis: str, value: float
) -> None:
    fields = read(replace(ImuSensor().ideal(), misalignment_deg=turn))
    assert np.degrees(np.arcsin(fields[axis][0] / G)) == pytest.approx(value, abs=1e-6)


def test_lever_arm_adds_what_turning_does() -> None:
    at_cg = simulate("ryu2004-chirp", ideal=True)
    ahead = simulate("ryu2004-chirp", ideal=True, overrides={"imu.position": [1.5, 0.0, 0.0]})
    own, other = at_cg.table("/imu").columns, ahead.table("/imu").columns
    rate = np.stack([own[f"gyro_{axis}"] for axis in "xyz"], axis=1)
    turning = np.gradient(rate, 1 / RATE, axis=0)
    d = np.array([1.5, 0.0, 0.0])
    extra = np.cross(turning, d) + np.cross(rate, np.cross(rate, d))
    difference = other["accel_y"] - own["accel_y"]
    assert np.std(difference) > 0.1
    np.testing.assert_allclose(difference[5:-5], extra[5:-5, 1], atol=0.02)


def test_wheel_sensors_are_blind_below_their_dead_band_and_late() -> None:
    wheels = stopgo().table("/wheel_speeds").columns["fl"]
    assert not np.any((wheels > 0) & (wheels < 0.25))
    late = simulate("luo2024-s2", ideal=True, overrides={"can.latency": 0.2})
    prompt = simulate("luo2024-s2", ideal=True)
    shift = round(0.2 * RATE)
    np.testing.assert_allclose(
        late.table("/speed").columns["v"][shift:],
        prompt.table("/speed").columns["v"][:-shift],
        atol=1e-3,
    )


def test_torques_carry_the_gain_of_the_control_unit() -> None:
    wrong, right = stopgo(drive_gain=1.2), stopgo(drive_gain=1.0)
    high = right.table("/wheel_torques").columns["drive_rl"]
    ratio = wrong.table("/wheel_torques").columns["drive_rl"][high > 100] / high[high > 100]
    assert np.median(ratio) == pytest.approx(1.2, rel=0.01)


def test_gnss_latency_shifts_the_stamps_and_one_antenna_knows_no_heading() -> None:
    late = stopgo(**{"gnss.latency": 0.5, "gnss.two_antennas": False}).table("/gnss")
    prompt = stopgo().table("/gnss")
    late_speed, speed = late.columns["speed"], prompt.columns["speed"]
    delay = (late.time[0] - prompt.time[0]) * 1e-9
    assert delay == pytest.approx(0.5)
    assert np.abs(late_speed[:100] - speed[:100]).max() < 0.3
    assert np.isnan(late.columns["heading"]).all()
    assert np.isfinite(prompt.columns["heading"]).all()


def test_gnss_noise_is_what_the_accuracy_says() -> None:
    simulation = simulate("luo2024-s1")
    table = simulation.table("/gnss")
    climb = np.interp(
        (table.time - table.time[0]) * 1e-9,
        simulation.motion.time,
        simulation.motion.velocity[:, 2],
    )
    error = table.columns["climb"] - climb
    # the antenna sways over the reference point; the noise dominates
    assert np.std(error) == pytest.approx(table.columns["climb_accuracy"][0], rel=0.25)


def test_fuel_sender_saturates_at_the_tank() -> None:
    simulation = simulate("wang2025-down12", overrides={"fuel.volume": 0.002})
    sender = simulation.table("/fuel").columns["sender"]
    assert sender.min() == 0.0
    assert sender.max() <= simulation.vehicle.tank_height
