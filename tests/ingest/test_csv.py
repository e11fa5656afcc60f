"""Text tables as loggers write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.profile import Profile

PROFILE = """
[time]
column = "t"
{unit}
[speed]
v = {{ from = "v", unit = "m/s" }}
"""


def speed(path: Path, unit: str = 'unit = "s"'):
    profile = path.with_suffix(".toml")
    profile.write_text(PROFILE.format(unit=unit))
    result = ingest([path], profile)
    return result.tables[0], result


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("t,v\n100,1.5\n100.5,2.5\n", 'unit = "s"'),
        ("t;v\n100,0;1,5\n100,5;2,5\n", 'unit = "s"'),
        ("t\tv\n100000\t1.5\n100500\t2.5\n", 'unit = "ms"'),
        ("\ufefft, v\r\n100, 1.5\r\n100.5, 2.5\r\n", 'unit = "s"'),
        ('"t","v"\n"100","1.5"\n"100.5","2.5"\n', 'unit = "s"'),
        ("t,v,\n100,1.5,\n100.5,2.5,\n", 'unit = "s"'),
    ],
    ids=["comma", "decimal-comma", "tab-ms", "bom-crlf", "quoted", "trailing"],
)
def test_dialects_give_the_same_columns(tmp_path, text, unit):
    path = tmp_path / "drive.csv"
    path.write_bytes(text.encode())
    table, _ = speed(path, unit)
    assert table.time.tolist() == [100_000_000_000, 100_500_000_000]
    np.testing.assert_array_equal(table.columns["v"], [1.5, 2.5])


@pytest.mark.parametrize(
    "stamp",
    ["2019-05-24T18:11:23.018Z", "2019-05-24 20:11:23.018+02:00", "24-May-2019 18:11:23.018"],
)
def test_dates_become_nanoseconds_of_utc(tmp_path, stamp):
    path = tmp_path / "drive.csv"
    path.write_text(f"t,v\n{stamp},1\n")
    table, _ = speed(path, "")
    assert table.time.tolist() == [1_558_721_483_018_000_000]


def test_epoch_stamps_keep_their_nanoseconds(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t,v\n1558739321455,1\n1558739321655,2\n")
    table, _ = speed(path, "")
    assert table.time.tolist() == [1_558_739_321_455_000_000, 1_558_739_321_655_000_000]


def test_blanks_are_unknown_and_short_rows_are_counted(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t,v\n0,1\n1,\n2,3\n3\n")
    table, result = speed(path)
    np.testing.assert_array_equal(table.columns["v"], [1, 3])
    assert result.losses == ["drive.csv: 1 rows without 2 fields left out"]


def test_a_clock_that_runs_backward_is_sorted_and_said(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t,v\n0,1\n2,3\n1,2\n")
    table, result = speed(path)
    assert np.all(np.diff(table.time) > 0)
    np.testing.assert_array_equal(table.columns["v"], [1, 2, 3])
    assert any("backward" in loss for loss in result.losses)


@pytest.mark.parametrize(
    ("text", "error", "words"),
    [
        ("t,w\n0,1\n", ConfigError, "no 'v'"),
        ("x,v\n0,1\n", ConfigError, "no time column 't'"),
        ("t,v\n", LogReadError, "no rows"),
        ("t,v\n0,fast\n", ConfigError, "no numbers"),
        ("t,v,v\n0,1,2\n", LogReadError, "there twice"),
        ("t,v\nsoon,1\n", LogReadError, "row 1: 'soon' is no time"),
    ],
)
def test_faults_are_named(tmp_path, text, error, words):
    path = tmp_path / "drive.csv"
    path.write_text(text)
    with pytest.raises(error, match=words):
        speed(path)


def test_two_files_of_one_drive_are_joined(tmp_path):
    (tmp_path / "b.csv").write_text("t,v\n2,3\n3,4\n")
    (tmp_path / "a.csv").write_text("t,v\n0,1\n1,2\n")
    profile = tmp_path / "p.toml"
    profile.write_text(PROFILE.format(unit='unit = "s"'))
    result = ingest([tmp_path / "b.csv", tmp_path / "a.csv"], profile)
    np.testing.assert_array_equal(result.tables[0].columns["v"], [1, 2, 3, 4])


@pytest.mark.parametrize(
    "names",
    [
        "AccelX (m/s^2),AccelY (m/s^2),AccelZ (m/s^2)",
        "Latitude (deg),Longitude (deg),Altitude (m),Pitch (deg),Roll (deg)",
        "Lat,Long,Alt(m),Speed(m/s)",
        "RollRate,PitchRate,YawRate,GPS Speed",
        "latitude,longitude,heading,velocity,height",
        "AccelerationX,AccelerationY,AccelerationZ,Latitude",
    ],
)
def test_names_that_many_loggers_use_are_no_vendors(tmp_path, names):
    path = tmp_path / "drive.csv"
    row = ",1" * len(names.split(","))
    path.write_text(f"time,{names}\n" + "".join(f"{k / 10}{row}\n" for k in range(50)))
    with pytest.raises(ConfigError, match="say what its names mean with --profile"):
        ingest([path])


def test_a_long_table_of_any_names_gets_a_profile(tmp_path):
    path = tmp_path / "drive.csv"
    rows = "".join(
        f"{k / 10},VehicleSpeed,{50 + k / 10},km/h\n{k / 10 + 0.01},Level,{k % 7},l\n"
        for k in range(100)
    )
    path.write_text("timestamp,signal,value,unit\n" + rows)
    profile = Profile.from_toml(starter([path]), "new")
    (table,) = ingest([path], profile).tables
    known = np.isfinite(table.columns["v"])
    np.testing.assert_allclose(table.columns["v"][known] * 3.6, 50 + np.arange(100) / 10)
    with pytest.raises(ConfigError, match="say what its names mean with --profile"):
        ingest([path])
