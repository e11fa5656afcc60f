"""The second reading of a log agrees with ours, and says where it does not."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.drives import ROOT
from support.results import put, result
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.verify import verify

pytest.importorskip("mcap_protobuf")
SAMPLES = sorted((ROOT / "sample_logs").glob("*.mcap"))
CONFORMANCE = ROOT.parent / "shared" / "data" / "mcap_conformance"


@pytest.mark.parametrize("log", SAMPLES[:1], ids=lambda log: log.name)
def test_a_sample_log(log: Path) -> None:
    found = verify(log)
    assert not found.differences
    assert sum(topic.values for topic in found.topics) > 100_000


@pytest.mark.slow
@pytest.mark.parametrize("log", SAMPLES[1:], ids=lambda log: log.name)
def test_every_sample_log(log: Path) -> None:
    assert not verify(log).differences


def test_a_log_with_results(hill_log: Path) -> None:
    put(hill_log, result(500))
    before = hill_log.read_bytes()
    done = CliRunner().invoke(app, ["verify", str(hill_log)])
    assert (done.exit_code, hill_log.read_bytes()) == (0, before)
    assert "both readings are the same" in done.output


def test_a_damaged_log_differs(hill_log: Path) -> None:
    content = bytearray(hill_log.read_bytes())
    content[len(content) // 2] ^= 1
    hill_log.write_bytes(content)
    assert CliRunner().invoke(app, ["verify", str(hill_log)]).exit_code == 3
