"""`profile new` of tables in other scripts, of raw counts, of positions without a sign."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import ROOT

from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.formats.text import decoded
from roadlog.ingest.profile import Profile

SAMPLE = ROOT / "sample_logs" / "small_logger.csv"  # x left, y backward
ROLES = [*(f"imu.{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"), "speed.v"]
HEADINGS = {
    "cp932": "時間,前後加速度[G],左右加速度[G],上下加速度[G],ロールレート[deg/s],"
    "ピッチレート[deg/s],ヨーレート[deg/s],車速[km/h]",
    "gb18030": "时间,纵向加速度[g],横向加速度[g],垂直加速度[g],侧倾角速度[deg/s],俯仰角速度[deg/s],"
    "横摆角速度[deg/s],车速[km/h]",
    "cp949": "시간,종가속도[g],횡가속도[g],수직가속도[g],롤각속도[deg/s],피치각속도[deg/s],"
    "요각속도[deg/s],차속[km/h]",
    "cp1251": "Время,Продольное ускорение [g],Поперечное ускорение [g],Вертикальное ускорение [g],"
    "Скорость крена [deg/s],Скорость тангажа [deg/s],Скорость рысканья [deg/s],Скорость [km/h]",
}


@pytest.mark.parametrize("encoding", ["own", "utf-8", "utf-16"])
@pytest.mark.parametrize("page", HEADINGS)
def test_headings_in_other_scripts(tmp_path: Path, page: str, encoding: str) -> None:
    rows = "".join(f"{k / 10},{k % 7},1,9,{k % 5},2,3,{40 + k % 3}\n" for k in range(60))
    path = tmp_path / "drive.csv"
    path.write_bytes(f"{HEADINGS[page]}\n{rows}".encode(page if encoding == "own" else encoding))
    profile = Profile.from_toml(starter([path]), "new")
    names = HEADINGS[page].split(",")
    assert profile.clock.column in (names[0], "")
    assert {entry.role: entry.sources[0] for entry in profile} == dict(
        zip(ROLES, names[1:], strict=True)
    )


@pytest.mark.parametrize(
    "text",
    [
        "Größe;Höhe über NN;Längsbeschl. [m/s²];Gierrate [°/s]",
        "Accélération;été;créée;cœur;Tempér. [°C]",
        "TEMPÉRATURE ÉLEVÉE DÉJÀ",
        "Velocità;così è",
        "“Été” – ’été’ … €",
        "Aceleración;año;ÑANDÚ",
        "Fußgängerübergänge",
    ],
)
def test_western_text_stays_western(text: str) -> None:
    assert decoded(text.encode("cp1252")) == text


def counts(path: Path, per_g: float, per_dps: float) -> Path:
    """The sample in counts of its sensor, as an Arduino writes them."""
    table = np.loadtxt(SAMPLE, delimiter=",", skiprows=1)
    table = table[:, :8] * [1, *[per_g] * 3, *[per_dps] * 3, 1]
    header = "millis,ax,ay,az,gx,gy,gz,speed_kmh"
    np.savetxt(path, table, "%.0f", delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize(("per_g", "per_dps"), [(16384, 131.0), (4096, 32.8), (2048, 16.4)])
def test_counts_of_a_sensor(tmp_path: Path, per_g: float, per_dps: float) -> None:
    text = starter([counts(tmp_path / "LOG.TXT", per_g, per_dps)])
    assert f"counts of a sensor, {per_g} a g" in text
    assert f"1/{per_dps:g}, of the MPU-6050 and its kin; the data sheet tells" in text
    assert "is assumed" not in text
    assert "No gravity" not in text
    profile = Profile.from_toml(text, "new")
    shipped = Profile.load(SAMPLE.with_suffix(".toml"))
    np.testing.assert_array_equal(profile.mounts["imu"], shipped.mounts["imu"])
    own, known = (
        next(t for t in ingest([path], by).tables if t.topic == "/imu")
        for path, by in ((tmp_path / "LOG.TXT", profile), (SAMPLE, shipped))
    )
    for name, values in known.columns.items():
        coarse = 9.81 / per_g if name.startswith("accel") else np.radians(1 / per_dps)
        np.testing.assert_allclose(own.columns[name], values, atol=coarse)


def test_counts_that_read_down_keep_their_scale(tmp_path: Path) -> None:
    path = counts(tmp_path / "LOG.TXT", -16384, 131.0)
    imu = next(
        t
        for t in ingest([path], Profile.from_toml(starter([path]), "p")).tables
        if t.topic == "/imu"
    )
    assert np.median(imu.columns["accel_z"]) == pytest.approx(9.81, rel=0.02)


@pytest.mark.parametrize(("letters", "sign"), [("NE", 1), ("NW", -1), ("SE", 1)])
def test_positions_whose_sign_is_a_letter(tmp_path: Path, letters: str, sign: int) -> None:
    path = tmp_path / "drive.csv"
    lines = [f"{k},{10 + k / 1e4},{letters[0]},{20 + k / 1e4},{letters[1]}" for k in range(60)]
    path.write_text("t,lat,ns,lon,ew\n" + "\n".join(lines) + "\n")
    gnss = ingest([path], Profile.from_toml(starter([path]), "p")).tables[0]
    assert np.all(np.sign(gnss.columns["longitude"]) == sign)
    assert np.all(np.sign(gnss.columns["latitude"]) == (-1 if "S" in letters else 1))
