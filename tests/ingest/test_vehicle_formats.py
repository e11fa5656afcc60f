"""VBO, OxTS, MATLAB and TDMS files give what they mean, in degrees, meters and their own time."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.formats import mat, vbo
from roadlog.ingest.profile import Profile

COUNT = 80
T = np.arange(COUNT) / 10
V = 50 + 5 * np.sin(T)  # km/h
NORTH = 52 + np.cumsum(V) / 3.6 * 0.1 / 111_195
WEST = 1.25  # deg
MIDNIGHT = datetime(2026, 3, 1, tzinfo=UTC).timestamp()
NAMES = "sats time lat long velocity heading height vert-vel"
TITLES = (
    "satellites\ntime\nlatitude\nlongitude\nvelocity {}\nheading\nheight\nvertical velocity m/s"
)
PROFILE = '[speed]\nv = { from = "v", unit = "km/h" }\n'


def write_vbo(
    path: Path,
    unit: str = "kmh",
    start: float = 36_595.0,
    fix: int = 0,
    more: dict[str, float] | None = None,
) -> Path:
    """Satellites with flags, hhmmss, minutes of arc with west positive; more: channels in deg."""
    more = more or {}
    titles = "\n".join([TITLES.format(unit), *more])
    lines = [f"File created on 01/03/2026 at 10:09:55\n\n[header]\n{titles}\n"]
    units = "".join("Degrees\n" for _ in more)
    lines += [
        f"\n[channel units]\n{units}\n[comments]\n(c) a made-up box\n",
        f"\n[column names]\n{' '.join([NAMES, *more])}\n",
    ]
    rest = "".join(f" {value:+.3f}" for value in more.values())
    lines += ["\n[data]\n"]
    scale = 1.852 if unit == "knots" else 1.0
    for k, t in enumerate(T):
        s = start + t
        clock = f"{s // 3600 % 24:02.0f}{s // 60 % 60:02.0f}{s % 60:05.2f}"
        sats = 128 + 9 if k >= fix else 0
        lines.append(
            f"{sats:03d} {clock} {NORTH[k] * 60:+012.6f} {WEST * 60:+013.6f} {V[k] / scale:07.3f} "
            f"{90 + k / 10:06.2f} {150 + k / 100:+09.2f} {0.5:+07.2f}{rest}\n"
        )
    path.write_text("".join(lines).replace("\n", "\r\n"))
    return path


@pytest.mark.parametrize("unit", ["kmh", "knots"])
@pytest.mark.parametrize("start", [36_595.0, 86_397.0])
def test_a_vbo_file_is_read_by_itself(tmp_path, unit, start):
    result = ingest([write_vbo(tmp_path / "drive.vbo", unit, start)])
    tables = {t.topic: t for t in result.tables}
    gnss = tables["/gnss"]
    np.testing.assert_allclose(gnss.time * 1e-9, MIDNIGHT + start + T, atol=1e-6)
    np.testing.assert_allclose(gnss.columns["latitude"], NORTH, atol=1e-8)
    np.testing.assert_allclose(gnss.columns["longitude"], -WEST, atol=1e-8)
    np.testing.assert_allclose(gnss.columns["altitude"], 150 + np.arange(COUNT) / 100, atol=0.01)
    np.testing.assert_allclose(
        np.degrees(gnss.columns["course"]), -np.arange(COUNT) / 10, atol=1e-3
    )
    assert not result.losses
    np.testing.assert_allclose(gnss.columns["climb"], 0.5)
    np.testing.assert_allclose(tables["/gnss"].columns["speed"] * 3.6, V, atol=2e-3)


BOX = {"True_Head": 91.0, "Slip_Angle": 1.0, "Roll_Angle": -1.5, "Pitch_imu": 2.0, "Roll_imu": 1.2}


@pytest.mark.parametrize("drafted", [False, True])
def test_the_attitude_in_a_vbo_is_heading_roll_and_truth(tmp_path, drafted):
    path = write_vbo(tmp_path / "drive.vbo", more=BOX)
    result = ingest([path], Profile.from_toml(starter([path]), "new") if drafted else None)
    tables = {t.topic: t.columns for t in result.tables}
    for topic, field, degrees in (
        ("/gnss", "heading", -1.0),
        ("/gnss", "roll", -1.5),
        ("/truth/angles", "inclination", 2.0),
        ("/truth/angles", "roll_total", 1.2),
    ):
        np.testing.assert_allclose(np.degrees(tables[topic][field]), degrees, err_msg=field)


def test_a_slip_angle_without_a_heading_is_said(tmp_path):
    path = write_vbo(tmp_path / "drive.vbo", more={"Slip_Angle": 1.0})
    assert any("slip angle is not used" in note for note in ingest([path]).notes)


def test_without_satellites_there_is_no_position(tmp_path):
    recording = vbo.read(write_vbo(tmp_path / "drive.vbo", fix=30), Profile("", ""))
    (frame,) = recording.frames
    assert np.isnan(frame.columns["latitude"][:30]).all()
    assert np.isfinite(frame.columns["latitude"][30:]).all()
    assert set(frame.columns["satellites"]) == {0, 9}


def test_a_vbo_without_time_is_refused(tmp_path):
    path = tmp_path / "drive.vbo"
    path.write_text("[header]\nlat\n[column names]\nlat long\n[data]\n1 2\n")
    with pytest.raises(LogReadError, match="have no time"):
        ingest([path])


def test_an_oxts_export_has_its_attitude_as_truth(tmp_path):
    names = ["Time (HMS)", "Latitude (deg)", "Longitude (deg)", "Altitude (m)", "VelForward (m/s)"]
    names += ["Speed2D (m/s)", "VelDown (m/s)", "Heading (deg)", "Pitch (deg)", "Roll (deg)"]
    names += [f"Accel{a} (m/s²)" for a in "XYZ"] + [f"AngRate{a} (deg/s)" for a in "XYZ"]
    rows = [",".join(names)]
    for k, t in enumerate(T):
        row = [NORTH[k], -WEST, 100.0, V[k] / 3.6, V[k] / 3.6, -0.5, 90.0, 2.0, -1.5]
        row += [0.2, 0.3, -9.8, 1.0, 2.0, 3.0]
        rows.append(",".join([f"10:00:{t:06.3f}", *(f"{x:.8f}" for x in row)]))
    path = tmp_path / "oxts.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    result = ingest([path])
    assert any("profile oxts" in note for note in result.notes)
    tables = {t.topic: t.columns for t in result.tables}
    np.testing.assert_allclose(np.degrees(tables["/truth/angles"]["inclination"]), 2.0)
    np.testing.assert_allclose(np.degrees(tables["/truth/angles"]["roll_total"]), -1.5)
    for name, value in {"accel_x": 0.2, "accel_y": -0.3, "accel_z": 9.8}.items():
        np.testing.assert_allclose(tables["/imu"][name], value)
    np.testing.assert_allclose(np.degrees(tables["/imu"]["gyro_z"]), -3.0)
    np.testing.assert_allclose(tables["/gnss"]["climb"], 0.5)
    np.testing.assert_allclose(tables["/gnss"]["heading"], 0.0, atol=1e-12)


def matlab(kind: str) -> dict:
    """One drive in the shapes in which MATLAB, Simulink and dSPACE save it."""
    if kind == "plain":
        return {"time": T, "v": V, "name": "a drive"}
    if kind == "struct":
        return {"drive": {"t": T, "v": V[:, None], "remark": "x"}, "other": np.arange(7)}
    if kind == "shared":
        return {"t": T, "can": {"v": V}}
    if kind == "simulink":
        signals = np.zeros(2, dtype=[("values", object), ("label", object)])
        signals[0], signals[1] = (V[:, None], "v"), (T[:, None], "w")
        return {"out": {"time": T[:, None], "signals": signals}}
    y = np.zeros(2, dtype=[("Name", object), ("Data", object)])
    y[0], y[1] = ('"Model Root"/v', V), ("Model Root/w", T)
    return {"rec": {"X": {"Name": "time", "Data": T}, "Y": y}}


@pytest.mark.parametrize("kind", ["plain", "struct", "shared", "simulink", "dspace"])
def test_matlab_files_of_every_shape(tmp_path, kind):
    pytest.importorskip("pymatreader")
    from scipy.io import savemat

    path = tmp_path / "drive.mat"
    savemat(path, matlab(kind))
    result = ingest([path], Profile.from_toml(PROFILE, "p"))
    (table,) = result.tables
    np.testing.assert_allclose(table.time * 1e-9, T, atol=1e-9)
    np.testing.assert_allclose(table.columns["v"] * 3.6, V)
    assert not result.losses
    assert 'v = { from = "' in starter([path])


def test_a_matlab_file_of_version_7_3(tmp_path):
    pytest.importorskip("pymatreader")
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "drive.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in {"time": T, "v": V}.items():
            file.create_dataset(name, data=values[None]).attrs["MATLAB_class"] = np.bytes_("double")
    head = b"MATLAB 7.3 MAT-file, made up".ljust(124) + b"\x00\x02IM"
    path.write_bytes(head + path.read_bytes()[len(head) :])
    assert mat.recognizes(path)
    (table,) = ingest([path], Profile.from_toml(PROFILE, "p")).tables
    np.testing.assert_allclose(table.columns["v"] * 3.6, V)


def test_a_matlab_file_without_a_time_says_so(tmp_path):
    pytest.importorskip("pymatreader")
    from scipy.io import savemat

    path = tmp_path / "drive.mat"
    savemat(path, {"v": V})
    with pytest.raises(ConfigError, match="which column is the time"):
        ingest([path], Profile.from_toml(PROFILE, "p"))


@pytest.mark.parametrize("timed", ["waveform", "channel", "stamps"])
def test_tdms_files(tmp_path, timed):
    nptdms = pytest.importorskip("nptdms")
    channel = nptdms.ChannelObject
    start = datetime(2026, 3, 1, 10, tzinfo=UTC).replace(tzinfo=None)
    properties: dict = {"unit_string": "km/h"}
    if timed == "waveform":
        properties |= {
            "wf_increment": 0.1,
            "wf_start_time": np.datetime64(start, "us"),
            "wf_start_offset": 0.0,
            "wf_samples": COUNT,
        }
    channels = [channel("drive", "v", V, properties=properties)]
    if timed == "channel":
        channels.append(channel("drive", "time", T))
    if timed == "stamps":
        stamps = np.datetime64(start, "us") + (T * 1e6).astype("timedelta64[us]")
        channels.append(channel("drive", "Time", stamps))
    path = tmp_path / "drive.tdms"
    with nptdms.TdmsWriter(str(path)) as writer:
        writer.write_segment([nptdms.RootObject(), nptdms.GroupObject("drive"), *channels])
    (table,) = ingest([path], Profile.from_toml(PROFILE, "p")).tables
    np.testing.assert_allclose(table.columns["v"] * 3.6, V)
    base = 0.0 if timed == "channel" else MIDNIGHT + 36_000
    np.testing.assert_allclose(table.time * 1e-9 - base, T, atol=2e-6)
    assert 'unit = "km/h"' in starter([path])


@pytest.mark.parametrize(
    ("pauses", "expected"),
    [((60.0, 5.0), (60.0, 5.0)), ((0.0, 0.0), (0.0, 0.0)), ((0.03, -0.02), (0.0, 0.0))],
    ids=["paused", "in blocks", "blocks by a computer's clock"],
)
def test_a_tdms_recording_that_went_on_later_keeps_its_moments(tmp_path, pauses, expected):
    """npTDMS' own time track gives all samples the clock of the last segment."""
    nptdms = pytest.importorskip("nptdms")
    start = np.datetime64("2026-03-01T10:00:00", "us")
    blocks = np.array_split(V, 3)
    begins = np.cumsum([0.0, *(0.1 * len(b) + p for b, p in zip(blocks, pauses, strict=False))])
    path = tmp_path / "drive.tdms"
    with nptdms.TdmsWriter(str(path)) as writer:
        for begin, block in zip(begins, blocks, strict=True):
            moment = start + np.timedelta64(round(begin * 1e6), "us")
            properties = {"wf_start_time": moment, "wf_increment": 0.1, "wf_start_offset": 0.0}
            writer.write_segment([nptdms.ChannelObject("drive", "v", block, properties)])
    (table,) = ingest([path], Profile.from_toml(PROFILE, "p")).tables
    late = np.repeat(np.cumsum([0.0, *expected]), [len(block) for block in blocks])
    time = table.time * 1e-9 - MIDNIGHT - 36_000
    np.testing.assert_allclose(time, 0.1 * np.arange(len(V)) + late, atol=2e-6)
    np.testing.assert_allclose(table.columns["v"] * 3.6, V)


def test_a_unit_that_the_source_contradicts_is_said(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text("t,v\ns,mph\n" + "".join(f"{t},{v}\n" for t, v in zip(T, V, strict=True)))
    notes = ingest([path], Profile.from_toml(PROFILE, "p")).notes
    assert "speed.v: the source states mph for v, the profile km/h" in notes
