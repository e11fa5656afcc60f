"""The command line as a process: the way a user goes, and what happens when input is bad."""

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from mcap.reader import make_reader
from support.drives import ROOT, Run

KEYS = {
    "n", "matched_share", "valid_share", "bias_deg", "rmse_deg", "mae_deg", "p95_deg", "max_deg",
    "std_deg", "bias_percent", "rmse_percent", "mae_percent", "p95_percent", "max_percent",
    "within_2sd", "nees",
}  # fmt: skip


def messages(path: Path, prefix: str = "") -> list[tuple]:
    with path.open("rb") as file:
        return [
            (c.topic, m.log_time, m.data)
            for _, c, m in make_reader(file, validate_crcs=True).iter_messages()
            if c.topic.startswith(prefix)
        ]


def test_demo_goes_the_whole_way(
    roadlog_process: Run, monkeypatch: pytest.MonkeyPatch, tmp_path
) -> None:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    done = roadlog_process("demo")
    assert done.returncode == 0, done.stderr
    assert "kmbe" in done.stdout
    (log,) = tmp_path.glob("roadlog-demo-*/demo.mcap")
    (recording,) = tmp_path.glob("roadlog-demo-*/demo.rrd")
    assert recording.stat().st_size > 100_000
    last = done.stdout.strip().splitlines()[-3:]
    assert [line.split()[:2] for line in last] == [
        ["roadlog", "info"],
        ["roadlog", "view"],
        ["roadlog", "estimators"],
    ]
    shown = roadlog_process(*last[0].split()[1:])
    assert shown.returncode == 0
    assert str(log) in shown.stdout


def test_results_are_replaced_and_inputs_stay_byte_for_byte(roadlog: Run, hill_log: Path) -> None:
    inputs = messages(hill_log)
    assert roadlog("estimate", hill_log).returncode == 0
    once = hill_log.read_bytes()
    assert roadlog("estimate", hill_log).returncode == 0
    assert hill_log.read_bytes() == once
    topics = {topic for topic, _, _ in inputs}
    after = messages(hill_log)
    assert [m for m in after if m[0] in topics] == inputs
    added = {topic for topic, _, _ in after} - topics
    assert all(
        t.startswith(("/estimates/", "/truth/")) for t in added
    )  # /truth/degrees is for viewers
    assert roadlog("estimate", hill_log, "-e", "kmbe", "--set", "kmbe.smooth=false").returncode == 0
    topics = [topic for topic, _, _ in messages(hill_log, "/estimates/")]
    assert topics.count("/estimates/kmbe/angles") == 6001
    assert topics.count("/estimates/lowpass_attitude/angles") == 6001


def test_out_leaves_the_log_alone(roadlog: Run, hill_log: Path, tmp_path: Path) -> None:
    before = hill_log.read_bytes()
    out = tmp_path / "out.mcap"
    assert roadlog("estimate", hill_log, "-e", "kmbe", "-o", out).returncode == 0
    assert hill_log.read_bytes() == before
    assert messages(out, "/estimates/kmbe/")


def test_evaluate_json_has_exactly_the_keys(roadlog: Run, hill_log: Path) -> None:
    roadlog("estimate", hill_log)
    done = roadlog("evaluate", hill_log, "--json")
    result = json.loads(done.stdout)
    assert set(result) == {"log", "estimates"}
    assert set(result["estimates"]) >= {"kmbe", "lowpass_attitude"}
    for angles in result["estimates"].values():
        for figures in angles.values():
            assert set(figures) == KEYS
    assert result["estimates"]["kmbe"]["grade"]["n"] == 5501
    assert result["estimates"]["lowpass_attitude"]["inclination"]["rmse_percent"] is None
    table = roadlog("evaluate", hill_log, "--remove-offset", "--csv", hill_log.with_suffix(".csv"))
    assert "mean error removed" in table.stdout
    assert "log,estimator,angle,n" in hill_log.with_suffix(".csv").read_text()


def test_reference_engine_writes_the_same_angles(roadlog: Run, hill_log: Path, tmp_path) -> None:
    from roadlog.log import DriveLog

    logs = []
    for engine in ("compiled", "reference"):
        out = tmp_path / f"{engine}.mcap"
        done = roadlog("estimate", hill_log, "-e", "kmbe", "-o", out, "--engine", engine)
        assert done.returncode == 0, done.stderr
        logs.append(DriveLog(out).stored("kmbe"))
    assert abs(logs[0].angles["grade"] - logs[1].angles["grade"]).max() < 1e-9


def test_kill_at_any_instant_leaves_the_old_file_or_the_new_one(
    roadlog: Run, hill_log: Path, tmp_path: Path
) -> None:
    before = hill_log.read_bytes()
    after_path = tmp_path / "after.mcap"
    started = time.monotonic()
    assert roadlog("estimate", hill_log, "-e", "kmbe", "-o", after_path).returncode == 0
    usual = time.monotonic() - started
    after = after_path.read_bytes()
    chance = random.Random(7)
    command = [sys.executable, "-m", "roadlog", "estimate", str(hill_log), "-e", "kmbe"]
    killed = 0
    for _ in range(20):
        hill_log.write_bytes(before)
        process = subprocess.Popen(
            command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        time.sleep(chance.uniform(0.3, 1.1) * usual)
        process.send_signal(signal.SIGKILL)
        killed += process.wait() != 0
        assert hill_log.read_bytes() in (before, after)
    assert killed >= 5, "the process was never caught at work"


@pytest.mark.parametrize("command", ["info", "estimate", "evaluate", "view"])
@pytest.mark.parametrize("content", [None, b"", b"not a log at all\n"])
def test_unreadable_log_is_one_line(
    roadlog: Run, tmp_path: Path, command: str, content: bytes | None
) -> None:
    path = tmp_path / "bad.mcap"
    if content is not None:
        path.write_bytes(content)
    done = roadlog(command, path)
    assert done.returncode == 1
    assert done.stdout == ""
    (line,) = done.stderr.strip().splitlines()
    assert line.startswith("roadlog: ")
    assert "bad.mcap" in line
    assert list(tmp_path.iterdir()) == ([path] if content is not None else [])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "kmbe.smoth=1"], "Close: smooth"),
        (["-e", "kmb"], "Close: kmbe"),
        (["--vehicle", "none.toml"], "none.toml"),
        (["--engine", "fast"], "compiled, reference or both"),
        (["--rate", "0"], "between 1 and 2000"),
        (["--set", "kmbe"], "NAME.PARAM=VALUE"),
    ],
)
def test_bad_option_is_explained(
    roadlog: Run, hill_log: Path, arguments: list[str], message: str
) -> None:
    before = hill_log.read_bytes()
    done = roadlog("estimate", hill_log, *arguments)
    assert done.returncode in (1, 2)
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert hill_log.read_bytes() == before


PROFILE = """
[time]
column = "t"
unit = "s"

[speed]
v = { from = "speed", unit = "km/h" }

[imu]
accel_x = { from = "ax", unit = "m/s^2" }
"""


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('from = "ax"', 'from = "axx"', "ax"),
        ('unit = "km/h"', 'unit = "km/hour"', "km/h"),
        ("accel_x", "acel_x", "accel_x"),
        ("[speed]", "[sped]", "speed"),
        ("unit = ", "unti = ", "unit"),
    ],
)
def test_bad_profile_is_explained(
    roadlog: Run, tmp_path: Path, old: str, new: str, message: str
) -> None:
    source = tmp_path / "drive.csv"
    rows = "\n".join(f"{k / 100},{36 + k},{0.1 * k}" for k in range(200))
    source.write_text("t,speed,ax\n" + rows + "\n")
    profile, out = tmp_path / "p.toml", tmp_path / "out.mcap"
    profile.write_text(PROFILE)
    good = roadlog("ingest", source, "-o", out, "--profile", profile)
    assert good.returncode == 0, good.stderr
    out.unlink()
    profile.write_text(PROFILE.replace(old, new))
    done = roadlog("ingest", source, "-o", out, "--profile", profile)
    assert done.returncode in (1, 2)
    (line,) = done.stderr.strip().splitlines()
    assert message in line
    assert not out.exists()


@pytest.mark.parametrize(
    "command",
    ["ingest", "info", "estimate", "evaluate", "view", "simulate", "scenarios", "estimators",
     "profiles", "demo", "report"],
)  # fmt: skip
def test_every_command_has_help_with_an_example(roadlog: Run, command: str) -> None:
    done = roadlog(command, "--help")
    assert done.returncode == 0
    assert "Example: roadlog" in done.stdout


def test_no_sentence_of_the_help_is_cut(roadlog: Run) -> None:
    done = roadlog("--help")
    assert done.returncode == 0
    assert "..." not in done.stdout.partition("Commands:")[2]
    assert "what looks wrong, and which estimators can run." in " ".join(done.stdout.split())


def test_comma2k19_minute(roadlog: Run, shared: Path, tmp_path: Path) -> None:
    """Public drive: grade RMSE 0.20 deg smoothed, 0.46 deg causal, offset removed."""
    log = tmp_path / "comma.mcap"
    done = roadlog("ingest", shared / "comma2k19", "-o", log, "--profile", "comma2k19")
    assert done.returncode == 0, done.stderr
    assert roadlog("estimate", log).returncode == 0

    def rmse() -> float:
        result = json.loads(roadlog("evaluate", log, "--remove-offset", "--json").stdout)
        assert result["remove_offset"] is True
        return result["estimates"]["kmbe"]["grade"]["rmse_deg"]

    assert rmse() <= 0.20
    assert roadlog("estimate", log, "-e", "kmbe", "--set", "kmbe.smooth=false").returncode == 0
    assert rmse() <= 0.46
    recording = tmp_path / "comma.rrd"
    assert roadlog("view", log, "--save", recording).returncode == 0
    verified = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "verify", str(recording)],
        capture_output=True,
        check=False,
    )
    assert verified.returncode == 0
