"""A log whose end is missing: every command says so first, and none passes it over."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.drives import Run, hill_tables

from roadlog.log import create


@pytest.fixture
def cut(tmp_path: Path) -> Path:
    """Without its last third."""
    path = tmp_path / "cut.mcap"
    create(path, hill_tables(240.0))
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    return path


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["info"], 3),
        (["estimate", "-e", "kmbe"], 3),
        (["evaluate"], 1),  # no estimates
        (["plot", "-o", "x.png"], 3),
        (["plot", "-o", "x.png", "--angle", "none"], 1),
        (["view", "--save", "x.rrd"], 3),
    ],
)
def test_the_damage_is_said_first(words: list[str], code: int, cut: Path, roadlog: Run) -> None:
    done = roadlog(words[0], cut, *words[1:])
    assert done.returncode == code, done.stderr
    said = done.stderr.splitlines()
    assert said[0].startswith(f"roadlog: warning: {cut}: it is damaged: the record at byte")
    assert said[0].endswith("only what lies before was read")
    assert sum("it is damaged" in line for line in said) == 1


def test_signals_behind_the_cut_may_be_what_lacks(tmp_path: Path, roadlog: Run) -> None:
    path = tmp_path / "cut.mcap"
    create(path, hill_tables(240.0)[:1])  # an IMU alone
    for part, said in ((1.0, "no estimator"), (0.7, "what is missing may lie behind the damage")):
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * part)])
        done = roadlog("estimate", path, "-e", "kmbe")
        assert done.returncode == 1
        assert done.stderr.splitlines()[-1].startswith(f"roadlog: {path}: {said}")


def test_estimates_behind_the_cut_are_not_called_never_made(tmp_path: Path, roadlog: Run) -> None:
    path = tmp_path / "cut.mcap"
    create(path, hill_tables(60.0))
    assert roadlog("estimate", path, "-e", "kmbe").returncode == 0
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    for words in (["evaluate"], ["plot", "-o", "x.png"]):
        said = roadlog(words[0], path, *words[1:]).stderr
        assert "what could be read holds no estimates; they lie at a log's end" in said
        assert "yet" not in said


def test_only_what_fusion_lacks_is_asked_for(tmp_path: Path, roadlog: Run) -> None:
    imu, wheels, truth = hill_tables()
    create(tmp_path / "still.mcap", [imu, truth])
    assert "  a speed: `fusion` can run then" in roadlog("info", "still.mcap").stdout
    slow = {name: imu.columns[name] for name in ("accel_x", "accel_y", "accel_z")}
    create(tmp_path / "few.mcap", [type(imu)(imu.topic, imu.schema, imu.time, slow), wheels])
    said = roadlog("info", "few.mcap").stdout
    assert "  three rates: `fusion` can run then" in said
