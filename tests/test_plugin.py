"""The example of plug-ins, installed as a user would; broken ones."""

from __future__ import annotations

import struct
import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from support.drives import EPOCH_NS, ROOT

from roadlog import estimators, extras, plugins
from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile
from roadlog.log import DriveLog
from roadlog.storage import LogReader

SPEED = '[speed]\nv = { from = "speed", unit = "km/h" }\n'


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example installed in it."""
    target = tmp_path_factory.mktemp("site")
    options = ["--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--target", target]
    command = [sys.executable, "-m", "pip", "install", *options, ROOT / "docs/examples/plugin"]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return target


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    """Plug-ins are looked up anew, before and after."""
    plugins.installed.cache_clear()
    yield monkeypatch
    monkeypatch.undo()
    plugins.installed.cache_clear()


@pytest.fixture
def example(site: Path, fresh: pytest.MonkeyPatch) -> None:
    """The example is installed."""
    fresh.syspath_prepend(str(site))


@pytest.mark.usefixtures("example")
def test_example_estimates_and_is_configured(hill_log: Path) -> None:
    log = DriveLog(hill_log)
    assert log.estimate("mean_slope", window=1).parameters == {"window": 1}
    with pytest.raises(ConfigError, match="Close: window"):
        log.estimate("mean_slope", windw=1)


@pytest.mark.usefixtures("example")
def test_example_reads_a_format_of_its_own(tmp_path: Path) -> None:
    source = tmp_path / "drive.acme"
    source.write_text("ACME LOG\n0|0.1|36\n100|0.1|x\n200|0.2|72\n")
    made = ingest([source], Profile.from_toml(SPEED, "p"))
    (table,) = made.tables
    np.testing.assert_allclose(table.columns["v"], [10.0, 20.0])
    np.testing.assert_array_equal(table.time, [0, 200_000_000])
    assert made.losses == ["drive.acme: 1 rows are no numbers"]
    assert made.left_over == ["forward"]


@pytest.mark.usefixtures("example")
def test_example_decodes_an_encoding_of_its_own(tmp_path: Path, slow: list[int]) -> None:
    path = tmp_path / "packed.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("acme.Speed", "struct", b"f8 speed\nu2 gear")
        channel = writer.register_channel("/acme", "packed", schema)
        for k in range(50):
            payload = struct.pack("<dH", 36.0 + k, 3)
            writer.add_message(channel, EPOCH_NS + k, payload, EPOCH_NS + k)
        writer.add_message(channel, EPOCH_NS + 50, b"short", EPOCH_NS + 50)
        writer.finish()
    with LogReader(path) as reader:
        columns = reader.read(["/acme"])["/acme"].columns
        assert reader.losses == ["/acme: 1 of 51 messages cannot be decoded"]
    np.testing.assert_array_equal(columns["speed"][:50], 36.0 + np.arange(50))
    assert np.isnan(columns["speed"][50])
    assert slow == [1]  # all that are whole were decoded at once
    made = ingest([path], Profile.from_toml(SPEED.replace('"speed"', '"/acme.speed"'), "p"))
    np.testing.assert_allclose(made.tables[0].columns["v"][0], 10.0)


def test_without_the_plugin_the_name_is_unknown() -> None:
    with pytest.raises(ConfigError, match="no estimator 'mean_slope'"):
        estimators.get("mean_slope")


@pytest.mark.parametrize("target", ["nowhere_at_all:FORMAT", "json:loads", "broken_plugin:FORMAT"])
def test_a_broken_plugin_is_one_warning(
    target: str, tmp_path: Path, fresh: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site"
    (site / "broken-1.0.dist-info").mkdir(parents=True)
    (site / "broken-1.0.dist-info" / "METADATA").write_text("Name: broken\nVersion: 1.0\n")
    (site / "broken-1.0.dist-info" / "entry_points.txt").write_text(
        f"[roadlog.formats]\nbad = {target}\n[roadlog.estimators]\nbad = {target}\n"
    )
    (site / "broken_plugin.py").write_text("raise RuntimeError('one\\ntwo')\n")
    fresh.syspath_prepend(str(site))
    source = tmp_path / "drive.csv"
    source.write_text("t,speed\n0,36\n1,36\n")
    profile = Profile.from_toml('[time]\ncolumn = "t"\nunit = "s"\n' + SPEED, "p")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        for _ in range(2):
            assert len(ingest([source], profile).tables) == 1
        with pytest.raises(ConfigError, match="no estimator 'x'"):
            estimators.get("x")
    groups = [str(w.message) for w in said if w.category is plugins.PluginWarning]
    assert len(groups) == 2  # one for the format, one for the estimator
    assert all(text.startswith("plug-in bad (") and "\n" not in text for text in groups)


def test_a_format_that_fails_to_look_is_passed_over(
    tmp_path: Path, fresh: pytest.MonkeyPatch
) -> None:
    from roadlog.ingest.formats import base, csv

    def fails(path: Path) -> bool:
        raise IndexError(f"of the plug-in: {path}")

    bad = base.Format("bad", "bad logs", fails, csv.read)
    fresh.setattr(plugins, "installed", lambda *_: {"bad": bad})
    source = tmp_path / "drive.csv"
    source.write_text("t,speed\n0,36\n1,36\n")
    profile = Profile.from_toml('[time]\ncolumn = "t"\nunit = "s"\n' + SPEED, "p")
    with pytest.warns(plugins.PluginWarning, match="plug-in bad left out: IndexError"):
        assert len(ingest([source], profile).tables) == 1


def test_an_unknown_file_is_told_what_would_read_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "drive.bin"
    source.write_bytes(bytes(range(256)))
    monkeypatch.setattr(extras, "is_installed", lambda extra: extra != "mdf")
    with pytest.raises(LogReadError) as refused:
        ingest([source])
    said = str(refused.value)
    assert "is of no known format; understood here: " in said
    here, _, more = said.partition("; pip install")
    assert "ROS bags" in here
    assert "MDF files" not in here
    assert more == " 'roadlog[mdf]' adds MDF files"
