"""What loggers also write, and what users also have: by the command line, one line for each."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.drive_formats import DBC, payloads, profile_of, write_kitti, write_ros2

from roadlog import cli
from roadlog.ingest import ingest
from roadlog.ingest.formats import ros
from roadlog.log import DriveLog

SPEED = '[speed]\nv = { from = "v", unit = "m/s" }\n'

Ingest = Callable[..., tuple[int, str]]


@pytest.fixture
def command(tmp_path, monkeypatch, capsys) -> Ingest:
    """`roadlog ingest ... -o out.mcap`: its exit code and what it says on stderr."""

    def run(*arguments: object) -> tuple[int, str]:
        words = [
            "roadlog",
            "ingest",
            *map(str, arguments),
            "-o",
            str(tmp_path / "out.mcap"),
            "--force",
        ]
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0), capsys.readouterr().err

    return run


def refused(command: Ingest, folder: Path, *arguments: object) -> str:
    """The one line of a run that fails and leaves what was there."""
    out = folder / "out.mcap"
    out.write_bytes(b"precious")
    code, said = command(*arguments)
    assert code == 1, said
    assert out.read_bytes() == b"precious"
    assert not list(folder.glob(".out*"))
    assert said.startswith("roadlog: ")
    assert said.count("\n") == 1, said
    return said


@pytest.mark.parametrize(
    ("name", "module", "extra"),
    [
        ("drive.mf4", "asammdf", "mdf"),
        ("drive.blf", "can", "can"),
        ("drive.log", "can", "can"),
        ("drive.parquet", "pyarrow", "table"),
        ("car.dbc", "cantools", "can"),
    ],
)
def test_a_missing_extra_is_named(tmp_path, monkeypatch, command, name, module, extra):
    heads = {
        "drive.mf4": b"MDF     4.11",
        "drive.blf": b"LOGG",
        "drive.log": b"(1.0) can0 100#0000\n",
        "drive.parquet": b"PAR1",
        "car.dbc": b"",
    }
    path = tmp_path / name
    path.write_bytes(heads[name].ljust(64))
    profile = tmp_path / "p.toml"
    profile.write_text(SPEED)
    arguments: list[object] = [path, "--profile", profile]
    if name == "car.dbc":
        trace = tmp_path / "drive.log"
        trace.write_bytes(heads["drive.log"])
        arguments = [trace, "--dbc", path, "--profile", profile]
    monkeypatch.setitem(sys.modules, module, None)
    said = refused(command, tmp_path, *arguments)
    assert f"needs an extra: pip install 'roadlog[{extra}]'" in said


def table_of(folder: Path, data: bytes, column: str = "v", time: str = 'unit = "s"'):
    (folder / "p.toml").write_text(
        f'[time]\n{time}\n[speed]\nv = {{ from = "{column}", unit = "m/s" }}\n', encoding="utf-8"
    )
    path = folder / "drive.csv"
    path.write_bytes(data)
    result = ingest([path], folder / "p.toml")
    return result.tables[0], result.losses


TEXT = "t;Größe [°];v\n0;1;1,5\n0,1;2;2,5\n"


@pytest.mark.parametrize(
    "data",
    [
        TEXT.encode("cp1252"),
        TEXT.encode("utf-8-sig"),
        ("\ufeff" + TEXT).encode("utf-16-le"),
        ("\ufeff" + TEXT).encode("utf-16-be"),
        TEXT.encode("utf-16-le"),
        "t;Größe [°];v\n".encode() + "0;ß;1,5\n0,1;ß;2,5\n".encode("cp1252"),
        "t;Größe [°];v\n".encode("cp1252") + "0;ß;1,5\n0,1;ß;2,5\n".encode(),
        TEXT.encode() + bytes(200),  # the last block of a logger without power
    ],
    ids=["cp1252", "utf-8", "utf-16-le", "utf-16-be", "no-mark", "mixed", "mixed-2", "zeros"],
)
def test_encodings_give_the_same_columns(tmp_path, data):
    table, _ = table_of(tmp_path, data)
    assert table.time.tolist() == [0, 100_000_000]
    assert table.columns["v"].tolist() == [1.5, 2.5]


def test_a_name_beyond_ascii_is_found_in_any_encoding(tmp_path):
    for encoding in ("utf-8", "cp1252", "utf-16"):
        table, _ = table_of(tmp_path, "t;Größe\n0;1\n1;2\n".encode(encoding), "Größe")
        assert table.columns["v"].tolist() == [1, 2]


@pytest.mark.parametrize(
    "row", ["s;km/h", "[s];[km/h]", "(s);(km/h)"], ids=["plain", "brackets", "parentheses"]
)
def test_a_row_of_units_is_no_data(tmp_path, row):
    table, losses = table_of(tmp_path, f"t;v\n{row}\n0;36\n0,1;72\n".encode())
    assert table.columns["v"].tolist() == [36, 72]
    assert not losses


@pytest.mark.parametrize(
    ("text", "milliseconds"),
    [
        ("05/24/2019 06:11:23.018 PM", 1558721483018),
        ("05/24/2019 12:11:23 AM", 1558656683000),
        ("24-May-2019 06:11:23 PM", 1558721483000),
        ("May 24, 2019 6:11:23 PM", 1558721483000),
        ("24.05.2019 18:11:23,5", 1558721483500),
        ("06:11:23 PM", 65483000),
        ("18:11:23", 65483000),
    ],
)
def test_clocks_of_twelve_and_of_twenty_four_hours(tmp_path, text, milliseconds):
    table, _ = table_of(tmp_path, f"t;v\n{text};1\n".encode(), time="")
    assert table.time.tolist() == [milliseconds * 1_000_000]


def test_decimal_commas_are_understood_or_refused(tmp_path, command):
    table, _ = table_of(tmp_path, b't,v\n"0,5","1,5"\n"1,0","2,5"\n')
    assert table.columns["v"].tolist() == [1.5, 2.5]
    (tmp_path / "drive.csv").write_text("t,v\n0,5,1,5\n1,0,2,5\n")
    said = refused(command, tmp_path, tmp_path / "drive.csv", "--profile", tmp_path / "p.toml")
    assert "decimal commas between commas? Export with semicolons" in said


@pytest.mark.parametrize(
    ("rows", "lost"),
    [
        (["0,1", "x,2", "0.2,3"], 1),
        (["0,1", "1e300,2", "0.2,3"], 1),
        (["2019-05-24 18:11:23,1", "2019-05-2,2", "2019-05-24 18:11:24,3"], 1),
        (["2019-05-24 18:11:23,1", "9999-05-24 18:11:23,2", "2019-05-24 18:11:24,3"], 1),
    ],
    ids=["word", "beyond-int64", "cut", "beyond-2262"],
)
def test_rows_without_a_time_are_left_out_and_counted(tmp_path, rows, lost):
    time = "" if rows[0].startswith("2019") else 'unit = "s"'
    table, losses = table_of(tmp_path, "\n".join(["t,v", *rows, ""]).encode(), time=time)
    assert table.columns["v"].tolist() == [1, 3]
    assert losses == [f"drive.csv: {lost} rows without a time left out"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b't,v\n0,"1\n0.1,2\n', "a quote that does not end"),
        (b"t,v\n0,1\n0.1,\x00\n0.2,3\n", "is of no known format"),
        (b"t,v\n2019,1\n", "has no 'w'. There are: v"),
        (b"1,2\n3,4\n", "its first line holds numbers"),
    ],
    ids=["quote", "binary", "name", "no-header"],
)
def test_what_no_table_can_mean_is_one_line(tmp_path, command, data, words):
    name = "w" if "'w'" in words else "v"
    (tmp_path / "p.toml").write_text(SPEED.replace('"v"', f'"{name}"') + '[time]\nunit = "s"\n')
    (tmp_path / "drive.csv").write_bytes(data)
    said = refused(command, tmp_path, tmp_path / "drive.csv", "--profile", tmp_path / "p.toml")
    assert words in said


def parquet_of(path: Path, **columns: object) -> Path:
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    parquet.write_table(pyarrow.table(columns), path)
    return path


def test_parquet_columns_of_every_numeric_type(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from decimal import Decimal

    (tmp_path / "p.toml").write_text(SPEED)
    values = {
        "integer": [1, 2, 3],
        "decimal": [Decimal("1"), Decimal("2"), Decimal("3")],
        "dictionary": pyarrow.array([1, 2, 3]).dictionary_encode(),
        "float16": np.array([1, 2, 3], np.float16),
    }
    stamps = pyarrow.array([0, 100_000, 200_000], pyarrow.timestamp("us", "UTC"))
    for kind, v in values.items():
        path = parquet_of(tmp_path / f"{kind}.parquet", t=stamps, v=v)
        table = ingest([path], tmp_path / "p.toml").tables[0]
        assert table.time.tolist() == [0, 100_000_000, 200_000_000]
        np.testing.assert_array_equal(table.columns["v"], [1, 2, 3], kind)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ({"t": [0.0, 0.1], "v": ["fast", "slow"]}, "holds no numbers (e.g. 'fast')"),
        ({"t": [0.0, 0.1], "v": ["1", "2"]}, "holds no numbers (e.g. '1')"),
        ({"t": [0.0, 0.1], "v": [[1.0], [2.0]]}, "holds no numbers"),
        ({"t": ["soon", "later"], "v": [1.0, 2.0]}, "row 1: 'soon' is no time"),
        ({"x": [0.0, 0.1], "v": [1.0, 2.0]}, "which column is the time"),
        ({"t": [0.0, 0.1], "w": [1.0, 2.0]}, "has no 'v'"),
        ({"t": np.zeros(0), "v": np.zeros(0)}, "has columns but no rows"),
    ],
    ids=["text", "text-numbers", "lists", "time", "no-time", "no-column", "empty"],
)
def test_a_parquet_file_that_does_not_fit_is_one_line(tmp_path, command, columns, words):
    (tmp_path / "p.toml").write_text(SPEED)
    path = parquet_of(tmp_path / "drive.parquet", **columns)
    assert words in refused(command, tmp_path, path, "--profile", tmp_path / "p.toml")


def test_a_cut_parquet_file_is_one_line(tmp_path, command):
    (tmp_path / "p.toml").write_text(SPEED)
    path = parquet_of(tmp_path / "drive.parquet", t=[0.0, 0.1], v=[1.0, 2.0])
    path.write_bytes(path.read_bytes()[:-20])
    said = refused(command, tmp_path, path, "--profile", tmp_path / "p.toml")
    assert "cannot be read as Parquet" in said


def test_a_kitti_folder_finds_its_own_profile(tmp_path):
    drive = write_kitti(tmp_path)
    result = ingest([drive])
    tables = {table.topic: table for table in result.tables}
    assert not result.losses
    assert tables["/imu"].time[0] == 1317042145_000000009
    assert np.diff(tables["/imu"].time).tolist() == [100_000_000] * 49
    truth, gnss = tables["/truth/angles"].columns, tables["/gnss"].columns
    np.testing.assert_allclose(truth["grade"], np.arctan(0.1))
    np.testing.assert_allclose(truth["inclination"], 0.02)  # KITTI's pitch: front down +
    np.testing.assert_allclose(truth["roll_total"], 0.01)
    np.testing.assert_allclose(gnss["course"], np.pi / 2)  # north, from east
    np.testing.assert_allclose(tables["/imu"].columns["accel_z"], 9.8)
    np.testing.assert_array_equal(
        ingest([drive / "oxts"]).tables[0].columns["accel_x"], tables["/imu"].columns["accel_x"]
    )


def test_a_kitti_folder_with_damage_says_what_was_left_out(tmp_path, command):
    drive = write_kitti(tmp_path)
    data = drive / "oxts" / "data"
    (data / f"{7:010d}.txt").write_text("1.0")
    (data / f"{49:010d}.txt").unlink()
    code, said = command(drive)
    assert code == 3
    assert "1 data files are not 30 figures" in said
    assert "49 data files for 50 stamps" in said
    assert len(DriveLog(tmp_path / "out.mcap").drive()["imu.accel_x"]) > 400
    for file in data.iterdir():
        file.write_bytes(b"\xff\xfe")
    assert "no data file holds the 30 figures" in refused(command, tmp_path, drive)


def test_a_folder_stands_for_the_files_in_it(tmp_path, command):
    folder = tmp_path / "drive"
    folder.mkdir()
    can = pytest.importorskip("can")
    for name, half in (("a.blf", slice(0, 400)), ("b.blf", slice(400, None))):
        with can.Logger(folder / name) as writer:
            for stamp, identifier, data in payloads()[half]:
                writer.on_message_received(
                    can.Message(
                        timestamp=stamp * 1e-9,
                        arbitration_id=identifier,
                        is_extended_id=False,
                        data=data,
                    )
                )
    (folder / "car.dbc").write_text(DBC)
    (folder / "notes.txt").write_text("a rainy day")
    (folder / ".hidden.csv").write_text("t,v\n0,1\n")
    result = ingest([folder], profile_of(tmp_path))
    assert {table.topic: len(table) for table in result.tables} == {"/imu": 400, "/speed": 80}
    assert "not a source: notes.txt" in result.notes
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "holds no file of a known format" in refused(command, tmp_path, empty)


def trace(path: Path, count: int) -> Path:
    can = pytest.importorskip("can")
    rng = np.random.default_rng(1)
    with can.Logger(path) as writer:
        for k in range(count):
            data = rng.integers(0, 256, 8, np.uint8).tobytes()
            message = can.Message(
                timestamp=1.7e9 + 0.01 * k, arbitration_id=258, is_extended_id=False, data=data
            )
            writer.on_message_received(message)
    return path


def test_a_cut_blf_gives_what_comes_before_or_is_refused(tmp_path, command):
    path = trace(tmp_path / "drive.blf", 20_000)
    (tmp_path / "car.dbc").write_text(DBC)
    (tmp_path / "p.toml").write_text(SPEED)
    arguments = [path, "--dbc", tmp_path / "car.dbc", "--profile", tmp_path / "p.toml"]
    whole = path.read_bytes()
    for share in (0.5, 0.95):
        path.write_bytes(whole[: round(share * len(whole))])
        code, said = command(*arguments)
        assert code == 3
        assert f"cut short: {share:.0%} of the file is there" in said
        (speed,) = DriveLog(tmp_path / "out.mcap").tables(["/speed"]).values()
        assert len(speed) == pytest.approx(20_000 * share, rel=0.15)
    path.write_bytes(whole[:100])  # not the whole header
    assert "holds no CAN frame" in refused(command, tmp_path, *arguments)


def test_a_dbc_of_another_car_is_one_line(tmp_path, command):
    path = trace(tmp_path / "drive.log", 10)
    (tmp_path / "p.toml").write_text(SPEED)
    other = tmp_path / "other.dbc"
    other.write_text(DBC.replace("BO_ 258", "BO_ 999"))
    said = refused(command, tmp_path, path, "--dbc", other, "--profile", tmp_path / "p.toml")
    assert "the DBC knows none of its identifiers (seen: 0x102 (10))" in said
    said = refused(command, tmp_path, path, "--profile", tmp_path / "p.toml")
    assert "raw CAN needs --dbc FILE" in said
    gone = tmp_path / "othr.dbc"
    said = refused(command, tmp_path, path, "--dbc", gone, "--profile", tmp_path / "p.toml")
    assert "no such DBC file. Close: other.dbc" in said


def test_a_signal_outside_of_its_message_is_said_and_not_decoded(tmp_path):
    path = trace(tmp_path / "drive.log", 10)
    (tmp_path / "p.toml").write_text(SPEED)
    wide = DBC + ' SG_ far : 60|16@1+ (1,0) [0|0] "" ECU\n'
    (tmp_path / "car.dbc").write_text(wide)
    result = ingest([path], tmp_path / "p.toml", [tmp_path / "car.dbc"])
    assert any("outside of its message: Odo.far" in note for note in result.notes)
    assert len(result.tables[0]) == 10


def test_a_ros2_folder_without_its_file_is_one_line(tmp_path, command):
    bag = write_ros2(tmp_path / "drive", "SQLITE3")
    for file in bag.glob("*.db3"):
        file.unlink()
    assert "cannot be read as a ROS bag" in refused(command, tmp_path, bag)
    (bag / "metadata.yaml").write_text("{")
    assert "cannot be read as a ROS bag" in refused(command, tmp_path, bag)


def test_an_mdf_file_of_text_and_of_invalid_samples(tmp_path, command):
    asammdf = pytest.importorskip("asammdf")
    t = np.arange(100) / 10
    path = tmp_path / "drive.mf4"
    with asammdf.MDF() as file:
        bad = t == 1.0
        file.append(
            [
                asammdf.Signal(np.arange(100.0), t, name="v", invalidation_bits=bad),
                asammdf.Signal(np.array([b"left"] * 100), t, name="w", encoding="utf-8"),
            ]
        )
        file.save(path)
    (tmp_path / "p.toml").write_text(SPEED)
    table = ingest([path], tmp_path / "p.toml").tables[0]
    np.testing.assert_array_equal(table.columns["v"], np.arange(100)[~bad])
    (tmp_path / "p.toml").write_text(SPEED.replace('"v"', '"w"'))
    said = refused(command, tmp_path, path, "--profile", tmp_path / "p.toml")
    assert "holds no numbers (e.g." in said
    path.write_bytes(path.read_bytes()[:-500])
    assert "cannot be read as MDF" in refused(
        command, tmp_path, path, "--profile", tmp_path / "p.toml"
    )


def test_a_file_that_may_not_be_read_is_one_line(tmp_path, monkeypatch, command):
    path = tmp_path / "drive.csv"
    path.write_text("t,v\n0,1\n")

    def refuse(self: Path, *_: object, **__: object) -> None:
        raise PermissionError(13, "Permission denied", str(self))

    broken = replace(ros.FORMAT, recognizes=refuse)
    monkeypatch.setattr("roadlog.ingest.formats.ros.FORMAT", broken)
    said = refused(command, tmp_path, path)
    assert said == f"roadlog: {path}: cannot be read: Permission denied\n"


@pytest.mark.parametrize("low", [1, 128])
def test_bytes_that_are_no_text_are_no_table_with_a_profile_either(tmp_path, command, low):
    data = np.random.default_rng(1).integers(low, 256, 20_000).astype(np.uint8)
    data[::50], data[::7] = ord("\n"), ord(",")
    (tmp_path / "p.toml").write_text(SPEED)
    path = tmp_path / "drive.bin"
    path.write_bytes(data.tobytes())
    said = refused(command, tmp_path, path, "--profile", tmp_path / "p.toml")
    assert "drive.bin: is of no known format" in said
    assert said.isascii()
