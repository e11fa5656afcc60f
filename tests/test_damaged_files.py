"""Damaged profiles, vehicle files, reports and journals: read, or refused in one line, soon."""

from __future__ import annotations

import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.drives import hill_tables
from support.hostile import VEHICLE, damaged
from support.results import put, result

from roadlog import estimators
from roadlog.car.correction import corrected
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile, shipped
from roadlog.storage import LogReader, journal, write_log

LONGEST = 2.0  # s of CPU
LONG = 2000  # characters of a message
FEW, MANY = 60, 5000  # of each kind; four kinds
COUNTS = [FEW, pytest.param(MANY, marks=pytest.mark.slow)]

PROFILE = """[time]
column = "t"
unit = "s"
[imu]
mount = { x = "forward", y = "left", z = "up" }
accel_x = { from = "ax", unit = "m/s^2", scale = 1.0, offset = 0.0 }
accel_z = { from = "az", unit = "g", use = "where t > 1", delay = "20 ms" }
[speed]
v = { from = "v", unit = "km/h", map = { "1" = 2.0 } }
"""


def soon_and_in_one_line(
    read: Callable[[bytes], object], data: bytes, count: int, *, text: bool = True, seed: int = 1
) -> None:
    """Give damaged copies to `read`, which may only raise RoadlogError."""
    chance = random.Random(seed)
    refused, wrong = 0, []
    for k in range(count):
        bad, said = damaged(data, chance, text), None
        start = time.process_time()
        try:
            read(bad)
        except RoadlogError as error:
            refused, said = refused + 1, str(error)
        except Exception as error:
            wrong.append(f"{k}: {type(error).__name__}: {error}")
        took = time.process_time() - start
        if said is not None and not (0 < len(said) < LONG and said.isprintable()):
            wrong.append(f"{k}: {said[:LONG]!r}")
        if took > LONGEST:
            wrong.append(f"{k}: took {took:.1f} s")
    assert not wrong, f"{len(wrong)}, with seed {seed}: {wrong[:5]}"
    assert refused > count / 10


@pytest.mark.parametrize("count", COUNTS)
def test_profiles(tmp_path: Path, count: int) -> None:
    """Of a table that is ingested with them, and those that ship."""
    t = np.arange(300) / 50
    table = np.stack([t, np.sin(t), np.ones(len(t)), 36 + t], 1)
    source, profile = tmp_path / "s.csv", tmp_path / "p.toml"
    np.savetxt(source, table, "%.4f", ",", header="t,ax,az,v", comments="")

    def read(data: bytes) -> None:
        profile.write_bytes(data)
        ingest([source], str(profile))

    profile.write_text(PROFILE)
    soon_and_in_one_line(read, PROFILE.encode(), count // 2)
    names = shipped()
    share = count // 2 // len(names) + 1
    for seed, name in enumerate(names):
        text = (Path(estimators.__file__).parents[1] / "profiles" / f"{name}.toml").read_bytes()
        soon_and_in_one_line(
            lambda data, name=name: Profile.from_toml(data.decode("utf-8", "replace"), name),
            text,
            share,
            seed=seed,
        )


@pytest.mark.parametrize("count", COUNTS)
def test_vehicle_files(tmp_path: Path, count: int) -> None:
    path, drive = tmp_path / "car.toml", Drive.from_tables(hill_tables(5.0))

    def read(data: bytes) -> None:
        path.write_bytes(data)
        vehicle = Vehicle.load(path)
        made = estimators.run("lowpass_attitude", corrected(drive, vehicle), vehicle)
        assert Vehicle.from_toml(vehicle.to_toml()) == vehicle
        assert np.isfinite(made.inclination[made.valid]).all()

    soon_and_in_one_line(read, VEHICLE.encode(), count)


@pytest.mark.parametrize("count", COUNTS)
def test_rows_of_a_report(tmp_path: Path, count: int) -> None:
    pytest.importorskip("jinja2")
    from roadlog.log import create
    from roadlog.report import table
    from roadlog.report.row import Options, run_log
    from roadlog.report.run import finish, read_report
    from roadlog.report.sources import find

    create(tmp_path / "a.mcap", hill_tables(12.0, rate=50.0))
    folder = tmp_path / "report"
    folder.mkdir()
    options = Options(("kmbe",))
    done = run_log(find([str(tmp_path / "a.mcap")])[0], options)
    assert done.row["status"] == "ok", done.row["message"]
    content = (table.line(done.row)).encode()
    left = [count // 10]  # pages are made of some of those that are read

    def read(data: bytes) -> None:
        (folder / table.ROWS).write_bytes(data)
        rows = list(read_report(str(folder)).values())
        if left[0] > 0:
            left[0] -= 1
            finish(rows, options, folder)

    soon_and_in_one_line(read, content, count)


@pytest.mark.parametrize("count", COUNTS)
def test_journals(tmp_path: Path, count: int) -> None:
    """The log beside it is put back as it was, or is left as it is."""
    log, half = tmp_path / "x.mcap", tmp_path / "half"
    write_log(log, hill_tables(1.0), {})
    put(log, result(100), in_place=True)
    before = log.read_bytes()
    undo = journal.path_of(log)
    saved = tmp_path / "saved"

    def stopped() -> object:
        yield result(60_000)
        shutil.copy(log, half)
        shutil.copy(undo, saved)

    from roadlog.storage import update_log

    keep = {"drop": lambda _: False, "drop_metadata": lambda _: False}
    update_log(log, stopped(), {}, in_place=True, **keep)  # type: ignore[arg-type]
    there = half.read_bytes()

    def read(data: bytes) -> None:
        undo.unlink(missing_ok=True)
        log.write_bytes(there)
        undo.write_bytes(data)
        try:
            with LogReader(log):
                pass
        finally:
            assert log.read_bytes() in (there, before)

    read(saved.read_bytes())
    assert log.read_bytes() == before
    soon_and_in_one_line(read, saved.read_bytes(), count, text=False)
