"""A number from a bus is what the database means, of the bus and sender that sent it, or none."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from support.can_cases import COUNT, MOTION, PROFILE, START, candump, files, mdf_bus, motion

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.formats import can
from roadlog.ingest.formats.can_signals import no_value
from roadlog.ingest.formats.can_trace import read
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

cantools = pytest.importorskip("cantools")
python_can = pytest.importorskip("can")

TRUCK = """VERSION ""

BU_: X

BO_ 2566844926 CCVS1: 8 X
 SG_ WheelBasedVehicleSpeed : 8|16@1+ (0.00390625,0) [0|250.996] "km/h" X

BA_DEF_ BO_  "VFrameFormat" ENUM  "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_  "VFrameFormat" "J1939PG";
BA_ "VFrameFormat" BO_ 2566844926 3;
"""
NESTED = """VERSION ""

BU_: X

BO_ 200 Nested: 8 X
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" X
 SG_ Sub m1M : 4|4@1+ (1,0) [0|0] "" X
 SG_ Speed m2 : 8|16@1+ (0.01,0) [0|0] "km/h" X
 SG_ Odd m3 : 8|16@1+ (1,0) [0|0] "" X
 SG_ Wide m5 : 24|8@1+ (1,0) [0|0] "" X

SG_MUL_VAL_ 200 Sub Page 1-1;
SG_MUL_VAL_ 200 Speed Sub 2-2;
SG_MUL_VAL_ 200 Odd Sub 3-3;
SG_MUL_VAL_ 200 Wide Page 5-7, 9-9;
"""


def decoded(folder: Path, frames: list, database: str = MOTION, **buses: str) -> Recording:
    path = candump(folder / "car.log", frames)
    given = [folder / "car.dbc"]
    given[0].write_text(database)
    for bus, text in buses.items():
        (folder / f"{bus}.dbc").write_text(text)
        given.append(Path(f"{bus}={folder / bus}.dbc"))

    class Everything(Profile):
        def reads(self, column: str, *frames: str) -> bool:
            del column, frames
            return True

    return read(path, Everything("all", ""), given)


def test_two_buses_with_one_identifier_stay_apart(tmp_path):
    other = struct.pack("<Hhhh", 22000, -20000, 3, 0)
    frames = [
        (k / 50, bus, 100, data)
        for k in range(COUNT)
        for bus, data in (("can0", motion(k)), ("can1", other))
    ]
    dbc, profile = files(tmp_path)
    path = candump(tmp_path / "car.log", frames)
    with pytest.raises(ConfigError, match=r"can0\.Motion\.AccelX, can1\.Motion\.AccelX"):
        ingest([path], profile, [dbc])
    one = ingest([path], profile, [Path(f"can0={dbc}")])
    speed = next(t for t in one.tables if t.topic == "/speed").columns["v"]
    np.testing.assert_allclose(speed * 3.6, 50 + np.arange(COUNT) / 100)
    profile.write_text(PROFILE.replace("Motion", "can1.Motion"))
    two = ingest([path], profile, [dbc])
    speed = next(t for t in two.tables if t.topic == "/speed").columns["v"]
    np.testing.assert_allclose(speed * 3.6, 220.0)
    assert any("comes on can0 (60) and can1 (60)" in note for note in two.notes)


def test_a_bus_may_be_named_where_there_is_only_one(tmp_path):
    dbc, profile = files(tmp_path, profile=PROFILE.replace("Motion", "can0.Motion"))
    path = candump(tmp_path / "car.log", [(k / 50, "can0", 100, motion(k)) for k in range(COUNT)])
    assert {m.source for m in ingest([path], profile, [dbc]).mapped} == {
        "Motion.AccelX",
        "Motion.VehicleSpeed",
    }


def test_a_database_of_a_bus_counts_before_one_of_all(tmp_path):
    other = MOTION.replace("(0.01,0)", "(0.02,0)")
    recording = decoded(
        tmp_path, [(0, "can0", 100, motion(0)), (0, "can1", 100, motion(0))], can1=other
    )
    speeds = {f.name: f.columns["VehicleSpeed"].tolist() for f in recording.frames}
    assert speeds == {"can0.Motion": [50.0], "can1.Motion": [100.0]}


def test_two_databases_that_disagree_are_said(tmp_path):
    dbc, profile = files(tmp_path)
    other = tmp_path / "other.dbc"
    other.write_text(MOTION.replace("Motion", "Gateway"))
    path = candump(tmp_path / "car.log", [(0, "can0", 100, motion(0))])
    result = ingest([path], profile, [dbc, other])
    assert any("0x64 is Motion in car.dbc and Gateway in other.dbc" in n for n in result.notes)


def test_groups_of_j1939_match_any_sender_and_keep_senders_apart(tmp_path):
    def speed(raw: int) -> bytes:
        return struct.pack("<BHBI", 0xFF, raw, 0xFF, 0xFFFFFFFF)

    raws = [256 * 60, 0xFAFF, 0xFE00, 0xFEFF, 0xFF00, 0xFFFF]
    frames = [(k, "can0", 0x18FEF100, speed(raw)) for k, raw in enumerate(raws)]
    one = decoded(tmp_path, frames, TRUCK)
    (frame,) = one.frames
    assert frame.name == "CCVS1"
    np.testing.assert_equal(
        frame.columns["WheelBasedVehicleSpeed"], [60.0, 0xFAFF / 256, *[np.nan] * 4]
    )
    assert any("not available (2)" in note and "error (2)" in note for note in one.notes)
    frames += [(k + 0.5, "can0", 0x0CFEF10B, speed(256 * 10)) for k in range(3)]
    two = decoded(tmp_path, frames, TRUCK)
    assert {f.name: len(f) for f in two.frames} == {"CCVS1@0x00": 6, "CCVS1@0x0B": 3}
    assert any("0x00 (6), 0x0B (3)" in note for note in two.notes)


def test_a_nested_page_is_not_read_as_another(tmp_path):
    pages = [(0x21, 500), (0x31, 500), (0x20, 500), (0x05, 500), (0x09, 500), (0x21, 600)]
    frames = [
        (k, "can0", 200, struct.pack("<BHB4x", page, value, 7))
        for k, (page, value) in enumerate(pages)
    ]
    (frame,) = decoded(tmp_path, frames, NESTED).frames
    nan = np.nan
    np.testing.assert_equal(frame.columns["Speed"], [5.0, nan, nan, nan, nan, 6.0])
    np.testing.assert_equal(frame.columns["Odd"], [nan, 500, nan, nan, nan, nan])
    np.testing.assert_equal(frame.columns["Wide"], [nan, nan, nan, 7, 7, nan])


def test_codes_that_the_database_names_are_no_value(tmp_path):
    database = MOTION + 'VAL_ 100 VehicleSpeed 65535 "SNA" 65534 "Signal_Error" 0 "standing" ;\n'
    database += 'VAL_ 100 AccelX 32768 "nicht verfuegbar" ;\n'
    rows = [(65535, 0), (65534, 1), (0, -32768), (5000, 100)]
    frames = [(k, "can0", 100, struct.pack("<Hhhh", *row, 0, 0)) for k, row in enumerate(rows)]
    recording = decoded(tmp_path, frames, database)
    (frame,) = recording.frames
    np.testing.assert_equal(frame.columns["VehicleSpeed"], [np.nan, np.nan, 0.0, 50.0])
    np.testing.assert_equal(frame.columns["AccelX"], [0.0, 0.001, np.nan, 0.1])
    assert any("Motion.VehicleSpeed: SNA (1)" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("code", "text", "said"),
    [
        (65535, "SNA [0..65535]", "SNA [0..65535] (1)"),
        (65535, "SNA\nof the sensor", "SNA of the sensor (1)"),
        (-1, "SNA", "SNA (1)"),
    ],
)
def test_a_label_names_its_code_alone_and_in_one_line(tmp_path, code, text, said):
    database = f'{MOTION}VAL_ 100 VehicleSpeed {code} "{text}" ;\n'
    frames = [(k, "can0", 100, struct.pack("<Hhhh", v, 0, 0, 0)) for k, v in enumerate((65535, 50))]
    recording = decoded(tmp_path, frames, database)
    np.testing.assert_equal(recording.frames[0].columns["VehicleSpeed"], [np.nan, 0.5])
    notes = " ".join(recording.notes)
    assert f"Motion.VehicleSpeed: {said}" in notes
    assert "\n" not in notes


def test_a_factor_of_zero_gives_no_value(tmp_path):
    frames = [(k, "can0", 100, struct.pack("<Hhhh", 50 + k, 0, 0, 0)) for k in range(3)]
    recording = decoded(tmp_path, frames, MOTION.replace("(0.01,0)", "(0,0)"))
    assert np.isnan(recording.frames[0].columns["VehicleSpeed"]).all()
    assert "Motion.VehicleSpeed: its factor is 0 (3)" in " ".join(recording.notes)


@pytest.mark.parametrize(
    ("text", "none"),
    [
        ("SNA", True),
        ("Signal not available", True),
        ("NotAvailable", True),
        ("invalid", True),
        ("Init", True),
        ("Sensor_Fault", True),
        ("Fehler", True),
        ("ungültig", True),
        ("erreur", True),
        ("no disponible", True),
        ("N/A", True),
        ("undefined", True),
        ("No error", False),
        ("NoFault", False),
        ("kein Fehler", False),
        ("valid", False),
        ("error free", False),
        ("Reverse", False),
        ("standing", False),
        ("sport", False),
        ("Nassau", False),
        ("Gear_1", False),
        ("available", False),
    ],
)
def test_which_texts_say_that_there_is_no_value(text, none):
    assert no_value(text) is none


def test_short_frames_give_the_signals_that_they_hold(tmp_path):
    database = MOTION + ' SG_ Counter : 56|8@1+ (1,0) [0|255] "" X\n'
    frames = [(k / 50, "can0", 100, motion(k)[:6]) for k in range(COUNT)]
    dbc, profile = files(tmp_path, database)
    path = candump(tmp_path / "car.log", frames)
    result = ingest([path], profile, [dbc])
    assert {m.samples for m in result.mapped} == {COUNT}
    assert not result.losses
    assert any(
        "Motion: 60 frames of 6 bytes, the database says 8 (without Counter)" in n
        for n in result.notes
    )
    candump(path, [(k / 50, "can0", 100, motion(k)[: 2 if k % 2 else 8]) for k in range(COUNT)])
    result = ingest([path], profile, [dbc])
    assert result.losses == ["car.log: Motion.AccelX: 30 frames cut short before it"]


@pytest.mark.parametrize("bus", [1, 9])
@pytest.mark.parametrize(
    "virtual", [[], ["IDE"], ["IDE", "BusChannel", "Dir"], ["DataLength", "IDE"]]
)
def test_what_an_mdf_bus_log_says_by_conversion_counts(tmp_path, virtual, bus):
    pytest.importorskip("asammdf")
    dbc, profile = files(tmp_path)
    short = [(k / 100, 100, motion(k)) for k in range(COUNT)]
    long = [(k / 100 + 0.001, 100, motion(20)) for k in range(COUNT)]  # 29-bit, another message
    groups = [
        {"frames": short, "extended": False, "bus": bus},
        {"frames": long, "extended": True, "bus": bus},
    ]
    result = ingest([mdf_bus(tmp_path / "log.mf4", groups, virtual)], profile, [dbc])
    speed = next(t for t in result.tables if t.topic == "/speed")
    np.testing.assert_allclose(speed.columns["v"] * 3.6, 50 + np.arange(COUNT) / 100)
    assert speed.time[0] == START * 10**9
    assert any("unknown identifiers (frames): 0x64 (60)" in note for note in result.notes)


def obd_of(frames: list[tuple[float, int, bytes]]) -> dict[str, list[float]]:
    width = max(len(data) for *_, data in frames)
    payload = np.array([list(data.ljust(width, b"\0")) for *_, data in frames], np.uint8)
    recording = can.decode(
        can.CanFrames(
            np.array([round(t * 1e9) for t, *_ in frames]),
            np.array([i if i < 0x800 else i | can.EXTENDED for _, i, _ in frames], np.uint32),
            payload,
            np.array([len(data) for *_, data in frames], np.uint8),
        ),
        [],
        "x",
    )
    return {f"{f.name}.{n}": v.tolist() for f in recording.frames for n, v in f.columns.items()}


@pytest.mark.parametrize("identifier", [0x7E8, 0x7EF, 0x18DAF110])
def test_obd_answers_of_every_form(identifier):
    frames = [
        bytes.fromhex("06 41 00 BE 3E B8 11 00"),  # which parameters there are: no value
        bytes.fromhex("03 41 0D 32 AA AA AA AA"),
        bytes.fromhex("06 41 0C 1A F8 0D 33 00"),  # two in one answer
        bytes.fromhex("10 0A 41 0C 1A F8 0D 34"),  # three in an answer of two frames
        bytes.fromhex("21 11 FF 33 65 00 00 00"),
        bytes.fromhex("03 7F 01 12 00 00 00 00"),  # refused
    ]
    assert obd_of([(k, identifier, data) for k, data in enumerate(frames)]) == {
        "OBD.VehicleSpeed": [50.0, 51.0, 52.0],
        "OBD.EngineSpeed": [1726.0, 1726.0],
        "OBD.ThrottlePosition": [100.0],
        "OBD.BarometricPressure": [101.0],
    }


def test_two_devices_that_answer_are_kept_apart():
    answer = bytes.fromhex("03 41 0D 32 00 00 00 00")
    other = bytes.fromhex("03 41 0D 33 00 00 00 00")
    found = obd_of([(0, 0x7E8, answer), (0, 0x7E9, other)])
    assert found == {"OBD.VehicleSpeed": [50.0], "OBD@0x7E9.VehicleSpeed": [51.0]}


def test_a_multi_frame_answer_with_a_hole_is_a_loss():
    frames = [
        (0, 0x7E8, bytes.fromhex("03410D3200000000")),
        (1, 0x7E8, bytes.fromhex("100A410C1AF80D34")),
        (2, 0x7E8, bytes.fromhex("2211FF3365000000")),
    ]
    recording = can.decode(
        can.CanFrames(
            np.arange(3),
            np.full(3, 0x7E8, np.uint32),
            np.array([list(d) for *_, d in frames], np.uint8),
            np.full(3, 8, np.uint8),
        ),
        [],
        "x",
    )
    assert recording.losses == ("x: 0x7E8: 1 OBD-II answers of several frames are not whole",)


def test_nothing_decoded_names_the_bus(tmp_path):
    with pytest.raises(LogReadError, match=r"seen: 0x65 \(1 on can0\), 0x66 \(1 on can1\)"):
        decoded(tmp_path, [(0, "can0", 0x65, b"1"), (1, "can1", 0x66, b"1")])


@pytest.mark.parametrize("kind", ["kcd", "sym"])
def test_databases_of_other_kinds(tmp_path, kind):
    database = cantools.database.load_string(MOTION, "dbc")
    text = database.as_kcd_string() if kind == "kcd" else database.as_sym_string()
    other = tmp_path / f"car.{kind}"
    other.write_text(text)
    _, profile = files(tmp_path)
    path = candump(tmp_path / "car.log", [(k / 50, "can0", 100, motion(k)) for k in range(COUNT)])
    result = ingest([path], profile, [other])
    speed = next(t for t in result.tables if t.topic == "/speed").columns["v"]
    np.testing.assert_allclose(speed * 3.6, 50 + np.arange(COUNT) / 100)


SLOPPY = {
    "29 bits": ("BO_ 100 ", f"BO_ {0x18FF0064} "),
    "digit": (" SG_ AccelX", ' SG_ 0_COUNTER : 48|8@1+ (1,0) [0|0] "" X\n SG_ AccelX'),
    "point": ("(0.01,0)", "(.01,0)"),
    "comment": ("\nBO_", '\nCM_ 100 "a; remark\nof two lines"\nCM_ "more"\nBO_'),
    "texts": ("[-30|30]", "[-30|30]"),
}


@pytest.mark.parametrize("kind", SLOPPY)
def test_databases_as_people_share_them_are_read(tmp_path, kind):
    text = MOTION.replace(*SLOPPY[kind], 1)
    identifier = 0x18FF0064 if kind == "29 bits" else 100
    text += f'VAL_ {identifier} Gone 3 "it; says" 4 "SNA" ;\n' if kind == "texts" else ""
    text += f'VAL_ {identifier} VehicleSpeed 65535 "SNA" ;\n'
    text += f'VAL_ {identifier} AccelX 5 "five"\n' if kind == "texts" else ""
    try:  # old versions of cantools take one of them as it is
        is_refused = not cantools.database.load_string(text, "dbc", strict=False)
    except cantools.database.UnsupportedDatabaseFormatError:
        is_refused = True
    assert is_refused or kind == "texts"
    frames = [(k / 50, "can0", identifier, motion(k)) for k in range(COUNT)]
    frames.append((COUNT / 50, "can0", identifier, b"\xff\xff" + motion(0)[2:]))
    found = decoded(tmp_path, frames, text)
    speed = found.frames[0].columns["VehicleSpeed"]
    np.testing.assert_allclose(speed[:-1], 50 + np.arange(COUNT) / 100)
    assert np.isnan(speed[-1])
    said = [note for note in found.notes if "put right in the database" in note]
    assert bool(said) is (is_refused and kind in ("29 bits", "digit", "texts"))


def test_two_senders_are_offered_by_profile_new(tmp_path):
    def speed(raw: int) -> bytes:
        return struct.pack("<BHBI", 0xFF, raw, 0xFF, 0xFFFFFFFF)

    frames = [
        (k / 10 + late, "can0", 0x18FEF100 + source, speed(256 * (60 + source) + k))
        for k in range(100)
        for source, late in ((0x00, 0.0), (0x0B, 0.03))
    ]
    dbc = tmp_path / "truck.dbc"
    dbc.write_text(TRUCK)
    path = candump(tmp_path / "truck.log", frames)
    text = starter([path], [dbc])
    assert 'from = "CCVS1@0x00.WheelBasedVehicleSpeed"' in text
    assert "# or: CCVS1@0x0B.WheelBasedVehicleSpeed" in text
    assert len(ingest([path], Profile.from_toml(text, "new"), [dbc]).tables[0]) == 100


def test_pages_without_end_are_refused(tmp_path):
    path = tmp_path / "car.dbc"
    path.write_text(NESTED.replace("2-2;", "0-4294967295;"))
    with pytest.raises(LogReadError, match="pages 0-4294967295"):
        can.load([path])
