"""`PhoneDrive` as receivers and cameras write it: by libraries, or after published descriptions."""

from __future__ import annotations

import struct
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path

import numpy as np
from support.phone_drive import EPOCH, START, PhoneDrive

DRIVE = PhoneDrive()
GPS_UTC = 18  # s
GPS_EPOCH = 315_964_800  # s
WEEK = 604_800  # s
UNDULATION = 47.0  # m


def rows(rate: float = 1.0) -> list[dict[str, float]]:
    t = np.arange(0, DRIVE.duration, 1 / rate)
    fixes = DRIVE.fixes(t)
    return [{"t": float(x), **{k: float(v[i]) for k, v in fixes.items()}} for i, x in enumerate(t)]


def gpx(folder: Path, speed: bool = True) -> Path:
    from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment

    file = GPX()
    segment = GPXTrackSegment()
    for r in rows():
        moment = START + timedelta(seconds=r["t"])
        point = GPXTrackPoint(r["latitude"], r["longitude"], r["altitude"], moment)
        if speed:
            point.speed, point.course = r["speed"], r["course"]
        segment.points.append(point)
    file.tracks.append(GPXTrack())
    file.tracks[0].segments.append(segment)
    path = folder / "drive.gpx"
    path.write_text(file.to_xml("1.0"))
    return path


def gpx_of_positions(folder: Path) -> Path:
    return gpx(folder, speed=False)


def fit(folder: Path) -> Path:
    from fit_tool.fit_file_builder import FitFileBuilder
    from fit_tool.profile.messages.file_id_message import FileIdMessage
    from fit_tool.profile.messages.record_message import RecordMessage
    from fit_tool.profile.profile_type import FileType, Manufacturer

    builder = FitFileBuilder(auto_define=True)
    head = FileIdMessage()
    head.type, head.manufacturer = FileType.ACTIVITY, Manufacturer.DEVELOPMENT.value
    head.time_created = round(1000 * EPOCH)
    builder.add(head)
    for r in rows():
        record = RecordMessage()
        record.timestamp = round(1000 * (EPOCH + r["t"]))
        record.position_lat, record.position_long = r["latitude"], r["longitude"]
        record.enhanced_altitude, record.enhanced_speed = r["altitude"], r["speed"]
        builder.add(record)
    path = folder / "drive.fit"
    builder.build().to_file(str(path))
    return path


def tcx(folder: Path) -> Path:
    points = "".join(
        f"<Trackpoint><Time>{(START + timedelta(seconds=r['t'])).isoformat()}</Time><Position>"
        f"<LatitudeDegrees>{r['latitude']:.9f}</LatitudeDegrees>"
        f"<LongitudeDegrees>{r['longitude']:.9f}</LongitudeDegrees></Position>"
        f"<AltitudeMeters>{r['altitude']:.3f}</AltitudeMeters><Extensions>"
        f"<ns3:TPX><ns3:Speed>{r['speed']:.4f}</ns3:Speed></ns3:TPX></Extensions></Trackpoint>"
        for r in rows()
    )
    path = folder / "drive.tcx"
    path.write_text(
        '<?xml version="1.0"?><TrainingCenterDatabase xmlns="http://www.garmin.com/xmlschemas/'
        'TrainingCenterDatabase/v2" xmlns:ns3="http://www.garmin.com/xmlschemas/ActivityExtension'
        f'/v2"><Activities><Activity Sport="Other"><Lap><Track>{points}</Track></Lap></Activity>'
        "</Activities></TrainingCenterDatabase>"
    )
    return path


def nmea(folder: Path, start: float = 0.0) -> Path:
    from pynmeagps import GET, NMEAMessage

    lines = []
    for r in rows(5):
        moment = START + timedelta(seconds=r["t"] + start)
        place = {"lat": r["latitude"], "NS": "N", "lon": r["longitude"], "EW": "E"}
        place |= {"time": moment.time()}
        speed = {"spd": r["speed"] * 3600 / 1852, "cog": r["course"], "date": moment.date()}
        gga = {"quality": 1, "numSV": 12, "HDOP": 0.8, "alt": r["altitude"], "altUnit": "M"}
        for kind, fields in (
            ("GGA", gga | {"sep": UNDULATION, "sepUnit": "M"}),
            ("RMC", {"status": "A", "posMode": "A"} | speed),
        ):
            message = NMEAMessage("GN", kind, GET, hpnmeamode=1, **place, **fields)
            lines.append(message.serialize())
    path = folder / "drive.nmea"
    path.write_bytes(b"".join(lines))
    return path


def nmea_over_midnight(folder: Path) -> Path:
    return nmea(folder, 15 * 3600 - 60)


def _ubx(group: int, kind: int, payload: bytes) -> bytes:
    body = bytes((group, kind)) + struct.pack("<H", len(payload)) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) & 255
        b = (b + a) & 255
    return b"\xb5b" + body + bytes((a, b))


def _week_ms(t: float) -> int:
    return round(1000 * ((EPOCH + GPS_UTC - GPS_EPOCH + t) % WEEK))


def _pvt(r: dict[str, float]) -> bytes:
    moment = START + timedelta(seconds=r["t"])
    head = struct.pack(
        "<IHBBBBBBIiBBBB",
        _week_ms(r["t"]),
        moment.year,
        moment.month,
        moment.day,
        moment.hour,
        moment.minute,
        moment.second,
        7,
        30,
        moment.microsecond * 1000,
        3,
        1,
        0,
        12,
    )
    height = round(1000 * r["altitude"])
    place = struct.pack(
        "<iiii",
        round(1e7 * r["longitude"]),
        round(1e7 * r["latitude"]),
        height + round(1000 * UNDULATION),
        height,
    )
    speed = struct.pack(
        "<IIiiiiiII",
        1200,
        2000,
        0,
        0,
        round(-1000 * r["climb"]),
        round(1000 * r["speed"]),
        round(1e5 * r["course"]),
        100,
        50_000,
    )
    return _ubx(0x01, 0x07, head + place + speed + bytes(92 - 76 + 0))


def _esf(tag: int, values: list[tuple[int, int]]) -> bytes:
    data = b"".join(struct.pack("<I", (v & 0xFFFFFF) | kind << 24) for kind, v in values)
    return _ubx(0x10, 0x02, struct.pack("<IHH", tag, len(values) << 11, 0) + data)


def ubx(folder: Path, own_clock: int = 0) -> Path:
    """Fixes at 1 Hz, IMU and wheel ticks at 20 Hz (0.1 m a tick, backward in the last seconds)."""
    t = np.arange(0, DRIVE.duration, 0.05)
    force, rate = DRIVE.imu(t)
    distance = np.cumsum(DRIVE.speed(t)) * 0.05
    blocks = []
    fixes = rows()
    for k, x in enumerate(t):
        if k % 20 == 0:
            blocks.append(_pvt(fixes[k // 20]))
        tag = _week_ms(float(x)) - own_clock
        gyro = np.round(np.degrees(rate[k]) * 4096).astype(int).tolist()
        accel = np.round(force[k] * 1024).astype(int).tolist()
        ticks = int(distance[k] / 0.1) & 0x7FFFFF | (1 << 23 if x > 115 else 0)
        turning = list(zip((14, 13, 5), gyro, strict=True))
        blocks.append(_esf(tag, [*turning, *zip((16, 17, 18), accel, strict=True)]))
        blocks.append(_esf(tag, [(8, ticks), (11, round(1000 * float(DRIVE.speed(x))))]))
    path = folder / "drive.ubx"
    path.write_bytes(b"".join(blocks))
    return path


def _ins(x: float) -> bytes:
    """ESF-INS: rates in 1e-3 deg/s valid, accelerations without gravity."""
    _, rate = DRIVE.imu(np.array([x]))
    turns = np.round(np.degrees(rate[0]) * 1000).astype(int).tolist()
    head = struct.pack("<III", 1 | 0b111 << 8 | 0b111 << 11, 0, _week_ms(x))
    return _ubx(0x10, 0x15, head + struct.pack("<iiiiii", *turns, 5, 5, 5))


def ubx_of_fused_rates(folder: Path) -> Path:
    """Fixes at 1 Hz, no measurements of sensors but the rates of ESF-INS at 10 Hz."""
    fixes = rows()
    blocks = []
    for k, x in enumerate(np.arange(0, DRIVE.duration, 0.1).tolist()):
        blocks += [_pvt(fixes[k // 10])] if k % 10 == 0 else []
        blocks.append(_ins(x))
    path = folder / "fused.ubx"
    path.write_bytes(b"".join(blocks))
    return path


def ubx_of_high_rate(folder: Path) -> Path:
    """HNR-PVT at 10 Hz between fixes at 1 Hz, with sentences of NMEA between them."""
    blocks = []
    for k, r in enumerate(rows(10)):
        blocks += [_pvt(r), b"$GNTXT,01,01,02,u-blox*50\r\n"] if k % 10 == 0 else []
        moment = START + timedelta(seconds=r["t"])
        head = struct.pack(
            "<IHBBBBBBiBBH",
            _week_ms(r["t"]),
            moment.year,
            moment.month,
            moment.day,
            moment.hour,
            moment.minute,
            moment.second,
            7,
            moment.microsecond * 1000,
            3,
            0b11111,
            0,
        )
        height = round(1000 * r["altitude"])
        place = (round(1e7 * r["longitude"]), round(1e7 * r["latitude"]))
        body = struct.pack("<iiii", *place, height + round(1000 * UNDULATION), height)
        speed = round(1000 * r["speed"])
        course = round(1e5 * r["course"])
        body += struct.pack("<iiiiIIII", speed, speed, course, course, 1200, 2000, 100, 50_000)
        blocks.append(_ubx(0x28, 0x00, head + body + bytes(4)))
    path = folder / "fast.ubx"
    path.write_bytes(b"".join(blocks))
    return path


def ubx_with_a_clock_of_its_own(folder: Path) -> Path:
    return ubx(folder, 12_345_678)


def sbf(folder: Path, more: bool = False) -> Path:
    """more: attitude of two antennas, whose roll is not known, and covariances of the velocity."""
    from pysbf2 import SBFMessage

    blocks = []
    for r in rows(2):
        gps = EPOCH + GPS_UTC - GPS_EPOCH + r["t"]
        stamp = {"TOW": round(1000 * (gps % WEEK)), "WNc": int(gps // WEEK)}
        if more:
            lean = float(np.degrees(DRIVE.grade(np.array([r["t"]]))[0]))
            angles = {"Heading": r["course"], "Pitch": lean, "Roll": -2e10}
            blocks.append(SBFMessage("AttEuler", **stamp, **angles).serialize())
            spread = {"Cov_VnVn": 0.01, "Cov_VeVe": 0.03, "Cov_VuVu": 0.09}
            blocks.append(SBFMessage("VelCovGeodetic", **stamp, **spread).serialize())
        course = np.radians(r["course"])
        blocks.append(
            SBFMessage(
                "PVTGeodetic",
                **stamp,
                Type=1,
                Latitude=np.radians(r["latitude"]),
                Longitude=np.radians(r["longitude"]),
                Height=r["altitude"] + UNDULATION,
                Undulation=UNDULATION,
                Vn=r["speed"] * np.cos(course),
                Ve=r["speed"] * np.sin(course),
                Vu=r["climb"],
                COG=r["course"],
                HAccuracy=1.2,
                VAccuracy=2.0,
            ).serialize()
        )
    path = folder / "drive.sbf"
    path.write_bytes(b"".join(blocks))
    return path


def sbf_of_two_antennas(folder: Path) -> Path:
    return sbf(folder, more=True)


RECEIVERS: dict[str, Callable[[Path], Path]] = {
    writer.__name__: writer
    for writer in (
        gpx,
        gpx_of_positions,
        fit,
        tcx,
        nmea,
        nmea_over_midnight,
        ubx,
        ubx_with_a_clock_of_its_own,
        ubx_of_fused_rates,
        ubx_of_high_rate,
        sbf,
        sbf_of_two_antennas,
    )
}
