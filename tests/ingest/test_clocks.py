"""Clocks of two devices: the offset that is estimated, fixed, or refused."""

from __future__ import annotations

import numpy as np
import pytest

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import clocks

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
