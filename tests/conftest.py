"""Fixtures that many tests share: small drives with known truth, the public logs, the command."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path

import pytest
from support.drives import PLAIN, ROOT, SHARED, Run, hill_tables

from roadlog.drive import Drive
from roadlog.storage.columns import Columns


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--no-skip", action="store_true", help="a test that is skipped has failed")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    del call
    report = yield
    if report.skipped and item.config.getoption("--no-skip") and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
    return report


@pytest.fixture
def shared() -> Path:
    """Public drives of other people, which the project does not ship."""
    if not SHARED.is_dir():
        pytest.skip("public drives: ../shared/data is missing")
    return SHARED


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many messages of each channel that is read were decoded one by one."""
    counts: list[int] = []
    finish = Columns.finish

    def counted(columns: Columns) -> tuple:
        counts.append(columns.by_hand)
        return finish(columns)

    monkeypatch.setattr(Columns, "finish", counted)
    return counts


@pytest.fixture
def roadlog_process(tmp_path: Path) -> Run:
    """Run the command line as a process: `roadlog_process("info", path)`."""

    def run(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, **PLAIN, "PYTHONPATH": str(ROOT)}
        return subprocess.run(
            [sys.executable, "-m", "roadlog", *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env=environment,
            timeout=300,
            check=False,
            **options,  # type: ignore[call-overload]
        )

    return run


@pytest.fixture
def roadlog(roadlog_process: Run) -> Run:
    """As `roadlog_process`; tests/cli has it in its own process."""
    return roadlog_process


@pytest.fixture
def hill_drive() -> Drive:
    """`hill_tables` on the common clock."""
    return Drive.from_tables(hill_tables())


@pytest.fixture
def hill_log(tmp_path: Path) -> Path:
    """`hill_tables` as a log."""
    from roadlog.log import create

    path = tmp_path / "hill.mcap"
    create(path, hill_tables())
    return path
