"""`roadlog road` on logs: from drives to files, one line for what does not work."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.drives import Run, hill_tables
from support.mountain_road import HOME, mountain_road

from roadlog.log import DriveLog, create
from roadlog.roads import formats
from roadlog.roads.model import road_of
from roadlog.simulate import simulate


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive each way over 500 m of mountain road, and a log without positions."""
    folder = tmp_path_factory.mktemp("drives")
    road = mountain_road(500.0, seed=6)
    for name, way in (("there", road), ("back", road.reversed())):
        made = simulate("mountain", road=way, seed=len(name))
        create(folder / f"{name}.mcap", made.tables, made.metadata, made.vehicle)
    create(folder / "blind.mcap", hill_tables(20.0))
    return folder


def test_drives_to_a_road(roadlog: Run, drives: Path, tmp_path: Path) -> None:
    both = [drives / "there.mcap", drives / "back.mcap"]
    options = ("-e", "ti", "-o", "out/pass.csv", "--plot", "out/pass.svg")
    done = roadlog("road", *both, *options)
    assert done.returncode == 0, done.stderr
    assert "2 drives, both directions" in done.stdout
    model = formats.read(tmp_path / "out" / "pass.csv")
    assert model.length == pytest.approx(460, abs=15)
    assert model.passes.max() == 2
    # `ti` needs excitation; where no drive has a valid grade, the road has none
    np.testing.assert_array_equal(np.isfinite(model.grade), model.passes > 0)
    again = roadlog("road", *both, *options)
    assert again.returncode == 1
    assert "--force" in again.stderr
    assert (tmp_path / "out" / "pass.svg").stat().st_size > 10_000


def test_a_log_without_positions_is_left_out(roadlog: Run, drives: Path) -> None:
    done = roadlog("road", drives, "-e", "ti", "-o", "pass.geojson")
    assert done.returncode == 3
    assert "blind.mcap: left out: needs positions" in done.stderr
    assert "2 drives" in done.stdout


def test_circles_on_a_car_park_are_no_road_and_say_so(roadlog: Run, tmp_path: Path) -> None:
    turn = np.linspace(0.0, 6 * np.pi, 230)
    x, y = 6 * np.cos(turn), 6 * np.sin(turn)
    circle = road_of("circle", HOME, x, y, np.zeros(len(x)), bank=np.zeros(len(x)))
    made = simulate("mountain", road=circle, seed=1)
    create(tmp_path / "park.mcap", made.tables, made.metadata, made.vehicle)
    done = roadlog("road", "park.mcap", "-o", "x.csv")
    assert done.returncode == 1
    assert "circles of less than 50 m are turning or parking" in done.stderr
    assert not (tmp_path / "x.csv").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("blind.mcap", "-e", "ti", "-o", "x.csv"), "no road: 1 log left out"),
        (("there.mcap", "-e", "ti", "-o", "x.png"), "a road file ends with"),
        (("there.mcap", "-e", "ti", "-o", "x.csv", "--from", "900"), "no road is left from 900 m"),
        (("missing.mcap", "-o", "x.csv"), "no such file"),
    ],
)
def test_what_cannot_be_a_road(
    roadlog: Run, drives: Path, tmp_path: Path, arguments: tuple[str, ...], words: str
) -> None:
    done = roadlog("road", drives / arguments[0], *arguments[1:])
    assert done.returncode == 1
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.glob("x.*"))


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (("--from", "300", "--to", "100"), 2, "--from 300 m is not before --to 100 m"),
        (("--from", "-5"), 2, "--from"),
        (("--plot", "y.bmp"), 2, "must end in .png, .svg, .pdf"),
        (("-e", "fusoin"), 1, "no estimator 'fusoin'. Close: fusion"),
        (("-e", "lowpass_attitude"), 1, "lowpass_attitude gives no grade"),
    ],
)
def test_options_are_checked_before_any_drive_is_read(
    roadlog: Run, options: tuple[str, ...], code: int, words: str
) -> None:
    done = roadlog("road", "no/such/drives", "-o", "x.csv", *options)
    assert done.returncode == code
    assert words in " ".join(done.stderr.replace("│", " ").split())
    assert "no such file" not in done.stderr


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"valid": False}, "the grade of kmbe is valid nowhere"),
        ({"sd": {}}, "needs a grade with its sd, and kmbe gives none"),
    ],
)
def test_an_estimate_without_a_usable_grade_is_no_lack_of_positions(
    roadlog: Run, drives: Path, tmp_path: Path, changes: dict[str, object], words: str
) -> None:
    path = tmp_path / "drive.mcap"
    path.write_bytes((drives / "there.mcap").read_bytes())
    with DriveLog(path) as log:
        made = log.estimate("kmbe")
        if "valid" in changes:
            changes = {"valid": np.zeros(len(made.time), np.bool_)}
        log.write([replace(made, **changes)])
    done = roadlog("road", path, "-e", "kmbe", "-o", "x.csv")
    assert done.returncode == 1
    assert f"left out: {words}" in " ".join(done.stderr.split())
