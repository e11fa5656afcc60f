"""A plug-in estimator that a drive can kill its process with, and processes that know it."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from support.drives import ROOT

PLUGIN = '''
import os
import signal
import time
from dataclasses import dataclass

import numpy as np

from roadlog.estimate import Estimate
from roadlog.estimators.base import Estimator


@dataclass(frozen=True)
class Parameters:
    pass


def level(drive, vehicle, params, engine):
    """No road climbs; and some cars are more than a process can bear."""
    if vehicle.name == "killer":
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.05)
    zero = np.zeros(len(drive))
    return Estimate(drive.time, {"grade": zero}, {"grade": zero + 0.05})


LEVEL = Estimator("level", level, Parameters, (), ("grade",), "none", "no road climbs")
'''


@pytest.fixture
def plugin(tmp_path: Path) -> Path:
    """A folder for PYTHONPATH with the estimator `level` installed."""
    folder = tmp_path / "plugin"
    info = folder / "level-1.0.dist-info"
    info.mkdir(parents=True)
    (folder / "level_plugin.py").write_text(PLUGIN)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: level\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[roadlog.estimators]\nlevel = level_plugin:LEVEL\n")
    return folder


@pytest.fixture
def start(plugin: Path, tmp_path: Path) -> Callable[..., subprocess.Popen]:
    """Start the command line, or a module, with the plug-in: `start("report", path)`."""

    def run(*arguments: object, module: str = "roadlog", **options: object) -> subprocess.Popen:
        path = os.pathsep.join([str(ROOT), str(plugin)])
        # a shell's background job ignores Ctrl-C, and so would its children
        signal.signal(signal.SIGINT, signal.default_int_handler)
        environment = {**os.environ, "PYTHONPATH": path, "NO_COLOR": "1", "COLUMNS": "140"}
        return subprocess.Popen(
            [sys.executable, "-m", module, *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
            env={**environment, "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "0"},
            **options,  # type: ignore[call-overload]
        )

    return run
