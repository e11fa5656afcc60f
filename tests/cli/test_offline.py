"""No command opens a connection that nobody asked for."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from support.drives import ROOT
from typer.testing import CliRunner

from roadlog.cli import app

SAMPLES = ROOT / "sample_logs"


def test_no_command_connects(hill_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def connect(_: socket.socket, address: object) -> None:
        asked.append(address)
        raise OSError("no network")

    monkeypatch.setattr(socket.socket, "connect", connect)
    monkeypatch.setattr(socket.socket, "connect_ex", connect)
    monkeypatch.setattr(socket, "getaddrinfo", lambda *address, **_: connect(None, address))
    monkeypatch.chdir(hill_log.parent)
    table, profile = SAMPLES / "small_logger.csv", SAMPLES / "small_logger.toml"
    for words in (
        ["ingest", table, "--profile", profile, "-o", "small.mcap"],
        ["info", "hill.mcap"],
        ["estimate", "hill.mcap", "-e", "incl_kinematic"],
        ["export", "hill.mcap", "--every", "1s", "-o", "hill.csv"],
        ["view", "hill.mcap", "--save", "hill.rrd"],
        ["verify", "hill.mcap"],
    ):
        done = CliRunner().invoke(app, [str(word) for word in words], catch_exceptions=False)
        assert done.exit_code == 0, done.output
    assert not asked
