"""A report's folder: only roadlog's own is written over; what it holds is checked when read."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from support.drives import hill_tables
from typer.testing import CliRunner, Result

from roadlog.cli import app
from roadlog.errors import LogReadError, LogWriteError
from roadlog.log import create
from roadlog.report.run import read_options, read_report

FOREIGN = b"precious"
pytest.importorskip("jinja2")


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log and its report."""
    folder = tmp_path_factory.mktemp("made")
    create(folder / "a.mcap", hill_tables(12.0, rate=50.0))
    done = run("report", folder / "a.mcap", "-o", folder / "report", "-e", "kmbe", "--jobs", "1")
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path) -> Path:
    shutil.copytree(made, tmp_path / "x")
    return tmp_path / "x"


@pytest.mark.parametrize(
    "name", ["index.html", "table.csv", "options.json", "rows.jsonl", "assets"]
)
def test_a_folder_of_others_stays(folder: Path, name: str) -> None:
    site = folder / "site"
    site.mkdir()
    (site / name).mkdir() if name == "assets" else (site / name).write_bytes(FOREIGN)
    for more in ([], ["--resume"]):
        done = run("report", folder / "a.mcap", "-o", site, "-e", "kmbe", "--jobs", "1", *more)
        assert isinstance(done.exception, LogWriteError)
        assert f"holds {name}" in str(done.exception)
    assert [path.name for path in site.iterdir()] == [name]
    assert name == "assets" or (site / name).read_bytes() == FOREIGN


def test_ones_own_is_made_again(folder: Path) -> None:
    (folder / "report" / "rows.jsonl").write_text("garbage\n")
    arguments = ["report", folder / "a.mcap", "-o", folder / "report", "-e", "kmbe", "--jobs", "1"]
    assert run(*arguments).exit_code == 0
    assert len(read_report(str(folder / "report"))) == 1
    assert run(*arguments, "--resume").exit_code == 0


def test_comparing_writes_nothing(folder: Path) -> None:
    """A last line without its end is not cut off; it does not count."""
    rows = folder / "report" / "rows.jsonl"
    rows.write_bytes(rows.read_bytes() + b'{"log":"x","angles":{}}')
    rows.chmod(0o444)
    before = rows.read_bytes()
    assert len(read_report(str(folder / "report"))) == 1
    assert rows.read_bytes() == before
    rows.chmod(0o644)
    rows.write_bytes(b'{"log":"x","angles":{}}')
    with pytest.raises(LogReadError, match="holds no report"):
        read_report(str(folder / "report"))
    assert rows.read_bytes() == b'{"log":"x","angles":{}}'


def test_a_report_is_not_compared_with_itself(folder: Path) -> None:
    (folder / "link").symlink_to("report")
    for other in ("report", "link"):
        done = run("report", "-o", folder / "report", "--against", folder / other)
        assert "one of the inputs" in str(done.exception)


# (where in a row, what stands there instead)
TAMPERED = [
    (["angles", "kmbe", "grade", "rmse_deg"], "much"),
    (["angles", "kmbe"], []),
    (["angles"], None),
    (["detail"], "javascript:alert(1)"),
    (["detail"], "details/../../x.html"),
    (["detail"], 3),
    (["status"], "fine"),
    (["estimators"], "kmbe"),
    (["seconds"], {"total": "long"}),
    (["grade"], {"estimator": 3}),
    (["duration_s"], 10**400),
    (["warnings"], [1]),
    (["start"], 5),
    (["log"], None),
]


@pytest.mark.parametrize(("place", "value"), TAMPERED)
def test_a_row_is_checked(folder: Path, place: list[str], value: object) -> None:
    rows = folder / "report" / "rows.jsonl"
    row = json.loads(rows.read_text())
    at = row
    for key in place[:-1]:
        at = at[key]
    at[place[-1]] = value
    rows.write_text(json.dumps(row) + "\n")
    done = run("report", "-o", folder / "report")
    assert isinstance(done.exception, LogReadError), done.output
    assert "line 1: " in str(done.exception)
    assert "javascript" not in (folder / "report" / "index.html").read_text()


@pytest.mark.parametrize(
    "text", ["[1]", "3", "{}", '{"log":NaN}', "[" * 100_000, "\x00", "9" * 5000]
)
def test_no_row_at_all(folder: Path, text: str) -> None:
    (folder / "report" / "rows.jsonl").write_text(text + "\n")
    with pytest.raises(LogReadError, match="line 1"):
        read_report(str(folder / "report"))


@pytest.mark.parametrize(
    "change", [{"estimators": "kmbe"}, {"write_back": "yes"}, {"vehicle": 1}, {"more": 1}]
)
def test_options_are_checked(folder: Path, change: dict[str, object]) -> None:
    path = folder / "report" / "options.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(LogReadError, match="cannot tell how the report was made"):
        read_options(folder / "report")
