"""Defaults of roadlog.toml and ROADLOG_*: who wins, and what is wrong with them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from roadlog.config import Option, defaults
from roadlog.errors import ConfigError

RATE = Option("rate", is_number=True)
COMMANDS = {
    "estimate": {
        "rate": RATE,
        "estimator": Option("estimator", is_list=True),
        "vehicle": Option("vehicle", is_path=True),
        "profile": Option("profile", is_path=True),
    },
    "view": {"rate": RATE, "web": Option("web", is_flag=True)},
}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder for configuration."""
    monkeypatch.setattr("roadlog.config._user_folder", lambda _: tmp_path / "user")
    (tmp_path / "user").mkdir()
    return tmp_path / "user"


def found(folder: Path, **environment: str) -> dict[str, object]:
    made = defaults(COMMANDS, environment, folder)
    return {f"{d.command} {d.option}": d.value for d in made}


def test_the_nearest_wins(tmp_path: Path, home: Path) -> None:
    (home / "roadlog.toml").write_text("rate = 10\n[view]\nweb = true\n")
    project = tmp_path / "project"
    (project / "deep").mkdir(parents=True)
    assert found(project / "deep") == {"estimate rate": 10, "view rate": 10, "view web": True}
    (project / "roadlog.toml").write_text("rate = 20\n[view]\nrate = 30\n")
    assert found(project / "deep")["estimate rate"] == 20
    assert found(project / "deep")["view rate"] == 30
    assert found(project, ROADLOG_RATE="40")["view rate"] == "40"
    both = found(project, ROADLOG_RATE="40", ROADLOG_VIEW_RATE="50")
    assert (both["estimate rate"], both["view rate"]) == ("40", "50")


def test_files_count_from_where_they_are_named(tmp_path: Path, home: Path) -> None:
    (tmp_path / "roadlog.toml").write_text('vehicle = "cars/a.toml"\nprofile = "iphone"\n')
    below = tmp_path / "drives"
    below.mkdir()
    made = found(below)
    assert made["estimate vehicle"] == str(tmp_path / "cars" / "a.toml")
    assert made["estimate profile"] == "iphone"
    assert home.is_dir()


BAD = {
    "rat = 1": r"no option 'rat'|option 'rat'\. Close: rate",
    "[estimat]\nrate = 1": r"\[estimat\].*Close: estimate",
    "[view]\nestimator = 'x'": r"\[view\] estimator",
    "rate = 'fast'": "must be a number",
    "web = 1": "true or false",
    "estimator = 3": "must be a text",
    "rate = [1, 2]": "must be a number",
    "rate = = 1": "not a TOML file",
}


@pytest.mark.parametrize("text", BAD)
def test_faults_name_file_key_and_near_names(tmp_path: Path, home: Path, text: str) -> None:
    (tmp_path / "roadlog.toml").write_text(text)
    with pytest.raises(ConfigError, match=BAD[text]) as caught:
        found(tmp_path)
    assert "roadlog.toml" in str(caught.value)
    assert home.is_dir()


def test_a_folder_of_that_name_is_not_passed_over(tmp_path: Path, home: Path) -> None:
    (tmp_path / "roadlog.toml").mkdir()
    with pytest.raises(ConfigError, match=r"roadlog\.toml: cannot be read"):
        found(tmp_path)
    assert home.is_dir()


def test_a_variable_that_no_command_knows(tmp_path: Path, home: Path) -> None:
    with pytest.raises(ConfigError, match=r"ROADLOG_RAET.*Close: ROADLOG_RATE"):
        found(tmp_path, ROADLOG_RAET="1")
    assert home.is_dir()


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [("RATE", "fast", "a number"), ("VIEW_RATE", "1O", "a number"), ("WEB", "2", "true or false")],
)
def test_variables_of_the_wrong_type(
    tmp_path: Path, home: Path, name: str, text: str, kind: str
) -> None:
    with pytest.raises(ConfigError, match=f"^ROADLOG_{name} = '{text}': must be {kind}$"):
        found(tmp_path, **{f"ROADLOG_{name}": text})
    assert home.is_dir()


@pytest.mark.parametrize("jobs", ["0", "-1", "2.5", "two"])
def test_a_number_that_is_too_small_is_refused_by_config_too(
    roadlog, tmp_path: Path, jobs: str
) -> None:
    quoted = f'"{jobs}"' if jobs == "two" else jobs
    (tmp_path / "roadlog.toml").write_text(f"jobs = {quoted}")
    run = roadlog("config")
    assert run.returncode == 1
    assert run.stderr.endswith("must be an integer, at least 1\n")
    assert len(run.stderr.splitlines()) == 1
    (tmp_path / "roadlog.toml").write_text("jobs = 1")
    assert "--jobs  1" in roadlog("config").stdout


REFUSED = {  # only the command knows what is wrong with it
    "jobs = 0": ("jobs = 0", "must be an integer, at least 1$"),
    "[estimate]\njobs = 2.5": ("[estimate] jobs = 2.5", "must be an integer, at least 1$"),
    "rate = nan": ("rate = nan", "between 1 and 2000 Hz"),
    "clock = 'foo'": ("clock = 'foo'", "log, publish or header"),
    "estimator = ['kmbee']": ("estimator = ['kmbee']", "Close: kmbe"),
    "set = ['kmbe.foo=1']": ("set = ['kmbe.foo=1']", "kmbe has no parameter 'foo'"),
    "set = ['kmbe.smooth=maybe']": ("set = ['kmbe.smooth=maybe']", "maybe"),
    "set = ['kmbee.smooth=1']": ("set = ['kmbee.smooth=1']", "Close: kmbe"),
    "profile = 'nope'": ("profile = 'nope'", "no such profile file"),
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused_defaults_name_file_and_key(
    roadlog, hill_log: Path, tmp_path: Path, text: str
) -> None:
    (tmp_path / "roadlog.toml").write_text(text)
    run = roadlog("estimate", hill_log)
    said, why = REFUSED[text]
    assert run.returncode == 1
    assert run.stderr.startswith(f"roadlog: {tmp_path / 'roadlog.toml'}: {said}: ")
    assert re.search(why, run.stderr)
    assert len(run.stderr.splitlines()) == 1


def test_a_path_that_is_not_there(
    roadlog, hill_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "roadlog.toml").write_text('vehicle = "cars/no.toml"\n')
    why = "vehicle file cannot be read: No such file or directory\n"
    there = tmp_path / "roadlog.toml"
    missing = str(tmp_path / "cars" / "no.toml")
    run = roadlog("estimate", hill_log, "-e", "kmbe")
    assert run.stderr == f"roadlog: {there}: vehicle = {missing!r}: {why}"
    monkeypatch.setenv("ROADLOG_VEHICLE", "none.toml")
    run = roadlog("estimate", hill_log, "-e", "kmbe")
    assert run.stderr == f"roadlog: ROADLOG_VEHICLE = 'none.toml': {why}"
    run = roadlog("estimate", hill_log, "-e", "kmbe", "--vehicle", "mine.toml")
    assert run.stderr == f"roadlog: mine.toml: {why}"  # the default is not to blame


def test_slopes_in_percent_for_all_commands(
    roadlog, hill_log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert roadlog("estimate", hill_log, "-e", "kmbe").returncode == 0

    def rmse() -> str:
        return roadlog("evaluate", hill_log).stdout.splitlines()[-1].split("kmbe")[1].strip()

    degrees = float(rmse().split()[0])
    (tmp_path / "roadlog.toml").write_text('slope = "percent"\n')
    value, unit = rmse().split()[:2]
    assert unit == "%"
    assert float(value) == pytest.approx(degrees * 100 * 0.01745, rel=0.02)
    monkeypatch.setenv("ROADLOG_SLOPE", "deg")
    assert float(rmse().split()[0]) == degrees
    monkeypatch.setenv("ROADLOG_SLOPE", "prozent")
    refused = roadlog("evaluate", hill_log)
    assert refused.stderr == "roadlog: ROADLOG_SLOPE = 'prozent': must be deg or percent\n"


def test_the_command_line_wins(roadlog, hill_log: Path, tmp_path: Path) -> None:
    (tmp_path / "roadlog.toml").write_text('estimator = ["ti"]\n')
    said = json.loads(roadlog("config", "--json").stdout)
    entry = next(d for d in said if (d["command"], d["option"]) == ("estimate", "estimator"))
    assert entry["value"] == ["ti"]
    assert entry["origin"] == str(tmp_path / "roadlog.toml")
    made = json.loads(roadlog("estimate", hill_log, "--json").stdout)
    assert list(made["estimates"]) == ["ti"]
    other = json.loads(roadlog("estimate", hill_log, "-e", "incl_kinematic", "--json").stdout)
    assert list(other["estimates"]) == ["incl_kinematic"]
