"""The clocks of TDMS channels, whatever each segment states of them."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from roadlog.errors import ConfigError
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile

nptdms = pytest.importorskip("nptdms")

START = np.datetime64("2026-03-01T10:00:00", "us")
T0 = datetime(2026, 3, 1, 10, tzinfo=UTC).timestamp()
PROFILE = Profile.from_toml('[speed]\nv = { from = "v", unit = "m/s" }\n', "p")
SIZE = 20  # samples of a segment
NAMES = {"start": "wf_start_time", "offset": "wf_start_offset", "interval": "wf_increment"}


def at(second: float, **more: object) -> dict:
    return {"start": START + np.timedelta64(round(second * 1e6), "us"), **more}


def speeds(folder, segments: list[dict], empty: int = -1):
    """Stamps [s] and values of a channel, segment after segment, and the result of ingest."""
    path = folder / "drive.tdms"
    with nptdms.TdmsWriter(str(path)) as writer:
        first = 0
        for k, stated in enumerate(segments):
            values = np.arange(first, first + (0 if k == empty else SIZE), dtype=float)
            first += len(values)
            properties = {NAMES[name]: value for name, value in stated.items()}
            channel = nptdms.ChannelObject("drive", "v", values, properties=properties)
            writer.write_segment([channel])
    result = ingest([path], PROFILE)
    (table,) = result.tables
    return table.time * 1e-9, table.columns["v"], result


FULL = at(0, interval=0.1)


@pytest.mark.parametrize(
    ("second", "begins", "step"),
    [
        (at(100), 100, 0.1),
        ({"offset": 60.0}, 60, 0.1),
        ({"interval": 0.05}, 2, 0.05),
        (at(100, interval=0.05), 100, 0.05),
        ({"offset": 60.0, "interval": 0.05}, 60, 0.05),
        ({}, 2, 0.1),
        (FULL, 2, 0.1),
    ],
    ids=["start", "offset", "interval", "start and interval", "two", "none", "the same again"],
)
def test_a_later_segment_may_state_a_part_of_its_clock(tmp_path, second, begins, step):
    time, values, result = speeds(tmp_path, [FULL, second])
    expected = np.r_[0.1 * np.arange(SIZE), begins + step * np.arange(SIZE)]
    np.testing.assert_allclose(time - T0, expected, atol=2e-6)
    np.testing.assert_allclose(values, np.arange(2 * SIZE))
    assert not result.losses


@pytest.mark.parametrize("interval", [0.001, 0.01])
def test_blocks_that_a_computer_stamps_keep_their_order(tmp_path, interval):
    late = np.random.default_rng(1).normal(0.0, 0.015, 40)
    late[0] = 0.0
    segments = [at(k * SIZE * interval + late[k], interval=interval) for k in range(40)]
    time, values, result = speeds(tmp_path, segments)
    np.testing.assert_array_equal(values, np.arange(40 * SIZE))
    np.testing.assert_allclose(time - T0, interval * values, atol=1e-6)
    assert not result.losses


@pytest.mark.parametrize(
    "segments",
    [
        [{}, at(100, interval=0.1)],
        [{"interval": 0.1}, at(100, interval=0.1)],
        [at(0), at(100, interval=0.1)],
        [at(0, interval=np.nan), at(100, interval=0.1)],
    ],
    ids=["nothing", "no start", "no interval", "not a number"],
)
def test_samples_before_the_first_clock_are_left_out_and_said(tmp_path, segments):
    time, values, result = speeds(tmp_path, segments)
    np.testing.assert_allclose(time - T0 - 100, 0.1 * np.arange(SIZE), atol=2e-6)
    np.testing.assert_allclose(values, np.arange(SIZE, 2 * SIZE))
    assert result.losses == [f"drive.tdms: drive: {SIZE} rows without a time left out"]


def test_a_clock_that_is_stated_after_all_samples_is_that_of_all(tmp_path):
    time, _, result = speeds(tmp_path, [{}, FULL], empty=1)
    np.testing.assert_allclose(time - T0, 0.1 * np.arange(SIZE), atol=2e-6)
    assert not result.losses


@pytest.mark.parametrize("interval", [np.inf, 1e12, -0.1, 0.0, np.nan, "fast\nslow"])
def test_an_interval_that_is_none_gives_no_time(tmp_path, interval):
    time, _, result = speeds(tmp_path, [FULL, at(100, interval=interval)])
    np.testing.assert_allclose(time - T0, 0.1 * np.arange(SIZE), atol=2e-6)
    assert f"{SIZE} rows without a time left out" in result.losses[0]
    (note,) = result.notes
    assert "is no interval" in note
    assert "\n" not in note
    with pytest.raises(ConfigError, match=r"which column is the time.*is no interval"):
        speeds(tmp_path, [at(0, interval=interval)])


@pytest.mark.parametrize(
    ("start", "said"),
    [
        ("2026-03-01 10:00", "a wf_start_time of '2026-03-01 10:00' is no moment"),
        (5.0, "a wf_start_time of 5.0 is no moment"),
        (np.datetime64("3000-01-01", "us"), "a wf_start_time of 3000-01-01"),
        (np.datetime64("1904-01-01", "us"), ""),
    ],
)
def test_a_start_that_is_no_moment_is_said(tmp_path, start, said):
    time, _, result = speeds(tmp_path, [{"start": start, "interval": 0.1}])
    np.testing.assert_allclose(time, 0.1 * np.arange(SIZE), atol=2e-6)
    assert [said in note for note in result.notes] == ([True] if said else [])
