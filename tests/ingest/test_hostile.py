"""Files of anyone: one line and an exit code, whatever is in them (see `hostile.py`)."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from support.drive_formats import DBC, profile_of, write_mdf, write_text, write_trace
from support.drives import ROOT

from roadlog.car.vehicle import Vehicle
from roadlog.errors import ConfigError, LogReadError, RoadlogError
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile


def fuzzed(folder: Path, count: int, seed: int) -> str:
    """What was wrong, of `count` damaged copies of each format."""
    for module in ("asammdf", "can", "cantools", "pyarrow", "rosbags"):
        pytest.importorskip(module)
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
    threads = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    done = subprocess.run(
        [sys.executable, ROOT / "tests" / "support" / "hostile.py", folder, str(count), str(seed)],
        capture_output=True,
        text=True,
        env=environment | dict.fromkeys(threads, "1"),
        check=False,
    )
    now = folder / "now"
    died = f"ended with {done.returncode} at {now.read_text()}" if now.exists() else ""
    return done.stdout + died + (done.stderr if done.returncode else "")


def test_damaged_files_of_every_format(tmp_path):
    pytest.importorskip("resource", reason="no limit of memory on this system")
    assert fuzzed(tmp_path / "files", 4, seed=0) == ""


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 6))
def test_many_damaged_files_of_every_format(tmp_path, seed):
    assert fuzzed(tmp_path / "files", 100, seed) == ""


def test_toml_nested_beyond_reason_is_a_config_error(tmp_path):
    deep = "a = " + "[" * 100_000 + "]" * 100_000
    with pytest.raises(ConfigError, match="not a TOML file"):
        Profile.from_toml(deep, "deep")
    path = tmp_path / "deep.toml"
    path.write_text(deep)
    with pytest.raises(ConfigError, match="deep"):
        Vehicle.load(path)


@pytest.mark.parametrize(
    "value",
    [
        *("1e999", "nan", "-inf", "9" * 400, "true", '"x"', "[]", "{}", "1979-05-27", "0"),
        "-1",
    ],
)
@pytest.mark.parametrize("key", ["mass", "driven", "inertia", "imu_position", "name"])
def test_a_vehicle_of_any_value_loads_or_is_refused_by_name(tmp_path, key, value):
    path = tmp_path / "car.toml"
    path.write_text(f"[vehicle]\n{key} = {value}\n")
    try:
        Vehicle.load(path)
    except RoadlogError as error:
        assert key in str(error)  # noqa: PT017 that it may also load is the point


@pytest.mark.parametrize("key", ["from", "unit", "scale", "offset", "delay", "valid", "file"])
@pytest.mark.parametrize(
    "value", ["1e308", "nan", "9" * 30, "true", "[1]", "{}", '""', '"a == 1e999"', '"1e308 s"']
)
def test_a_profile_of_any_value_is_used_or_refused(tmp_path, key, value):
    source = write_text(tmp_path / "drive.csv")
    entry = {"from": '"v"', "unit": '"m/s"'} | {key: value}
    profile = tmp_path / "p.toml"
    lines = ", ".join(f"{name} = {word}" for name, word in entry.items())
    profile.write_text(f"[speed]\nv = {{ {lines} }}\n")
    tomllib.loads(profile.read_text())
    try:
        ingest([source], profile)
    except RoadlogError as error:
        assert "\n" not in str(error)  # noqa: PT017 that it may also be used is the point


def linked(data: bytes, kind: bytes, number: int, to: int | None = None) -> bytes:
    """An MDF 4 of which one link of the first block of a kind leads to itself, or elsewhere."""
    address = data.index(b"##" + kind)
    changed = bytearray(data)
    struct.pack_into("<Q", changed, address + 24 + 8 * number, address if to is None else to)
    return bytes(changed)


@pytest.mark.parametrize(
    ("kind", "number"), [("DG", 0), ("DG", 1), ("CG", 0), ("CN", 0), ("CN", 1), ("FH", 0)]
)
def test_an_mdf_file_that_goes_in_a_circle_is_refused(tmp_path, kind, number):
    path = write_mdf(tmp_path / "drive.mf4")
    path.write_bytes(linked(path.read_bytes(), kind.encode(), number))
    with pytest.raises(LogReadError, match="go in a circle"):
        ingest([path], profile_of(tmp_path))


def test_an_mdf_file_that_promises_more_records_than_it_has_gives_these(tmp_path):
    path = write_mdf(tmp_path / "drive.mf4")
    whole = ingest([path], profile_of(tmp_path)).tables
    data = bytearray(path.read_bytes())
    for place in (data.index(b"##CG"), data.rindex(b"##CG")):
        links = struct.unpack_from("<Q", data, place + 16)[0]
        struct.pack_into("<Q", data, place + 24 + 8 * links + 8, 1 << 60)  # cycles
    path.write_bytes(data)
    tables = ingest([path], profile_of(tmp_path)).tables
    assert [len(table) for table in tables] == [len(table) for table in whole]


@pytest.mark.parametrize(
    "line",
    [
        *("BO_ 258 Odo: 4294967295 ECU", "BO_ 258 Odo: -1 ECU", "BO_ 99999999999 Odo: 8 ECU"),
        *("BO_ 258 Odo: 0 ECU", "BO_ 258 ../../x: 8 ECU"),
    ],
)
def test_a_dbc_with_impossible_messages(tmp_path, line):
    path = write_trace(tmp_path / "drive.log")
    (tmp_path / "car.dbc").write_text(DBC.replace("BO_ 258 Odo: 8 ECU", line))
    try:
        result = ingest([path], profile_of(tmp_path), [tmp_path / "car.dbc"])
    except RoadlogError:
        return
    assert {table.topic for table in result.tables} <= {"/imu", "/speed"}


@pytest.mark.parametrize(
    "bits", ["0|0@1+", "0|65@1+", "0|4000000000@1+", "63|64@1+", "0|17@0-", "4000000000|8@1+"]
)
def test_a_dbc_with_impossible_signals(tmp_path, bits):
    path = write_trace(tmp_path / "drive.log")
    (tmp_path / "car.dbc").write_text(DBC + f' SG_ odd : {bits} (1,0) [0|0] "" ECU\n')
    try:
        result = ingest([path], profile_of(tmp_path), [tmp_path / "car.dbc"])
    except RoadlogError:
        return
    assert len(result.tables[1]) == 80
