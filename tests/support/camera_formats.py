"""`PhoneDrive` as a GoPro keeps it: GPMF in a video, after its description, and as JSON."""

from __future__ import annotations

import json
import struct
from datetime import timedelta
from pathlib import Path

import numpy as np
from support.phone_drive import START, PhoneDrive

DRIVE = PhoneDrive()


def _item(key: str, kind: str, size: int, count: int, data: bytes) -> bytes:
    head = struct.pack(">4scBH", key.encode(), kind.encode("latin1"), size, count)
    return head + data + bytes(-len(data) % 4)


def _triad(key: str, values: np.ndarray, scale: int, orientation: str) -> bytes:
    order = ["xyz".index(letter.lower()) for letter in orientation]
    signs = [1 if letter.isupper() else -1 for letter in orientation]
    raw = np.round(values[:, order] * signs * scale).astype(">i2")
    body = _item("SCAL", "s", 2, 1, struct.pack(">h", scale))
    body += _item("ORIN", "c", 1, 3, orientation.encode())
    return _nest("STRM", body + _item(key, "s", 6, len(raw), raw.tobytes()))


def _nest(key: str, data: bytes) -> bytes:
    return _item(key, "\0", 1, len(data), data)


def _gps5(second: int) -> bytes:
    fix = DRIVE.fixes(second + np.arange(10) / 10)
    scales = [10**7, 10**7, 1000, 1000, 100]
    names = ("latitude", "longitude", "altitude", "speed", "speed")
    raw = np.column_stack([np.round(fix[n] * s) for n, s in zip(names, scales, strict=True)])
    moment = (START + timedelta(seconds=second)).strftime("%y%m%d%H%M%S.000").encode()
    body = _item("GPSF", "L", 4, 1, struct.pack(">I", 3)) + _item("GPSU", "U", 16, 1, moment)
    body += _item("SCAL", "l", 4, 5, struct.pack(">5i", *scales))
    return _nest("STRM", body + _item("GPS5", "l", 20, 10, raw.astype(">i4").tobytes()))


def _box(kind: str, data: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(data), kind.encode()) + data


def gopro(folder: Path, orientation: str = "ZXY") -> Path:
    """A video without pictures: one block of telemetry a second."""
    blocks = []
    for second in range(int(DRIVE.duration)):
        force, rate = DRIVE.phone(second + np.arange(100) / 100)
        streams = _triad("ACCL", force, 418, orientation) + _triad("GYRO", rate, 3755, orientation)
        blocks.append(_nest("DEVC", streams + _gps5(second)))
    head = _box("ftyp", b"mp41" + bytes(4) + b"mp41")
    at = len(head) + 8
    offsets = []
    for block in blocks:
        offsets.append(at)
        at += len(block)
    count = len(blocks)
    tables = _box("stsd", struct.pack(">II", 0, 1) + struct.pack(">I4s", 16, b"gpmd") + bytes(8))
    tables += _box("stts", struct.pack(">IIII", 0, 1, count, 1000))
    tables += _box("stsc", struct.pack(">IIIII", 0, 1, 1, 1, 1))
    sizes = struct.pack(f">{count}I", *map(len, blocks))
    tables += _box("stsz", struct.pack(">III", 0, 0, count) + sizes)
    tables += _box("stco", struct.pack(f">II{count}I", 0, count, *offsets))
    media = _box("mdhd", struct.pack(">IIIIII", 0, 0, 0, 1000, 1000 * count, 0))
    media += _box("minf", _box("stbl", tables))
    index = _box("moov", _box("trak", _box("mdia", media)))
    path = folder / "GX010001.MP4"
    path.write_bytes(head + _box("mdat", b"".join(blocks)) + index)
    return path


def gopro_turned(folder: Path) -> Path:
    return gopro(folder, "YxZ")


def gopro_json(folder: Path) -> Path:
    t, f = np.arange(0, DRIVE.duration, 0.01), np.arange(0, DRIVE.duration, 0.1)
    force, rate = DRIVE.phone(t)
    fix = DRIVE.fixes(f)
    place = np.column_stack(
        [fix[n] for n in ("latitude", "longitude", "altitude", "speed", "speed")]
    )

    def samples(times: np.ndarray, values: np.ndarray) -> list[dict[str, object]]:
        return [
            {
                "value": v,
                "cts": 1000 * x,
                "date": (START + timedelta(seconds=x)).isoformat(timespec="milliseconds"),
            }
            for x, v in zip(times.tolist(), values.tolist(), strict=True)
        ]

    streams = {
        "ACCL": {"samples": samples(t, force[:, [2, 0, 1]])},
        "GYRO": {"samples": samples(t, rate[:, [2, 0, 1]])},
        "GPS5": {"samples": samples(f, place)},
    }
    path = folder / "GX010001.json"
    path.write_text(json.dumps({"1": {"streams": streams, "device name": "Hero"}}))
    return path


def gopro_tables(folder: Path, older: bool = False) -> Path:
    """A folder of what gopro-telemetry calls its CSV preset; the first fixes have none."""
    folder = folder / "GX010001"
    folder.mkdir()
    t, f = np.arange(0, DRIVE.duration, 0.01), np.arange(0, DRIVE.duration, 0.1)
    force, rate = DRIVE.phone(t)
    fix = DRIVE.fixes(f)
    parts = ("up/down", "right/left", "forward/back") if older else tuple("zxy")

    def write(key: str, names: list[str], times: np.ndarray, values: np.ndarray, more: str) -> None:
        rows = [
            f"{1000 * x:.6f},{(START + timedelta(seconds=x)).isoformat(timespec='milliseconds')},"
            + ",".join(f"{value:.9g}" for value in row)
            for x, row in zip(times.tolist(), values.tolist(), strict=True)
        ]
        rows = [row.replace("+00:00", "Z") for row in rows]
        text = f"cts,date,{','.join(names)}{more}\n" + "\n".join(rows)
        (folder / f"HERO8 Black-{key}.csv").write_text(text)

    accel = [f"Accelerometer ({part}) [m/s2]" for part in parts]
    gyro = [f"Gyroscope ({part}) [rad/s]" for part in parts]
    write("ACCL", accel, t, np.column_stack([force[:, [2, 0, 1]], 0 * t + 40]), ",temperature [°C]")
    write("GYRO", gyro, t, rate[:, [2, 0, 1]], "")
    place = np.column_stack(
        [fix[n] for n in ("latitude", "longitude", "altitude", "speed", "speed")]
    )
    state = np.where(f < 3, 0, 3)
    place[f < 3] = 0
    names = [f"GPS ({p}) [deg]" for p in ("Lat.", "Long.")] + ["GPS (Alt.) [m]"]
    if older:
        names += ["GPS (2D speed) [m/s]", "GPS (3D speed) [m/s]"]
        write("GPS5", names, f, np.column_stack([place, state]), ",fix")
    else:
        names += ["GPS (2D) [m/s]", "GPS (3D) [m/s]", "GPS (days) [deg]", "GPS (fix) [deg]"]
        write("GPS9", names, f, np.column_stack([place, 0 * f, state]), "")
    return folder


def gopro_tables_older(folder: Path) -> Path:
    return gopro_tables(folder, older=True)
