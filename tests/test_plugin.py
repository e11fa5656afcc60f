"""The example of a plug-in, installed as a user would, and found by the command line."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.drives import ROOT

from roadlog.log import DriveLog


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the example installed in it."""
    target = tmp_path_factory.mktemp("site")
    options = ["--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--target", target]
    command = [sys.executable, "-m", "pip", "install", *options, ROOT / "docs/examples/plugin"]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return target


def test_example_estimates_and_is_configured(site: Path, hill_log: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{site}"}
    command = [sys.executable, "-m", "roadlog", "estimate", hill_log, "-e", "mean_slope"]
    done = subprocess.run(
        [*command, "--set", "mean_slope.window=1"],
        check=False,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    log = DriveLog(hill_log)
    assert log.estimators == ["mean_slope"]
    assert '"window": 1.0' in log.metadata["estimate/mean_slope"]["parameters"]


def test_without_the_plugin_the_name_is_unknown(hill_log: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "roadlog", "estimate", hill_log, "-e", "mean_slope"]
    done = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
    assert done.returncode == 1
    assert "no estimator 'mean_slope'" in done.stderr
