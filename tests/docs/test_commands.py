"""Every command of README and docs, run as it is written; what is left out says by which test."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from support.drives import ROOT, hill_tables, simulated
from support.tumbled import tumbled

from roadlog.cli import app
from roadlog.log import create

BLOCK = re.compile(r"^```sh\n(.*?)^```", re.MULTILINE | re.DOTALL)
# what a command of the documentation holds -> where that is tried instead
ELSEWHERE = {
    "--web": "tests/view/test_viewer.py, in a browser",
    "--connect": "tests/view/test_viewer.py",
    "--png": "tests/view/test_viewer.py, where there is a Vulkan driver",
    "s3://": "tests/report/test_cloud.py, against a store of its own",
    "reproduce": "tests/cli/test_reproduce.py",
    "road": "tests/cli/test_road.py",
    ".xodr": "tests/cli/test_road.py, tests/view/test_surface.py",
    "--road": "tests/simulate/test_on_road.py",
    ".tif": "tests/ingest/test_terrain.py, tests/simulate/test_on_road.py, test_survey.py",
    "--detail": "tests/test_details.py, with sideslip",
    "evaluate": "test_site.py, on the quick start's drive, which has truth",
}
UNITS = {"accel": "m/s^2", "gyro": "rad/s"}
AXES = {f"{kind}_{axis}": unit for kind, unit in UNITS.items() for axis in "xyz"}
PROFILE = '[time]\ncolumn = "t"\nunit = "s"\n[imu]\n' + "\n".join(
    f'{name} = {{ from = "{name}", unit = "{unit}" }}' for name, unit in AXES.items()
)
PROFILE += '\n[speed]\nv = { from = "v", unit = "m/s" }\n'
PROFILE += '[truth]\ngrade = { from = "grade", unit = "rad" }\n'


def commands(page: Path) -> Iterator[list[str]]:
    """The words of each `roadlog` line of a page's shell blocks, but for those tried elsewhere."""
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            words = shlex.split(line, comments=True)
            is_elsewhere = any(
                mark == word or (mark != "road" and mark in word)
                for mark in ELSEWHERE
                for word in words
            )
            if words and words[0] == "roadlog" and not is_elsewhere:
                yield words[1:]


def hill(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    create(path, hill_tables(20.0))


def csv(path: Path) -> None:
    """A minute of curves, as a logger of few words writes it."""
    path.parent.mkdir(exist_ok=True)
    tables = {table.topic: table for table in simulated("luo2024-s3b").tables}
    imu, wheels, truth = (tables[t] for t in ("/imu", "/wheel_speeds", "/truth/angles"))
    v = np.interp(imu.time, wheels.time, wheels.columns["rl"])
    grade = np.interp(imu.time, truth.time, truth.columns["grade"])
    t = (imu.time - imu.time[0]) * 1e-9
    rows = np.stack([t, *(imu.columns[name] for name in AXES), v, grade], axis=1)
    names = ",".join(["t", *AXES, "v", "grade"])
    np.savetxt(path, rows, delimiter=",", header=names, comments="")


def ingested() -> None:
    csv(Path("drive.csv"))
    Path("logger.toml").write_text(PROFILE)
    app(
        ["ingest", "drive.csv", "-o", "drive.mcap", "--profile", "logger.toml"],
        standalone_mode=False,
    )
    Path("drive.csv").unlink()


def drives() -> None:
    """Logs, a source of another format with its profile, and a report as it was before."""
    for name in ("drives/one.mcap", "drives/two.mcap", "2026-01/one.mcap", "more.mcap"):
        hill(Path(name))
    csv(Path("raw/one.csv"))
    Path("logger.toml").write_text(PROFILE)
    report = ["report", "drives/", "-o", "before", "-e", "kmbe"]
    app(report, standalone_mode=False)


def week() -> None:
    """Three drives of one car, and its IMU turned over on a table."""
    for seed, day in enumerate(("monday", "tuesday", "wednesday")):
        made = simulated("luo2024-s3b", seed=seed)
        create(Path(f"{day}.mcap"), made.tables, made.metadata, made.vehicle)
    create(Path("table.mcap"), [tumbled()])


def recording() -> None:
    """What README begins with: a logger's file, and no profile yet."""
    csv(Path("recording/one.csv"))
    hill(Path("drives/one.mcap"))


def logger() -> None:
    """The file that the tutorial begins with, by the script that it names."""
    runpy.run_path(str(ROOT / "docs" / "examples" / "logger.py"))["write"](Path("pass.csv"))


def scenario() -> None:
    """The page's own scenario file."""
    text = (ROOT / "docs" / "simulator.md").read_text(encoding="utf-8")
    Path("my-pass.toml").write_text(text.split("```toml\n")[1].split("```")[0])


def drive() -> None:
    """Two runs, one of them with forces of the tires and their truth."""
    hill(Path("causal.mcap"))
    shutil.copy(ROOT / "sample_logs" / "stops.mcap", "drive.mcap")
    app(["estimate", "causal.mcap", "-e", "fusion"], standalone_mode=False)
    app(["estimate", "drive.mcap", "-e", "fusion", "-e", "tfobe"], standalone_mode=False)


PAGES: dict[str, Callable[[], None]] = {
    "README.md": recording,
    "docs/calibration.md": week,
    "docs/ingest.md": ingested,
    "docs/report.md": drives,
    "docs/simulator.md": scenario,
    "docs/tutorial.md": logger,
    "docs/view.md": drive,
}


@pytest.mark.parametrize("page", PAGES)
def test_commands_of_a_page(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    # there is no display to open Rerun's window on
    monkeypatch.setattr("roadlog.view.viewer.check_display", lambda: None)
    monkeypatch.setattr("roadlog.view.viewer.open_window", lambda _path: None)
    PAGES[page]()
    ran = 0
    for words in commands(ROOT / page):
        code = app(words, standalone_mode=False)
        assert not code, words
        ran += 1
    assert ran >= 2


def test_every_page_with_commands_is_run() -> None:
    """The quick start is run by test_site."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    with_commands = {p.relative_to(ROOT).as_posix() for p in pages if any(commands(p))}
    assert with_commands - {"docs/index.md"} == set(PAGES)
