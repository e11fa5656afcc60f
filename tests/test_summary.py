"""`roadlog info`: the figures of channels, what is said of the public drives, foreign files."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables, table

from roadlog.ingest import ingest
from roadlog.log import DriveLog, create
from roadlog.summary import summarize


def naive(name: str, tmp_path: Path) -> Path:
    """A shipped profile as a newcomer would write it: names and units, nothing put right."""
    import re

    from roadlog.ingest.profile import Profile

    text = re.sub(r"mount = .*", "", Profile.load(name).text)
    text = re.sub(r', (valid|delay) = "[^"]*"|, (scale|offset) = [-\d.]+', "", text)
    path = tmp_path / f"{name}.toml"
    path.write_text(text)
    return path


def found(sources, profile, dbc=()) -> dict[str, str]:
    from roadlog import checks

    result = ingest(sources, profile, dbc)
    faults = checks.check({t.topic: t for t in result.tables})
    return {f.check: f.advice for f in faults if f.level == "fault"}


def test_channels_have_their_figures(tmp_path):
    time = EPOCH_NS + np.arange(0, 10 * 10**9, 10**7)
    time = np.delete(time, slice(300, 400))  # one gap of 1.01 s
    values = np.where(np.arange(len(time)) % 10 == 0, np.nan, 1.5)
    create(tmp_path / "x.mcap", [table("speed", time, {"v": values})])
    summary = summarize(DriveLog(tmp_path / "x.mcap"))
    (channel,) = summary.channels
    assert (channel.topic, channel.role, channel.messages) == ("/speed", "speed", 900)
    assert channel.rate == pytest.approx(100)
    assert (channel.gaps, channel.not_monotonic) == (1, 0)
    assert channel.longest_gap == pytest.approx(1.01)
    assert channel.jitter == pytest.approx(0, abs=1e-9)
    assert channel.nan_share == pytest.approx(0.1)
    (signal,) = summary.signals
    assert (signal.role, signal.unit, signal.mean) == ("speed.v", "m/s", 1.5)
    able = {e.name: e for e in summary.estimators}
    assert not able["kmbe"].can_run
    assert "imu.accel_x" in able["kmbe"].reason


def test_json_has_stable_keys(roadlog, hill_log):
    done = roadlog("info", hill_log, "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert set(summary) == {
        "log", "duration", "profile", "channels", "signals", "checks", "estimators", "sensors",
        "outlook",
    }  # fmt: skip
    assert summary["duration"] == pytest.approx(60.0)
    assert summary["checks"] == [] or {c["level"] for c in summary["checks"]} == {"note"}
    assert {c["role"] for c in summary["channels"]} == {"imu", "wheel_speeds", "truth"}


def test_text_names_the_fault_and_the_remedy(roadlog, tmp_path):
    tables = hill_tables()
    imu = tables[0]
    columns = {n: x / 9.80665 if n.startswith("accel") else x for n, x in imu.columns.items()}
    create(tmp_path / "g.mcap", [table("imu", imu.time, columns), tables[1]])
    done = roadlog("info", "g.mcap")
    assert done.returncode == 0
    assert "CHECK: imu.accel_x, imu.accel_y, imu.accel_z: gravity reads 1" in done.stdout
    assert 'say unit = "g"' in done.stdout


def test_damage_is_said_beside_the_checks_and_angles_in_degrees(roadlog, hill_log, tmp_path):
    whole = roadlog("info", hill_log).stdout
    assert "checks: nothing looks wrong\n" in whole
    assert re.search(r"truth\.grade +deg .* 4\.000", whole)
    data = bytearray(hill_log.read_bytes())
    data[len(data) // 2] ^= 1
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    done = roadlog("info", damaged)
    assert done.returncode == 3
    assert "nothing looks wrong in what could be read; the warnings say" in done.stdout
    assert "damaged and was skipped" in done.stderr


def test_a_foreign_log_is_listed(roadlog, tmp_path):
    from mcap.writer import Writer

    with (tmp_path / "foreign.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("Pose", "jsonschema", b'{"type": "object"}')
        channel = writer.register_channel("/pose", "json", schema)
        for k in range(50):
            writer.add_message(channel, EPOCH_NS + k * 10**8, b'{"x": 1.5}', EPOCH_NS + k * 10**8)
        writer.finish()
    done = roadlog("info", "foreign.mcap", "--json")
    (channel,) = json.loads(done.stdout)["channels"]
    assert (channel["topic"], channel["role"], channel["messages"]) == ("/pose", None, 50)
    assert channel["rate"] == pytest.approx(10)
    assert not any(e["can_run"] for e in json.loads(done.stdout)["estimators"])


def test_comma2k19_is_told_apart_from_its_raw_form(shared, tmp_path):
    assert found([shared / "comma2k19"], "comma2k19") == {}
    raw = found([shared / "comma2k19"], naive("comma2k19", tmp_path))
    assert set(raw) == {"axes", "course"}
    assert '"+x", left = "-y"' in raw["axes"]


def test_the_phone_s_sign_axes_and_delay_are_found(shared, tmp_path):
    raw = found([shared / "iphone" / "sample_trip.csv"], naive("iphone", tmp_path))
    assert set(raw) == {"axes", "sign", "latency"}
    assert '"+y", left = "-x"' in raw["axes"]


def test_the_upright_housing_and_invalid_frames_are_found(shared, tmp_path):
    pytest.importorskip("asammdf")
    folder = shared / "canmod"
    files, dbc = [sorted(folder.glob("*.MF4"))[0]], [folder / "canmod-gps.dbc"]
    assert found(files, "canmod", dbc) == {}
    raw = found(files, naive("canmod", tmp_path), dbc)
    assert set(raw) == {"axes", "invalid_values", "latency"}
    assert '"-y", left = "-z"' in raw["axes"]


def test_a_slow_signal_in_fast_rows_lacks_nothing(roadlog, tmp_path):
    """1 Hz in rows of 25.6 Hz, of which 3 of 60 values are missing."""
    imu, wheels, _ = hill_tables(60.0, 25.6)
    speed = np.full(len(wheels.time), np.nan)
    fresh = np.unique(np.round(np.arange(0, 60) * 25.6).astype(int))
    speed[fresh] = 10.0
    speed[fresh[20:23]] = np.nan
    create(tmp_path / "slow.mcap", [imu, wheels, table("gnss", wheels.time, {"speed": speed})])
    said = roadlog("info", "slow.mcap").stdout
    assert re.search(r"gnss\.speed +m/s +1\.0 +5\.0 %", said), said


def test_a_log_without_all_rates_says_no_word_of_numpy(roadlog, tmp_path):
    """Two stops, no rates but that of yaw: `kmbe` is best of its kind, `fusion` no better."""
    imu, wheels, truth = hill_tables(120.0)
    standing = (wheels.time - wheels.time[0]) % 60_000_000_000 < 8_000_000_000
    still = {n: np.where(standing, 0.0, v) for n, v in wheels.columns.items()}
    few = {n: v for n, v in imu.columns.items() if n not in ("gyro_x", "gyro_y")}
    few |= {n: np.where(standing, 9.81 * (n == "accel_z"), v) for n, v in few.items()}
    empty = dict.fromkeys(("gyro_x", "gyro_y"), np.full(len(imu.time), np.nan))
    tables = [table("imu", imu.time, few | empty), table("wheel_speeds", wheels.time, still), truth]
    create(tmp_path / "x.mcap", tables)
    done = roadlog("info", "x.mcap")
    assert (done.returncode, done.stderr) == (0, "")
    assert re.search(r"\ngrade +kmbe +0\.28 +- *\n", done.stdout)
    assert "can run then" in re.search(r"\nbank .*", done.stdout)[0]
