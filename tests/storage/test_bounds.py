"""What a log makes roadlog inflate, list and export is bounded by what lies in the file."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from support.drives import hill_tables
from support.memory import peak
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.errors import LogReadError
from roadlog.log import create

CPU = 5.0  # s
YEARS = 5 * 365 * 86400 * 10**9  # ns


@contextmanager
def within_bounds() -> Iterator[None]:
    started = time.process_time()
    before = peak()
    yield
    assert time.process_time() - started < CPU
    assert peak() - before < 500e6


def refused(*arguments: object) -> str:
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert isinstance(done.exception, LogReadError), done.output
    return str(done.exception)


@pytest.mark.parametrize("summary", [True, False])
def test_a_bomb(tmp_path: Path, summary: bool) -> None:
    """A few kB that declare two chunks of 100 MB of zeros."""
    path = tmp_path / "bomb.mcap"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=1, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
        channel = writer.register_channel("/t", "cdr", schema)
        for k in range(2):
            writer.add_message(channel, k, bytes(100_000_000), k)
        writer.finish()
    if not summary:
        path.write_bytes(path.read_bytes()[:-40])
    for command in (["info", path], ["export", path, "-o", tmp_path / "x.csv"]):
        with within_bounds():
            assert "would inflate" in refused(*command)


def test_tens_of_thousands_of_channels(tmp_path: Path) -> None:
    path = tmp_path / "many.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data\n")
        for k in range(20_000):
            channel = writer.register_channel(f"/t{k}", "cdr", schema)
            writer.add_message(channel, k, b"\0\1\0\0" + bytes(8), k)
        writer.finish()
    for command in (["info", path], ["export", path, "-o", tmp_path / "x.csv"]):
        with within_bounds():
            assert "20000 channels" in refused(*command)


@pytest.fixture(scope="module")
def jumping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive whose clock is set in its middle."""
    path = tmp_path_factory.mktemp("jumping") / "years.mcap"
    half = (
        dataclasses.replace(
            t, time=np.where(np.arange(len(t)) > len(t) // 2, t.time + YEARS, t.time)
        )
        for t in hill_tables(10.0)
    )
    create(path, half)
    return path


@pytest.mark.parametrize("rate", [[], ["--every", "10Hz"]])
def test_export_of_a_clock_that_jumps_by_years(
    jumping: Path, tmp_path: Path, rate: list[str]
) -> None:
    with within_bounds():
        said = refused("export", jumping, "-o", tmp_path / "x.csv", *rate)
    assert "jumps by 1825.0 days" in said
    assert not (tmp_path / "x.csv").exists()


def test_info_of_a_clock_that_jumps_by_years(jumping: Path) -> None:
    with within_bounds():
        done = CliRunner().invoke(app, ["info", str(jumping)])
    assert done.exit_code == 0
    assert "far from the recording" in " ".join(done.output.split())


@pytest.mark.parametrize("command", [["view", "--save", "x.rrd"], ["plot", "-o", "x.png"]])
def test_view_of_a_clock_that_jumps_by_years(
    jumping: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    with within_bounds():
        assert "stamps span 1825.0 days" in refused(*command, jumping)
    assert not list(tmp_path.iterdir())
