"""Other people's readers find in our logs, with results in them, what we find ourselves."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from rerun.chunk import McapReader
from support.drives import ROOT
from support.protobuf_values import bits, numbers

import roadlog
from roadlog.storage import LogReader, Table
from roadlog.view.viewer import _environment, _executable


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sample log into which results were put, for the second time."""
    path = tmp_path_factory.mktemp("readers") / "slalom.mcap"
    shutil.copy(ROOT / "sample_logs" / "slalom.mcap", path)
    for names in (["incl_kinematic", "ls_attitude"], ["ls_attitude"]):
        opened = roadlog.open(path)
        estimates = [opened.estimate(name) for name in names]
        opened.write(estimates, names=names)
    return path


def own(path: Path) -> dict[str, Table]:
    with LogReader(path) as reader:
        tables = reader.read()
        assert reader.losses == []
    return tables


def test_reference_library_gives_every_value_of_every_channel(log: Path) -> None:
    messages: dict[str, list[tuple[int, dict[str, Any]]]] = {}
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for _, channel, message, decoded in reader.iter_decoded_messages():
            assert message.log_time == message.publish_time
            found = messages.setdefault(channel.topic, [])
            found.append((message.log_time, dict(numbers(decoded))))
    tables = own(log)
    assert {"/gnss/fix", "/estimates/ls_attitude/angles"} <= tables.keys()
    assert messages.keys() == tables.keys()
    for topic, table in tables.items():
        times, rows = zip(*messages[topic], strict=True)
        assert list(times) == table.time.tolist()
        assert {name for row in rows for name in row} == table.columns.keys()
        for name, column in table.columns.items():
            theirs = [float(row.get(name, np.nan)) for row in rows]
            assert bits(column.astype(np.float64)) == bits(theirs), (topic, name)


def test_rerun_loads_every_value(log: Path) -> None:
    tables = own(log)
    rows: dict[str, list[Any]] = {}
    for chunk in McapReader(log).stream():
        if not chunk.is_static:
            rows.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
    drawn = {t for t, table in tables.items() if table.schema.startswith("foxglove.")}
    flat = tables.keys() - drawn  # of which Rerun makes points on its map, and frames
    assert all(len(rows[topic]) > 0 for topic in drawn)
    for topic in flat:
        table, batches = tables[topic], rows[topic]
        times = [np.asarray(b.column("message_log_time").cast("int64")) for b in batches]
        np.testing.assert_array_equal(np.concatenate(times), table.time)
        values = [batch.column(f"{table.schema}:message").flatten() for batch in batches]
        for name, column in table.columns.items():
            fields = [part.field(name) for part in values]
            fields = [f.field("value") if f.type.num_fields else f for f in fields]  # of an enum
            theirs = [np.asarray(field, np.float64) for field in fields]
            np.testing.assert_array_equal(np.concatenate(theirs), column.astype(np.float64), name)


def rerun_mcap(*arguments: str) -> str:
    done = subprocess.run(
        [_executable(), "mcap", *arguments],
        capture_output=True, text=True, check=True, env=_environment(),
    )  # fmt: skip
    return done.stdout


def test_rerun_finds_no_issue(log: Path) -> None:
    if "check" not in rerun_mcap("--help"):
        pytest.skip("this version of Rerun has no `mcap check`")
    lines = [line.split() for line in rerun_mcap("check", "--full", str(log)).splitlines()]
    found = {line[3]: (line[0], *line[4:]) for line in lines if line[1:2] and line[1].isdigit()}
    assert found == dict.fromkeys(own(log), ("ok", "—"))
