"""Names in a log are anyone's: none of them chooses where a file is written."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.drives import hill_tables

from roadlog.car.vehicle import Vehicle
from roadlog.log import create
from roadlog.signals import ANGLES_SCHEMA, TRUTH_TOPIC

OUTSIDE = "../../outside"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A drive whose topics, estimates, car and source files are named like paths."""
    tables = hill_tables(duration=20.0, rate=20.0)
    truth = next(table for table in tables if table.topic == TRUTH_TOPIC)
    names = (f"/{OUTSIDE}", f"/estimates/{OUTSIDE}/angles", f"/estimates/x/{OUTSIDE}", OUTSIDE)
    tables += [replace(truth, topic=name) for name in names]
    assert truth.schema == ANGLES_SCHEMA
    metadata = {
        "source": {"files": f'{{"{OUTSIDE}": "0"}}'},
        "profile": {"name": OUTSIDE, "toml": ""},
        f"estimate/{OUTSIDE}": {"parameters": "{}"},
    }
    path = tmp_path / "logs" / "deep" / "drive.mcap"
    path.parent.mkdir(parents=True)
    create(path, tables, metadata, Vehicle().with_values(name=OUTSIDE))
    return path


def files(folder: Path) -> set[Path]:
    return {path.relative_to(folder) for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_export_writes_the_file_it_was_told(log, tmp_path, roadlog, suffix):
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    before = files(tmp_path)
    out = tmp_path / "a" / "b" / f"drive.{suffix}"
    out.parent.mkdir(parents=True)
    done = roadlog("export", log, "-o", out)
    assert done.returncode == 0, done.stderr
    assert files(tmp_path) - before == {out.relative_to(tmp_path)}


def test_a_report_stays_in_its_folder(log, tmp_path, roadlog):
    pytest.importorskip("jinja2")
    before = files(tmp_path)
    out = tmp_path / "a" / "b" / "report"
    done = roadlog("report", log, "-o", out, "-e", "lowpass_attitude", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    made = files(tmp_path) - before
    assert made
    assert all(path.is_relative_to(Path("a/b/report")) for path in made)
    assert not any(".." in path.parts for path in made)


def test_an_mcap_with_such_topics_is_ingested_into_the_file_that_was_told(log, tmp_path, roadlog):
    before = files(tmp_path)
    out = tmp_path / "a" / "out.mcap"
    out.parent.mkdir()
    assert roadlog("ingest", log, "-o", out).returncode == 0
    profile = tmp_path / "a" / "new.toml"
    roadlog("profile", "new", log, "-o", profile)
    assert files(tmp_path) - before <= {out.relative_to(tmp_path), profile.relative_to(tmp_path)}
    assert np.isfinite(out.stat().st_size)
