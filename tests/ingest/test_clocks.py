"""Clocks of two devices: the offset that is estimated, fixed, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import clocks
from roadlog.units import STANDARD_GRAVITY as G

START = 1_700_000_000_000_000_000


def drive(offset: float, rate: float, seed: int, role: str = "speed.v") -> clocks.Signals:
    """Three minutes of stop and go as one device sees them; its clock is behind by `offset` s."""
    t = np.arange(0, 180, 1 / rate)
    knots = np.random.default_rng(5).uniform(0, 15, 24)

    def speed(at: np.ndarray) -> np.ndarray:
        return np.interp(at, np.linspace(0, 180, 24), knots)

    values = speed(t)
    if role == "imu.accel_x":
        values = (speed(t + 0.05) - speed(t - 0.05)) / 0.1
    noise = np.random.default_rng(seed).normal(0, 0.2, len(t))
    stamps = START + np.round((t - offset) * 1e9).astype(np.int64)
    return {role: (stamps, values + noise)}


@pytest.mark.parametrize("role", ["speed.v", "imu.accel_x"])
@pytest.mark.parametrize("offset", [0.0, 1.5, -7.3, 18000.4])
def test_the_offset_is_found_within_a_tenth_of_a_second(role, offset):
    found = clocks.estimate(drive(0.0, 50, 1, role), drive(offset, 4, 2))
    assert found is not None
    assert found.sure
    assert found.seconds == pytest.approx(offset, abs=0.1)


def merged(offset: float, fixed: dict[str, float] | None = None):
    reference = clocks.Group(["a.csv"], drive(0.0, 50, 1, "imu.accel_x"))
    return clocks.merged([reference, clocks.Group(["b.txt"], drive(offset, 4, 2))], fixed or {})


def test_a_small_offset_is_applied_and_a_time_zone_told_apart():
    signals, notes = merged(1.5)
    assert (signals["speed.v"][0][0] - START) * 1e-9 == pytest.approx(0.0, abs=0.1)
    assert "set to that of a.csv by +1." in notes[0]
    _, notes = merged(-18001.5)
    assert "-5 h of it a time zone" in notes[0]


def test_a_large_offset_is_refused_unless_told():
    with pytest.raises(LogReadError, match=r"give --time-offset b\.txt=200\."):
        merged(200.0)
    signals, notes = merged(200.0, {"b.txt": 200.0})
    assert signals["speed.v"][0][0] == START
    assert "as given" in notes[0]


def test_a_fixed_offset_of_no_source_is_an_error():
    with pytest.raises(ConfigError, match=r"no source 'c\.txt'"):
        merged(0.0, {"c.txt": 1.0})


RATES = (1, 2, 5, 10, 50, 100)  # Hz


def pair(
    rng: np.random.Generator, accelerometer: bool
) -> tuple[clocks.Signals, clocks.Signals, float]:
    """Five minutes of stop and go on hills by two devices of any rates, the second one late."""
    grid = np.arange(0.0, 300.0, 0.1)
    wave = [np.convolve(rng.normal(size=len(grid)), np.hanning(n), "same") for n in (80, 300)]
    speed = np.cumsum(wave[0] / wave[0].std() * 0.07)
    speed = CubicSpline(grid, 12 + speed - np.polyval(np.polyfit(grid, speed, 5), grid))
    grade = np.interp(grid, grid, 0.03 * wave[1] / wave[1].std())
    late = rng.uniform(0, 2)
    t, own = (np.arange(5, 295, 1 / rng.choice(RATES)) for _ in range(2))
    first = speed(t) + rng.normal(0, 0.1, len(t))
    if accelerometer:
        slope = np.interp(t, grid, grade)
        first = speed(t, 1) + G * np.sin(slope) + rng.normal(0, 0.3, len(t))
    second = speed(own - late) + rng.normal(0, 0.1, len(own))
    role = "imu.accel_x" if accelerometer else "speed.v"
    stamps = [START + np.round(x * 1e9).astype(np.int64) for x in (t, own)]
    return {role: (stamps[0], first)}, {"gnss.speed": (stamps[1], second)}, -late


@pytest.mark.parametrize(
    ("count", "most"), [(40, 1.0), pytest.param(200, 0.99, marks=pytest.mark.slow)]
)
def test_the_sd_of_an_offset_holds_at_any_rate_and_latency(count, most):
    rng = np.random.default_rng(21)
    inside = 0
    for k in range(count):
        reference, other, true = pair(rng, k % 2 == 0)
        found = clocks.estimate(reference, other)
        assert found is not None
        assert found.sure
        inside += abs(found.seconds - true) < 2 * found.sd
    assert 0.90 <= inside / count <= most


@pytest.mark.parametrize("rate", [1, 5, 50])
def test_clocks_that_agree_are_left_alone(rate):
    """No bias from the rate of an exact speed (a 1 Hz one seemed 0.14 s early)."""
    reference = drive(0.0, 50, 1, "imu.accel_x")
    signals, notes = clocks.merged(
        [clocks.Group(["a.csv"], reference), clocks.Group(["b.csv"], drive(0.0, rate, 2))], {}
    )
    assert signals["speed.v"][0][0] == START
    assert "agrees with" in notes[0] or "not known to half a sample" in notes[0]


def test_stamps_before_zero_are_moved_together():
    early = {"speed.v": (np.array([-2_500_000_000, 0, 1_000_000_000]), np.ones(3))}
    signals, notes = clocks.merged([clocks.Group(["a.csv"], early)], {})
    assert signals["speed.v"][0].tolist() == [500_000_000, 3_000_000_000, 4_000_000_000]
    assert notes == ["the clock begins at -2.500 s: all stamps moved by +3 s"]
