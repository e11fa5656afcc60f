"""CAN: bit picking against cantools, traces of every kind, OBD-II answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from roadlog.errors import LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.formats import can

cantools = pytest.importorskip("cantools")
python_can = pytest.importorskip("can")

DBC = """VERSION ""
BS_:
BU_: ECU
BO_ 100 Motion: 8 ECU
 SG_ Speed : 0|16@1+ (0.01,0) [0|0] "km/h" ECU
 SG_ Yaw : 23|12@0- (0.1,5) [0|0] "deg/s" ECU
 SG_ Odd : 37|11@1- (1,0) [0|0] "" ECU
BO_ 200 Muxed: 8 ECU
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" ECU
 SG_ First m0 : 8|8@1+ (1,0) [0|0] "" ECU
 SG_ Second m1 : 8|16@0- (1,0) [0|0] "" ECU
BO_ 2566844672 Real: 8 ECU
 SG_ Value : 0|32@1- (1,0) [0|0] "m" ECU
SIG_VALTYPE_ 2566844672 Value : 1;
"""
PROFILE = '[speed]\nv = { from = "Motion.Speed", unit = "km/h" }\n'


@pytest.fixture
def dbc(tmp_path: Path) -> Path:
    path = tmp_path / "car.dbc"
    path.write_text(DBC)
    return path


@pytest.fixture
def profile(tmp_path: Path) -> Path:
    path = tmp_path / "car.toml"
    path.write_text(PROFILE)
    return path


def frames_of(identifier: int, payload: np.ndarray) -> can.CanFrames:
    n = len(payload)
    return can.CanFrames(
        np.arange(n), np.full(n, identifier, np.uint32), payload, np.full(n, 8, np.uint8)
    )


@pytest.mark.parametrize("identifier", [100, 200, 2566844672])
def test_columns_equal_what_cantools_decodes_frame_by_frame(dbc, identifier):
    payload = np.random.default_rng(3).integers(0, 256, (200, 8), np.uint8)
    if identifier == 200:
        payload[:, 0] = payload[:, 0] % 2  # pages 0 and 1
    messages = can.load([dbc])
    (frame,) = can.decode(frames_of(identifier, payload), messages, "x").frames
    message = next(m.message for m in messages if m.message.name == frame.name)
    for row, data in enumerate(payload):
        expected = message.decode(bytes(data), decode_choices=False)
        for name, column in frame.columns.items():
            np.testing.assert_equal(column[row], np.float64(expected.get(name, np.nan)))


@pytest.mark.parametrize("suffix", [".blf", ".asc", ".trc", ".log"])
def test_every_trace_format_gives_the_same_drive(tmp_path, dbc, profile, suffix):
    path = tmp_path / f"drive{suffix}"
    with python_can.Logger(path) as writer:
        for k in range(50):
            data = int(100 * 3.6 * k).to_bytes(2, "little") + bytes(6)
            writer.on_message_received(
                python_can.Message(
                    timestamp=1.7e9 + 0.1 * k, arbitration_id=100, is_extended_id=False, data=data
                )
            )
    (table,) = ingest([path], profile, [dbc]).tables
    np.testing.assert_allclose(table.columns["v"], np.arange(50), atol=0.003)
    np.testing.assert_allclose(np.diff(table.time) * 1e-9, 0.1, atol=1e-3)


def test_a_trace_that_is_cut_short_gives_what_comes_before_or_says_so(tmp_path, dbc, profile):
    path = tmp_path / "drive.blf"
    with python_can.Logger(path) as writer:
        for k in range(20_000):
            data = np.random.default_rng(k).integers(0, 256, 8, np.uint8).tobytes()
            writer.on_message_received(
                python_can.Message(
                    timestamp=1.7e9 + 0.01 * k, arbitration_id=100, is_extended_id=False, data=data
                )
            )
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    result = ingest([path], profile, [dbc])
    assert 0 < len(result.tables[0]) < 20_000
    assert any("cut short" in loss for loss in result.losses)


def test_a_dbc_that_does_not_match_is_an_error(dbc):
    frames = frames_of(0x321, np.zeros((3, 8), np.uint8))
    with pytest.raises(LogReadError, match=r"none of its identifiers \(seen: 0x321 \(3\)\)"):
        can.decode(frames, can.load([dbc]), "x.blf")
    with pytest.raises(LogReadError, match="raw CAN needs --dbc"):
        can.decode(frames, [], "x.blf")


def test_the_report_tells_what_is_unknown_multiplexed_and_never_valid(dbc):
    text = DBC.replace(
        "SIG_VALTYPE_",
        """BO_ 300 State: 8 ECU
 SG_ GyroValid : 0|1@1+ (1,0) [0|0] "" ECU
 SG_ Gone : 8|16@1+ (1,0) [0|0] "" ECU
 SG_ Choice : 24|8@1+ (1,0) [0|0] "" ECU
 SG_ Far : 32|8@1+ (1,-100) [0|50] "" ECU
 SG_ Zero : 40|8@1+ (1,0) [0|50] "" ECU
VAL_ 300 Choice 14 "SNA" ;
SIG_VALTYPE_""",
    )
    dbc.write_text(text)
    page = np.zeros((5, 8), np.uint8)  # page 0 only
    state = np.tile(np.array([0, 255, 255, 14, 7, 0, 0, 0], np.uint8), (5, 1))
    parts = [frames_of(n, d) for n, d in ((200, page), (300, state), (0x555, page))]
    frames = can.CanFrames(
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("time", "identifier", "data", "length")
        )
    )
    notes = can.decode(frames, can.load([dbc]), "x").notes
    assert notes[0] == "x: CAN: 3 identifiers, 2 decoded: Muxed, State"
    assert notes[1] == "x: CAN: unknown identifiers (frames): 0x555 (5)"
    assert notes[2] == "x: CAN: multiplexed: Muxed"
    for signal in ("Muxed.Second", "State.GyroValid", "State.Gone", "State.Choice", "State.Far"):
        assert signal in notes[3]
    assert "State.Zero" not in notes[3]
    assert "Muxed.First" not in notes[3]


def test_a_broken_dbc_is_named(tmp_path):
    path = tmp_path / "bad.dbc"
    path.write_text("this is no database {{{")
    with pytest.raises(LogReadError, match=r"bad\.dbc: cannot be read as a CAN database"):
        can.load([path])


def test_obd_answers_follow_the_standard():
    # J1979: speed 50 km/h; engine speed (256 * 0x1A + 0xF8) / 4 = 1726 rpm
    data = np.array(
        [[3, 0x41, 0x0D, 50, 0, 0, 0, 0], [4, 0x41, 0x0C, 0x1A, 0xF8, 0, 0, 0]], np.uint8
    )
    found = {}
    for frame in can.decode(frames_of(0x7E8, data), [], "x").frames:
        found |= {name: values.tolist() for name, values in frame.columns.items()}
    assert found == {"VehicleSpeed": [50.0], "EngineSpeed": [1726.0]}


def test_an_obd_text_log_finds_its_own_profile(tmp_path):
    path = tmp_path / "trip.txt"
    path.write_text("1558739321455;010D;36.0\n1558739321535;gps;1:2:3\n1558739321642;010D;72.0\n")
    (table,) = ingest([path]).tables
    np.testing.assert_allclose(table.columns["v"], [10.0, 20.0])
    assert table.time.tolist() == [1558739321455000000, 1558739321642000000]
