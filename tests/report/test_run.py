"""Reports from beginning to end, on threads: what is found, kept, written and compared."""

import csv
import json
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from support.drives import Run, hill_tables
from support.report_folder import read_rows, statuses

from roadlog.errors import LogReadError
from roadlog.log import DriveLog, create
from roadlog.report.batch import Workers
from roadlog.report.row import Options
from roadlog.report.run import finish, output_folder, run
from roadlog.report.sources import SOURCE_SUFFIXES, find
from roadlog.report.table import FIGURES

OPTIONS = Options(("kmbe", "lowpass_attitude"))


def in_threads() -> Workers:
    executor = ThreadPoolExecutor(2)
    return Workers(executor, 2, lambda: None, executor.shutdown)


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("drive") / "drive.mcap"
    create(path, hill_tables(12.0, rate=50.0))
    return path


@pytest.fixture
def logs(drive: Path, tmp_path: Path) -> Path:
    """Two good logs and a bad one, below folders."""
    folder = tmp_path / "logs"
    for name in ("a.mcap", "mon/b.mcap"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(drive, folder / name)
    (folder / "mon" / "bad.mcap").write_bytes(b"no log")
    (folder / "notes.txt").write_text("not a log")
    (folder / ".hidden.mcap").write_bytes(b"")
    return folder


def report(where: Path, out: Path, options: Options = OPTIONS, resume: bool = False):
    with output_folder(str(out), fetch=resume):
        return run(find([str(where)]), options, out, in_threads, resume=resume)


def test_folders_globs_and_files_give_each_log_once(logs: Path) -> None:
    def names(*paths: object) -> list[str]:
        return [source.name for source in find([str(p) for p in paths])]

    assert names(logs) == ["a.mcap", "mon/b.mcap", "mon/bad.mcap"]
    assert names(logs / "mon" / "*.mcap", logs / "mon") == ["b.mcap", "bad.mcap"]
    assert names(logs / "**" / "b*.mcap") == ["b.mcap", "bad.mcap"]
    assert names(logs / "*", logs / "a.mcap") == ["a.mcap", "b.mcap", "bad.mcap"]
    odd = logs / "[1] *?.mcap"
    odd.write_bytes(b"")
    assert names(odd) == ["[1] *?.mcap"]
    raw = find([str(logs)], SOURCE_SUFFIXES)
    assert "notes.txt" in [source.name for source in raw]


@pytest.mark.parametrize(
    ("path", "message"),
    [("lgos", "Close: logs"), ("logs/*.bag", "no such file"), ("logs/empty", "holds no log")],
)
def test_nothing_found_is_said(
    logs: Path, monkeypatch: pytest.MonkeyPatch, path: str, message: str
) -> None:
    (logs / "empty").mkdir()
    monkeypatch.chdir(logs.parent)
    with pytest.raises(LogReadError, match=message):
        find([path])


def test_rows_tables_and_pages(logs: Path, tmp_path: Path) -> None:
    out = tmp_path / "report"
    before = (logs / "a.mcap").read_bytes()
    rows, done = report(logs, out)
    finish(rows, OPTIONS, out)
    assert done == 0
    assert [row["name"] for row in rows] == ["a.mcap", "mon/b.mcap", "mon/bad.mcap"]
    assert statuses(rows) == {"ok": 2, "failed": 1}
    assert (logs / "a.mcap").read_bytes() == before
    good = rows[0]
    assert good["duration_s"] == pytest.approx(12.0)
    assert good["distance_m"] == pytest.approx(157.8, rel=0.01)
    assert set(good["angles"]["kmbe"]["grade"]) == set(FIGURES)
    assert good["grade"]["estimator"] == "kmbe"
    assert (out / good["detail"]).is_file()
    assert rows[2]["message"].startswith("is no MCAP file")
    with (out / "table.csv").open() as file:
        table = list(csv.DictReader(file))
    assert [row["status"] for row in table] == ["ok", "ok", "failed"]
    rmse = good["angles"]["kmbe"]["grade"]["rmse_deg"]
    assert float(table[0]["kmbe.grade.rmse_deg"]) == pytest.approx(rmse)
    from pyarrow import parquet

    assert parquet.read_table(out / "table.parquet").num_rows == 3
    metrics = parquet.read_table(out / "metrics.parquet").to_pylist()
    assert {(m["estimator"], m["angle"]) for m in metrics} == {
        ("kmbe", "grade"),
        ("lowpass_attitude", "inclination"),
    }


def test_the_same_figures_as_evaluate(logs: Path, tmp_path: Path) -> None:
    from roadlog.metrics import evaluate

    rows, _ = report(logs / "a.mcap", tmp_path / "r", Options(("kmbe",), write_back=True))
    log = DriveLog(logs / "a.mcap")
    assert log.estimators == ["kmbe"]
    expected = evaluate(log)["kmbe"]["grade"]
    assert rows[0]["angles"]["kmbe"]["grade"]["rmse_deg"] == pytest.approx(
        expected.rmse_deg, rel=1e-5
    )
    again, done = report(
        logs / "a.mcap", tmp_path / "r", Options(("kmbe",), write_back=True), resume=True
    )
    assert (again, done) == (rows, 1)


def test_a_log_that_is_cut_off_is_said_to_be(logs: Path, drive: Path, tmp_path: Path) -> None:
    cut = logs / "mon" / "cut.mcap"
    cut.write_bytes(drive.read_bytes()[:9000])
    (row,), _ = report(cut, tmp_path / "r")
    assert row["status"] == "failed"
    assert row["message"].startswith("it is damaged: ")
    assert "; no vehicle signals" in row["message"]


def test_the_damage_comes_before_what_an_estimator_lacks(logs: Path, tmp_path: Path) -> None:
    """The IMU lies before the cut, the wheel speeds behind it."""
    cut = logs / "mon" / "cut.mcap"
    create(cut, hill_tables(120.0))
    data = cut.read_bytes()
    cut.write_bytes(data[: len(data) * 14 // 100])
    (row,), _ = report(cut, tmp_path / "r", Options(("kmbe",)))
    assert row["message"].startswith("it is damaged: the record at byte")
    assert "no speed" in row["message"]


def test_resume_does_what_changed(logs: Path, drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "report"
    first, _ = report(logs, out)
    shutil.copy(drive, logs / "mon" / "bad.mcap")  # repaired
    (logs / "mon" / "b.mcap").unlink()
    second, done = report(logs, out, resume=True)
    assert done == 1
    assert second[0] == first[0]
    assert statuses(second) == {"ok": 2}
    assert [row["name"] for row in read_rows(out)] == ["a.mcap", "mon/bad.mcap"]
    assert len(list((out / "details").iterdir())) == 2
    _, done = report(logs, out, Options(("kmbe",)), resume=True)
    assert done == 0
    _, done = report(logs, out, Options(("kmbe",)))
    assert done == 0
    assert len(read_rows(out)) == 2


def test_a_method_that_fails_leaves_the_others(logs: Path, tmp_path: Path) -> None:
    rows, _ = report(logs / "a.mcap", tmp_path / "r", Options(("kmbe", "fuel_level")))
    (row,) = rows
    assert row["status"] == "failed"
    assert "fuel_level cannot run: the drive has no fuel.sender" in row["message"]
    assert row["angles"]["kmbe"]["grade"]["rmse_deg"] > 0


def test_names_need_not_be_unicode(drive: Path, tmp_path: Path) -> None:
    folder = tmp_path / "logs"
    folder.mkdir()
    name = os.fsdecode(b"caf\xe9.mcap")
    shutil.copy(drive, folder / name)
    rows, _ = report(folder, tmp_path / "r", Options(("kmbe",)))
    finish(rows, OPTIONS, tmp_path / "r")
    assert statuses(rows) == {"ok": 1}
    assert "caf?" in (tmp_path / "r" / "index.html").read_text("utf-8")


def test_a_log_that_is_cut_is_counted_as_read_in_part(
    roadlog: Run, drive: Path, tmp_path: Path
) -> None:
    logs, whole = tmp_path / "logs", drive.read_bytes()
    logs.mkdir()
    (logs / "whole.mcap").write_bytes(whole)
    (logs / "cut.mcap").write_bytes(whole[: 3 * len(whole) // 4])
    words = ["report", logs, "-o", tmp_path / "r", "-e", "kmbe", "--jobs", "1", "--one-file"]
    done = roadlog(*words)
    assert done.returncode == 3
    assert "2 logs: 2 ok (1 read in part), 0 failed, 0 crashed" in done.stdout
    pages = [line for line in done.stdout.splitlines() if line.endswith(".html")]
    assert [Path(page).name for page in pages] == ["index.html", "report.html"]
    assert all(Path(page).is_file() for page in pages)


def test_command_compares_with_an_earlier_report(roadlog: Run, logs: Path, tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    done = roadlog("report", logs, "-o", old, "-e", "kmbe", "--jobs", "1")
    assert done.returncode == 3
    assert "3 logs: 2 ok, 1 failed, 0 crashed" in done.stdout
    same = roadlog("report", logs / "a.mcap", "-o", new, "-e", "kmbe", "--against", old)
    assert same.returncode == 0, same.stderr
    assert "0 better, 0 worse" in same.stdout
    rows = read_rows(old)
    for row in rows:
        for figures in row["angles"].values():
            figures["grade"]["rmse_deg"] /= 2
    (old / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    worse = roadlog("report", "-o", new, "--against", old)
    assert worse.returncode == 1
    assert "worse: a.mcap: kmbe grade: " in worse.stderr
    assert "+100 %" in (new / "index.html").read_text()
    tolerant = roadlog("report", "-o", new, "--against", old, "--threshold", "150")
    assert tolerant.returncode == 0


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["logs"], 2, "--out"),
        (["nowhere", "-o", "r"], 1, "nowhere: no such file or folder"),
        (["logs", "-o", "r", "-e", "kmb"], 1, "Close: kmbe"),
        (["logs", "-o", "r", "--against", "nowhere"], 1, "nowhere: holds no report"),
        (["logs", "-o", "logs/notes.txt"], 1, "cannot be made a folder"),
        (["logs", "-o", "r", "--profile", "commma"], 1, "comma2k19"),
        (["-o", "r"], 1, "holds no report"),
        (["-o", "r", "-e", "kmbe"], 2, "PATH"),
    ],
)
def test_bad_option_is_explained(
    roadlog: Run, logs: Path, arguments: list[str], code: int, message: str
) -> None:
    del logs
    done = roadlog("report", *arguments)
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr
