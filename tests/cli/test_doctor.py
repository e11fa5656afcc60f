"""`roadlog doctor` as a process, healthy and not."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.version import Version
from support.drives import ROOT

from roadlog import doctor, warmup
from roadlog.car.vehicle import Vehicle
from roadlog.doctor import NOT_FOR_USERS
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.estimators import TABLE, get, run
from roadlog.filters.compiling import compiling


def test_a_healthy_installation(roadlog: Callable) -> None:
    done = roadlog("doctor", "--json")
    assert done.returncode == 0, done.stderr
    findings = json.loads(done.stdout)
    core = {f["name"].split(">")[0]: f for f in findings if f["topic"] == "core"}
    assert {"numpy", "numba", "mcap", "typer"} <= set(core)
    assert all(f["ok"] for f in core.values())


@pytest.mark.parametrize("task", warmup.ESTIMATORS)
def test_warming_up_reaches_what_a_drive_would_compile(task: str, hill_drive: Drive) -> None:
    """Where the task has run, no estimator compiles anything."""
    warmup.exercise(task)
    for name in warmup.ESTIMATORS[task]:
        if get(name).refusal(hill_drive):
            continue
        with compiling(name) as count:
            run(name, hill_drive, Vehicle())
        assert count.seconds == 0.0


def test_every_estimator_with_a_loop_is_warmed_up() -> None:
    """An estimator whose module leads to a kernel belongs to a task."""
    warmed = {name for names in warmup.ESTIMATORS.values() for name in names}
    drive = warmup.short_drive()
    for name in set(TABLE) - warmed:
        if get(name).refusal(drive):
            continue
        with compiling(name) as count:
            run(name, drive, Vehicle())
        assert count.seconds == 0.0, name


def test_a_task_that_fails_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(warmup, "TASKS", ("nothing",))
    wait = next(warmup.warm())
    with pytest.raises(RoadlogError, match="nothing: did not compile"):
        wait()


def test_what_is_missing_is_named_with_the_command(monkeypatch: pytest.MonkeyPatch) -> None:
    real = metadata.version

    def version(name: str) -> str:
        if name in ("cantools", "scipy"):
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(metadata, "version", version)
    findings = {f.name.split(">")[0]: f for f in doctor.examine()}
    assert findings["cantools"].ok is None
    assert "pip install 'roadlog[can]'" in findings["cantools"].found
    assert findings["scipy"].ok is False


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="may write everywhere")
def test_a_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tmp_path.chmod(0o500)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    cache = next(f for f in doctor.examine() if f.topic == "compiler")
    assert cache.ok is None
    assert "NUMBA_CACHE_DIR" in cache.found


def test_the_oldest_set_is_the_lower_bounds() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    texts = [text for name, group in extras.items() if name not in NOT_FOR_USERS for text in group]
    needed = {r.name.lower(): r for r in map(Requirement, [*project["dependencies"], *texts])}
    lines = (ROOT / "constraints-oldest.txt").read_text().splitlines()
    oldest = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert needed.keys() == oldest.keys()
    for name, version in oldest.items():
        bounds = [s.version for s in needed[name].specifier if s.operator == ">="]
        assert [Version(bound) for bound in bounds] == [Version(version)], name


@pytest.mark.parametrize("task", ["simulator", "text files"])
def test_what_is_compiled_ahead_can_be_run(task: str) -> None:
    """The other tasks are estimators, which have tests of their own."""
    assert task in warmup.TASKS
    warmup.exercise(task)
