"""No row is dropped in silence because its stamp is that of another, whatever the format."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from support.can_cases import MOTION, START, candump
from support.can_cases import files as car

from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile

COUNT = 400
T = np.arange(COUNT) / 100
V = 10 + np.arange(COUNT) / 100
PROFILE = Profile.from_toml('[speed]\nv = { from = "v", unit = "m/s" }\n', "p")
WHOLE, TENTH = np.floor(T), np.floor(T * 10 + 1e-6) / 10
SOME = np.where(np.arange(COUNT) % 10 == 5, T - 0.01, T)


def can(folder, stamps):
    frames = [
        (s, "can0", 100, struct.pack("<Hhhh", round(v * 100), 0, 0, 0))
        for s, v in zip(stamps, V, strict=True)
    ]
    dbc, _ = car(folder, MOTION)
    toml = '[speed]\nv = { from = "Motion.VehicleSpeed", unit = "m/s" }\n'
    return ingest([candump(folder / "car.log", frames)], Profile.from_toml(toml, "p"), dbc=[dbc])


def mdf(folder, stamps):
    asammdf = pytest.importorskip("asammdf")
    path = folder / "car.mf4"
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(V, stamps, name="v", unit="m/s")])
        file.save(path)
    return ingest([path], PROFILE)


def parquet(folder, stamps):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    path = folder / "car.parquet"
    parquet.write_table(pyarrow.table({"time": stamps + START, "v": V}), path)
    return ingest([path], PROFILE)


@pytest.mark.parametrize("stamps", [WHOLE, TENTH], ids=["1 s", "0.1 s"])
@pytest.mark.parametrize("source", [can, mdf, parquet])
def test_coarse_stamps_of_any_format_are_spread_and_said(tmp_path, source, stamps):
    result = source(tmp_path, stamps)
    (table,) = result.tables
    np.testing.assert_allclose(table.columns["v"], V, atol=0.006)
    np.testing.assert_allclose((table.time - table.time[0]) * 1e-9, T, atol=1e-6)
    assert any("spread evenly" in note for note in result.notes)
    assert not result.losses


@pytest.mark.parametrize("source", [can, mdf, parquet])
def test_rows_that_give_way_to_another_of_their_stamp_are_counted(tmp_path, source):
    result = source(tmp_path, SOME)
    assert len(result.tables[0]) == COUNT - COUNT // 10
    (loss,) = result.losses
    assert f"{COUNT // 10} rows have the stamp of another row and other values" in loss


def test_copies_of_a_row_are_no_loss(tmp_path):
    path = tmp_path / "drive.csv"
    rows = [f"{t:.2f},{v:.2f}" for t, v in zip(T, V, strict=True)]
    rows[10:10] = rows[9:10] * 2
    path.write_text("time,v\n" + "\n".join(rows) + "\n")
    result = ingest([path], PROFILE)
    assert len(result.tables[0]) == COUNT
    assert not result.losses


@pytest.mark.parametrize("times", [2, 3])
@pytest.mark.parametrize("header", ["time,v\n", ""])
def test_a_logger_that_began_again_from_zero_goes_on_behind(tmp_path, times, header):
    path = tmp_path / "drive.csv"
    parts = [
        "".join(f"{t:.2f},{v + k:.2f}\n" for t, v in zip(T, V, strict=True)) for k in range(times)
    ]
    path.write_text("time,v\n" + header.join(parts))
    result = ingest([path], PROFILE)
    (table,) = result.tables
    np.testing.assert_allclose(table.time * 1e-9, np.arange(times * COUNT) / 100, atol=1e-6)
    np.testing.assert_allclose(table.columns["v"], np.concatenate([V + k for k in range(times)]))
    (loss,) = result.losses
    assert "the rows after go on behind those before" in loss


def test_tables_of_several_sensors_in_one_file_stay_beside_each_other(tmp_path):
    path = tmp_path / "drive.csv"
    first = "".join(f"{t:.2f},{v:.2f},\n" for t, v in zip(T, V, strict=True))
    path.write_text("time,v,w\n" + first + "".join(f"{t:.2f},,{k}\n" for k, t in enumerate(T)))
    profile = (
        '[speed]\nv = { from = "v", unit = "m/s" }\n[imu]\naccel_x = { from = "w", unit = "g" }'
    )
    result = ingest([path], Profile.from_toml(profile, "p"))
    for table in result.tables:
        np.testing.assert_allclose(table.time * 1e-9, T, atol=1e-6)
