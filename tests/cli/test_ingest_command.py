"""`roadlog ingest` and `roadlog profiles` as processes: good input, and every kind of bad one."""

from __future__ import annotations

import json

import pytest

PROFILE = '[time]\ncolumn = "t"\nunit = "s"\n[speed]\nv = { from = "v", unit = "km/h" }\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "p.toml").write_text(PROFILE)
    (tmp_path / "drive.csv").write_text("t,v\n" + "".join(f"{k / 10},{k}\n" for k in range(100)))
    return tmp_path


def test_a_csv_becomes_a_log_with_its_origin(folder, roadlog):
    done = roadlog("ingest", "drive.csv", "-o", "out.mcap", "--profile", "p.toml")
    assert done.returncode == 0, done.stderr
    assert "speed.v" in done.stdout
    from roadlog.log import DriveLog

    log = DriveLog(folder / "out.mcap")
    assert log.metadata["profile"] == {"name": "p", "toml": PROFILE}
    assert set(json.loads(log.metadata["source"]["files"])) == {"drive.csv"}
    assert log.drive()["speed.v"][900] == pytest.approx(90 / 3.6)


@pytest.mark.parametrize(
    ("change", "arguments", "code", "words"),
    [
        ({}, ["gone.csv"], 1, "no such file"),
        ({"drive.csv": ""}, ["drive.csv"], 1, "is empty"),
        ({"drive.csv": "\0\1\2"}, ["drive.csv"], 1, "is of no known format"),
        ({"drive.csv": "t,w\n0,1\n1,2\n"}, ["drive.csv"], 1, "has no 'v'"),
        ({"p.toml": PROFILE.replace("km/h", "kmm/h")}, ["drive.csv"], 1, "Close: km/h"),
        ({"p.toml": PROFILE.replace("[speed]", "[sped]")}, ["drive.csv"], 1, "Close: speed"),
        ({"p.toml": PROFILE.replace("from", "form")}, ["drive.csv"], 1, "Close: from"),
        ({}, ["drive.csv", "--truth-from", "map"], 2, "must be gnss or a file"),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(folder, roadlog, change, arguments, code, words):
    for name, text in change.items():
        (folder / name).write_text(text)
    failed = roadlog("ingest", *arguments, "-o", "out.mcap", "--profile", "p.toml")
    assert failed.returncode == code
    assert words in failed.stderr
    assert "Traceback" not in failed.stderr
    if code == 1:
        assert len(failed.stderr.strip().splitlines()) == 1
    assert not (folder / "out.mcap").exists()
    assert not list(folder.glob(".out*"))


def test_loss_is_said_and_ends_with_3(folder, roadlog):
    (folder / "drive.csv").write_text("t,v\n0,1\n1,2\n2\n")
    done = roadlog("ingest", "drive.csv", "-o", "out.mcap", "--profile", "p.toml")
    assert done.returncode == 3
    assert "1 rows without 2 fields" in done.stderr
    assert (folder / "out.mcap").exists()


@pytest.mark.usefixtures("folder")
def test_a_csv_without_a_profile_is_told_what_to_do(roadlog):
    failed = roadlog("ingest", "drive.csv", "-o", "out.mcap")
    assert failed.returncode == 1
    assert "--profile" in failed.stderr


def test_profiles_lists_and_prints(roadlog):
    assert "comma2k19" in roadlog("profiles").stdout
    assert "[imu]" in roadlog("profiles", "comma2k19").stdout
