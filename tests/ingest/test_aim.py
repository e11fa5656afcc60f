"""AiM logs, of which libxrk gives tables; made here as it gives them."""

from __future__ import annotations

import numpy as np
import pytest
from support.phone_drive import PhoneDrive

from roadlog.ingest import ingest
from roadlog.units import STANDARD_GRAVITY as G

libxrk = pytest.importorskip("libxrk")
pa = pytest.importorskip("pyarrow")
DRIVE = PhoneDrive()


def channel(name: str, unit: str, t: np.ndarray, values: np.ndarray):
    meta = libxrk.ChannelMetadata(units=unit).to_field_metadata()
    field = pa.field(name, pa.float64(), metadata=meta)
    times = pa.array(np.round(1000 * t).astype(np.int64))
    return pa.table([times, pa.array(values)], pa.schema([("timecodes", pa.int64()), field]))


def test_channels_of_an_aim_logger_become_signals(tmp_path, monkeypatch):
    t, f = np.arange(0, 120, 0.02), np.arange(0, 120, 0.1)
    force, rate = DRIVE.imu(t)
    names = ("InlineAcc", "LateralAcc", "VerticalAcc", "RollRate", "PitchRate", "YawRate")
    columns = [*(force / G).T, *np.degrees(rate).T]
    channels = {n: channel(n, "g", t, v) for n, v in zip(names, columns, strict=True)}
    fixes = DRIVE.fixes(f)
    for name, own in (("Speed", "speed"), ("Latitude", "latitude"), ("Altitude", "altitude")):
        channels[f"GPS {name}"] = channel(f"GPS {name}", "m/s", f, fixes[own])
    log = type("Log", (), {"channels": channels})
    monkeypatch.setattr(libxrk, "aim_xrk", lambda *_: log)
    path = tmp_path / "session.xrk"
    path.write_bytes(b"<hCNF\0")
    tables = {table.topic: table for table in ingest([path]).tables}
    imu, gnss = tables["/imu"], tables["/gnss"]
    assert np.abs(imu.columns["accel_x"] - DRIVE.imu(imu.time * 1e-9)[0][:, 0]).max() < 1e-6
    assert np.abs(imu.columns["gyro_z"] - DRIVE.imu(imu.time * 1e-9)[1][:, 2]).max() < 1e-9
    assert np.abs(gnss.columns["speed"] - DRIVE.speed(gnss.time * 1e-9)).max() < 1e-9


def test_a_file_that_is_none_is_one_line(tmp_path):
    from roadlog.errors import LogReadError

    path = tmp_path / "session.xrk"
    path.write_bytes(b"<hCNF\0" + bytes(100))
    with pytest.raises(LogReadError):
        ingest([path])
